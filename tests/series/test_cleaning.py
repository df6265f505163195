"""Cleaning: every flag found where it was put, one place removes, nothing else is lost."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cellwright import formats
from cellwright.formats.fields import SERIES
from cellwright.refusal import Refusal
from cellwright.series import Flag, assemble, clean, counts, flag, remove
from cellwright.series.sign import current_sign


def record(rows=500):
    current = np.where((np.arange(rows) // 50) % 2, -2.0, 0.0)
    rng = np.random.default_rng(0)
    charge = np.cumsum(current) / 3600
    return {
        "test_time_second": np.arange(rows, dtype=float),
        "current_ampere": current,
        "voltage_volt": 3.7 + 0.5 * charge + 0.03 * current + 2e-4 * rng.standard_normal(rows),
        "surface_temperature_celsius": np.full(rows, 25.0),
    }


def flagged(columns, kind):
    return np.flatnonzero(flag(columns) & kind).tolist()


def test_a_clean_record_stays_as_it_is():
    columns = record()
    cleaned = clean(columns)
    assert not flag(columns).any()
    assert cleaned.actions["row"].size == 0
    for name, column in columns.items():
        np.testing.assert_array_equal(cleaned.columns[name], column)
    assert cleaned.columns["charge_ampere_hour"][-1] == pytest.approx(-250 * 2 / 3600, rel=0.01)


@settings(max_examples=30, deadline=None)
@given(st.sets(st.integers(1, 498), max_size=8), st.sampled_from([np.nan, 3.4e38, -3.4e38, np.inf]))
def test_rows_without_a_reading_are_removed(rows, mark):
    columns = record()
    rows = sorted(rows)
    columns["current_ampere"][rows] = mark
    cleaned = clean(columns)
    assert cleaned.columns["test_time_second"].size == 500 - len(rows)
    assert cleaned.actions["row"].tolist() == rows
    assert set(cleaned.actions["action"]) <= {"row removed"}


@pytest.mark.parametrize("shown", [3276.7, -999.0, np.nan])
def test_a_thermometer_without_a_reading_is_blank_there_and_the_row_stays(shown):
    columns = record()
    columns["surface_temperature_celsius"][[7, 300]] = shown
    cleaned = clean(columns)
    assert flagged(columns, Flag.NO_VALUE) == [7, 300]
    assert cleaned.actions["action"].tolist() == ["temperature left blank, row kept"] * 2
    np.testing.assert_array_equal(cleaned.actions["value"], [shown, shown])
    assert np.isnan(cleaned.columns["surface_temperature_celsius"][[7, 300]]).all()
    assert np.nanmax(cleaned.columns["surface_temperature_celsius"]) == 25.0
    columns["surface_temperature_celsius"][::5] = shown  # a logger that writes it now and then
    assert not flagged(columns, Flag.NO_VALUE)


def test_single_rows_that_are_missing_are_seen_by_the_pace():
    columns = {name: np.delete(column, [30, 130, 131, 333]) for name, column in record().items()}
    assert flagged(columns, Flag.LOST) == [30, 129, 330]
    np.testing.assert_allclose(
        clean(columns).columns["charge_ampere_hour"][-1], -250 / 1800, rtol=0.01
    )


@settings(max_examples=30, deadline=None)
@given(st.integers(2, 8), st.integers(0, 99))
def test_a_burst_of_corrupt_voltages_is_replaced_by_the_line_over_it(rows, seed):
    columns, rng = record(), np.random.default_rng(seed)
    true = columns["voltage_volt"].copy()
    burst = slice(215, 215 + rows)
    columns["voltage_volt"][burst] += np.resize((-1, 1), rows) * rng.uniform(0.02, 0.04, rows)
    found = flag(columns) & (Flag.BURST | Flag.SPIKE)
    assert set(np.flatnonzero(found)) <= set(range(212, 218 + rows))
    cleaned = clean(columns).columns["voltage_volt"]
    assert np.mean(np.abs(cleaned - true)[burst] < 2e-3) > 0.9


def test_a_step_of_the_load_and_a_pulse_are_no_burst():
    columns = record()
    for name, by in (("current_ampere", -2.0), ("voltage_volt", -0.06)):
        columns[name][215:219] += by
    assert not flag(columns).any()


def test_dead_sample_and_mark_in_another_channel():
    columns = record()
    columns["voltage_volt"][120] = columns["current_ampere"][120] = 0.0
    columns["surface_temperature_celsius"][7] = 3.4e38
    assert flagged(columns, Flag.SENTINEL) == [120]
    surface = clean(columns).columns["surface_temperature_celsius"]
    assert np.isnan(surface[7])
    assert surface.size == 499


@pytest.mark.parametrize("rows", [[120], [120, 121, 122], [0, 1], [498, 499], [52, 53, 215]])
def test_zeros_of_the_potential_are_no_readings_wherever_they_stand(rows):
    columns = record()
    columns["voltage_volt"][rows] = 0.0
    assert flagged(columns, Flag.SENTINEL) == rows
    truth = current_sign(*(record()[name] for name in SERIES))
    found = current_sign(*(columns[name] for name in SERIES))
    assert (found.sign, found.evidence) == (truth.sign, pytest.approx(truth.evidence, abs=0.02))


def test_a_cell_that_is_emptied_to_zero_volt_shows_what_it_has():
    columns = record()
    columns["voltage_volt"] = np.concatenate([np.linspace(2.0, 0.0, 490), np.zeros(10)])
    assert not flagged(columns, Flag.SENTINEL)


def doubled(columns, row):
    return {name: np.insert(column, row, column[row]) for name, column in columns.items()}


def test_repeats_go_and_edges_stay():
    columns = doubled(doubled(record(), 20), 51)  # row 52 holds the first sample of the step
    columns["current_ampere"][51] = 0.0
    columns["voltage_volt"][51] = columns["voltage_volt"][49]
    assert flagged(columns, Flag.REPEAT) == [21]
    cleaned = clean(columns).columns
    assert np.flatnonzero(np.diff(cleaned["test_time_second"]) == 0).tolist() == [50]
    assert cleaned["current_ampere"][50:52].tolist() == [0, -2]


@pytest.mark.parametrize("shift", [-30.0, 30.0])
def test_one_row_out_of_place_is_removed(shift):
    columns = record()
    expected = np.delete(columns["test_time_second"], 200)
    columns["test_time_second"][200] += shift
    assert flagged(columns, Flag.OUT_OF_PLACE) == [200]
    assert clean(columns).columns["test_time_second"].tolist() == expected.tolist()


@pytest.mark.parametrize(
    ("rows", "back", "jumps"), [(slice(200, None), 150, [200]), (slice(100, 300), 80, [100, 300])]
)
def test_a_clock_set_back_or_of_its_own_per_step_is_rebased(rows, back, jumps):
    columns, true = record(), record()["test_time_second"]
    columns["test_time_second"][rows] -= back
    assert flagged(columns, Flag.CLOCK) == jumps
    assert clean(columns).columns["test_time_second"].tolist() == true.tolist()


def test_spike_is_repaired_and_listed():
    columns = record()
    columns["voltage_volt"][130] += 0.05
    cleaned = clean(columns)
    assert cleaned.actions["flag"].tolist() == ["spike"]
    assert cleaned.actions["value"][0] == columns["voltage_volt"][130]
    assert abs(cleaned.columns["voltage_volt"][130] - record()["voltage_volt"][130]) < 2e-3


def test_gap_is_kept_and_sampling_that_changes_is_none():
    columns = record()
    columns["test_time_second"][300:] += 1000
    assert flagged(columns, Flag.GAP) == [300]
    assert clean(columns).columns["test_time_second"].size == 500
    columns = record()
    columns["test_time_second"][300:] = 300 + 600 * np.arange(200)
    assert flagged(columns, Flag.GAP) == []


def test_between_files_the_record_is_silent():
    columns = {**record(), "file_index": np.repeat([0, 1], 250)}
    assert flagged(columns, Flag.GAP) == [250]


def test_nothing_left_is_refused():
    columns = record(4)
    columns["voltage_volt"][:3] = np.nan
    with pytest.raises(Refusal, match="1 of 4 rows are left"):
        clean(columns)


def test_flag_and_remove_do_not_write_into_their_input():
    columns = record()
    columns["voltage_volt"][130] += 0.05
    columns["current_ampere"][10] = np.nan
    before = {name: column.copy() for name, column in columns.items()}
    remove(columns, flag(columns))
    for name, column in before.items():
        np.testing.assert_array_equal(columns[name], column)


@pytest.mark.parametrize(
    ("file", "allowed"),
    [
        # At 44,628 s the voltage falls by 35 mV for one row, at the same current.
        ("a123/raw/dynamic/A123_DYN_10_N25_s1.csv.gz", {"spike": 1}),
        ("a123/raw/dynamic/A123_DYN_50_P25_s1.csv.gz", {}),
        ("dmegc/raw/R1/pulses.csv.gz", {}),
        ("leaf/raw/hppc/NissanLeaf-cell-Low-Current-HPPC-25C-2.csv.gz", {}),
        ("weng/raw/parallel_C10.csv.gz", {}),
        ("panasonic/raw/hppc/hppc_25C.parquet", {"repeat": 153, "gap": 13}),
        ("panasonic/raw/drive/cycle1_25C.parquet", {"repeat": 4}),
        ("lgm50/raw/pulses/0C/Cell19_SoC5.csv.gz", {"repeat": 7}),
        ("nasa/raw/B0025_ageing.parquet", {"nan": 2, "gap": 20}),
    ],
)
def test_measured_records_keep_their_steps(shared, file, allowed):
    reading = formats.read((shared / "campaigns" / file).read_bytes(), name=file)
    columns = assemble([reading]).columns
    flags = flag(columns)
    assert {kind: n for kind, n in counts(flags).items() if n} == allowed
    interval = np.diff(remove(columns, flags).columns["test_time_second"])
    assert interval.min() >= 0


def test_labview_clocks_of_their_own(shared):
    """K2: each kind of step has its own clock, and 5 to 8 % of the currents are marks."""
    path = shared / "campaigns/k2lfp/raw/hppc/10SOCK220.txt.gz"
    columns = formats.read(path.read_bytes(), name=path.name).columns
    numbers = counts(flag(columns))
    assert 0.05 < numbers["sentinel"] / columns["test_time_second"].size < 0.08
    assert 24 <= numbers["clock"] <= 48
    assert numbers["gap"] == numbers["spike"] == 0
    cleaned = clean(columns).columns["test_time_second"]
    assert cleaned[-1] - cleaned[0] == pytest.approx(columns["test_time_second"].size, rel=2e-4)
    assert np.diff(cleaned).max() < 6
