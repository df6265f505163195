"""Open-circuit voltage of one cell over temperature, from the tests it has, and its tables."""

from typing import NamedTuple

import numpy as np

from cellwright.laws.law import Form, best_of, fit_law, law_row, rows_of
from cellwright.laws.ocv.entropy import (
    COLUMNS,
    fit_entropic,
    on_curve,
    shared_covariance,
    slow_readings,
    step_readings,
    zero_crossings,
)
from cellwright.laws.ocv.surface import (
    LARGEST_STD_VOLT,
    LINE,
    PARABOLA,
    TABLES,
    compare,
    is_tested,
    surface_from,
    table_at,
)
from cellwright.laws.points import first_check_up
from cellwright.records import inputs
from cellwright.records.conditions import REFERENCE_CELSIUS
from cellwright.refusal import Refusal
from cellwright.result import Result


class OverTemperature(NamedTuple):
    """Open-circuit voltage of one cell over temperature: coefficient, functions and surface.

    entropic : dict, source ("steps", "slow") → `entropy.Entropic`. used : the source of all
    else. readings : of that source over an even grid of SoC. fitted : Entropic of these.
    functions : list of dict of `surface.compare`. surface : `surface.Surface`. notes : sentences.
    """

    entropic: dict
    used: str
    readings: object
    fitted: object
    functions: list
    surface: object
    notes: tuple


def ocv_over_temperature(curves=(), steps=()):
    """Open-circuit voltage [V] of one cell over SoC and temperature.

    curves : (test, result of `ocv`) each. steps : (test, result of `chamber_steps`) each.

    Returns rows: the laws; map, entropic, surface, functions. Raises Refusal: fewer than two
    temperatures. Source: thesis 3.1; docs/charge-temperature.md.
    """
    # Slow curves err by their polarisation, which differs between temperatures; rests at stepped
    # temperatures are fewer. The surer of the two tells the entropic coefficient, both are tables.
    slow = inputs.entries(curves, inputs.curves_of)
    result = over_temperature(slow, inputs.entries(steps))
    tables = {
        "rows": law_rows(result),
        "map": map_columns(result),
        "entropic": entropic_columns(result),
        "surface": surface_columns(result),
        "functions": function_rows(result),
    }
    return Result(tables, notes=tuple(result.notes))


def over_temperature(curves, step_rows):
    """Entropic coefficient, functions and surface of a cell.

    Parameters
    ----------
    curves : list of dict, slow tests as `entropy.slow_readings` takes them.
    step_rows : list of dict, rows of stage `ocv_step`.

    Returns
    -------
    ocv : OverTemperature, about the tested temperature nearest 25 °C. Where both kinds of test were
        made, the one with the smaller standard deviation of the entropic coefficient is used; both
        are reported.

    Raises
    ------
    Refusal : neither kind of test suffices; with the reasons of both.
    """
    sources, notes = _sources(curves, step_rows)
    if not sources:
        raise Refusal("; ".join(notes))
    entropic = {}
    for name, readings in sources.items():
        means = np.nanmean(readings.celsius, axis=0)
        nearest = np.round(means[np.argmin(np.abs(means - REFERENCE_CELSIUS))], 1)
        entropic[name] = fit_entropic(readings, reference_celsius=float(nearest))
    std = {name: fit.slope_std[np.isfinite(fit.slope_std)] for name, fit in entropic.items()}
    used = min(std, key=lambda name: np.median(std[name]) if len(std[name]) else np.inf)
    reference = entropic[used].reference_celsius
    # The shape between rests is that of the slow test nearest to the reference.
    away = [abs(slow["ambient_temperature_celsius"] - reference) for slow in first_check_up(curves)]
    curve = first_check_up(curves)[int(np.argmin(away))] if away else None
    readings = sources[used] if used == "slow" else on_curve(sources[used], curve)
    fitted, functions = fit_entropic(readings, reference_celsius=reference), []
    try:
        functions = compare(readings, reference_celsius=reference)
    except Refusal as refusal:
        notes.append(f"functions over temperature not compared: {refusal}")
    notes += [note for source in sources.values() for note in source.notes]
    notes += _parabola_note(functions) if used == "slow" else []
    return OverTemperature(
        entropic,
        used,
        readings,
        fitted,
        functions,
        surface_from(
            _coefficients(fitted, functions),
            readings,
            reference,
            None if curve is None else np.asarray(curve["ocv_volt"], float),
        ),
        tuple(notes),
    )


