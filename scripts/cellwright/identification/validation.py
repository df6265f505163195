"""Simulated against measured: the numbers of `validation.csv`."""

import numpy as np

from cellwright.circuits import inputs as given
from cellwright.circuits.model_file import in_use, names_of, simulate_model
from cellwright.numerics.statistics import rms
from cellwright.records import inputs
from cellwright.records.basis import at_cycle
from cellwright.records.record import laid_out
from cellwright.records.repeats import of_tests, rows_repeated
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.settings import Models

MODELS = Models()

FAULT_VOLT = 0.5  # a simulation so far outside what was measured has a fault, not an error
INNER_SOC = (0.05, 0.95)  # near empty and full the OCV is steep: an error of the SoC rules there


def simulated(model, member, record):
    """A member of a model simulated through a record, as the instrument reads it.

    Parameters
    ----------
    model : dict of schema cellwright-model/2. member : its name. record : Record.

    Returns
    -------
    simulated : model_file.Simulated.
    """
    columns = (record.test_time_second, record.current_ampere, record.soc, record.celsius)
    return simulate_model(model, member, *columns, kind=record.kind)


def held_out(model, series, test, cell, *, split_rest_second=MODELS.split_rest_second):
    """A test that took no part in a model's fit, laid out to be predicted by it.

    Returns (model at the age of the test, `Record` on its SoC scale): what `validate` and
    `estimate_soc` take. Raises Refusal: no SoC at the start can be known. Source: docs/models.md.
    """
    measured = inputs.measured(test, series, inputs.COUNTED)
    model, facts = at_cycle(given.model(model), measured.facts.cycle), inputs.cell_facts(cell)
    how = {"split_rest_second": split_rest_second, "proof": True}
    return model, laid_out(measured, model, facts, **how)


def validate(model, record, *, repeats=None):
    """Errors [V] of every member of a model, simulated through a test it was not fitted to.

    model, record : of `held_out`.
    repeats : rows that were fitted in another test, or score there, do not score here; None: all
        do.

    Returns rows, one a member: rmse_volt, max_abs_volt [V] and others; series. Raises Refusal:
    nothing is left to score. Source: docs/models.md.
    """
    model, found = given.model(model), of_tests(repeats)
    if found is not None:
        elsewhere = rows_repeated(found, record.test, len(record.used))
        record = record._replace(used=record.used & ~elsewhere)
    scored, rows, columns = record.used, [], {}
    for name in names_of(model):
        run = simulated(model, name, record)
        columns[f"simulated_{name}_volt"] = run.voltage_volt
        error = record.voltage_volt - run.voltage_volt
        row = scores(error[scored], record.soc[scored])
        row["beyond_volt"] = beyond_volt(record.voltage_volt, error)
        outside = (run.extrapolated | run.outside_temperature)[scored]
        parts = {"within": ~outside, "beyond": outside}
        row |= {f"rmse_{part}_fitted_volt": rms(error[scored][at]) for part, at in parts.items()}
        rows.append(
            {"model": name, **row, "extrapolated": float(outside.mean())}
            | {"chosen": name == in_use(model)}
            | {"soc_start": float(record.soc[0]), "soc_anchor": record.anchor}
        )
    names = ("test_time_second", "current_ampere", "voltage_volt", "soc")
    columns = {name: getattr(record, name) for name in names} | {"scored": scored} | columns
    notes = [f"simulated at {record.temperature_source} temperature"]
    notes += [
        f"{row['model']} simulates {row['beyond_volt']:.2g} V outside what was measured: a fault"
        for row in rows
        if row["chosen"] and row["beyond_volt"] > FAULT_VOLT
    ]
    return Result({"rows": rows, "series": columns}, notes=tuple(notes))


def beyond_volt(voltage_volt, error_volt):
    """How far a simulation leaves the range of the measured voltage [V]; 0 where it stays inside.

    Infinite where it holds values that are not finite.

    A small error over a whole record may hide a few samples at -1.5 V, which no cell ever has.

    Parameters
    ----------
    voltage_volt, error_volt : (n,) measured, and measured minus simulated [V].
    """
    simulated_volt = voltage_volt - error_volt
    above = simulated_volt.max() - voltage_volt.max()
    most = max(above, voltage_volt.min() - simulated_volt.min(), 0.0)
    return float(most) if np.isfinite(simulated_volt).all() else np.inf


def is_inner(soc):
    """Which rows (n,) lie within the inner range of the SoC, 5 to 95 %."""
    return (soc >= INNER_SOC[0]) & (soc <= INNER_SOC[1])


def scores(error_volt, soc):
    """Errors of a simulation: RMS, RMS over SoC 5–95 %, largest, mean, and how many samples.

    Parameters
    ----------
    error_volt, soc : (n,) measured minus simulated [V], state of charge [1].

    Raises
    ------
    Refusal
        No sample, or errors that are not finite.
    """
    if not len(error_volt):
        raise Refusal("no sample is left to score")
    if not np.isfinite(error_volt).all():
        raise Refusal(f"{np.sum(~np.isfinite(error_volt))} simulated voltages are not finite")
    return {
        "rmse_volt": rms(error_volt),
        "rmse_volt_soc_5_95": rms(error_volt[is_inner(soc)]),
        "max_abs_volt": float(np.abs(error_volt).max()),
        "mean_volt": float(error_volt.mean()),
        "samples": len(error_volt),
    }
