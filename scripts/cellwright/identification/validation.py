"""Simulated against measured: the numbers of `validation.csv`."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.model_file import simulate_model
from cellwright.numerics.scores import rms
from cellwright.records.anchor import REST_C_RATE
from cellwright.records.basis import soc_of
from cellwright.records.record import course_celsius, fit_mask
from cellwright.refusal import Refusal


class Validation(NamedTuple):
    """Rows of scores, one a member, and the series (n,) they were taken from."""

    rows: list
    series: dict
    notes: tuple


def validate(model, cell, facts, series, *, split_rest_second):
    """Simulate every member of a model through a test that took no part in its fit.

    Parameters
    ----------
    model : dict of schema cellwright-model/2.
    cell, facts : dicts, the rows of the cell and of the test.
    series : dict of (n,) columns, clean.
    split_rest_second : shortest rest that cuts a test of role `split` [s]; its even blocks count.

    Returns
    -------
    validation : Validation.

    Raises
    ------
    Refusal
        No SoC at the start can be known, or nothing is left to score.
    """
    time, current = series["test_time_second"], series["current_ampere"]
    anchored = soc_of(series, model, facts, cell)
    celsius, source = course_celsius(facts, series)
    scored = np.ones(len(time), bool)
    if facts["role"] == "split":
        rest = REST_C_RATE * model["capacity_ampere_hour"]
        scored = ~fit_mask(time, current, rest_second=split_rest_second, rest_ampere=rest)
    rows, columns = [], {}
    for member in model["members"]:
        name = member["model"]
        run = simulate_model(
            model, name, time, current, anchored.soc, celsius, kind=facts.get("kind")
        )
        columns[f"simulated_{name}_volt"] = run.voltage_volt
        error = series["voltage_volt"] - run.voltage_volt
        row = scores(error[scored], anchored.soc[scored])
        outside = (run.extrapolated | run.outside_temperature)[scored]
        rows.append(
            {"model": name, **row, "extrapolated": float(outside.mean())}
            | {"chosen": name == model["chosen"]}
            | {"soc_start": float(anchored.soc[0]), "soc_anchor": anchored.anchor}
        )
    kept = {name: series[name] for name in ("test_time_second", "current_ampere", "voltage_volt")}
    columns = kept | {"soc": anchored.soc, "scored": scored} | columns
    return Validation(rows, columns, (f"simulated at {source} temperature",))


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
    inner = error_volt[(soc >= 0.05) & (soc <= 0.95)]
    return {
        "rmse_volt": rms(error_volt),
        "rmse_volt_soc_5_95": rms(inner),
        "max_abs_volt": float(np.abs(error_volt).max()),
        "mean_volt": float(error_volt.mean()),
        "samples": len(error_volt),
    }
