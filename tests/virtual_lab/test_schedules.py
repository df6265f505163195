"""The driving schedules keep to the statistics that they state."""

import numpy as np
import pytest

from virtual_lab import protocols, schedules
from virtual_lab.cells import CELLS


@pytest.mark.parametrize(
    ("name", "mean", "top"), [("udds", (28, 36), 91.0), ("us06", (70, 90), 129.0)]
)
def test_speeds(name, mean, top):
    style = schedules.STYLES[name]
    speed = 3.6 * schedules.speed_profile(style)
    assert mean[0] < speed.mean() < mean[1]
    assert speed.max() == pytest.approx(top, rel=0.02)
    assert speed.size == pytest.approx(style.duration_second, rel=0.1)
    assert speed[0] == speed[-1] == 0


@pytest.mark.parametrize("name", schedules.STYLES)
def test_current_has_braking_and_the_stated_peak(name):
    time, current = schedules.current_profile(name).T
    assert current.min() == pytest.approx(-schedules.STYLES[name].peak_discharge_ampere)
    assert current.max() > 1.0
    assert current[0] == current[-1] == 0
    assert (np.diff(time) == 1).all()


def test_repetition_takes_out_what_was_asked():
    parts = schedules.repeated(schedules.current_profile("us06"), ampere_hour=3.5)
    drawn = sum(-np.trapezoid(part[:, 1], part[:, 0]) / 3600 for part in parts)
    assert drawn == pytest.approx(3.5, abs=0.005)
    assert all(part[-1, 1] == 0 for part in parts)


def test_pulses_of_a_tenth_reach_the_end():
    steps = protocols.hybrid_pulses(CELLS["C2"])
    pulses = [s for s in steps if s.duration_second == 10.0]
    assert sum(s.value < 0 for s in pulses) == 11
    assert sum(s.value > 0 for s in pulses) == 9
    taken = sum(s.duration_second for s in steps if s.value == -protocols.ampere(0.5)) / 3600
    assert taken * 2.5 == pytest.approx(0.95 * CELLS["C2"].capacity_ampere_hour, rel=1e-3)
