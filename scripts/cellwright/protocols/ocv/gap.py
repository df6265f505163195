"""The gap between the two branches of a slow test, and the hysteresis that it allows."""

from typing import NamedTuple

import numpy as np

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


def largest_hysteresis(basis, celsius, knots):
    """Largest hysteresis at each SoC [V] that the slow test nearest in temperature allows.

    Between the branches lie hysteresis and twice the drop over the resistance, so that half the
    distance is the most that hysteresis can be; what comes at once with the current is none, and is
    taken off where it is most of the distance, as over leads. Hysteresis grows in the cold: a slow
    test that was warmer by more than 2.5 K bounds nothing. A knot takes the widest gap within 2 %
    of SoC, with 3 mV for the reading of the branches; beyond what both branches reach, the gap at
    the end.

    basis : dict, from `records.basis`.
    celsius : temperature of the condition [degC].
    knots : (k,) SoC [1].

    Returns most_volt: (k,) [V], None without a slow test. words : where it is from.

    Source: G. L. Plett, Battery Management Systems I (2015), ch. 2: hysteresis parts slow branches.
    """
    # ASSUME: In a slow full branch the hysteresis has developed: its charge constant is small
    # beside the charge that the branch has moved.
    if basis["borrowed_from"] is not None:
        return None, f"not bounded: the OCV is that of {basis['borrowed_from']}"
    found = []
    for curve in basis["ocv"]:
        warmer = stated_or_reference(curve["ambient_temperature_celsius"]) - celsius
        if half_gap(curve)[0].size and warmer <= SAME_CELSIUS:
            found.append((abs(warmer), curve))
    if not found:
        return None, "not bounded: no slow test both ways at this temperature or below"
    _, curve = min(found, key=lambda one: one[0])
    soc, gap = half_gap(curve)
    whole_volt, _, step_volt = slow_gap(curve)
    leads_volt = step_volt if step_volt > whole_volt / 2 else 0.0
    gap = gap - leads_volt
    # As `identification.regression` trusts a slow branch: to 2 % of SoC and 3 mV.
    shifts = np.linspace(-0.02, 0.02, 9)
    near = [np.interp(np.asarray(knots) + shift, soc, gap) for shift in shifts]
    most = np.maximum(np.max(near, axis=0), 0.0) + 3e-3
    less = f" less the {1e3 * leads_volt:.0f} mV that come at once" if leads_volt else ""
    words = f"at most half the gap of {curve['test']}{less}, {1e3 * most.min():.0f}"
    return most, f"{words} to {1e3 * most.max():.0f} mV"


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
