"""Impedance of a fast cell at rest: the same parameters, linearised."""

import numpy as np

from virtual_lab.fast import packing
from virtual_lab.fast.cell import Cell
from virtual_lab.fast.kernel import REFERENCE_CELSIUS, arrhenius, smooth, straight


def impedance(cell: Cell, frequency_hertz: np.ndarray, *, soc: float, celsius: float) -> np.ndarray:
    """Complex impedance of a cell at rest.

    Parameters
    ----------
    cell : what it is made of.
    frequency_hertz : frequencies [Hz].
    soc : state of charge [1].
    celsius : temperature of the cell [°C].

    Returns
    -------
    impedance [ohm] at each frequency; capacitive arcs have a negative imaginary part. It is the
    ohmic resistance (where charge and discharge differ, the mean of both), the exponentials, and
    the capacitance of the open-circuit curve, slope / (j·2·pi·f·Q). Hysteresis does not answer to
    currents that move no charge.
    """
    omega = 1j * 2 * np.pi * np.asarray(frequency_hertz, float)
    one = packing.single(cell)
    warmer = celsius - REFERENCE_CELSIUS
    coulomb = one["coulomb"] + one["coulomb_per_kelvin"] * warmer
    factor = [straight(table, soc) for table in one["factor"]]
    slope = smooth(one["ocv"], one["ocv_slope"], soc)[1]
    r0 = one["r0"] * arrhenius(one["r0_energy"], celsius) * factor[0]
    total = r0 * (1 + one["asymmetry"] / 2) + slope / (omega * coulomb)
    names = ("r", "tau", "r_energy", "tau_energy")
    for r, tau, of_r, of_tau, f in zip(*(one[n] for n in names), factor[1:], strict=True):
        element = r * arrhenius(of_r, celsius) * f
        total = total + element / (1 + omega * tau * arrhenius(of_tau, celsius))
    return total
