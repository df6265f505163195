"""A cell's heat capacity and its way to the ambient, from tests whose temperature was logged."""

import numpy as np

from cellwright.circuits import inputs as given
from cellwright.circuits.heat import fit_thermal, heat, temperature
from cellwright.circuits.model_file import simulate_model
from cellwright.numerics.linear import hats
from cellwright.numerics.lines import fit_line
from cellwright.numerics.statistics import rms
from cellwright.records import inputs
from cellwright.records.record import laid_out
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.settings import Models

MODELS = Models()
SURFACE = "surface_temperature_celsius"
SOC_STEPS = np.linspace(0.0, 1.0, 9)  # at which the entropic coefficient is told
LEAST_EXPLAINED = 0.5  # of the variance of a temperature: less is the chamber's, or a draught's
LARGEST_RELATIVE_STD = 0.3  # of heat capacity and resistance: beyond it a test tells neither


def thermal_constants(cell, model, tests, *, split_rest_second=MODELS.split_rest_second):
    """Heat capacity and thermal resistance of a cell from tests with its logged temperature.

    1. Each test of role fit is laid out on the SoC scale; its heat is I·(V − OCV), with the OCV of
    the cell's model, and I·T·dOCV/dT with a coefficient at every eighth of the SoC that is fitted
    as well. 2. A test whose temperature its heat does not explain by half, or that tells one of the
    two constants no better than 30 %, is left out, with the reason: pulses on a discharge alone
    do not tell reversible heat from losses. 3. The tests' values are averaged by their
    deviations and the scatter beyond these, which is part of each test's own deviation too: what
    one test of a cell errs by, the next may. The entropic coefficients are those of the test that
    knows the resistance best. 4. Tests of role validation are simulated with the result from
    their first temperature on, and scored.

    tests : those of role fit with surface_temperature_celsius are fitted, those of role validation
        scored.

    Returns content: heat_capacity_joule_per_kelvin [J/K], resistance_kelvin_per_watt [K/W], each
    with its standard deviation, entropic: {soc, volt_per_kelvin, std_volt_per_kelvin} [V/K], tests:
    names; and reason: None; where no test of role fit tells the constants, they are None and it
    says why of each test; rows: one a test. Source: docs/temperature.md.
    """
    model, cell, tests = given.model(model), inputs.cell_facts(cell), inputs.tests(tests)
    # ASSUME: A model's temperature is that of the surface: the constants are those by which the
    # surface follows the heat, its core's share of the heat capacity counted at the surface.
    rows, fits = [], []
    for test in (t for t in tests if t.facts.role == "fit" and SURFACE in t.series):
        row, fit = _fitted(model, cell, test, split_rest_second)
        rows.append(row)
        fits += [] if fit is None else [(test.facts, fit)]
    if not fits:
        why = "; ".join(f"{row['test']}: {row['reason']}" for row in rows)
        why = why or "no test of role fit has a logged surface temperature"
        unknown = UNKNOWN | {"cell": cell.cell, "reason": why}
        return Result({"rows": rows}, unknown)
    averaged, scatter = _averaged([fit for _, fit in fits])
    content = UNKNOWN | {"cell": cell.cell} | averaged
    content["tests"] = [facts.test for facts, _ in fits]
    for row in (row for row in rows if row["test"] in content["tests"]):
        row |= {name: float(np.hypot(row[name], excess)) for name, excess in scatter.items()}
    for test in (t for t in tests if t.facts.role == "validation" and SURFACE in t.series):
        rows.append(_scored(content, model, cell, test, split_rest_second))
    left = [row["test"] for row in rows if row["reason"]]
    notes = [f"temperatures of {', '.join(left)} do not tell the thermal constants"] if left else []
    return Result({"rows": rows}, content, tuple(notes))


CONSTANTS = ("heat_capacity_joule_per_kelvin", "resistance_kelvin_per_watt")
NAMES = (
    *("heat_capacity_joule_per_kelvin", "heat_capacity_std_joule_per_kelvin"),
    *("resistance_kelvin_per_watt", "resistance_std_kelvin_per_watt"),
    "ambient_offset_kelvin",
)
UNKNOWN = {"cell": "", **dict.fromkeys(NAMES), "entropic": None, "tests": [], "reason": None}
EMPTY = dict.fromkeys((*NAMES, "rmse_kelvin", "moved_kelvin"), np.nan) | {
    "samples": 0,
    "reason": "",
}


def _fitted(model, cell, test, split_rest_second):
    """Row of a test, and its ThermalFit, None where it tells nothing."""
    row = {"test": test.facts.test, "use": "fitted"} | EMPTY
    try:
        record, ocv, ambient = _laid_out(model, cell, test, split_rest_second)
        shape = hats(record.soc, SOC_STEPS)
        # Nothing tells the coefficient at a SoC where no current flowed.
        visited = np.abs(record.current_ampere) @ shape > 0
        fit = fit_thermal(
            record.test_time_second,
            record.current_ampere,
            record.voltage_volt,
            ocv,
            record.celsius,
            ambient,
            entropic_shape=shape[:, visited],
        )
    except Refusal as refusal:
        return row | {"reason": str(refusal)}, None
    fit = fit._replace(
        entropic_volt_per_kelvin=_put(fit.entropic_volt_per_kelvin, visited),
        entropic_std_volt_per_kelvin=_put(fit.entropic_std_volt_per_kelvin, visited),
    )
    values = fit._asdict()
    row |= {name: values[name] for name in row.keys() & values.keys()}
    reason = _why_not(fit)
    return row | {"reason": reason}, None if reason else fit


