"""Open-circuit voltage of whole cells from two electrodes, each a sum of galleries.

The lithiation of an electrode at a potential U is Σ Xj / (1 + exp(F/RT (U − Uj)/ωj)), the form of
M. Verbrugge et al., J. Electrochem. Soc. 164 (2017), E3243 (multi-species, multi-reaction model).
Potentials, shares and widths here are rounded own values of the usual stages, not a published set.
"""

from typing import NamedTuple

import numpy as np

THERMAL_VOLT = 8.314 * 298.15 / 96485.0
SOC = np.linspace(0.0, 1.0, 2001)


class Gallery(NamedTuple):
    """Sites that fill around one potential [V]: their share of all sites [1], and width ω [1]."""

    volt: float
    share: float
    width: float


GRAPHITE = (
    Gallery(0.088, 0.43, 0.09),
    Gallery(0.128, 0.24, 0.10),
    Gallery(0.144, 0.14, 0.7),
    Gallery(0.172, 0.06, 2.4),
    Gallery(0.215, 0.07, 0.12),
    Gallery(0.36, 0.06, 5.8),
)
POSITIVE = {
    "NMC": (
        Gallery(3.62, 0.14, 0.95),
        Gallery(3.73, 0.32, 1.4),
        Gallery(3.91, 0.22, 3.4),
        Gallery(4.23, 0.32, 5.4),
    ),
    "NCA": (
        Gallery(3.52, 0.15, 1.3),
        Gallery(3.70, 0.28, 1.6),
        Gallery(3.90, 0.27, 2.2),
        Gallery(4.19, 0.30, 2.6),
    ),
    "LFP": (Gallery(3.424, 0.93, 0.16), Gallery(3.40, 0.05, 2.5), Gallery(3.6, 0.02, 4.0)),
}
CUTOFFS_VOLT = {"NMC": (2.8, 4.2), "NCA": (2.7, 4.2), "LFP": (2.3, 3.6)}
# Graphite at the ends of the window: nearly empty, and short of full.
EMPTY_LITHIATION, FULL_LITHIATION = 0.015, 0.83


def lithiation(galleries, volt):
    """Lithiation [1] of an electrode at potentials [V]."""
    volt = np.asarray(volt, float)
    return sum(
        g.share / (1.0 + np.exp(np.clip((volt - g.volt) / (THERMAL_VOLT * g.width), -500, 500)))
        for g in galleries
    )


def potential_volt(galleries, lithiated, volt):
    """Potential [V] at lithiations [1], from the electrode's curve over a grid of potentials."""
    return np.interp(lithiated, lithiation(galleries, volt)[::-1], volt[::-1])


def open_circuit_volt(chemistry: str, *, empty_shift=0.0, full_shift=0.0) -> np.ndarray:
    """OCV [V] over `SOC`, from cut-off to cut-off.

    Parameters
    ----------
    chemistry : NMC, NCA or LFP.
    empty_shift, full_shift : of the graphite's lithiation [1] at either end, by which cells differ.
    """
    low, high = CUTOFFS_VOLT[chemistry]
    graphite, positive = np.linspace(-0.2, 1.6, 40_001), np.linspace(1.5, 5.5, 40_001)
    x = EMPTY_LITHIATION + empty_shift
    x = x + SOC * (FULL_LITHIATION + full_shift - x)
    negative_volt = potential_volt(GRAPHITE, x, graphite)
    ends = np.array([low, high]) + negative_volt[[0, -1]]
    y = lithiation(POSITIVE[chemistry], ends)
    y = y[0] + SOC * (y[1] - y[0])
    return potential_volt(POSITIVE[chemistry], y, positive) - negative_volt
