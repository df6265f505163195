"""Records: what is kept of a measurement, what is filled in, and what is refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cellwright.records.record import (
    blocks,
    bridged,
    edges,
    fit_mask,
    record_of,
    thin,
    without_edges,
)
from cellwright.refusal import Refusal

TIME = np.arange(3000.0)


def record(current, **change):
    columns = {"test_time_second": np.arange(float(len(current))), "current_ampere": current}
    columns |= {"voltage_volt": np.full(len(current), 3.7), "soc": np.full(len(current), 0.5)}
    return record_of(**columns | change)


def pulses():
    return np.where((TIME % 1000 >= 100) & (TIME % 1000 < 130), -2.0, 0.0)


def test_all_rows_are_used_and_not_warmed_unless_said():
    made = record(pulses())
    assert made.used.all()
    np.testing.assert_array_equal(made.warmth, 1.0)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"test_time_second": np.arange(100.0)[::-1]}, "time runs back"),
        ({"voltage_volt": np.full(100, np.nan)}, "not finite"),
        ({"current_ampere": np.full(100, np.inf)}, "not finite"),
        ({"soc": np.linspace(1.3, 0.9, 100)}, "SoC of the record runs from 0.900 to 1.300"),
        ({"soc": np.linspace(-0.2, 0.9, 100)}, "outside −0.1 to 1.1"),
    ],
)
def test_records_refuse(change, reason):
    with pytest.raises(Refusal, match=reason):
        record(np.zeros(100), **change)


def test_one_sample_is_no_record():
    with pytest.raises(Refusal, match=r"record has 1 sample\(s\)"):
        record(np.zeros(1))


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


def with_gap():
    time = np.r_[np.arange(100.0), np.arange(8000.0, 8100.0)]
    soc = np.where(time < 1000, 0.9, 0.8)
    warmth = np.where(time < 1000, 1.2, 0.9)
    return record_of(time, 0 * time, 0 * time + 3.7, soc, warmth=warmth)


def test_a_gap_is_bridged_by_the_charge_that_passed_in_it():
    full = bridged(with_gap(), capacity_ampere_hour=2.0)
    assert len(full.soc) == 204
    new = slice(100, 104)
    np.testing.assert_array_equal(full.used[new], False)
    assert full.used.sum() == 200
    np.testing.assert_allclose(full.current_ampere[new], [-2.0, -2.0, -2.0, 0.0])
    np.testing.assert_allclose(full.test_time_second[new], [99.0, 279.0, 459.0, 459.0])
    np.testing.assert_allclose(full.soc[new], [0.9, 0.85, 0.8, 0.8])
    np.testing.assert_array_equal(full.warmth[new], 1.2)
    between = (full.current_ampere[1:] + full.current_ampere[:-1]) / 2
    passed = between @ np.diff(full.test_time_second) / 3600.0 / 2.0
    assert passed == pytest.approx(full.soc[-1] - full.soc[0])


def test_a_rest_that_was_not_logged_is_no_gap():
    torn = with_gap()
    rested = torn._replace(soc=np.full(200, 0.9))
    assert bridged(rested, capacity_ampere_hour=2.0) is rested
    short = torn._replace(test_time_second=np.arange(200.0))
    assert bridged(short, capacity_ampere_hour=2.0) is short


def test_what_has_no_room_in_a_gap_flows_faster():
    time = np.r_[np.arange(10.0), 709.0 + np.arange(10.0)]
    soc = np.where(time < 100, 0.9, 0.4)
    torn = record_of(time, 0 * time, 0 * time + 3.7, soc)
    full = bridged(torn, capacity_ampere_hour=2.0)
    assert full.test_time_second[12] == pytest.approx(9.0 + 0.9 * 700.0)
    assert full.current_ampere[11] == pytest.approx(-0.5 * 2.0 * 3600 / 630)


def test_blocks_end_with_their_rest():
    current = np.where(TIME % 500 < 300, -1.0, 0.0)
    np.testing.assert_array_equal(blocks(TIME, current, rest_ampere=0.01), TIME // 500)
    np.testing.assert_array_equal(fit_mask(TIME, current, rest_ampere=0.01), TIME // 500 % 2 == 0)
    first = np.r_[np.zeros(400), current[:-400]]
    np.testing.assert_array_equal(blocks(TIME, first, rest_ampere=0.01)[:900], 0)
    short = blocks(TIME, current, rest_second=250.0, rest_ampere=0.01)
    np.testing.assert_array_equal(short, 0)


def test_a_record_without_a_rest_cannot_be_cut():
    with pytest.raises(Refusal, match="no rest of 120 s inside the record"):
        fit_mask(TIME, TIME * 0 - 1.0, rest_ampere=0.01)