def _laid_out(model, cell, test, split_rest_second):
    """Record of a test, its OCV (n,) [V], and the temperature around it [degC]."""
    missing = int(np.sum(~np.isfinite(test.series[SURFACE])))
    if missing:
        raise Refusal(f"{missing} rows have no surface temperature, wanted all")
    record = laid_out(test, model, cell, split_rest_second=split_rest_second)
    read = (record.test_time_second, record.current_ampere, record.soc, record.celsius)
    ocv = simulate_model(model, None, *read, kind=test.facts.kind).ocv_volt
    ambient = test.facts.ambient_temperature_celsius
    if ambient is None:
        raise Refusal("no temperature of the chamber is stated")
    return record, ocv, float(ambient)


def _put(values, visited):
    """Values at all steps of SoC, NaN at those that were not visited."""
    found = np.full(len(visited), np.nan)
    found[visited] = values
    return found


def _why_not(fit):
    """Why a fit tells nothing of its cell, "" where it does."""
    moved = max(fit.moved_kelvin, 1e-9)
    explained = 1.0 - (fit.rmse_kelvin / moved) ** 2
    if not explained >= LEAST_EXPLAINED:
        return (
            f"heat explains {max(explained, 0.0):.0%} of a temperature that moves by "
            f"{fit.moved_kelvin:.2g} K RMS, wanted half of it"
        )
    capacity = fit.heat_capacity_joule_per_kelvin, fit.heat_capacity_std_joule_per_kelvin
    resistance = fit.resistance_kelvin_per_watt, fit.resistance_std_kelvin_per_watt
    constants = ("heat capacity", *capacity, "J/K"), ("thermal resistance", *resistance, "K/W")
    for name, value, std, unit in constants:
        if not std <= LARGEST_RELATIVE_STD * value:
            return (
                f"{name} {value:.3g} ± {std:.2g} {unit}, wanted within {LARGEST_RELATIVE_STD:.0%}"
            )
    return ""


def _averaged(fits):
    """Constants of several tests: means by deviation and scatter, entropic of the best test.

    And what the tests scatter by beyond their own deviations, by name of the deviation.
    """
    content, scatter = {}, {}
    for name, unit in (("heat_capacity", "joule_per_kelvin"), ("resistance", "kelvin_per_watt")):
        values = np.array([getattr(fit, f"{name}_{unit}") for fit in fits])
        stds = np.array([getattr(fit, f"{name}_std_{unit}") for fit in fits])
        mean, std = values[0], stds[0]
        if len(fits) > 1:
            line = fit_line(np.ones((len(fits), 1)), values, stds)
            mean, std = line.values[0], line.std[0]
            scatter[f"{name}_std_{unit}"] = line.excess_std
        content |= {f"{name}_{unit}": float(mean), f"{name}_std_{unit}": float(std)}
    best = min(fits, key=lambda fit: fit.resistance_std_kelvin_per_watt)
    content["ambient_offset_kelvin"] = float(np.mean([fit.ambient_offset_kelvin for fit in fits]))
    known = np.isfinite(best.entropic_volt_per_kelvin)
    content["entropic"] = {
        "soc": SOC_STEPS[known].tolist(),
        "volt_per_kelvin": best.entropic_volt_per_kelvin[known].tolist(),
        "std_volt_per_kelvin": best.entropic_std_volt_per_kelvin[known].tolist(),
    }
    return content, scatter


def _scored(content, model, cell, test, split_rest_second):
    """Row of a test that took no part: its temperature simulated from its current and voltage."""
    row = {"test": test.facts.test, "use": "scored"} | EMPTY
    try:
        record, ocv, ambient = _laid_out(model, cell, test, split_rest_second)
    except Refusal as refusal:
        return row | {"reason": str(refusal)}
    entropic = content["entropic"]
    slope = np.interp(record.soc, entropic["soc"], entropic["volt_per_kelvin"])
    watt = heat(
        record.current_ampere,
        record.voltage_volt,
        ocv,
        temperature_celsius=record.celsius,
        entropic_volt_per_kelvin=slope,
    )
    around = ambient + content["ambient_offset_kelvin"]
    simulated = temperature(
        record.test_time_second,
        watt,
        around,
        initial_celsius=record.celsius[0],
        **{name: content[name] for name in CONSTANTS},
    )
    errors = {"rmse_kelvin": rms(record.celsius - simulated)}
    errors |= {"moved_kelvin": rms(record.celsius - around), "samples": len(watt)}
    return row | errors


def constants_of(documents):
    """Heat capacity [J/K] and resistance [K/W] of the cells whose constants are known: dict.

    Parameters
    ----------
    documents : contents of `thermal_constants`.
    """
    return {
        one["cell"]: tuple(one[name] for name in CONSTANTS)
        for one in documents
        if one["reason"] is None
    }


def thermal_columns(documents):
    """Constants of a pack's cells as arrays, None where one cell's are not known.

    Parameters
    ----------
    documents : of `thermal_constants`, one a cell, in the order of the leaves; None where there
        is none.

    Returns
    -------
    columns : dict of heat_capacity_joule_per_kelvin, resistance_kelvin_per_watt (cells,) and
        entropic_volt_per_kelvin (cells, 9) at even steps of SoC, as `packs.thermal.Thermal` takes.
    """
    if any(one is None or one["reason"] is not None for one in documents):
        return None
    columns = {name: np.array([one[name] for one in documents]) for name in CONSTANTS}
    tables = [one["entropic"] for one in documents]
    columns["entropic_volt_per_kelvin"] = np.array(
        [np.interp(SOC_STEPS, table["soc"], table["volt_per_kelvin"]) for table in tables]
    )
    return columns
