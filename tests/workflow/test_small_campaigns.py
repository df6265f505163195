"""Small campaigns (tests/campaigns): what is planned for which tests, and that it runs."""

import csv
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CAMPAIGNS = ROOT / "tests" / "campaigns"
# Planned for every campaign, and for every one that has a series of current and voltage.
ALWAYS = {"table", "excluded", "summary", "checks", "report", "manifest", "figure_overview"}
ALWAYS |= {"missing_effect"}
SERIES = {"ingest", "clean", "segment"}
CAPACITY = SERIES | {"capacity", "basis", "relaxation", "figure_records", "figure_capacity"}
METHODS = {"identification_methods", "figure_identification_methods"}
# Of each campaign the other rules, among them the search, which says what it would need.
PLANNED = {
    "bad_file_only": CAPACITY | {"effect_search", "witnesses"},
    "capacity_only": CAPACITY | {"effect_search", "witnesses"},
    "ocv_pulses_drive": CAPACITY
    | METHODS
    | {"ocv", "resistance", "polarisation", "identify", "model", "export", "validate", "soc"}
    | {"effect_search", "witnesses", "figure_missing_effect", "figure_ocv", "figure_resistance"}
    | {"figure_relaxation", "figure_polarisation", "figure_parameters", "figure_validation"}
    | {"figure_soc"},
    "spectra_only": {"spectrum", "impedance", "basis", "temperature", "cold_limit"}
    | {"figure_impedance", "figure_impedance_fit", "figure_drt", "figure_arrhenius"}
    | {"figure_temperature"},
    "pulses_over_temperature": CAPACITY
    | METHODS
    | {
        "resistance",
        "temperature",
        "resistance_surface",
        "cold_limit",
        "effect_search",
        "witnesses",
    }
    | {"figure_missing_effect", "figure_resistance", "figure_surface", "figure_arrhenius"}
    | {"figure_temperature"},
    "parallel_group": SERIES
    | {"basis", "branches", "model", "export", "pack", "missing_effect_group"}
    | {"figure_parameters", "figure_pack"},
}


def snakemake(folder, *arguments):
    program = [sys.executable, "-m", "snakemake", "--cores", "1", "--directory", str(folder)]
    done = subprocess.run(
        [*program, *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def copied(name, folder):
    """A campaign in a place of its own, over the same raw files."""
    target = folder / name
    made = shutil.ignore_patterns("data", "results", "logs", ".snakemake")
    shutil.copytree(CAMPAIGNS / name, target, ignore=made)
    (target / "data").symlink_to(ROOT / "data")
    return target


def table(folder, name):
    with open(folder / "results" / name, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_every_campaign_is_told_of_and_planned_here():
    folders = {path.parents[1].name for path in CAMPAIGNS.glob("*/config/tests.tsv")}
    page = (CAMPAIGNS / "README.md").read_text(encoding="utf-8")
    assert folders == set(PLANNED) == set(re.findall(r"^\| `(\w+)` \|", page, re.M))


@pytest.mark.parametrize("name", PLANNED)
def test_what_is_planned_is_what_its_tests_carry(name, tmp_path):
    said = snakemake(copied(name, tmp_path), "--dry-run", "all")
    jobs = re.findall(r"^(\w+) +\d+$", said.split("Job stats:")[1].split("\ntotal")[0], re.M)
    assert set(jobs) - {"all"} == ALWAYS | PLANNED[name]


def test_a_campaign_of_one_bad_file_ends_with_a_report_that_names_it(tmp_path):
    folder = copied("bad_file_only", tmp_path)
    snakemake(folder, "all")
    (row,) = table(folder, "tables/excluded.csv")
    assert (row["cell"], row["test"], row["stage"]) == ("X", "capacity", "ingest")
    assert row["reason"].startswith("raw/letter.csv: of no instrument known here")
    page = (folder / "results/report.html").read_text(encoding="utf-8")
    assert "raw/letter.csv: of no instrument known here" in page
    assert "internal error" not in page
    assert [row["cell"] for row in table(folder, "summary.csv")] == ["X"]


def test_spectra_alone_are_fitted_and_nothing_is_left_out(tmp_path):
    """They are no series of current and voltage, and none of the rules for those is asked."""
    folder = copied("spectra_only", tmp_path)
    snakemake(folder, "results/tables/eis.csv")
    rows = table(folder, "tables/eis.csv")
    assert [row["test"] for row in rows] == [f"eis_{celsius}C_soc50" for celsius in (20, 10, 0)]
    transfer = [float(row["r_charge_transfer_ohm"]) for row in rows]
    assert transfer == sorted(transfer), "charge transfer is slower in the cold"
    assert not (folder / "results/ingest").exists()
