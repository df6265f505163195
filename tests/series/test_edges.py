"""When the current stepped between two rows: by the pace of the rows, else an interval."""

import numpy as np
import pytest

from cellwright.series.cleaning import net_charge
from cellwright.series.edges import begun_at_last_row, edge_variance, step_rows


def stepped(paces=(60.0, 360.0), amperes=(0.0, 2.5), counts=(10, 20), times=4):
    """Steps in turn whose rows lie one pace after their beginning, and the true charge."""
    time, current, charge = [0.0], [0.0], [0.0]
    for pace, ampere, count in list(zip(paces, amperes, counts, strict=True)) * times:
        for _ in range(count):
            time.append(time[-1] + pace)
            current.append(ampere)
            charge.append(charge[-1] + ampere * pace / 3600)
    return np.array(time), np.array(current), np.array(charge)


def test_the_pace_of_a_step_tells_that_it_began_at_the_row_before():
    time, current, charge = stepped()
    rows = step_rows(time, current)
    assert begun_at_last_row(time, current, rows).all()
    assert net_charge(time, current) == pytest.approx(charge)
    assert not edge_variance(time, current, charge).any()


def test_a_habit_of_the_tester_holds_where_both_paces_are_one():
    time, current, charge = stepped((60.0, 360.0, 360.0), (0.0, 2.5, -2.5), (10, 20, 20))
    assert net_charge(time, current) == pytest.approx(charge)


def test_a_logger_of_one_pace_tells_nothing_and_the_deviation_holds_the_truth():
    rng, errors, stds = np.random.default_rng(5), [], []
    for _ in range(200):
        edge = 300 + 30 * rng.random()
        time = np.arange(0, 700, 30.0)
        current = np.where(time > edge, 2.0, 0.0)
        true = np.maximum(time - edge, 0) * 2.0 / 3600
        counted = net_charge(time, current)
        errors.append(counted[-1] - true[-1])
        stds.append(np.sqrt(edge_variance(time, current, counted).sum()))
    assert np.std(errors) == pytest.approx(np.mean(stds), rel=0.15)


def test_a_row_just_after_the_edge_leaves_nothing_open():
    time = np.array([0.0, 10, 20, 30, 30.01, 31, 32, 33])
    current = np.array([0.0, 0, 0, 0, 1, 1, 1, 1])
    assert np.sqrt(edge_variance(time, current, net_charge(time, current)).sum()) < 1e-6


def test_missing_rows_of_a_logger_of_one_pace_are_no_other_pace():
    time = np.delete(np.arange(0, 400, 10.0), [14, 18])
    current = np.where(time > 195, 1.0, 0.0)
    rows = step_rows(time, current)
    assert not begun_at_last_row(time, current, rows).any()


def test_a_load_that_rested_between_two_rows_ended_and_began_within_their_pace():
    """Ten rows of 1 A each 20 s, an hour without rows, five each 10 s: 0 to 30 s lack at most."""
    time = np.r_[20.0 * np.arange(10), 3780.0 + 10.0 * np.arange(5)]
    current, step = np.ones(15), np.diff(time)
    charge = np.r_[0.0, np.cumsum(np.where(step > 60, 0.0, step))] / 3600
    variance = edge_variance(time, current, charge)
    np.testing.assert_allclose(variance[9], (20.0**2 + 10.0**2) / 3 / 3600**2)
    assert np.count_nonzero(variance) == 1


def test_a_counter_of_few_digits_that_has_not_moved_yet_stops_no_load():
    time = np.arange(200.0)
    charge = np.floor(time / 3600 / 0.01) * 0.01
    assert not edge_variance(time, np.ones(200), charge).any()
