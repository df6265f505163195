"""The branches of a slow test: a gap that no resistance explains is hysteresis."""

from types import SimpleNamespace

import numpy as np
import pytest

from cellwright.effects.case import Case
from cellwright.effects.library import LIBRARY
from cellwright.protocols.ocv.gap import SlowGap, shows_hysteresis, slow_gap

SOC = np.linspace(0.0, 1.0, 201)


def curve(gap_volt, branches="both"):
    half = np.where(np.abs(SOC - 0.5) < 0.45, gap_volt, np.nan)
    ends = {"discharge_current_ampere": -0.1, "charge_current_ampere": 0.14}
    return {"branches": branches, "soc": SOC.tolist(), "half_gap_volt": half.tolist()} | ends


def test_the_gap_is_read_between_the_ends_at_the_mean_current():
    assert slow_gap(curve(0.02)) == pytest.approx((0.02, 0.12, 0.0))
    assert slow_gap(curve(0.02) | {"step_volt": None}).step_volt == 0.0


@pytest.mark.parametrize("one", [curve(0.02, "discharge"), curve(np.nan)])
def test_without_two_branches_nothing_is_known_and_nothing_shown(one):
    gap = slow_gap(one)
    assert np.isnan(gap.half_gap_volt)
    assert not shows_hysteresis(gap, 0.05)


@pytest.mark.parametrize(
    ("half_gap_volt", "resistance_ohm", "shown"),
    [(0.020, 0.05, True), (0.020, 0.12, False), (0.004, 0.0, False), (0.006, 0.005, True)],
)
def test_what_a_resistance_leaves_decides(half_gap_volt, resistance_ohm, shown):
    assert shows_hysteresis(SlowGap(half_gap_volt, 0.12), resistance_ohm) is shown


def test_what_comes_at_once_with_the_current_is_no_hysteresis():
    """A 2013 Leaf cell: 2.17 A over 112 mOhm of leads, half the gap 261 mV; the cell has 4 mOhm."""
    assert shows_hysteresis(SlowGap(0.261, 2.17), 0.0044)
    assert not shows_hysteresis(SlowGap(0.261, 2.17, step_volt=0.243), 0.0044)


def fitted(*effects, ohm=0.05):
    logs = {f"log_{part}": np.log(0.01) for part in ("r0", "r1", "r2")}
    values = logs | {"slow_diffusion.resistance_ohm": ohm}
    effects = [LIBRARY[effect_id] for effect_id in effects]
    return SimpleNamespace(solution=SimpleNamespace(values=values), effects=effects)


def denied(gap, state):
    return Case(None, None, None, gap=gap).denied(state)


def test_slow_diffusion_does_not_stand_in_for_hysteresis():
    gap = SlowGap(0.02, 0.12)
    assert denied(gap, fitted("slow_diffusion", "polarisation_soc")) == {"slow_diffusion"}
    assert not denied(gap, fitted("slow_diffusion", ohm=0.12))
    assert not denied(gap, fitted("slow_diffusion", "hysteresis_one_state"))
    assert not denied(SlowGap(), fitted("slow_diffusion"))
