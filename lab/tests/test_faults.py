"""Faults put into records and into whole files."""

from functools import partial

import numpy as np
import pytest

from cellwright import formats
from cellwright.refusal import Refusal
from virtual_lab import instruments
from virtual_lab.instruments import faults, measurement

FAULTS = {
    "spikes": partial(faults.spikes, seed=4),
    "bursts": partial(faults.noise_bursts, seed=4),
    "repeats": partial(faults.repeats, seed=4),
    "gap": partial(faults.gap, begin_second=1000.0, end_second=1600.0),
    "lost": partial(faults.lost_records, seed=4),
    "no_values": partial(faults.no_values, seed=4, channel="surface_celsius"),
    "frozen": partial(faults.frozen, channel="voltage_volt", begin_second=900, end_second=1900),
    "dead": partial(faults.dead, channel="ambient_celsius"),
    "clock_reset": partial(faults.clock_reset, at_second=2000.0),
    "swapped": partial(faults.swapped_rows, seed=4),
}
every_fault = pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS)


@every_fault
def test_what_was_handed_in_stays_and_something_was_done(ideal, fault):
    before = {name: column.copy() for name, column in ideal.items()}
    spoilt, done = fault(ideal)
    for name, column in before.items():
        np.testing.assert_array_equal(ideal[name], column)
    assert done
    assert len({column.size for column in spoilt.values()}) == 1
    assert all(0 <= row["row"] < spoilt["step"].size for row in done)


@every_fault
def test_seed_decides(ideal, fault):
    (one, listed), (again, as_listed) = fault(ideal), fault(ideal)
    assert listed == as_listed
    for name, column in one.items():
        np.testing.assert_array_equal(column, again[name])


@pytest.mark.parametrize("name", ["spikes", "bursts", "no_values"])
def test_values_are_listed_where_they_stand_and_nowhere_else(ideal, name):
    spoilt, done = FAULTS[name](ideal)
    channel = "surface_celsius" if name == "no_values" else "voltage_volt"
    assert {row["row"] for row in done} == set(np.flatnonzero(spoilt[channel] != ideal[channel]))
    assert all(spoilt[channel][row["row"]] == row["value"] for row in done)


def test_spikes_are_single_samples(ideal):
    spoilt, _ = faults.spikes(ideal, seed=4, count=2, size_volt=0.05)
    moved = spoilt["voltage_volt"] - ideal["voltage_volt"]
    assert sorted(np.round(moved[moved != 0], 6)) == [-0.05, 0.05]


def test_repeats_are_whole_rows_twice(ideal):
    spoilt, done = faults.repeats(ideal, seed=4, count=4)
    assert spoilt["step"].size == ideal["step"].size + 4
    again = np.flatnonzero(np.diff(spoilt["time_second"]) == 0) + 1
    assert [row["row"] for row in done] == again.tolist()
    assert np.unique(spoilt["time_second"]).size == ideal["time_second"].size


def test_gap_leaves_counters_running(ideal):
    spoilt, done = FAULTS["gap"](ideal)
    hole = np.argmax(np.diff(spoilt["time_second"]))
    assert done[0]["row"] == hole + 1
    assert 600 < done[0]["value"] < 603
    counted = np.diff(spoilt["discharged_ampere_hour"])[hole]
    assert counted == pytest.approx(2.0 * 600 / 3600, rel=0.01)


def test_lost_records_are_told_by_the_wait_after_them(ideal):
    spoilt, done = FAULTS["lost"](ideal)
    lost = np.setdiff1d(ideal["time_second"], spoilt["time_second"])
    assert lost.size == pytest.approx(0.01 * ideal["step"].size, rel=0.4)
    after = np.unique(np.searchsorted(spoilt["time_second"], lost))
    assert [row["row"] for row in done] == after.tolist()


def test_a_missing_number_has_no_value_to_list(ideal):
    spoilt, done = faults.no_values(ideal, seed=1, channel="voltage_volt", value=np.nan)
    assert np.isnan(spoilt["voltage_volt"]).sum() == 3
    assert {row["value"] for row in done} == {""}


