"""The gap between the two branches of a slow test, and the hysteresis that it allows."""

from typing import NamedTuple

import numpy as np

from cellwright.records.conditions import SAME_CELSIUS

MIDDLE = (0.2, 0.8)  # SoC over which the gap is read: near the ends it is resistance
READING_VOLT = (
    3e-3  # how far a slow branch is trusted, as `identification.regression.Noise.floor_volt`
)
READING_SOC = 0.02  # and at which SoC, as `identification.regression.Prior.missing`


class SlowGap(NamedTuple):
    """Half the gap of the branches of a slow test [V] and its current [A]; NaN where unknown."""

    half_gap_volt: float = np.nan
    current_ampere: float = np.nan


class Allowed(NamedTuple):
    """Largest hysteresis (k,) [V], None without a slow test, and its source in words."""

    most_volt: np.ndarray | None
    words: str


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
    soc, gap = half_gap(curve)
    inside = (soc >= MIDDLE[0]) & (soc <= MIDDLE[1])
    if not inside.any():
        return SlowGap()
    current = (curve["charge_current_ampere"] - curve["discharge_current_ampere"]) / 2
    return SlowGap(float(np.median(gap[inside])), float(current))


def half_gap(curve):
    """SoC [1] and half the gap of the branches [V], each (m,), where both were measured.

    Parameters
    ----------
    curve : dict, as in `slow_gap`; empty for a single branch, for rests, or without half_gap_volt.
    """
    if curve["branches"] != "both" or "half_gap_volt" not in curve:
        return np.empty(0), np.empty(0)
    soc, gap = (np.array(curve[name], float) for name in ("soc", "half_gap_volt"))
    measured = np.isfinite(gap)
    return soc[measured], gap[measured]


def largest_hysteresis(basis, celsius, knots):
    """Largest hysteresis at each SoC [V] that the slow test nearest in temperature allows.

    Between the branches lie hysteresis and twice the drop over the resistance, so that half the
    distance is the most that hysteresis can be. Hysteresis grows in the cold: a slow test that was
    warmer by more than 2.5 K bounds nothing. A knot takes the widest gap within 2 % of SoC, with
    3 mV for the reading of the branches; beyond what both branches reach, the gap at the end.

    Parameters
    ----------
    basis : dict, from `records.basis`.
    celsius : temperature of the condition [degC].
    knots : (k,) SoC [1].

    Returns
    -------
    allowed : Allowed.

    Source: G. L. Plett, Battery Management Systems I (2015), ch. 2: hysteresis parts slow branches.
    """
    # ASSUME: In a slow full branch the hysteresis has developed: its charge constant is small
    # beside the charge that the branch has moved.
    if basis["borrowed_from"] is not None:
        return Allowed(None, f"not bounded: the OCV is that of {basis['borrowed_from']}")
    curves = [c for c in basis["ocv"] if half_gap(c)[0].size]
    curves = [c for c in curves if _celsius(c) <= celsius + SAME_CELSIUS]
    if not curves:
        return Allowed(None, "not bounded: no slow test both ways at this temperature or below")
    curve = min(curves, key=lambda c: abs(celsius - _celsius(c)))
    soc, gap = half_gap(curve)
    shifts = np.linspace(-READING_SOC, READING_SOC, 9)
    near = [np.interp(np.asarray(knots) + shift, soc, gap) for shift in shifts]
    most = np.maximum(np.max(near, axis=0), 0.0) + READING_VOLT
    words = f"at most half the gap of {curve['test']}, {1e3 * most.min():.0f}"
    return Allowed(most, f"{words} to {1e3 * most.max():.0f} mV")


def _celsius(curve):
    """Temperature of a slow test [degC]."""
    # ASSUME: A test without a stated temperature was made at 25 °C.
    celsius = curve["ambient_temperature_celsius"]
    return 25.0 if celsius is None else celsius


LEAST_VOLT = 5e-3  # of half the gap, the design's limit of what an OCV error swallows
LEAST_SHARE = 0.5  # of half the gap that a resistance may leave


def shows_hysteresis(gap, resistance_ohm):
    """Whether a resistance at the slow test's current leaves most of the gap unexplained.

    A relaxation, however slow, drives the branches apart by no more than current times its
    resistance; a hysteresis does so at any current.

    Parameters
    ----------
    gap : SlowGap.
    resistance_ohm : all that the model has, ohmic and relaxing [ohm].

    Source: W. Dreyer et al., Nature Materials 9 (2010) 448: the gap of LFP stays at vanishing
    current.
    """
    unexplained_volt = gap.half_gap_volt - gap.current_ampere * resistance_ohm
    return bool(unexplained_volt > max(LEAST_VOLT, LEAST_SHARE * gap.half_gap_volt))
