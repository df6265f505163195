"""Rows that stand twice: in one file, or in two exports of one test."""

import numpy as np

from cellwright.formats import Reading
from cellwright.series import assemble, clean

RNG = np.random.default_rng(1)
TIME = 10.0 * np.arange(300)
CURRENT = np.repeat([0.0, -1.0, 0.0], 100)
CHARGE = np.cumsum(CURRENT) * 10 / 3600
VOLT = np.round(4.0 + 0.4 * CHARGE + 0.03 * CURRENT + 1e-3 * RNG.standard_normal(300), 5)


def columns(rows):
    return {
        "test_time_second": TIME[rows],
        "current_ampere": CURRENT[rows],
        "voltage_volt": VOLT[rows],
    }


def reading(rows):
    return Reading(columns(rows), "table", "series")


def test_a_later_export_that_holds_the_first_counts_alone():
    found = assemble([reading(slice(0, 150)), reading(slice(0, 300))])
    np.testing.assert_array_equal(found.columns["test_time_second"], TIME)
    assert found.notes[0] == "file 2 holds all rows of file 1, which is left out"


def test_exports_that_overlap_count_once():
    found = assemble([reading(slice(0, 150)), reading(slice(120, 300))])
    np.testing.assert_array_equal(found.columns["test_time_second"], TIME)
    assert found.notes[0] == "30 rows of file 2 stand in file 1: left out"


def test_a_block_that_stands_twice_in_one_file_is_flagged_and_removed():
    rows = np.r_[0:200, 120:300]
    found = clean(columns(rows))
    np.testing.assert_array_equal(found.columns["test_time_second"], TIME)
    assert list(found.actions["flag"]) == ["repeat"] * 80


def test_files_that_only_begin_alike_are_both_kept():
    """Two rests of 100 rows at one quantised voltage are no repeat."""
    rest = {
        "test_time_second": TIME[:100],
        "current_ampere": np.zeros(100),
        "voltage_volt": np.full(100, 4.2),
    }
    rest["current_ampere"][50] = -1.0
    rest["voltage_volt"][50] = 4.17
    found = assemble([Reading(rest, "table", "series", (), 1)] * 2)
    assert len(found.columns["test_time_second"]) == 200
