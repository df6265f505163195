"""The statistics of a score: what belongs together, errors, intervals and their coverage."""

import numpy as np
import pandas as pd
import pytest

from virtual_lab.score import comparison, page, summary


def table(**columns):
    return pd.DataFrame(columns)


@pytest.mark.parametrize("seed", range(5))
def test_partners_are_each_others_nearest_in_their_group(seed):
    """Against every pair of rows looked at one by one."""
    random = np.random.default_rng(seed)
    sizes = (60, 50)
    found, true = (
        table(cell=random.choice(["a", "b", "c"], n), at=random.uniform(0, 100, n)) for n in sizes
    )
    pairs = comparison.pair(found, true, keys=["cell"], near="at", tolerance=2.0)
    gap = np.abs(found["at"].to_numpy()[:, None] - true["at"].to_numpy())
    gap[found["cell"].to_numpy()[:, None] != true["cell"].to_numpy()] = np.inf
    mutual = (gap == gap.min(axis=0)) & (gap == gap.min(axis=1)[:, None]) & (gap <= 2.0)
    assert set(zip(pairs.found, pairs.true, strict=True)) == set(
        zip(*mutual.nonzero(), strict=True)
    )
    assert len(pairs.found) + len(pairs.extra) == 60
    assert len(pairs.true) + len(pairs.missing) == 50


def test_without_a_distance_the_kth_goes_with_the_kth_and_blank_equals_blank():
    found = table(cell=["a", "a", None], test=["x", "x", "y"])
    true = table(cell=["a", None, "b"], test=["x", "y", "z"])
    pairs = comparison.pair(found, true, keys=["cell", "test"])
    assert set(zip(pairs.found, pairs.true, strict=True)) == {(0, 0), (2, 1)}
    assert pairs.extra.tolist() == [1]
    assert pairs.missing.tolist() == [2]


def test_a_row_without_a_place_has_no_partner():
    found, true = table(cell=["a"], at=[np.nan]), table(cell=["a"], at=[1.0])
    assert not len(comparison.pair(found, true, keys=["cell"], near="at", tolerance=1e9).true)


def test_measured_rates_become_those_asked_for():
    found = table(cell=["a", "a", "b"], c_rate=[0.0499, 0.34, 0.05])
    true = table(cell=["a", "a"], c_rate=[0.05, 1 / 3])
    rates = comparison.snapped(found, true, keys=["cell"], near="c_rate", tolerance=0.25)
    assert rates.tolist() == [0.05, 1 / 3, 0.05]


@pytest.mark.parametrize(
    ("hits", "of", "low", "high"),
    [
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_interval_of_a_share_is_wilsons(hits, of, low, high):
    """R. G. Newcombe, Statistics in Medicine 17 (1998) 857, table I, method 3."""
    assert summary.wilson(hits, of) == pytest.approx((low, high), abs=5e-5)


def scored(found, true, std, **more):
    count = len(true)
    rows = {"cell": "a", "test": [f"t{k}" for k in range(count)], "at": ""}
    rows |= {"found": found, "true": true, "std": std}
    return comparison.errors("capacity", "capacity", "Ah", pd.DataFrame(rows | more))


def test_bias_rms_relative_and_worst_are_what_was_put_in():
    true = np.full(4, 2.0)
    rows = scored(true + [0.1, 0.1, 0.1, -0.3], true, np.nan)
    row = summary._row("capacity", "capacity", "Ah", "scored", rows)
    assert row["bias"] == pytest.approx(0.0)
    assert row["rms_error"] == pytest.approx(np.sqrt(0.03))
    assert row["relative_rms"] == pytest.approx(np.sqrt(0.03) / 2)
    assert (row["worst_test"], row["worst_error"]) == ("t3", pytest.approx(-0.3))
    assert row["n_interval"] == 0


@pytest.mark.parametrize(("stated", "remark"), [(1.0, ""), (0.5, "narrow"), (2.0, "wide")])
def test_coverage_sees_intervals_that_are_too_narrow_or_too_wide(stated, remark):
    random = np.random.default_rng(4)
    true = random.uniform(1, 2, 4000)
    rows = scored(true + random.normal(0, 0.01, 4000), true, 0.01 * stated)
    row = summary._row("capacity", "capacity", "Ah", "scored", rows)
    # 95 %, and what lies within half and twice 1.96 standard deviations.
    expected = {1.0: 0.95, 0.5: 0.673, 2.0: 0.9999}[stated]
    assert row["coverage_low"] <= expected <= row["coverage_high"] + 1e-3
    said = page.remark({**dict.fromkeys(summary.COLUMNS, 0), **row})
    assert remark in said
    assert bool(said) == bool(remark)


def test_what_cannot_be_compared_is_counted_by_its_kind():
    rows = pd.DataFrame(
        {
            "cell": "a",
            "test": ["both", "lost", "besides", "never", "told", "neither"],
            "at": "",
            "found": [1.0, None, 1.0, None, 1.0, None],
            "true": [1.0, 1.0, None, 1.0, None, None],
            "word": [None, None, None, "untested", None, None],
            "paired": [True, False, False, False, True, True],
        }
    )
    status = comparison.errors("capacity", "capacity", "Ah", rows).set_index("test")["status"]
    assert status.to_dict() == {
        "both": "compared",
        "lost": "missing",
        "besides": "extra",
        "never": "untested",
        "told": "no truth",
    }


def test_a_deviation_of_nothing_is_no_interval():
    assert scored([1.0, 1.0], np.ones(2), [0.0, np.nan])["inside_95"].isna().all()


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.0123, "V", "12.3 mV"),
        (-0.00001234, "Ohm", "-0.0123 mΩ"),
        (-2415.0, "J/mol", "-2.42 kJ/mol"),
        (0.5, "", "0.5"),
        (np.nan, "V", ""),
    ],
)
def test_errors_are_shown_in_units_that_read_well(value, unit, text):
    assert page.with_unit(value, unit) == text


def test_names_lose_their_units_and_underscores():
    assert page.plain_name("resistance_ohm, 10 s") == "resistance, 10 s"
    assert page.plain_name("height_ampere_hour_per_volt") == "height"
