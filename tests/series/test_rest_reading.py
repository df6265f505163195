"""Readings in rests: an offset is not charge, a small load is, and what nobody can tell is said."""

import gzip

import numpy as np
import pytest

from cellwright import formats
from cellwright.records.blocks import fit_mask
from cellwright.series import assemble, clean
from cellwright.series.rest_current import as_logged, open_circuit

CAPACITY, STEP = 2.5, 2.0  # Ah, s
OHM, SLOW_OHM, SLOW_SECOND = 0.02, 0.01, 300.0


def cell(current):
    """Voltage of a cell with a steep, smooth OCV, one ohmic and one relaxing resistance."""
    soc = 0.95 + np.cumsum(current) * STEP / 3600 / CAPACITY
    slow, state = np.zeros(len(current)), 0.0
    for row, ampere in enumerate(current):
        state += STEP / SLOW_SECOND * (SLOW_OHM * ampere - state)
        slow[row] = state
    return 3.2 + 0.9 * soc + OHM * current + slow


def record(*, flows=0.0, reads=0.0, scatter=1e-3, rests_only=False, dither=0.0, seed=1):
    """Eight discharges of 0.25 Ah with rests of 1 h.

    flows : a true current in the rests [A]. reads : an offset of the sensor [A]. dither : scatter
    of the true current in rests [A].
    """
    rng = np.random.default_rng(seed)
    block = np.r_[np.full(180, -CAPACITY), np.zeros(1800)]
    load = np.tile(block, 8)
    load = np.r_[np.zeros(100), load]
    rest = load == 0
    true = load + rest * (flows + dither * rng.standard_normal(len(load)))
    offset = reads * (rest if rests_only else 1.0)
    return {
        "test_time_second": STEP * np.arange(len(load)),
        "current_ampere": true + offset + scatter * rng.standard_normal(len(load)),
        "voltage_volt": cell(true) + 2e-4 * rng.standard_normal(len(load)),
    }, true


def moved(current):
    return float(np.sum((current[1:] + current[:-1]) / 2) * STEP / 3600)


@pytest.mark.parametrize("rests_only", [True, False])
def test_an_offset_in_rests_is_told_and_not_counted(rests_only):
    columns, true = record(reads=CAPACITY / 125, rests_only=rests_only)
    cleaned = clean(columns)
    rests = open_circuit(columns["test_time_second"], columns["current_ampere"])
    loads = 8 * 180 * STEP / 3600 * CAPACITY / 125
    under_load = 0.0 if rests_only else loads  # what no rest shows
    assert cleaned.columns["charge_ampere_hour"][-1] == pytest.approx(
        moved(true) + under_load, abs=4e-3
    )
    assert cleaned.actions["flag"].tolist() == ["rest_reading"] * len(rests[0])
    assert cleaned.actions["value"] == pytest.approx(CAPACITY / 125, abs=1e-4)
    assert "+20 mA" in cleaned.notes[0]
    assert "not counted" in cleaned.notes[0]


def test_a_small_load_that_the_voltage_follows_is_counted():
    columns, true = record(flows=-CAPACITY / 125)
    cleaned = clean(columns)
    assert "logged_current_ampere" not in cleaned.columns
    assert cleaned.columns["charge_ampere_hour"][-1] == pytest.approx(moved(true), abs=2e-3)
    assert "; counted: in" in cleaned.notes[0]


def test_a_dither_that_the_voltage_answers_is_a_current():
    columns, true = record(flows=3e-3, dither=2e-2)
    cleaned = clean(columns)
    assert cleaned.columns["charge_ampere_hour"][-1] == pytest.approx(moved(true), abs=2e-3)
    assert "; counted: its changes move the voltage by 20" in cleaned.notes[0]


def test_noise_of_one_sign_that_the_voltage_does_not_answer_is_the_sensors():
    columns, true = record()
    rng = np.random.default_rng(2)
    columns["current_ampere"] += (true == 0) * (rng.random(len(true)) < 0.1) * 0.02
    columns["voltage_volt"] = columns["voltage_volt"].round(4)
    cleaned = clean(columns)
    assert cleaned.columns["charge_ampere_hour"][-1] == pytest.approx(moved(true), abs=1e-3)


def test_what_nobody_can_tell_is_counted_and_said():
    columns, true = record(reads=5e-3, scatter=0.0)
    charge = np.cumsum(true) * STEP / 3600
    columns["voltage_volt"] -= 0.9 * charge / CAPACITY  # a flat OCV, as of an LFP cell
    cleaned = clean(columns)
    assert "logged_current_ampere" not in cleaned.columns
    assert "counted: nothing tells a small load from an offset" in cleaned.notes[0]


def test_a_record_without_an_offset_stays_as_it_is():
    columns, _ = record()
    cleaned = clean(columns)
    assert cleaned.notes == ()
    np.testing.assert_array_equal(cleaned.columns["current_ampere"], columns["current_ampere"])


@pytest.mark.parametrize(("counts", "kept"), [(True, True), (False, False)])
def test_the_instruments_counter_decides(counts, kept):
    columns, true = record(reads=CAPACITY / 125, rests_only=True)
    counted = columns["current_ampere"] if counts else true
    columns["net_capacity_ampere_hour"] = np.cumsum(counted) * STEP / 3600
    assert ("logged_current_ampere" not in clean(columns).columns) == kept


def test_the_end_of_a_charge_at_constant_voltage_is_no_rest():
    fading = np.r_[np.full(50, 2.0), 2.0 * np.exp(-np.arange(2000) / 200)]
    first, _ = open_circuit(np.arange(len(fading), dtype=float), fading)
    assert len(first) == 0


def test_a_small_current_at_a_held_voltage_is_no_rest():
    columns, _ = record(reads=CAPACITY / 125)
    rest = columns["current_ampere"] > -1
    columns["voltage_volt"] = np.where(rest, 4.1, 3.9)
    assert clean(columns).notes == ()


def test_who_searches_for_faults_gets_what_was_read():
    columns, _ = record(reads=CAPACITY / 125)
    logged = as_logged(clean(columns).columns)
    np.testing.assert_array_equal(logged["current_ampere"], columns["current_ampere"])
    assert logged["charge_ampere_hour"][-1] == pytest.approx(moved(columns["current_ampere"]))


def test_an_offset_does_not_hide_the_rests_at_which_a_record_is_cut():
    columns, _ = record(reads=CAPACITY / 125)
    time, current = columns["test_time_second"], columns["current_ampere"]
    fit = fit_mask(time, current, rest_ampere=0.004 * CAPACITY)
    assert np.count_nonzero(np.diff(fit.astype(int))) == 7


def test_a_real_cell_returns_what_its_capacity_test_gave(shared):
    raw = shared / "campaigns/k2lfp/raw/hppc"
    files = [raw / name for name in ("10SOCK220.txt.gz", "5SOCK220.txt.gz")]
    readings = [formats.read(gzip.decompress(f.read_bytes()), name=f.stem) for f in files]
    cleaned = clean(assemble(readings).columns)
    assert cleaned.columns["charge_ampere_hour"][-1] == pytest.approx(
        -2.187, abs=2e-3
    )  # was −2.086
    assert "+5.25 mA" in cleaned.notes[0]
