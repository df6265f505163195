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


def started(cell, stack, values, effects, tolerance):
    """SoC at the start of each record from its first rest, weighed against what is stated.

    Nothing else of these records enters a parameter.

    Parameters
    ----------
    cell : base.Cell. stack : records.Stack. values : dict. effects : sequence of Effect.
    tolerance : plain.Tolerance.

    Returns
    -------
    values : dict, with the starts of this stack in the place of others.
    """
    values = values | {f"soc0[{k}]": float(s) for k, s in enumerate(stack.soc_at_start)}
    loaded = np.abs(stack.current_ampere) > LOADED_C_RATE * cell.capacity_ampere_hour
    for _ in range(PASSES):
        error = stack.voltage_volt - base.voltage(cell, stack, values, effects)
        for k in range(len(stack.first)):
            rows = np.flatnonzero(stack.file == k)
            rest = rows[: int(np.argmax(loaded[rows])) if loaded[rows].any() else len(rows)]
            name = f"soc0[{k}]"
            stated = stack.soc_at_start[k]
            values = values | {name: _weighed(cell, values[name], stated, error[rest], tolerance)}
    return values


def _weighed(cell, soc, stated, error, tolerance):
    slope = float(np.diff(cell.ocv_at(soc + np.array([-0.005, 0.005])))[0]) / 0.01
    if not len(error) or abs(slope) < LEAST_SLOPE_VOLT:
        return stated
    known = tolerance.soc**-2.0
    told = slope**2 / (READ_VOLT**2 / len(error) + tolerance.ocv_volt**2)
    return (stated * known + (soc + error.mean() / slope) * told) / (known + told)
