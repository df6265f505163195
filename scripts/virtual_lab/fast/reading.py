"""From the instants that the kernel noted to functions of time."""

from functools import partial

import numpy as np

from virtual_lab.behaviour import Behaviour
from virtual_lab.fast.march import COLUMNS, NOTED
from virtual_lab.fast.packing import Pack


def behaviour_of(noted: np.ndarray, packed: Pack, *, held: bool) -> Behaviour:
    """One step; `noted` has shape (instants, columns), see `march.NOTED`; held: at a voltage."""
    column = dict(zip(NOTED, noted.T.copy(), strict=False))
    branches = tuple(noted[:, COLUMNS:].T.copy())
    straight = {
        name: partial(np.interp, xp=column["second"], fp=column[name])
        for name in ("current", "volt", "celsius", "soc")
    }
    column["branch"] = branches[0]
    first = tuple(
        float(values[0])
        for values in (packed.leak, packed.asymmetry, packed.kinetic_share, packed.kinetic_volt)
    )
    column["rest"] = (
        column["volt"] - column["unrest"] - _ohmic(column["branch"], column["r0"], first)
    )
    return Behaviour(
        duration_second=float(column["second"][-1]),
        current=straight["current"],
        voltage=straight["volt"] if held else partial(_voltage, column=column, first=first),
        temperature=straight["celsius"],
        branches=tuple(partial(np.interp, xp=column["second"], fp=one) for one in branches),
        charge=partial(_charge, column=column),
        soc=straight["soc"],
    )


def _ohmic(ampere, r0, first):
    """Voltage over the ohmic element of the first cell, as the kernel has it."""
    leak, asymmetry, share, scale = first
    through = ampere - leak
    volt = np.where(through > 0.0, 1.0 + asymmetry, 1.0) * r0 * through
    if scale == 0.0:
        return volt
    return (1.0 - share) * volt + scale * np.arcsinh(share * volt / scale)


def _interval(second, grid):
    """Number of the interval that each instant lies in, its length [s], the share of it passed."""
    second = np.clip(second, 0.0, grid[-1])
    k = np.clip(np.searchsorted(grid, second, side="right") - 1, 0, grid.size - 2)
    length = grid[k + 1] - grid[k]
    return k, length, (second - grid[k]) / np.where(length > 0.0, length, 1.0)


def _voltage(second, column, first):
    """Open circuit, exponentials and hysteresis by a cubic, for their rates are known; the ohmic
    element by its law, for the current is known; what is left by a straight line."""
    k, length, u = _interval(second, column["second"])

    def between(name):
        return column[name][k] + u * (column[name][k + 1] - column[name][k])

    rise = column["unrest"][k + 1] - column["unrest"][k]
    begin, end = column["unrest_rate"][k] * length, column["unrest_rate"][k + 1] * length
    bend = u * (1 - u) * ((1 - u) * (begin - rise) + u * (rise - end))
    prompt = _ohmic(between("branch"), between("r0"), first)
    return between("unrest") + bend + prompt + between("rest")


def _charge(second, column):
    """Charge [Ah]; the current runs straight between instants."""
    k, length, u = _interval(second, column["second"])
    current = column["current"]
    mean = current[k] + 0.5 * u * (current[k + 1] - current[k])
    return column["charge"][k] + u * length * mean / 3600.0