def _sources(curves, step_rows):
    """Readings of each kind of test, and reasons where there are none."""
    readings, reasons = {}, []
    for name, read, content in (
        ("slow", slow_readings, curves),
        ("steps", step_readings, step_rows),
    ):
        try:
            readings[name] = read(content)
        except Refusal as refusal:
            reasons += [str(refusal)] if content else []
    return readings, reasons or ["neither slow tests nor rests in a stepping chamber"] * (
        not readings
    )


def _coefficients(fitted, functions):
    """Coefficients over SoC of the table that predicts best; of the line where none was compared.

    Where the bias is less certain than the limit at the ends of what was tested, nothing.
    """
    tables = {
        table["function"]: table["cross_validation_rmse_volt"]
        for table in functions
        if table["function"] in TABLES
    }
    best = best_of(tables) if tables else LINE
    line = np.stack([fitted.ocv_volt, fitted.slope], axis=1)
    if best != LINE:
        line = fitted.parabola if best == PARABOLA else line * [1.0, 0.0]
    sure = fitted.slope_std * fitted.reach_kelvin <= LARGEST_STD_VOLT
    return np.where(sure[:, None], line, np.nan) if sure.any() else line


def _parabola_note(functions):
    """Note that a chosen parabola may be overpotential rather than entropy."""
    chosen = [function["function"] for function in functions if function["chosen"]]
    if chosen == [PARABOLA]:
        yield (
            "the table bends over temperature: overpotential of the slow current that grows in the "
            "cold does that, an entropic coefficient of its own hardly; which, only rests can tell"
        )


def entropic_columns(ocv):
    """The entropic coefficient over SoC, one row a source and SoC: dict of columns."""
    parts = []
    for source, entropic in sorted(ocv.entropic.items()):
        finite = np.isfinite(entropic.slope)
        columns = {
            "source": source,
            "used": source == ocv.used,
            "soc": entropic.soc[finite],
            "ocv_volt": entropic.ocv_volt[finite],
            "entropic_millivolt_per_kelvin": 1e3 * entropic.slope[finite],
            "std_millivolt_per_kelvin": 1e3 * entropic.slope_std[finite],
            "lower_millivolt_per_kelvin": 1e3 * entropic.slope_lower[finite],
            "upper_millivolt_per_kelvin": 1e3 * entropic.slope_upper[finite],
            "bend_microvolt_per_kelvin_squared": 1e6 * entropic.bend[finite],
            "bend_std_microvolt_per_kelvin_squared": 1e6 * entropic.bend_std[finite],
            "bend_p": entropic.bend_p[finite],
            "shared_error": entropic.shared[finite],
            "temperatures": entropic.temperatures[finite].astype(int),
            "reference_celsius": entropic.reference_celsius,
        }
        parts.append(_broadcast_columns(columns))
    return _stacked(parts)


def map_columns(ocv):
    """Curve and bias at each tested temperature, over every second SoC: dict of columns."""
    surface, readings, fitted = ocv.surface, ocv.readings, ocv.fitted
    base, parts = table_at(surface, surface.reference_celsius)[0], []
    for column, celsius in enumerate(np.nanmean(readings.celsius, axis=0)):
        volt, moves = table_at(surface, celsius)
        columns = {
            "temperature_celsius": celsius,
            "soc": surface.soc,
            "ocv_volt": volt,
            "bias_volt": volt - base,
            "bias_std_volt": fitted.slope_std * abs(celsius - surface.reference_celsius),
            "measured_bias_volt": readings.ocv_volt[:, column] - fitted.ocv_volt,
            "entropic_volt_per_kelvin": moves,
            "tested": is_tested(surface, surface.soc, celsius),
        }
        parts.append({name: v[::2] for name, v in _broadcast_columns(columns).items()})
    return _stacked(parts)


def function_rows(ocv):
    """One row a function over SoC and temperature; parameters row by row, K0 first."""
    cold, warm = ocv.surface.tested_celsius
    rows = []
    for function in ocv.functions:
        parameters = function["parameters"]
        row = {
            "function": f"{function['function']}(T)",
            "parameters": np.ravel(parameters).tolist(),
            "std": np.ravel(function["std"]).tolist(),
            "coefficients": int(parameters.shape[1]) if parameters.ndim == 2 else 0,
            "reference_celsius": ocv.surface.reference_celsius,
        }
        scores = {n: function[n] for n in ("rmse_volt", "cross_validation_rmse_volt", "chosen")}
        rows.append(row | scores | {"tested_from_celsius": cold, "tested_to_celsius": warm})
    return rows


