"""How a fitted model does on records that took no part in its fit."""

import numpy as np

from cellwright.effects import base
from cellwright.effects.records import LOADED_C_RATE

READ_VOLT = 2e-3  # of a single reading at rest
LEAST_SLOPE_VOLT = 1e-3  # of the OCV over the whole SoC, below which a rest tells nothing
PASSES = 3


def rms(values):
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def started(cell, stack, values, effects, tolerance, shared=()):
    """SoC at the start of each record from its first rest, weighed against what is stated.

    Nothing else of these records enters a parameter.

    Parameters
    ----------
    cell : base.Cell. stack : records.Stack. values : dict. effects : sequence of Effect.
    tolerance : plain.Tolerance. shared : (number here, number in the fit) of records of which one
        part was fitted and another judges: they have one start, and the fit has found it.

    Returns
    -------
    values : dict, with the starts of this stack in the place of others.
    """
    found = {
        f"soc0[{k}]": _near(values[f"soc0[{n}]"], stack.soc_at_start[k], tolerance.soc)
        for k, n in shared
    }
    values = values | {f"soc0[{k}]": float(s) for k, s in enumerate(stack.soc_at_start)} | found
    loaded = np.abs(stack.current_ampere) > LOADED_C_RATE * cell.capacity_ampere_hour
    for _ in range(PASSES):
        error = stack.voltage_volt - base.voltage(cell, stack, values, effects)
        for k in range(len(stack.first)):
            name, stated = f"soc0[{k}]", stack.soc_at_start[k]
            rest = _first_rest(stack, k, loaded)
            known = _weighed(cell, values[name], stated, error[rest], tolerance)
            values = values | {name: found.get(name, known)}
    return values


def _near(found, stated, tolerance):
    """A start from the fit, within the tolerance: a model that lacks much bends it far beyond."""
    return float(np.clip(found, stated - tolerance, stated + tolerance))


def _first_rest(stack, k, loaded):
    """Rows of record k before its first load."""
    rows = np.flatnonzero(stack.file == k)
    return rows[: int(np.argmax(loaded[rows])) if loaded[rows].any() else len(rows)]


def _weighed(cell, soc, stated, error, tolerance):
    slope = float(np.diff(cell.ocv_at(soc + np.array([-0.005, 0.005])))[0]) / 0.01
    if not len(error) or abs(slope) < LEAST_SLOPE_VOLT:
        return stated
    known = tolerance.soc**-2.0
    told = slope**2 / (READ_VOLT**2 / len(error) + tolerance.ocv_volt**2)
    return (stated * known + (soc + error.mean() / slope) * told) / (known + told)
