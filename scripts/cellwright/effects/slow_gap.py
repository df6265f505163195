"""What the two branches of a slow test say of hysteresis: a gap that no resistance explains."""

from typing import NamedTuple

import numpy as np

HYSTERESIS = {"hysteresis_one_state", "hysteresis_instant"}
MIDDLE = (0.2, 0.8)  # SoC over which the gap is read: near the ends it is resistance
LEAST_VOLT = 5e-3  # of half the gap, the design's limit of what an OCV error swallows
LEAST_SHARE = 0.5  # of half the gap that a resistance may leave


class SlowGap(NamedTuple):
    """Half the distance of the branches of a slow test [V] at a current [A]; NaN where unknown."""

    half_gap_volt: float = np.nan
    current_ampere: float = np.nan


def slow_gap(curve):
    """Half the gap of a slow test with a full discharge and a full charge.

    Parameters
    ----------
    curve : dict of a basis' OCV: branches, soc, half_gap_volt, discharge_current_ampere,
        charge_current_ampere.

    Returns
    -------
    gap : SlowGap, median over SoC 20–80 %; NaN of a single branch.
    """
    if curve["branches"] != "both":
        return SlowGap()
    soc, gap = (np.array(curve[name], float) for name in ("soc", "half_gap_volt"))
    inside = (soc >= MIDDLE[0]) & (soc <= MIDDLE[1]) & np.isfinite(gap)
    if not inside.any():
        return SlowGap()
    current = (curve["charge_current_ampere"] - curve["discharge_current_ampere"]) / 2
    return SlowGap(float(np.median(gap[inside])), float(current))


def shows_hysteresis(gap, resistance_ohm):
    """Whether a resistance at the slow test's current leaves most of the gap unexplained.

    A relaxation, however slow, drives the branches apart by no more than current times its
    resistance; a hysteresis does so at any current.

    Parameters
    ----------
    gap : SlowGap. resistance_ohm : all that the model has, ohmic and relaxing [ohm].

    Source: W. Dreyer et al., Nature Materials 9 (2010) 448: the gap of LFP stays at vanishing
    current.
    """
    left = gap.half_gap_volt - gap.current_ampere * resistance_ohm
    return bool(left > max(LEAST_VOLT, LEAST_SHARE * gap.half_gap_volt))