def surface_columns(ocv):
    """The table over SoC that moves with temperature, one row a SoC: dict of columns."""
    surface = ocv.surface
    cold, warm = surface.tested_celsius
    return _broadcast_columns(
        {
            "soc": surface.soc,
            "ocv_volt": surface.ocv_volt,
            "slope_volt_per_kelvin": surface.slope,
            "bend_volt_per_kelvin_squared": surface.bend,
            "reference_celsius": surface.reference_celsius,
            "tested": is_tested(surface, surface.soc, warm),
            "tested_from_celsius": cold,
            "tested_to_celsius": warm,
        }
    )


def _broadcast_columns(columns):
    """Columns of equal length; a single value is repeated."""
    return dict(zip(columns, np.broadcast_arrays(*columns.values()), strict=True))


def _stacked(parts):
    """Columns of several tables, one below the other."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def law_rows(ocv):
    """Rows of tables/temperature: laws at every tenth of SoC, and changes of sign of dOCV/dT.

    In the shape of `laws.law.rows_of`. The line is chosen unless the parabola's bend is
    significant at 5 %; of changes of sign those that are certain at 95 %.
    """
    fitted, rows = ocv.fitted, []
    low, high = ocv.surface.tested_soc
    for soc in np.arange(1, 10) / 10:
        k = int(np.argmin(np.abs(fitted.soc - soc)))
        if not (np.isfinite(fitted.slope[k]) and low - 1e-9 <= fitted.soc[k] <= high + 1e-9):
            continue
        bent = bool(fitted.bend_p[k] < 0.05)
        for degree, law, chosen in ((1, "linear", not bent), (2, "quadratic", bent)):
            rows += _law(ocv, k, soc, degree=degree, law=law, chosen=chosen)
    sure = crossings(ocv)
    found = sure or crossings(ocv, certain=False)
    return rows + [_crossing_row(crossing, bool(sure)) for crossing in found]


def crossings(ocv, *, certain=True):
    """Changes of sign of the entropic coefficient of the used source, as of `zero_crossings`.

    Between signs that are certain at 95 %; else that are one standard deviation off zero.
    """
    entropic = ocv.entropic[ocv.used]
    limits = (entropic.slope_lower, entropic.slope_upper)
    if not certain:
        limits = (entropic.slope - entropic.slope_std, entropic.slope + entropic.slope_std)
    return zero_crossings(entropic.soc, entropic.slope, entropic.slope_std, *limits)


def _crossing_row(crossing, certain):
    """Row of tables/temperature for a change of sign."""
    way = "rising" if crossing["sign_above"] > 0 else "falling"
    # Nothing says where in the range between two certain signs it lies: rectangular.
    std = (crossing["upper_soc"] - crossing["lower_soc"]) / np.sqrt(12)
    quantity = f"zero crossing of dOCV/dT, {way}"
    return law_row(quantity, "linear", "soc", crossing["soc"], std, unit="1", chosen=certain)


PARAMETERS = ("ocv", "entropic_coefficient", "bend"), ("V", "V/K", "V/K^2")


def _law(ocv, k, soc, *, degree, law, chosen):
    """Rows of one law at one SoC, with R² and the error at temperatures left out [V]."""
    readings, reference = ocv.readings, ocv.surface.reference_celsius
    finite = np.isfinite(readings.ocv_volt[k])
    celsius, volt, std, common = (getattr(readings, name)[k][finite] for name in COLUMNS)
    if len(volt) <= degree:
        return []
    form = Form(
        law,
        # About the reference temperature, so that the slope is the coefficient there.
        lambda celsius: np.vander(celsius - reference, degree + 1, increasing=True),
        *(words[: degree + 1] for words in PARAMETERS),
    )
    fitted = fit_law(form, celsius, volt, shared_covariance(std, common), unit="V")
    quantity = f"OCV at {100 * soc:.0f} % SoC, about {reference:g} degC"
    return rows_of(quantity, fitted._replace(chosen=chosen), with_ranges=False)
