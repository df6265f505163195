"""The committed campaign: sheets, files and truth belong together and stay small."""

import csv
import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from cellwright.effects.story.words import KNOWN
from virtual_lab import campaigns
from virtual_lab.campaigns import making
from virtual_lab.instruments.chain import CHAIN
from virtual_lab.specimens import branch_rows

ROOT = Path(__file__).resolve().parents[2]
TEN_MEGABYTES = 10_000_000
TRUTH = ROOT / "tests" / "truth"


@pytest.fixture(scope="module")
def plan():
    return campaigns.plan("demo")


@pytest.fixture(scope="module")
def sheet():
    return _rows(ROOT / "config" / "tests.tsv", "\t")


def _rows(path, separator=","):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file, delimiter=separator))


def _true(table):
    return _rows(TRUTH / f"{table}.csv")


def test_sheets_are_the_plan(plan, sheet):
    """Byte for byte, so that making the demo over itself changes nothing in the repository."""
    checksums = {row["file"]: row["sha256"] for row in sheet}
    (pair,) = plan.groups.values()
    believed = [float(row["initial_soc"]) for row in _rows(ROOT / "config" / "groups.tsv", "\t")]
    made = {
        "cells": campaigns.cells_sheet(plan),
        "tests": campaigns.tests_sheet(plan, checksums),
        "groups": branch_rows("pair", pair.names, pair.wire_ohm, believed),
    }
    for name, rows in made.items():
        text = campaigns.as_table(rows, separator="\t")
        assert (ROOT / "config" / f"{name}.tsv").read_text(encoding="utf-8") == text, name
    assert (ROOT / "config" / "config.yaml").read_text(encoding="utf-8") == plan.config


def test_checksums_are_those_of_the_files(sheet):
    for row in sheet:
        assert hashlib.sha256((ROOT / row["file"]).read_bytes()).hexdigest() == row["sha256"], row


def test_raw_files_are_small_and_all_listed(sheet):
    apart = {"README.md", "simulated.csv"}
    files = [p for p in (ROOT / "data").rglob("*") if p.is_file() and p.name not in apart]
    assert {str(p.relative_to(ROOT)) for p in files} == {row["file"] for row in sheet}
    assert sum(p.stat().st_size for p in files) <= TEN_MEGABYTES


def test_truth_covers_every_test_and_cell(plan, sheet):
    known = {(r["cell"], r["test"]) for table in ("soc", "eis") for r in _true(table)}
    known |= {(r["group"], r["test"]) for r in _true("packs")}
    assert known == {(row["cell"], row["test"]) for row in sheet}
    cycled = {test.cell for test in plan.tests if test.kind not in ("eis", "group")}
    assert {row["cell"] for row in _true("ocv")} == cycled
    hidden = {row["cell"] for row in json.loads((TRUTH / "missing_effect.json").read_text())}
    assert {row["cell"] for row in _true("health")} == cycled - hidden, "of these: what was hidden"


def test_what_the_report_shows_of_each_cell_is_the_plan(plan):
    text = (ROOT / making.SIMULATED).read_bytes()
    assert text == making._csv(plan.simulated)
    rows = _rows(ROOT / making.SIMULATED)
    assert [row["cell"] for row in rows] == [cell.name for cell in plan.cells]
    named = {one for row in rows for one in row["effects"].split(";") if one}
    assert named <= set(KNOWN), "what a search could name"


@pytest.mark.parametrize(
    ("table", "kinds"),
    [
        ("capacity", ("capacity", "ocv", "fast_charge")),
        ("resistance", ("hppc", "pulse_resistance")),
        ("ica", ("ica",)),
        ("cycles", ("ageing",)),
        ("eis", ("eis",)),
    ],
)
def test_truth_has_a_table_for_each_kind(table, kinds, sheet):
    tests = {(row["cell"], row["test"]) for row in sheet if row["kind"] in kinds}
    assert {(row["cell"], row["test"]) for row in _true(table)} == tests


def test_resistance_grows_and_capacity_falls_in_the_cold():
    def middle(celsius):
        rows = [
            row
            for row in _true("resistance")
            if (row["cell"], row["test"]) == ("C1", f"hppc_{celsius}C")
            and (row["direction"], float(row["delay_second"])) == ("discharge", 10.0)
        ]
        return float(min(rows, key=lambda r: abs(float(r["soc"]) - 0.5))["resistance_ohm"])

    def discharged(celsius):
        (row,) = [
            row
            for row in _true("capacity")
            if (row["cell"], row["test"]) == ("C1", f"capacity_{celsius}C")
            and row["direction"] == "discharge"
        ]
        return float(row["capacity_ampere_hour"])

    assert middle(0) > 1.5 * middle(25) > 2 * middle(40)
    assert discharged(0) < 0.98 * discharged(25) < 0.98 * discharged(40)


def test_files_hold_the_charge_that_is_true(plan, demo_records):
    rated = {cell.name: cell.rating.capacity_ampere_hour for cell in plan.cells}
    true = {(row["cell"], row["test"]): row for row in _true("soc")}
    checked = 0
    for test, shown in demo_records:
        # Where the room swings the capacity does too, and SoC counts no charge.
        if (test.cell, test.test) not in true or test.faults or test.kind == "ageing":
            continue
        row = true[test.cell, test.test]
        change = float(row["soc_end"]) - float(row["soc_begin"])
        moved = np.trapezoid(shown["current_ampere"], shown["test_time_second"]) / 3600
        # Trapezoids between samples of a drive, one a second, are what is least exact here.
        expected = change * float(row["capacity_ampere_hour"])
        assert moved == pytest.approx(expected, abs=4e-4 * rated[test.cell]), test.file
        checked += 1
    assert checked > 56


def test_currents_of_the_pair_add_up(demo_records):
    ((test, shown),) = [(test, shown) for test, shown in demo_records if test.kind == "group"]
    down = [step.value for step in test.steps if step.kind == "profile"]
    asked = sum(np.trapezoid(value[:, 1], value[:, 0]) for value in down) / 3600
    rows = _true("packs")
    assert sum(float(row["charge_ampere_hour"]) for row in rows) == pytest.approx(-asked, abs=2e-4)
    branches = [shown[f"branch_{k}_current_ampere"] for k in (1, 2)]
    residual = sum(branches) - shown["current_ampere"]
    # Three readings, each with its noise and its resolution; nothing else is between them.
    noise = np.sqrt(3 * (CHAIN.current_noise_ampere**2 + CHAIN.current_resolution_ampere**2 / 12))
    assert residual.std() == pytest.approx(noise, rel=0.2)
    assert abs(residual.mean()) < 5 * noise / np.sqrt(residual.size)
    for row, branch in zip(rows, branches, strict=True):
        # One sample a second meets no peak of the load exactly.
        largest = float(row["current_max_ampere"])
        assert 0.95 * largest < np.abs(branch).max() < largest + 0.004
