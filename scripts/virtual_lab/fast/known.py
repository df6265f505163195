"""What is known of a fast cell without simulating it: open-circuit voltage and resistances."""

import numpy as np

from virtual_lab.fast import packing
from virtual_lab.fast.cell import Cell
from virtual_lab.fast.kernel import REFERENCE_CELSIUS, arrhenius, smooth, straight

PULSE_SECOND = 10.0


def rested_volt(cell: Cell, soc: np.ndarray, *, celsius: float) -> np.ndarray:
    """Open-circuit voltage [V] over the state of charge [1], without hysteresis."""
    one = packing.single(cell)
    warmer = celsius - REFERENCE_CELSIUS
    return np.array(
        [
            smooth(one["ocv"], one["ocv_slope"], z)[0] + warmer * straight(one["entropic"], z)
            for z in np.asarray(soc, float)
        ]
    )


def resistances(cell: Cell, soc: np.ndarray, *, celsius: float) -> dict[str, np.ndarray]:
    """Resistances [ohm] of a discharge at small current, over the state of charge [1].

    Returns
    -------
    r0: at once; r_10s: after 10 s; r_total: in the long run, the OCV's own change left out.
    """
    one = packing.single(cell)
    names = ("r", "tau", "r_energy", "tau_energy")
    elements = list(zip(*(one[name] for name in names), one["factor"][1:], strict=True))
    r0 = one["r0"] * arrhenius(one["r0_energy"], celsius) * _over(one["factor"][0], soc)
    found = {"r0": r0, "r_10s": r0, "r_total": r0}
    for r, tau, of_r, of_tau, factor in elements:
        whole = r * arrhenius(of_r, celsius) * _over(factor, soc)
        share = 1 - np.exp(-PULSE_SECOND / (tau * arrhenius(of_tau, celsius)))
        found["r_10s"] = found["r_10s"] + share * whole
        found["r_total"] = found["r_total"] + whole
    return found


def _over(table, soc):
    return np.array([straight(table, z) for z in np.asarray(soc, float)])
