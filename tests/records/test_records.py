"""Records: what a column must be, what is filled into gaps, where a record may be cut."""

import numpy as np
import pytest

from cellwright.records.record import blocks, bridged, checked, fit_mask, record_of
from cellwright.refusal import Refusal

TIME = np.arange(3000.0)


def record(rows=100, **change):
    columns = {"test_time_second": np.arange(float(rows)), "current_ampere": np.zeros(rows)}
    columns |= {"voltage_volt": np.full(rows, 3.7), "soc": np.full(rows, 0.5)}
    return record_of(**columns | change)


def test_all_rows_are_used_at_25_degrees_and_no_resistance_moved_unless_said():
    made = record()
    assert made.used.all()
    assert not made.thinned.any()
    np.testing.assert_array_equal(made.celsius, 25.0)
    np.testing.assert_array_equal(made.resistance_factor, 1.0)
    assert (made.test, made.kind, made.role) == ("", "drive", "fit")


def test_where_nothing_was_counted_only_the_first_soc_is_known():
    made = record(rows=3, soc=0.7)
    np.testing.assert_array_equal(made.soc, [0.7, np.nan, np.nan])
    assert checked(made) is made


def broken(value, row=7):
    return np.where(np.arange(100) == row, value, 3.0)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"test_time_second": np.arange(100.0)[::-1]}, "the clock runs back after row 0"),
        ({"voltage_volt": broken(np.nan)}, "row 7 of voltage_volt is nan, not a number"),
        ({"current_ampere": broken(np.inf)}, "row 7 of current_ampere is inf"),
        ({"celsius": broken(np.nan)}, "row 7 of celsius is nan"),
        ({"test_time_second": np.append(np.arange(99.0), np.nan)}, "row 99 of test_time_second"),
    ],
)
def test_a_column_that_cannot_be_used_is_refused_with_its_row(change, reason):
    with pytest.raises(Refusal, match=reason):
        checked(record(**change))


def with_gap():
    time = np.r_[np.arange(100.0), np.arange(8000.0, 8100.0)]
    soc = np.where(time < 1000, 0.9, 0.8)
    celsius = np.where(time < 1000, 12.0, 9.0)
    return record_of(time, 0 * time, 0 * time + 3.7, soc, celsius=celsius)


def test_a_gap_is_bridged_by_the_charge_that_passed_in_it():
    full = bridged(with_gap(), capacity_ampere_hour=2.0)
    assert len(full.soc) == 204
    new = slice(100, 104)
    np.testing.assert_array_equal(full.used[new], False)
    assert full.used.sum() == 200
    np.testing.assert_allclose(full.current_ampere[new], [-2.0, -2.0, -2.0, 0.0])
    np.testing.assert_allclose(full.test_time_second[new], [99.0, 279.0, 459.0, 459.0])
    np.testing.assert_allclose(full.soc[new], [0.9, 0.85, 0.8, 0.8])
    np.testing.assert_array_equal(full.celsius[new], 12.0)
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
