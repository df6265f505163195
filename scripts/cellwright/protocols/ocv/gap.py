"""The gap between the two branches of a slow test, and the hysteresis that it allows."""

from typing import NamedTuple

import numpy as np

from cellwright.protocols.messages import say
from cellwright.records.conditions import SAME_CELSIUS, stated_or_reference


class SlowGap(NamedTuple):
    """Half the gap of the branches of a slow test [V] and its current [A]; NaN where unknown.

    step_volt : of it what comes at once with the current, over leads and contacts too [V].
    """

    half_gap_volt: float = np.nan
    current_ampere: float = np.nan
    step_volt: float = 0.0

    def drop_volt(self, resistance_ohm):
        """What is no hysteresis of it [V]: the drop over a resistance, and what comes at once."""
        return max(self.current_ampere * resistance_ohm, self.step_volt)


def slow_gap(curve):
    """Half the gap of a slow test with a full discharge and a full charge.

    curve : dict of a basis' OCV: branches, soc, half_gap_volt, discharge_current_ampere,
        charge_current_ampere, step_volt.

    Returns gap: SlowGap, median over SoC 20–80 %; NaN of a single branch.
    """
    soc, gap = half_gap(curve)
    inside = (soc >= 0.2) & (soc <= 0.8)  # near the ends the gap is resistance
    if not inside.any():
        return SlowGap()
    charge, discharge, step = (
        np.nan if curve.get(name) is None else curve[name]
        for name in ("charge_current_ampere", "discharge_current_ampere", "step_volt")
    )
    half = float(np.median(gap[inside]))
    return SlowGap(half, float(charge - discharge) / 2, float(np.nan_to_num(step)))


def half_gap(curve):
    """SoC [1] and half the gap of the branches [V], each (m,), where both were measured.

    curve : dict, as in `slow_gap`; empty for a single branch, for rests, or without half_gap_volt.
    """
    if curve["branches"] != "both" or "half_gap_volt" not in curve:
        return np.empty(0), np.empty(0)
    soc, gap = (np.array(curve[name], float) for name in ("soc", "half_gap_volt"))
    measured = np.isfinite(gap)
    return soc[measured], gap[measured]


def largest_hysteresis(basis, celsius, knots, *, prompt_ohm=0.0):
    """Largest hysteresis at each SoC [V] that the cell's slow tests allow, whichever allows least.

    Between the branches lie hysteresis and twice the drop over the resistance, so that half the
    distance is the most that hysteresis can be. What comes at once with the current is none, and is
    taken off where it is most of the distance, as over leads; at the test's own temperature, where
    it is known, the drop over what relaxes within a minute. Polarisation grows in the cold by far
    more than a hysteresis does: the whole gap of a warmer slow test, with the polarisation in it,
    bounds a colder cell as well. A knot takes the widest gap within 2 % of SoC, with 3 mV for the
    reading of the branches; beyond what both branches reach, the gap at the end.

    basis : dict, from `records.basis`.
    celsius : temperature of the condition [degC].
    knots : (k,) SoC [1].
    prompt_ohm : number or (k,), ohmic resistance and what relaxes within a minute, of the condition
        at the knots [ohm].

    Returns most_volt: (k,) [V], None without a slow test. words : where it is from.

    Source: G. L. Plett, Battery Management Systems I (2015), ch. 2: hysteresis parts slow branches.
    """
    # ASSUME: In a slow full branch the hysteresis has developed: its charge constant is small
    # beside the charge that the branch has moved.
    # ASSUME: No hysteresis exceeds half the gap, polarisation included, of a slow test of the same
    # cell at another temperature.
    if basis["borrowed_from"] is not None:
        return None, say("gap.borrowed", cell=basis["borrowed_from"])
    bounds = {}
    for curve in basis["ocv"]:
        if half_gap(curve)[0].size:
            apart = stated_or_reference(curve["ambient_temperature_celsius"]) - celsius
            own_ohm = prompt_ohm if abs(apart) <= SAME_CELSIUS else 0.0
            bounds[curve["test"]] = _largest_by(curve, np.asarray(knots), own_ohm)
    if not bounds:
        return None, say("gap.none")
    tests, sizes = list(bounds), np.array([volt for volt, _ in bounds.values()])
    most = sizes.min(axis=0)
    named = [tests[k] + bounds[tests[k]][1] for k in np.unique(sizes.argmin(axis=0))]
    low, high = 1e3 * most.min(), 1e3 * most.max()
    return most, say("gap.bound", low=low, high=high, tests=" and ".join(named))


def _largest_by(curve, knots, prompt_ohm):
    """Largest hysteresis (k,) [V] by one slow test, and in words what was taken off its gap."""
    soc, gap = half_gap(curve)
    whole = slow_gap(curve)
    at_once_volt = whole.step_volt if whole.step_volt > whole.half_gap_volt / 2 else 0.0
    drop_volt = np.nan_to_num(whole.current_ampere) * np.asarray(prompt_ohm)
    # As `identification.regression` trusts a slow branch: to 2 % of SoC and 3 mV.
    shifts = np.linspace(-0.02, 0.02, 9)
    widest = np.max([np.interp(knots + shift, soc, gap) for shift in shifts], axis=0)
    off = np.maximum(at_once_volt, drop_volt) * np.ones(len(knots))
    most = np.maximum(widest - off, 0.0) + 3e-3
    if at_once_volt and at_once_volt >= off.max():
        return most, say("gap.at_once", volt=1e3 * at_once_volt)
    if off.any():
        return most, say("gap.ohmic", low=1e3 * off.min(), high=1e3 * off.max())
    return most, ""


def shows_hysteresis(gap, resistance_ohm):
    """Whether a resistance at the slow test's current leaves most of the gap unexplained.

    A relaxation, however slow, drives the branches apart by no more than current times its
    resistance; a hysteresis does so at any current.

    gap : SlowGap.
    resistance_ohm : all that the model has, ohmic and relaxing [ohm].

    Source: W. Dreyer et al., Nature Materials 9 (2010) 448: the gap of LFP stays at vanishing
    current.
    """
    unexplained_volt = gap.half_gap_volt - gap.drop_volt(resistance_ohm)
    # An error of the OCV swallows 5 mV, and the resistance is no better known than by half.
    return bool(unexplained_volt > max(5e-3, 0.5 * gap.half_gap_volt))
