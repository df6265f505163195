"""Simulated lives for the tests: two half cells, known losses, half cells that err."""

import numpy as np

from cellwright.health.electrodes.alignment import CORRELATED_SOC, Pair, SlowCurve, cell_volt
from cellwright.health.electrodes.half_cells import half_cell

SOC = np.linspace(0.0, 1.0, 201)
LOSSES = np.array([[0.0, 0.0, 0.0], [0.04, 0.02, 0.03], [0.10, 0.05, 0.06], [0.20, 0.12, 0.15]])


def nmc():
    """Half cells of an NMC cell, its cut-offs [V], and electrodes and lithium [Ah]."""
    return Pair(half_cell("graphite_siox_chen"), half_cell("nmc811_chen")), (3.0, 4.15, 1.2, 1.8)


NMC_LITHIUM = 1.55


def window(pair, lithium, negative, positive, lower, upper):
    """Limits (4,) [1] at which the rested cell has its cut-offs, and the charge between [Ah]."""
    empty = max(0.0, (lithium - positive) / negative)
    full = min(1.0, (lithium - pair.positive.lithiation[0] * positive) / negative)
    x = np.linspace(empty, full, 40001)
    y = (lithium - x * negative) / positive
    volt = np.interp(y, pair.positive.lithiation, pair.positive.potential_volt)
    volt -= np.interp(x, pair.negative.lithiation, pair.negative.potential_volt)
    ends = np.interp([lower, upper], volt, x)
    return np.array([*ends, *((lithium - ends * negative) / positive)]), negative * np.ptp(ends)


def half_cell_error(rng, size_volt):
    """A random walk over SoC that is pulled back, as half cells err (201,) [V]."""
    kept = np.exp(-np.diff(SOC) / CORRELATED_SOC)
    values = [rng.standard_normal()]
    for share in kept:
        values.append(share * values[-1] + np.sqrt(1 - share**2) * rng.standard_normal())
    return size_volt * np.array(values)


def life(seed, *, losses=LOSSES, common_volt=0.002, own_volt=0.001, shift_volt=0.005):
    """Slow charges of an NMC cell with known losses; half cells err alike and one by one."""
    rng = np.random.default_rng(seed)
    pair, (lower, upper, negative, positive) = nmc()
    common, curves = half_cell_error(rng, common_volt), []
    for k, (lithium, of_negative, of_positive) in enumerate(losses):
        sizes = (negative * (1 - of_negative), positive * (1 - of_positive))
        limits, charge = window(pair, NMC_LITHIUM * (1 - lithium), *sizes, lower, upper)
        volt = cell_volt(pair, np.array([*limits, shift_volt, 0.0]), SOC)
        volt = volt + common + half_cell_error(rng, own_volt)
        curves.append(curve_of(SOC, volt, charge, cycle=100.0 * k))
    return curves


def curve_of(soc, volt, charge, *, cycle=0.0, test=None, **changes):
    """A slow charge at 25 °C."""
    name = test or f"slow_{cycle:.0f}"
    made = SlowCurve("C1", name, cycle, 25.0, charge / 20, soc, volt, charge, "charge")
    return made._replace(**changes)
