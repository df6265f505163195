"""One rate, one temperature, one check-up: the middle between what laboratories hold apart."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cellwright.records.conditions import (
    at_rest,
    at_rest_in_record,
    checkups_of,
    in_first_checkup,
    low_current,
    same_rate,
    same_temperature,
    stated_or_reference,
)


@pytest.mark.parametrize(
    ("first", "second", "same"),
    [
        (0.047, 0.051, True),  # a C/20 as real ratings and currents have it
        (1 / 4, 1 / 5, False),
        (1.0, 1.25, False),
        (2.0, 2.2, True),
        (1 / 30, 1 / 25, False),
    ],
)
def test_rates_that_are_chosen_to_differ_are_two(first, second, same):
    assert bool(same_rate(first, second)) is bool(same_rate(second, first)) is same


def test_rates_are_compared_as_arrays():
    assert same_rate(np.array([1.0, 1.1, 1.2]), 1.0).tolist() == [True, True, False]


@pytest.mark.parametrize(
    ("first", "second", "same"),
    [(25.0, 23.0, True), (20.0, 25.0, False), (None, 25.0, True), (np.nan, 24.0, True)],
)
def test_temperatures_that_are_chosen_to_differ_are_two(first, second, same):
    assert same_temperature(first, second) is same_temperature(second, first) is same


def test_an_unstated_temperature_is_the_reference_and_zero_is_a_temperature():
    assert [stated_or_reference(c) for c in (None, np.nan, 0.0)] == [25.0, 25.0, 0.0]
    assert not same_temperature(None, 0.0)


def test_a_checkup_is_the_tests_that_follow_its_first_within_five_cycles():
    cycles = [102.0, None, 3.0, 100.0, 106.0, 0.0]
    assert checkups_of(cycles) == [100.0, 0.0, 0.0, 100.0, 106.0, 0.0]
    assert in_first_checkup(cycles) == [False, True, True, False, False, True]
    assert in_first_checkup([]) == []


@given(st.lists(st.floats(0, 1000), min_size=1))
def test_each_test_lies_within_five_cycles_of_its_checkup(cycles):
    first = checkups_of(cycles)
    assert all(0 <= cycle - begin <= 5 for cycle, begin in zip(cycles, first, strict=True))
    starts = np.sort(np.unique(first))
    assert np.all(np.diff(starts) > 5)


def test_a_cycle_that_is_no_number_is_a_new_cells():
    nan = float("nan")
    assert checkups_of([nan, 0, 100, nan, 3, 102]) == [0, 0, 100, 0, 0, 100]


def test_rest_low_current_and_load_follow_from_the_slowest_test():
    """C/30 is a load, also of a cell that is rated a tenth too small; a sensor's offset is none."""
    assert not low_current(1 / 30 / 1.1, 1.0)
    assert low_current(0.025, 1.0)
    assert at_rest(np.array([0.003, 0.005]), 1.0).tolist() == [True, False]
    rows = at_rest_in_record(np.array([0.0, -0.04, 0.06, -5.0]))
    assert rows.tolist() == [True, True, False, False]
    assert at_rest_in_record(np.zeros(3)).all()
