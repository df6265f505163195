"""How a fitted model does on records that took no part in its fit, and where it disagrees."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base
from cellwright.effects.records import LOADED_C_RATE
from cellwright.numerics.statistics import rms

READ_VOLT = 2e-3  # of a single reading at rest
LEAST_SLOPE_VOLT = 1e-3  # of the OCV over the whole SoC, below which a rest tells nothing
PASSES = 3
SETTLED_SOC = 1e-5  # a change below it ends them
SOC_STEP = 2e-4
ALIKE_SOC = 0.02  # between two rests whose OCV errs alike


class Rests(NamedTuple):
    """First rests of fitted records: soc [1], and the mean error of the model in each [V]."""

    soc: np.ndarray
    error_volt: np.ndarray


def rests_of(cell, stack, solution):
    """First rests of the records that were fitted.

    Their starts were found by all of their rows, so that what is left of these rests is how far the
    OCV is off there; it is steepest, and least known, where most records begin.

    Parameters
    ----------
    cell : base.Cell. stack : records.Stack. solution : problem.Solution of it.

    Returns
    -------
    rests : Rests.
    """
    loaded = _loaded(cell, stack)
    rows = {k: _first_rest(stack, k, loaded) for k in range(len(stack.first))}
    rows = {k: rest[stack.used[rest]] for k, rest in rows.items()}
    files = [k for k, rest in rows.items() if len(rest)]
    soc = np.array([solution.values[f"soc0[{k}]"] for k in files])
    return Rests(soc, np.array([solution.residual[rows[k]].mean() for k in files]))


def started(cell, stack, values, effects, tolerance, shared=(), rests=None):
    """SoC at the start of each record from its first rest, weighed against what is stated.

    Nothing else of these records enters a parameter.

    Parameters
    ----------
    cell : base.Cell. stack : records.Stack. values : dict. effects : sequence of Effect.
    tolerance : plain.Tolerance. shared : (number here, number in the fit) of records of which one
        part was fitted and another judges: they have one start, and the fit has found it.
    rests : Rests of the records fitted: a rest at a SoC near by is taken to have their error.

    Returns
    -------
    values : dict, with the starts of this stack in the place of others.
    """
    shared_starts = {
        f"soc0[{k}]": _near(values[f"soc0[{n}]"], stack.soc_at_start[k], tolerance.soc)
        for k, n in shared
    }
    values = values | {f"soc0[{k}]": float(s) for k, s in enumerate(stack.soc_at_start)}
    values = values | shared_starts
    loaded = _loaded(cell, stack)
    for _ in range(PASSES):
        earlier = values
        error = stack.voltage_volt - base.voltage(cell, stack, values, effects)
        for k in range(len(stack.first)):
            name, stated = f"soc0[{k}]", stack.soc_at_start[k]
            rest = _first_rest(stack, k, loaded)
            beyond = error[rest] - _error_near(values[name], rests)
            known = _weighed(cell, values[name], stated, beyond, tolerance)
            values = values | {name: shared_starts.get(name, known)}
        starts = [f"soc0[{k}]" for k in range(len(stack.first))]
        if max(abs(values[name] - earlier[name]) for name in starts) < SETTLED_SOC:
            break
    return values


def by_starts(cell, stack, values, effects, tolerance, prediction, whitening, shared=()):
    """Chi-square of a residual that errors of the starts explain, each as likely as it is.

    A start that is known to a millivolt only moves the whole record by one. That is no noise of
    single rows, and without this an effect that moves a record, too, would take it for proof.

    Parameters
    ----------
    cell, stack, effects, tolerance, shared : as in `started`. values : with the starts that it
    gave. prediction : (n,) voltage at them [V]. whitening : noise.Whitening.

    Returns
    -------
    chi_square : by which the whitened residual falls.
    """
    starts = [f"soc0[{k}]" for k in range(len(stack.first))]
    moved = values | {name: values[name] + SOC_STEP for name in starts}
    change = (base.voltage(cell, stack, moved, effects) - prediction) / SOC_STEP
    both = whitening.apply(np.stack([change, stack.voltage_volt - prediction], axis=1))
    loaded, fitted, fall = _loaded(cell, stack), {k for k, _ in shared}, 0.0
    for k in sorted(set(range(len(starts))) - fitted):
        column, error = both[stack.file == k].T
        rows = len(_first_rest(stack, k, loaded))
        known = sum(_weights(_slope(cell, values[starts[k]]), rows, tolerance))
        fall += (column @ error) ** 2 / (column @ column + known)
    return float(fall)


def _loaded(cell, stack):
    return np.abs(stack.current_ampere) > LOADED_C_RATE * cell.capacity_ampere_hour


def _error_near(soc, rests):
    """Mean error of rests near a SoC [V]; a rest without error is counted with them."""
    if rests is None:
        return 0.0
    near = rests.error_volt[np.abs(rests.soc - soc) <= ALIKE_SOC]
    return float(near.sum() / (len(near) + 1))


def _near(fitted, stated, tolerance):
    """A start from the fit, within the tolerance: a model that lacks much moves it far beyond."""
    return float(np.clip(fitted, stated - tolerance, stated + tolerance))


def _first_rest(stack, k, loaded):
    """Rows of record k before its first load."""
    rows = np.flatnonzero(stack.file == k)
    return rows[: int(np.argmax(loaded[rows])) if loaded[rows].any() else len(rows)]


def _weighed(cell, soc, stated, error, tolerance):
    slope = _slope(cell, soc)
    known, told = _weights(slope, len(error), tolerance)
    return (
        stated
        if not told
        else (stated * known + (soc + error.mean() / slope) * told) / (known + told)
    )


def _slope(cell, soc):
    """Slope of the OCV [V]."""
    return float(np.diff(cell.ocv_at(soc + np.array([-0.005, 0.005])))[0]) / 0.01


def _weights(slope, rows, tolerance):
    """Precision of a start as it is stated, and as a rest of so many rows tells it."""
    if not rows or abs(slope) < LEAST_SLOPE_VOLT:
        return tolerance.soc**-2.0, 0.0
    return tolerance.soc**-2.0, slope**2 / (READ_VOLT**2 / rows + tolerance.ocv_volt**2)


BANDS = 10  # of the SoC
LOW_C_RATE, HIGH_C_RATE = 0.05, 0.7
RATES = ("rest", "discharge_low", "discharge_high", "charge_low", "charge_high")
LEAST_ROWS = 5


def rate_of(current_ampere, capacity_ampere_hour):
    """Number of the class of RATES of each row."""
    rate = np.asarray(current_ampere) / capacity_ampere_hour
    size = np.abs(rate)
    high = (size > HIGH_C_RATE).astype(int)
    return np.where(size <= LOW_C_RATE, 0, np.where(rate < 0, 1 + high, 3 + high))


def residual_map(stack, role, soc, before, after, capacity_ampere_hour, rows):
    """RMS and mean of what two models leave, over record, band of the SoC and class of the rate.

    Parameters
    ----------
    stack : records.Stack. role : "fit" or "validation". soc : (n,) [1].
    before, after : (n,) residuals [V]. capacity_ampere_hour : [Ah].
    rows : (n,) bool, rows that count.

    Returns
    -------
    found : dict of lists, one entry a class that holds five rows or more.
    """
    band = np.clip((soc * BANDS).astype(int), 0, BANDS - 1)
    rate = rate_of(stack.current_ampere, capacity_ampere_hour)
    key = (stack.file * BANDS + band) * len(RATES) + rate
    entries = []
    for number in np.unique(key[rows]):
        here = rows & (key == number)
        if here.sum() < LEAST_ROWS:
            continue
        file, rest = divmod(int(number), BANDS * len(RATES))
        low, kind = divmod(rest, len(RATES))
        entries.append(
            {
                "role": role,
                "test": stack.tests[file],
                "soc_low": low / BANDS,
                "soc_high": (low + 1) / BANDS,
                "rate": RATES[kind],
                "temperature_celsius": float(stack.celsius[here].mean()),
                "rows": int(here.sum()),
                "before_rms_volt": rms(before[here]),
                "before_mean_volt": float(before[here].mean()),
                "after_rms_volt": rms(after[here]),
                "after_mean_volt": float(after[here].mean()),
            }
        )
    return {name: [entry[name] for entry in entries] for name in entries[0]} if entries else {}


def joined(maps):
    """Several maps as one."""
    maps = [one for one in maps if one]
    return {name: [v for one in maps for v in one[name]] for name in maps[0]} if maps else {}


def worst(residuals, floor_volt):
    """The class that holds the largest share of what is left beyond the floor, or None.

    Parameters
    ----------
    residuals : dict of lists, from `residual_map`. floor_volt : [V].

    Returns
    -------
    place : dict with file, soc, current, temperature_celsius and share, as in the contract.
    """
    if not residuals:
        return None
    excess = np.array(residuals["rows"]) * np.maximum(
        np.square(residuals["after_rms_volt"]) - floor_volt**2, 0.0
    )
    if excess.sum() <= 0:
        return None
    k = int(np.argmax(excess))
    return {
        "file": residuals["test"][k],
        "soc": [residuals["soc_low"][k], residuals["soc_high"][k]],
        "current": residuals["rate"][k],
        "temperature_celsius": [residuals["temperature_celsius"][k]],
        "share": float(excess[k] / excess.sum()),
    }
