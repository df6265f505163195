"""Searches without one record each: how often a name stays, and what told it."""

import numpy as np
import pytest
from small_plant import CAPACITY, HEALTHY, Truth, drive, measured, ocv, slow_discharge

import cellwright as cw
from cellwright.effects.story.stability import Repeat, name_rows
from cellwright.refusal import Refusal


def repeat(left_out, *effects, verdict="named", tied=()):
    alternatives = (tuple(tied), *(() for _ in effects[1:]))[: len(effects)]
    return Repeat(left_out, "fit" if left_out else None, verdict, effects, alternatives)


def test_a_name_stays_also_where_it_is_tied_with_the_one_chosen():
    repeats = [
        repeat(None, "leakage", "self_heating"),
        repeat("a", "current_offset", "self_heating", tied=["leakage"]),
        repeat("b", "leakage"),
        repeat("c", verdict="unknown"),
        Repeat("d", "fit", None, reason="no test can be fitted"),
    ]
    rows = {row["effect"]: row for row in name_rows(repeats)}
    assert list(rows) == ["leakage", "self_heating", "current_offset"]
    assert (rows["leakage"]["stays"], rows["leakage"]["searches"]) == (2, 3)
    assert rows["leakage"]["told_by"] == "c"
    assert rows["self_heating"]["told_by"] == "b; c"
    assert rows["self_heating"]["share"] == pytest.approx(1 / 3)
    assert not rows["current_offset"]["named_with_all"]
    assert rows["current_offset"]["told_by"] == "a"


DRIVES = {"cold": (101, 8.0, "fit"), "warm": (102, 34.0, "fit"), "wild": (103, 8.0, "validation")}


def cell_tests(truth):
    """Tests of a cell as the pipeline has them: facts and a clean series each."""
    plans = {name: (drive(seed, rows=1000), celsius, 0.95, role, "drive")
             for name, (seed, celsius, role) in DRIVES.items()}  # fmt: skip
    plans["slow"] = (slow_discharge(1000), 21.0, 1.0, "fit", "capacity")
    for number, (name, (current, celsius, soc, role, kind)) in enumerate(plans.items()):
        record = measured(name, current, celsius, soc, truth, seed=30 + number, kind=kind)
        charge = np.cumsum(np.r_[0.0, current[:-1]]) * 2.0 / 3600
        columns = ("test_time_second", "current_ampere", "voltage_volt")
        series = {column: getattr(record, column) for column in columns}
        series |= {"charge_ampere_hour": charge, "surface_temperature_celsius": record.celsius}
        facts = {"test": name, "kind": kind, "role": role, "soc": soc}
        yield facts | {"ambient_temperature_celsius": celsius}, series


GRID = np.linspace(0.0, 1.0, 201)
CURVE = {
    "soc": GRID,
    "ocv_volt": ocv(GRID),
    "ambient_temperature_celsius": 25.0,
    "test": "ocv",
    "branches": "discharge",
}
BASIS = {"cell": "A", "capacity_ampere_hour": CAPACITY, "capacity_source": "slow", "ocv": [CURVE]}
CELL = {"cell": "A", "lower_cutoff_volt": 2.5, "upper_cutoff_volt": 4.4}


@pytest.mark.slow
def test_a_search_is_repeated_without_each_record():
    found = cw.missing_effect_stability(CELL, BASIS, list(cell_tests(Truth(activation=2.5e4))))
    searches = {row["left_out"]: row for row in found.repeats}
    assert list(searches) == [None, "cold", "warm", "wild", "slow"]
    (named, *_) = found.rows
    assert named["effect"] == "resistance_temperature"
    assert named["named_with_all"]
    assert "slow" not in named["told_by"]
    # Without the only test for proof every third of three is kept out for it.
    assert searches["wild"]["verdict"] is not None
    assert list(found.to_frame()["effect"]) == [row["effect"] for row in found.rows]


@pytest.mark.slow
def test_a_healthy_cell_has_no_name_to_lose():
    found = cw.missing_effect_stability(CELL, BASIS, list(cell_tests(HEALTHY)))
    assert found.rows == []
    assert {row["verdict"] for row in found.repeats} == {"none"}


def test_a_cell_that_cannot_be_searched_at_all_is_refused():
    only = [test for test in cell_tests(HEALTHY) if test[0]["role"] == "validation"]
    with pytest.raises(Refusal, match="no test can be fitted"):
        cw.missing_effect_stability(CELL, BASIS, only)
