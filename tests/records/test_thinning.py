"""Fewer rows: means over bins where that is worth it, sparse rows in steady stretches."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cellwright.effects.preparing import _least_step_ampere
from cellwright.records.record import record_of
from cellwright.records.thinning import (
    averaged,
    averaged_to,
    driven,
    edges,
    rows_of,
    thin,
    without_edges,
)
from cellwright.refusal import Refusal

TIME = np.arange(3000.0)


def record(current, *, every=1.0, **change):
    time = every * np.arange(len(current))
    return record_of(time, current, np.full(len(time), 3.7), np.full(len(time), 0.5), **change)


def pulses():
    return np.where((TIME % 1000 >= 100) & (TIME % 1000 < 130), -2.0, 0.0)


def test_thinning_keeps_edges_and_a_row_of_each_tenth_of_growth():
    small = thin(record(pulses()), step_ampere=0.1)
    assert len(small.soc) < 300
    assert {99.0, 100.0, 129.0, 130.0, 2130.0} <= set(small.test_time_second)
    rest = small.test_time_second[(small.test_time_second > 130) & (small.test_time_second < 1100)]
    # A row of each tenth of growth, as far as rows of one second can have it.
    assert (np.diff(rest - 130) <= np.maximum(1.0, 0.25 * (rest[1:] - 130))).all()


@settings(deadline=None, max_examples=30)
@given(arrays(float, 60, elements=st.floats(-5, 5)))
def test_a_drive_that_steps_at_every_row_is_kept_whole(current):
    made = record(np.cumsum(np.abs(current) + 0.2) * (-1.0) ** np.arange(60))
    assert len(thin(made, step_ampere=0.1).soc) == 60
    # Only the step into the last row stands alone: after it nothing is known.
    assert without_edges(made, step_ampere=0.1).used[:-1].all()


def test_the_row_of_a_lone_edge_is_left_out():
    made = without_edges(record(pulses()), step_ampere=0.1)
    np.testing.assert_array_equal(np.flatnonzero(~made.used) % 1000, [100, 130] * 3)
    np.testing.assert_array_equal(edges(made, step_ampere=0.1) % 1000, [100, 130] * 3)
    before = record(pulses(), used=TIME >= 500)
    assert not without_edges(before, step_ampere=0.1).used[:500].any()


def test_rows_keep_all_their_columns_together():
    made = rows_of(record(pulses(), celsius=TIME, used=TIME > 5), slice(4, 8))
    np.testing.assert_array_equal(made.test_time_second, [4, 5, 6, 7])
    np.testing.assert_array_equal(made.celsius, made.test_time_second)
    np.testing.assert_array_equal(made.used, [False, False, True, True])
    assert made.kind == "drive"


def test_dropped_rows_are_marked_where_they_were():
    small = thin(record(pulses()), step_ampere=0.1)
    gaps = np.diff(small.test_time_second, prepend=-1.0) > 1.0
    assert gaps.any()
    np.testing.assert_array_equal(small.thinned, gaps)
    again = thin(small, step_ampere=0.1)
    assert again.thinned[np.isin(again.test_time_second, small.test_time_second[gaps])].all()


def test_a_long_load_keeps_a_row_for_each_portion_of_the_charge():
    long = record(np.full(7200, -1.0))
    by_time = thin(long, step_ampere=0.1)
    by_charge = thin(long, step_ampere=0.1, capacity_ampere_hour=2.0, portion_soc=0.005)
    longest = [np.diff(small.test_time_second).max() for small in (by_time, by_charge)]
    assert longest[0] > 300.0
    assert longest[1] <= 36.0 + 1.0  # half a per cent of 2 Ah at 1 A, to the next row


def test_means_over_bins_by_hand():
    time, soc = np.array([0.0, 0.4, 0.8, 1.2, 1.6, 2.0]), np.linspace(0.6, 0.5, 6)
    used = np.array([True, True, True, True, False, True])
    made = record_of(time, [0.0, -1, -2, -3, -5, -6], np.arange(6.0), soc, used=used, test="fast")
    small = averaged(made, width_second=1.0)
    np.testing.assert_allclose(small.test_time_second, [0.4, 1.4, 2.0])
    np.testing.assert_allclose(small.current_ampere, [-1.0, -4.0, -6.0])
    np.testing.assert_allclose(small.voltage_volt, [1.0, 3.5, 5.0])
    np.testing.assert_allclose(small.soc, [0.58, 0.53, 0.5])
    np.testing.assert_array_equal(small.used, [True, False, True])
    assert small.test == "fast"


@pytest.mark.parametrize(("every", "rows"), [(0.5, 50), (0.79, 79), (0.81, 100), (0.999, 100)])
def test_only_what_is_sampled_clearly_faster_is_averaged(every, rows):
    assert len(averaged(record(np.zeros(100), every=every), width_second=1.0).soc) == rows


def test_bins_widen_by_whole_seconds_until_the_rows_are_few():
    """Half-second rows of 720 s: 1,440, then 720, then bins of 2 s about 90 s of 1 s each 360 s."""
    fast = record(np.zeros(1440), every=0.5)
    (once,) = averaged_to([fast], most_rows=1000)
    (twice,) = averaged_to([fast], most_rows=500)
    assert (len(once.soc), len(twice.soc)) == (720, 450)
    np.testing.assert_allclose(twice.test_time_second[:2], [0.75, 2.75])
    with pytest.raises(Refusal, match="1 rows were asked for of 2 records"):
        averaged_to([fast, fast], most_rows=1)


def test_between_wide_bins_stretches_keep_the_edges_of_a_drive():
    """A resistance that shows at edges alone: a third of the rows tells it, as well as all did."""
    time = np.arange(40_000.0)
    current = np.random.default_rng(3).choice([-2.0, 0.0, 1.0], len(time))
    made = record_of(time, current, 3.7 + 0.02 * current, np.full(len(time), 0.5))
    short = averaged(made, width_second=16.0)
    step = np.diff(short.test_time_second)
    fine = np.append(step, 1.0) < 1.5
    assert fine.mean() == pytest.approx(1 / 3, abs=0.04)
    assert step.max() < 17.0
    # The first half minute of each stretch comes from a current that was averaged.
    assert short.used[fine].mean() == pytest.approx(2 / 3, abs=0.05)
    assert short.used[~fine].mean() > 0.99
    sharp = fine[1:] & fine[:-1]
    ohm = np.diff(short.voltage_volt)[sharp] @ np.diff(short.current_ampere)[sharp]
    ohm /= np.sum(np.diff(short.current_ampere)[sharp] ** 2)
    assert ohm == pytest.approx(0.02, rel=1e-6)
    assert np.all(np.diff(short.test_time_second) > 0)  # no bin holds rows of both widths


def test_steady_stretches_are_thinned_as_far_as_is_given_before_bins_widen():
    """A pulse a minute: the edges stay, and only what is too many even then is averaged."""
    pulses = np.tile(np.repeat([0.0, -1.0], 60), 20)
    ways = [partial(thin, step_ampere=0.1, growth=growth) for growth in (0.1, 0.4)]
    mild, hard, wide = (
        averaged_to([record(pulses)], most_rows=most, thinned=ways)[0] for most in (2000, 500, 300)
    )
    assert 1000 < len(mild.soc) < 2000
    assert 300 < len(hard.soc) < 500
    for kept in (mild, hard):
        moved = np.flatnonzero(np.diff(kept.current_ampere))
        assert len(moved) == 39
        np.testing.assert_array_equal(np.diff(kept.test_time_second)[moved], 1.0)
    assert len(wide.soc) <= 300
    assert np.median(np.diff(wide.test_time_second)) > 1.5


def test_branch_currents_of_a_group_are_averaged_with_their_total():
    time = 0.5 * np.arange(100)
    branches = np.column_stack([np.arange(100.0), -np.arange(100.0)])
    stated = np.array([0.9, 0.8])
    made = record_of(time, branches.sum(axis=1), time, np.nan)
    made = made._replace(member_current_ampere=branches, initial_soc=stated)
    small = averaged(made, width_second=1.0)
    np.testing.assert_allclose(small.branch_current_ampere[:2], [[0.5, -0.5], [2.5, -2.5]])
    np.testing.assert_array_equal(small.initial_soc, stated)
    assert averaged(small, width_second=1.0) is small


def test_a_drive_steps_at_most_of_its_rows():
    assert driven(np.tile([1.0, -1.0, 0.5], 30))
    assert not driven(pulses())


SLOW_AMPERE = 0.15  # C/20 of 3 Ah


def slow_test(*, noise_ampere=0.0, digit_ampere=0.0, every=5.0):
    """A rest, a slow discharge, a rest and a slow charge, as a coarse shunt reads them."""
    current = np.repeat([0.0, -SLOW_AMPERE, 0.0, SLOW_AMPERE, 0.0], [100, 6000, 300, 6000, 100])
    random = np.random.default_rng(7)
    # A shunt's reading wanders with its temperature, so that a level is passed here and there.
    current = current + 3e-4 * np.sin(np.arange(len(current)) / 150.0) * (current != 0)
    current += noise_ampere * random.normal(size=len(current))
    if digit_ampere:
        current = np.round(current / digit_ampere) * digit_ampere
    return record(current, every=every)


@pytest.mark.parametrize("digit", [0.0065, 0.02])
@pytest.mark.parametrize("noise", [5e-5, 2e-4])
def test_a_flicker_of_the_least_digit_keeps_no_rows(digit, noise):
    sizes = {"capacity_ampere_hour": 3.0}
    kept = [
        len(thin(made, step_ampere=_least_step_ampere(made), **sizes).soc)
        for made in (
            slow_test(),
            slow_test(noise_ampere=noise, digit_ampere=digit * SLOW_AMPERE),
        )
    ]
    assert kept[1] == pytest.approx(kept[0], rel=0.2)


def test_noise_of_a_slow_test_is_no_step():
    """A white noise of 0.5 % of the current of a slow test, whose edges are all that steps."""
    quiet, noisy = slow_test(), slow_test(noise_ampere=0.005 * SLOW_AMPERE)
    kept = [len(thin(r, step_ampere=_least_step_ampere(r)).soc) for r in (quiet, noisy)]
    assert kept[1] == pytest.approx(kept[0], rel=0.2)


def test_small_pulses_beside_large_ones_are_steps_however_coarse_the_reading():
    """All levels are multiples of 0.5 A, and none of them is a digit."""
    current = np.repeat([0.0, -0.5, 0.0, -10.0, 0.0, 5.0, 0.0, 0.5, 0.0], 200)
    made = record(current)
    assert set(edges(made, step_ampere=0.05)) >= set(200 * np.arange(1, 7))


def test_a_hold_at_the_end_of_a_slow_charge_does_not_make_it_a_drive():
    """A tapering current at 60 s steps beside one that flickers by 1.7 %, as LG HG2 logs it."""
    flicker = 2.55e-3 * (np.random.default_rng(4).random(2000) < 0.3)
    taper = 0.15 * np.exp(-np.arange(60) / 3.0)
    current = np.concatenate([np.zeros(100), 0.15 + flicker, taper, np.zeros(100)])
    made = record(np.round(current / 2.55e-3) * 2.55e-3, every=60.0)
    assert driven(made.current_ampere)
    kept = thin(made, step_ampere=_least_step_ampere(made), capacity_ampere_hour=10.0)
    assert len(kept.soc) < 600


def test_noise_of_a_record_without_any_step_is_no_step():
    """A charge that begins and ends under load: its largest change is its noise."""
    noise = 5e-5 * np.random.default_rng(6).normal(size=5000)
    kept = [
        len(thin(made, step_ampere=_least_step_ampere(made), capacity_ampere_hour=5.0).soc)
        for made in (record(0.15 + noise, every=11.0), record(np.full(5000, 0.15), every=11.0))
    ]
    assert kept[0] == pytest.approx(kept[1], rel=0.2)
