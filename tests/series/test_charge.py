"""Net charge: exact on polynomials, and across gaps what can be known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cellwright.series.cleaning import net_charge


@given(st.lists(st.floats(0.01, 100), min_size=1, max_size=40), st.floats(-5, 5), st.floats(-1, 1))
def test_exact_for_a_ramp_on_any_time_stamps(steps, level, slope):
    time = np.concatenate([[0.0], np.cumsum(steps)])
    charge = net_charge(time, level + slope * time)
    assert charge == pytest.approx((level * time + slope * time**2 / 2) / 3600, abs=1e-9)


def test_an_edge_with_one_stamp_moves_no_charge():
    charge = net_charge(np.array([0.0, 10, 10, 20]), np.array([0.0, 0, -3.6, -3.6]))
    assert charge == pytest.approx([0, 0, 0, -0.01])


TIME = np.array([0.0, 10, 3610, 3620])


@pytest.mark.parametrize(
    ("current", "counter", "moved"),
    [
        ([-1, -1, 0, 0], None, 0.0),  # differs: no current is assumed
        ([-1, -1, -1, -1], None, -1.0),  # the same on both sides: it flowed
        ([-1, -1, 0, 0], [0, 0, -0.5, -0.5], -0.5),  # the counter knows
        ([-1, -1, 0, 0], [0, 0, np.nan, np.nan], 0.0),
    ],
)
def test_across_a_gap(current, counter, moved):
    counter = None if counter is None else np.array(counter, dtype=float)
    charge = net_charge(
        TIME, np.array(current, dtype=float), gap_rows=np.array([2]), counter_ampere_hour=counter
    )
    assert charge[2] - charge[1] == pytest.approx(moved)


def test_counter_knows_when_the_current_stepped():
    time, current = np.arange(0, 100, 10.0), np.array([0.0] * 5 + [-3.6] * 5)
    true = np.minimum(0, 42.37 - time) / 1000  # it stepped at 42.37 s
    assert net_charge(time, current, counter_ampere_hour=np.round(true, 5)) == pytest.approx(true)


def test_a_counter_that_cannot_be_right_is_not_believed():
    time, current = np.arange(0, 100, 10.0), np.array([0.0] * 5 + [-3.6] * 5)
    absurd = np.where(time > 45, -1.0, 0.0) - 1e-5 * time
    np.testing.assert_allclose(
        net_charge(time, current, counter_ampere_hour=absurd), net_charge(time, current)
    )


@pytest.mark.parametrize("counts", ["rows", "itself"])
def test_a_counter_made_of_the_rows_of_a_hold_knows_no_more_than_they(counts):
    """A current that falls with 300 s, a row each 20 s: one end of each interval is 3 % off."""
    time = np.concatenate([np.arange(0.0, 600.0, 20.0), 600.0 + 20.0 * np.arange(60)])
    current = np.where(time < 600.0, 1.5, 1.5 * np.exp(-(time - 600.0) / 300.0))
    held = 1.5 * 300.0 * (1 - np.exp(-np.maximum(time - 600.0, 0.0) / 300.0))
    true = (1.5 * np.minimum(time, 600.0) + held) / 3600.0
    summed = np.append(0.0, np.cumsum(current[1:] * np.diff(time))) / 3600.0
    counter = summed if counts == "rows" else true
    charge = net_charge(time, current, counter_ampere_hour=np.round(counter, 9))
    assert charge[-1] == pytest.approx(true[-1], rel=2e-3 if counts == "rows" else 1e-6)
    assert abs(summed[-1] / true[-1] - 1) > 0.01
