"""How coarsely a current was read: what its readings show, and what that leaves of a capacity."""

import numpy as np
import pytest

from cellwright.protocols.coarse import coarsest_digit_ampere, unsure_of_digit
from cellwright.protocols.half_cycles import HalfCycle

RATED = 5.0


def of_levels(*levels):
    return np.repeat(levels, 50).astype(float)


def held(first=2.5, last=0.1):
    """A constant current, and one that falls while the voltage is held [A]."""
    return np.concatenate([np.zeros(20), np.full(400, first), np.geomspace(first, last, 300)])


@pytest.mark.parametrize("digit", [0.137, 0.2502, 0.4711])
def test_a_current_that_falls_shows_a_coarse_digit(digit):
    read = np.round(held() / digit) * digit
    assert coarsest_digit_ampere(read, RATED) == pytest.approx(digit)


def test_a_current_that_scatters_shows_its_digit():
    rng = np.random.default_rng(5)
    read = np.round(2.5 + 0.001 * rng.standard_normal(1000), 3)
    assert coarsest_digit_ampere(read, RATED) == pytest.approx(0.001)


@pytest.mark.parametrize("levels", [(0, -2.5), (0, -5, 3.75), (0, 5 / 3), (0, 1.2999)])
def test_round_currents_that_stand_still_were_set(levels):
    assert coarsest_digit_ampere(of_levels(*levels), 2.6 if 1.2999 in levels else RATED) == 0.0


@pytest.mark.parametrize("level", [1.2999, 1.3001, -2.6007])
def test_a_number_shows_by_its_last_decimal_that_it_was_written_with_more(level):
    """Held otherwise than set by 0.1 mA: no current of 1.3 A that is read to 0.1 A."""
    assert coarsest_digit_ampere(of_levels(0, level), 2.7524) == pytest.approx(1e-4)


def test_what_few_decimals_are_written_with_is_no_finer():
    assert coarsest_digit_ampere(of_levels(0, 2.87), RATED) == pytest.approx(0.01)


@pytest.mark.parametrize(
    "levels", [(0, -5.2511, -2.25046, 3.75078), (0, -0.8663277), (0, 2.83619147, 1.41809574)]
)
def test_a_current_that_stands_still_with_all_its_digits_was_set(levels):
    """A rate that nobody calls round, over a made or a measured capacity: no doubt is beside it."""
    assert coarsest_digit_ampere(of_levels(*levels), 2.6) == 0.0


def test_a_hold_that_is_read_once_a_level_shows_a_finer_digit_than_repeated_levels():
    """A thousandth of an ampere: levels met twice by chance lie 1.4 A apart."""
    for rows in (6, 60):
        read = np.concatenate([np.full(3000, -28.8), np.round(np.geomspace(27.3, 1.5, rows), 3)])
        read = np.concatenate([read, np.full(3000, 28.8), [1.433] * 2])
        assert coarsest_digit_ampere(read, 9.6) == 0.0


def test_levels_of_a_made_hold_that_repeats_are_no_digit():
    read = of_levels(0, -1.5, 0.089245, 0.119882, 0.167325, 0.263989, 0.553996, 1.5)
    assert coarsest_digit_ampere(read, 3.0) == 0.0


def test_nothing_flows_and_nothing_is_told():
    assert coarsest_digit_ampere(np.zeros(9), RATED) == 0.0


def test_the_error_of_one_reading_adds_up_and_of_many_half_a_digit_is_left():
    time = np.arange(3601.0)
    half = HalfCycle(1, 0, 3600, 1.0, True, False, last_row=3600)
    steady = unsure_of_digit(half, time, np.full(3601, 2.0), 0.1)
    assert steady == pytest.approx(0.1 / np.sqrt(3))
    flipping = 2.0 + 0.1 * (np.arange(3601) % 2)
    assert unsure_of_digit(half, time, flipping, 0.1) < 0.02 * steady
    slowly = 2.0 + 0.1 * (np.arange(3601) // 20 % 2)
    assert unsure_of_digit(half, time, slowly, 0.1) == pytest.approx(0.05, rel=0.01)
    # A converter's step is no round number: its readings are not cut.
    assert unsure_of_digit(half, time, slowly, 0.0976) < 0.1 * steady


@pytest.mark.parametrize(
    ("change", "digits"),
    [(np.round, np.linspace(0.1, 0.45, 23)), (np.trunc, (0.1, 0.2, 0.25))],
)
def test_what_a_rounded_or_cut_capacity_errs_by_lies_in_its_interval(change, digits):
    current, time = held(2.3), np.arange(720.0) * 10
    half = HalfCycle(1, 0, 719, 1.0, True, False, last_row=719)
    # Of fewer levels than five, round ones, only the voltage that does not answer tells.
    for digit in digits:
        read = change(current / digit) * digit
        off = abs(np.trapezoid(read - current, time)) / 3600
        std = unsure_of_digit(half, time, read, coarsest_digit_ampere(read, RATED))
        assert off <= 2 * std
