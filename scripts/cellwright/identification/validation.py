"""Simulated against measured: the numbers of `validation.csv`."""

import numpy as np

from cellwright.circuits import inputs as given
from cellwright.circuits.model_file import in_use, names_of
from cellwright.identification.intervals import beyond, fitted_at, half_width_volt, simulated
from cellwright.identification.messages import say
from cellwright.numerics.statistics import NORMAL_90, rms
from cellwright.records import inputs
from cellwright.records.basis import at_cycle
from cellwright.records.record import laid_out
from cellwright.records.repeats import of_tests, rows_repeated
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.settings import Models

MODELS = Models()

FAULT_VOLT = 0.5  # a simulation so far outside what was measured has a fault, not an error
NEAR = 1.1  # of rms errors that count as equal
MATERIAL_VOLT = 1e-3  # accuracy of a good cycler: errors that differ by less are alike
INNER_SOC = (0.05, 0.95)  # near empty and full the OCV is steep: an error of the SoC rules there


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
    runs = {name: simulated(model, name, record) for name in names_of(model)}
    half_volt = {name: half_width_volt(model, name, record, runs) for name in runs}
    rows = [_row(model, name, record, runs[name], half_volt[name]) for name in runs]
    names = ("test_time_second", "current_ampere", "voltage_volt", "soc")
    columns = {name: getattr(record, name) for name in names} | {"scored": record.used}
    columns |= {f"simulated_{name}_volt": run.voltage_volt for name, run in runs.items()}
    if half_volt[in_use(model)] is not None:
        columns["half_width_90_volt"] = half_volt[in_use(model)]
    notes = [f"simulated at {record.temperature_source} temperature"]
    notes += [
        f"{row['model']} simulates {row['beyond_volt']:.2g} V outside what was measured: a fault"
        for row in rows
        if row["chosen"] and row["beyond_volt"] > FAULT_VOLT
    ]
    notes += [words for row in rows if row["chosen"] and (words := below_in_words(row))]
    return Result({"rows": rows, "series": columns}, notes=tuple(notes))


def _row(model, name, record, run, half_volt):
    """Scores of one member; half_volt : (n,) half width of its interval [V], or None."""
    scored, fitted = record.used, fitted_at(model, record.celsius)
    error = (record.voltage_volt - run.voltage_volt)[scored]
    places = {where: mask[scored] for where, mask in beyond(model, record, run).items()}
    below = places.pop("below")
    outside = np.any(list(places.values()), axis=0)
    parts = {"within_fitted": ~outside, "beyond_fitted": outside}
    parts |= {"below_fitted": below, "above_lowest_fitted": ~below}
    row = {"model": name, **scores(error, record.soc[scored])}
    row["beyond_volt"] = beyond_volt(record.voltage_volt, record.voltage_volt - run.voltage_volt)
    row |= {f"rmse_{part}_volt": rms(error[at]) for part, at in parts.items()}
    row |= {"extrapolated": float(outside.mean()), "below_fitted": float(below.mean())}
    row |= {f"beyond_{where}": float(mask.mean()) for where, mask in places.items()}
    row["lowest_fitted_soc"] = np.nan if fitted is None else float(fitted.low_soc[scored].mean())
    row |= _of_interval(error, None if half_volt is None else half_volt[scored], ~outside)
    return row | {
        "chosen": name == in_use(model),
        "soc_start": float(record.soc[0]),
        "soc_anchor": record.anchor,
    }


def _of_interval(error_volt, half_volt, inside):
    """Stated deviation of a simulation [V], rms, and what share of its samples lies within the
    90 % interval, of all and of those inside what was fitted; NaN where there is none."""
    names = ("voltage_std_volt", "share_within_90", "share_within_90_fitted")
    if half_volt is None:
        return dict.fromkeys(names, np.nan)
    held = np.abs(error_volt) <= half_volt
    shares = held.mean(), held[inside].mean() if inside.any() else np.nan
    return dict(zip(names, map(float, (rms(half_volt) / NORMAL_90, *shares)), strict=True))


def below_in_words(row):
    """Sentence on what lies below the lowest fitted SoC where it moves the error; else "".

    Parameters
    ----------
    row : of `validate`.
    """
    above = row["rmse_above_lowest_fitted_volt"]
    if not row["below_fitted"] or not row["rmse_volt"] > max(NEAR * above, above + MATERIAL_VOLT):
        return ""
    below, low = row["rmse_below_fitted_volt"], row["lowest_fitted_soc"]
    place = "" if np.isnan(low) else say("validation.lowest", soc=low)
    volts = {"below": 1e3 * below, "above": 1e3 * above}
    return say(
        "validation.below", name=row["model"], share=row["below_fitted"], place=place, **volts
    )


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