def test_clock_begins_again(ideal):
    spoilt, done = FAULTS["clock_reset"](ideal)
    row = done[0]["row"]
    assert spoilt["time_second"][row] == 0.0
    assert ideal["time_second"][row] >= 2000.0 > ideal["time_second"][row - 1]


def test_swapped_rows_run_backwards_at_each_pair(ideal):
    spoilt, done = FAULTS["swapped"](ideal)
    backwards = np.flatnonzero(np.diff(spoilt["time_second"]) < 0)
    assert {row["row"] for row in done} == set(backwards) | set(backwards + 1)


def test_rows_are_counted_in_the_finished_file(ideal):
    several = [FAULTS["spikes"], FAULTS["repeats"], FAULTS["gap"], FAULTS["no_values"]]
    spoilt, done = faults.spoiled(ideal, several)
    assert "ticket" not in spoilt
    spikes = [row for row in done if row["fault"] == "spike"]
    assert all(spoilt["voltage_volt"][row["row"]] == row["value"] for row in spikes)
    assert abs(spoilt["voltage_volt"][spikes[0]["row"]] - 3.58) > 0.05
    none = [row["row"] for row in done if row["fault"] == "no_value"]
    np.testing.assert_array_equal(spoilt["surface_celsius"][none], 3276.7)
    for row in done:
        if row["fault"] == "repeat":
            assert spoilt["time_second"][row["row"]] == spoilt["time_second"][row["row"] - 1]
            assert spoilt["time_second"][row["row"]] == row["value"]
    hole = next(row["row"] for row in done if row["fault"] == "gap")
    assert np.diff(spoilt["time_second"])[hole - 1] > 600


def test_what_was_lost_later_is_not_listed(ideal):
    _, done = faults.spoiled(
        ideal, [FAULTS["spikes"], partial(faults.gap, begin_second=60.0, end_second=4550.0)]
    )
    assert [row["fault"] for row in done] == ["gap"]


def test_gap_outside_the_record_is_refused(ideal):
    with pytest.raises(ValueError, match="not within"):
        faults.gap(ideal, begin_second=1e6, end_second=2e6)


SERIES = sorted(name for name in instruments.WRITERS if not name.endswith("eis"))
FILE_FAULTS = {
    faults.cut_off: "cut off|damaged",
    faults.emptied: "the file is empty",
    partial(faults.damaged, seed=1): "damaged|cut off",
    partial(faults.torn_row, seed=1): "line [0-9]+: .*cut off|time",
}


@pytest.fixture
def shown(ideal):
    return measurement.measured(ideal, seed=5)


@pytest.mark.parametrize("name", SERIES)
@pytest.mark.parametrize("fault", FILE_FAULTS)
def test_a_spoiled_file_is_refused_with_its_reason(shown, name, fault):
    if name == "parquet" and "torn" in str(fault):
        pytest.skip("Parquet has no rows of text")
    left, done = fault(instruments.WRITERS[name](shown))
    assert done
    with pytest.raises(Refusal, match=FILE_FAULTS[fault]):
        formats.read(left, name="file")


def test_a_torn_row_is_named_by_its_line(shown):
    left, done = faults.torn_row(instruments.bdf_csv(shown), seed=2)
    with pytest.raises(Refusal, match=f"line {done[0]['value']}:"):
        formats.read(left, name="file")


@pytest.mark.parametrize(("name", "lines"), [("arbin", 1), ("bdf", 1), ("digatron", 30)])
def test_a_header_without_rows_is_refused(shown, name, lines):
    left, _ = faults.header_only(instruments.WRITERS[name](shown), lines=lines)
    with pytest.raises(Refusal, match="no row"):
        formats.read(left, name="file")


def test_spoiling_is_the_same_each_time(shown):
    content = instruments.bdf_csv(shown)
    for fault in FILE_FAULTS:
        assert fault(content) == fault(content)
