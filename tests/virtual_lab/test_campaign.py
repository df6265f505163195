"""The committed campaign: sheets, files and truth belong together and stay small."""

import csv
import hashlib
import json
from pathlib import Path

import pytest

from virtual_lab import campaign

ROOT = Path(__file__).resolve().parents[2]
TEN_MEGABYTES = 10_000_000


@pytest.fixture(scope="module")
def sheet():
    with (ROOT / "config" / "tests.tsv").open(newline="") as file:
        return list(csv.DictReader(file, delimiter="\t"))


@pytest.fixture(scope="module")
def truth():
    return json.loads((ROOT / "tests" / "truth" / "truth.json").read_text())


def test_sheet_is_the_plan(sheet):
    assert [row["file"] for row in sheet] == [test.file for test in campaign.plan()]


def test_checksums_are_those_of_the_files(sheet):
    for row in sheet:
        assert hashlib.sha256((ROOT / row["file"]).read_bytes()).hexdigest() == row["sha256"], row


def test_raw_files_are_small_and_all_listed(sheet):
    files = [p for p in (ROOT / "data").rglob("*") if p.is_file() and p.name != "README.md"]
    assert {str(p.relative_to(ROOT)) for p in files} == {row["file"] for row in sheet}
    assert sum(p.stat().st_size for p in files) <= TEN_MEGABYTES


def test_truth_covers_every_test(sheet, truth):
    assert set(truth["tests"]) == {f"{row['cell']}/{row['test']}" for row in sheet}


def test_resistance_grows_and_capacity_falls_in_the_cold(truth):
    def middle(test):
        pulses = truth["tests"][f"C1/hppc_{test}C"]["pulses"]
        found = min(pulses, key=lambda p: (p["direction"] == "charge", abs(p["soc"] - 0.5)))
        return found["resistance_ohm"]["10.0"]

    def discharged(test):
        return -truth["tests"][f"C1/capacity_{test}C"]["steps"][1]["charge_ampere_hour"]

    assert middle(0) > 1.5 * middle(25) > 2 * middle(40)
    assert discharged(0) < 0.98 * discharged(25) < 0.98 * discharged(40)


def test_currents_of_the_pair_add_up(truth):
    steps = truth["tests"]["pair/drive_25C"]["steps"]
    assert max(step["kcl_residual_ampere"] for step in steps) < 1e-9
    for step in steps:
        total = sum(step["branch_charge_ampere_hour"])
        assert total == pytest.approx(step["charge_ampere_hour"], abs=2e-4)
