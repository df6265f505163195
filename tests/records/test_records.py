"""Records: what a column must be, what is filled into gaps, where a record may be cut."""

import numpy as np
import pytest

from cellwright.records import facts
from cellwright.records.blocks import blocks, blocks_of_used, cut_of, fit_mask, parts
from cellwright.records.filled import bridged, with_edges
from cellwright.records.record import checked, record_of, started_second
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


def sampled_every_5_second(counted_ampere):
    """Pulses of 60 A on a load of 10 A for 15 ms, each shown by its last row; a row every 5 s."""
    time = np.sort(np.r_[5.0 * np.arange(40.0), 15.0 * np.arange(1.0, 13.0) + 0.015])
    current = np.where(np.isclose(time % 15.0, 0.015), -60.0, -10.0)
    moved = np.diff(time) * counted_ampere(time, current) / 3600.0
    soc = 1.0 + np.append(0.0, np.cumsum(moved)) / 25.0
    return record_of(time, current, 0 * time + 3.7, soc, kind="pulse_resistance")


def test_the_counter_tells_which_current_flowed_between_two_rows():
    """From the row of a pulse to the next the load flows, not the pulse, nor their mean."""

    def flowing(time, current):
        return np.where(np.diff(time) < 0.1, current[1:], -10.0)

    read = sampled_every_5_second(flowing)
    full = with_edges(read, capacity_ampere_hour=25.0)
    assert full.used.sum() == len(read.soc)
    between = (full.current_ampere[1:] + full.current_ampere[:-1]) / 2
    counted = np.cumsum(between * np.diff(full.test_time_second)) / 3600.0 / 25.0
    np.testing.assert_allclose(full.soc[1:] - 1.0, counted, atol=1e-12)
    assert (np.diff(full.test_time_second) >= 0).all()
    ramps = np.diff(full.test_time_second)[np.abs(np.diff(full.current_ampere)) > 1.0]
    np.testing.assert_allclose(ramps, 0.0, atol=1e-9)


@pytest.mark.parametrize("share", [0.2, 0.7])
def test_an_edge_lies_where_the_charge_counted_has_it(share):
    time = np.array([0.0, 10.0, 20.0, 30.0, 40.0])
    current = np.array([0.0, 0.0, -5.0, -5.0, -5.0])
    moved = np.array([0.0, -50.0 * (1 - share), -50.0, -50.0]) / 3600.0
    soc = np.append(0.8, 0.8 + np.cumsum(moved) / 2.0)
    read = record_of(time, current, 0 * time, soc, kind="hppc")
    full = with_edges(read, capacity_ampere_hour=2.0)
    np.testing.assert_allclose(full.test_time_second[2:4], 10.0 + 10.0 * share)
    np.testing.assert_array_equal(full.current_ampere[2:4], [0.0, -5.0])
    np.testing.assert_allclose(full.soc[2:4], 0.8)


def test_without_a_counter_and_in_a_drive_no_edge_is_known():
    guessed = sampled_every_5_second(lambda _, current: (current[1:] + current[:-1]) / 2)
    assert with_edges(guessed, capacity_ampere_hour=25.0) is guessed
    time, current = np.arange(500.0), 10.0 * np.sin(np.arange(500.0))
    soc = 0.9 + np.cumsum(current) / 3600.0 / 25.0
    drive = record_of(time, current, 0 * time, soc)
    assert with_edges(drive, capacity_ampere_hour=25.0) is drive
    rest = record_of(time, 0 * time, 0 * time, 0.5 + 0 * time, kind="hppc")
    assert with_edges(rest, capacity_ampere_hour=25.0) is rest


def test_blocks_end_with_their_rest():
    current = np.where(TIME % 500 < 300, -1.0, 0.0)
    np.testing.assert_array_equal(blocks(TIME, current, rest_ampere=0.01), TIME // 500)
    np.testing.assert_array_equal(fit_mask(TIME, current, rest_ampere=0.01), TIME // 500 % 2 == 0)
    first = np.r_[np.zeros(400), current[:-400]]
    np.testing.assert_array_equal(blocks(TIME, first, rest_ampere=0.01)[:900], 0)
    short = blocks(TIME, current, rest_second=250.0, rest_ampere=0.01)
    np.testing.assert_array_equal(short, 0)


def test_a_record_without_a_rest_is_cut_into_parts_where_its_current_is_small():
    time = np.arange(4000.0)
    current = np.where(np.abs(time - 1010) <= 3, -0.05, -1.0)
    part = parts(time, current, rest_ampere=0.01)
    starts = np.flatnonzero(np.diff(part)) + 1
    np.testing.assert_allclose(np.diff(starts), 250, atol=63)
    assert (part.max() + 1, set(np.unique(part))) == (16, set(range(16)))
    assert 1007 < starts[3] <= 1014
    np.testing.assert_array_equal(fit_mask(time, current, rest_ampere=0.01), part % 2 == 0)


def test_a_short_record_has_fewer_parts_and_none_that_is_shorter_than_two_rests():
    time = np.arange(800.0)
    part = parts(time, np.full(800, -1.0), rest_ampere=0.01)
    np.testing.assert_array_equal(np.bincount(part), [267, 267, 266])
    message = "no rest of 120 s inside the record to cut it at, and its 470 s are too short for two"
    with pytest.raises(Refusal, match=message):
        fit_mask(time[:471], np.full(471, -1.0), rest_ampere=0.01)


def test_records_are_cut_into_parts_only_where_none_of_the_cell_has_a_rest():
    time = np.arange(2000.0)
    drives = [record_of(time, np.full(2000, -ampere), time, time * 0) for ampere in (1.0, 2.0)]
    rest = {"rest_second": 120.0, "rest_ampere": 0.01}
    columns = [[("drive", r.test_time_second, r.current_ampere)] for r in drives]
    assert cut_of(columns, **rest) is parts
    assert cut_of([[*columns[0], *columns[1]]], **rest) is blocks
    numbers = blocks_of_used(drives, cut=parts, **rest)
    assert [len(np.unique(block)) for block in numbers] == [8, 8]
    pulse = np.where((time > 500) & (time < 900), 0.0, -1.0)
    assert cut_of([*columns, [("hppc", time, pulse)]], **rest) is blocks
    assert cut_of([*columns, [("capacity", time, pulse)]], **rest) is parts
    assert cut_of([[("capacity", time, pulse)]], **rest) is blocks
    numbers = blocks_of_used(drives, cut=blocks, **rest)
    assert [np.unique(block).tolist() for block in numbers] == [[0], [1]]


def test_a_test_began_when_the_sheet_says_else_by_the_dates_in_its_file():
    series = {"test_time_second": np.array([0.0, 60.0]), "unix_time_second": [np.nan, 86460.0]}
    stated = facts.TestFacts("t", "drive", started="1970-01-03 00:00")
    assert started_second(stated, series) == 2 * 86400.0
    assert started_second(facts.TestFacts("t", "drive"), series) == 86400.0
    del series["unix_time_second"]
    assert started_second(facts.TestFacts("t", "drive"), series) is None
