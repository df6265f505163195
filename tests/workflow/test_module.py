"""The workflow as a module of another one: its rules renamed, its sheets and config that one's."""

import re
import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
import starts
import tiny
from quick import slow_but

from runtime import artefact

ROOT = Path(__file__).resolve().parents[2]
CAPACITY, TABLE = "results/stages/capacity/B/capacity.parquet", "results/tables/capacity.csv"
# As docs/api.md shows it, with a rule of its own before and after.
USING = """
configfile: "config/config.yaml"

rule everything:
    input: "largest.txt", "{capacity}"

module cellwright:
    snakefile: "{house}/workflow/Snakefile"
    config: config["cellwright"]

use rule * from cellwright as cellwright_*

use rule capacity from cellwright as cellwright_capacity with:
    message: "Capacity for the fleet: {{wildcards.cell}}."

rule largest:
    input: "{table}"
    output: "largest.txt"
    params: column="capacity_ampere_hour"
    script: "scripts/largest.py"
"""
# Its script has a module of its own beside it that bears the name of one of ours.
SCRIPT = """
from tables import largest
cell, names = largest(snakemake.input[0], snakemake.params.column), sorted(snakemake.params.keys())
with open(snakemake.output[0], "w") as file:
    print(cell, names, file=file)
"""
TABLES = """
import csv
def largest(path, column):
    with open(path, newline="") as file:
        return max(row["cell"] for row in csv.DictReader(file) if float(row[column]) > 1.9)
"""


def snakemake(folder, *arguments, start=starts.forked):
    """Run Snakemake as in an environment that has the packages, without the launcher `run`."""
    return start("--cores", "1", *arguments, folder=folder, environment=starts.plain())


def write(folder, using=USING):
    """The tiny campaign's capacity tests, and a workflow beside its sheets that uses ours."""
    _capacities(folder)
    (folder / "scripts").mkdir()
    (folder / "scripts/largest.py").write_text(SCRIPT)
    (folder / "scripts/tables.py").write_text(TABLES)
    chosen = "fleet: 7\ncellwright:\n  title: Fleet\n  clean:\n    gap_second: 60\n"
    (folder / "config/config.yaml").write_text(chosen)
    filled = using.format(house=ROOT, table=TABLE, capacity=CAPACITY)
    (folder / "Snakefile").write_text(filled)
    return folder


def _capacities(folder):
    """Write the tiny campaign with no other tests than these, a job of each kind is enough here."""
    sheet = tiny.write(folder) / "config/tests.tsv"
    head, *rows = sheet.read_text().splitlines(keepends=True)
    sheet.write_text(head + "".join(row for row in rows if "\tcapacity\tcapacity\t" in row))
    return folder


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """A workflow that uses ours, run to its own default target."""
    folder = write(tmp_path_factory.mktemp("module") / "fleet")
    return folder, *snakemake(folder, start=starts.anew)


@pytest.mark.slow
def test_its_default_target_is_made_by_our_jobs(fleet):
    folder, status, said = fleet
    assert status == 0, said
    assert "Capacity for the fleet: B." in said
    assert "cellwright_series" in said
    assert (folder / "largest.txt").read_text() == "A ['column']\n"


@pytest.mark.slow
def test_its_config_is_the_module_s_and_its_sheets_are_its_folder_s(fleet):
    about = artefact.read_about(fleet[0] / "results/stages/clean/B/capacity.parquet")
    assert about["params"]["clean"]["gap_second"] == 60
    assert about["params"]["clean"]["spike_limit_volt"] == 0.01
    assert about["reason"] is None


@pytest.mark.slow
def test_an_artefact_is_the_same_as_without_the_other_workflow(fleet, tmp_path):
    folder = _capacities(tmp_path / "alone")
    (folder / "config/config.yaml").write_text("clean:\n  gap_second: 60\n")
    house = ["--snakefile", str(ROOT / "Snakefile")]
    status, said = snakemake(folder, *house, CAPACITY)
    assert status == 0, said
    assert (folder / CAPACITY).read_bytes() == (fleet[0] / CAPACITY).read_bytes()


@pytest.mark.slow
def test_a_second_run_finds_nothing_to_do(fleet):
    profile = ["--workflow-profile", str(ROOT / "workflow/profiles/default")]
    assert "Nothing to be done" in snakemake(fleet[0], *profile)[1]


REFUSED = {
    "prefix": (
        'config: config["cellwright"]',
        'config: {{}}\n    prefix: "fleet/"',
        "a run of its own",
    ),
    "foreign key": (
        'config: config["cellwright"]',
        "config: config",
        "config of the module: found 'fleet'",
    ),
}


@pytest.mark.parametrize("case", slow_but("prefix", REFUSED))
def test_what_cannot_work_is_told_before_any_job(tmp_path, case):
    was, instead, words = REFUSED[case]
    status, said = snakemake(write(tmp_path / "fleet", USING.replace(was, instead)), "--dry-run")
    assert status != 0
    assert words in said
    assert "Job stats" not in said


def test_the_example_of_the_documents_plans_what_it_says(tmp_path):
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```snakemake\n(.*?)^```", page, re.M | re.S)
    folder = write(tmp_path / "fleet")
    (folder / "Snakefile").write_text(block.replace("path/to/cellwright", str(ROOT)))
    status, said = snakemake(folder, "--dry-run")
    assert status == 0, said
    jobs = dict(
        re.findall(r"^(\w+) +(\d+)$", said.split("Job stats:")[1].split("\ntotal")[0], re.M)
    )
    assert {"everything", "largest", "cellwright_tables_of_tests", "cellwright_series"} <= set(jobs)


@pytest.mark.slow
def test_a_workflow_without_its_scripts_says_that_a_clone_is_needed(tmp_path):
    shutil.copytree(ROOT / "workflow", tmp_path / "fetched" / "workflow")
    using = USING.replace("{house}", str(tmp_path / "fetched"))
    status, said = snakemake(write(tmp_path / "fleet", using), "--dry-run")
    assert status != 0
    assert "Cellwright runs from a clone on this disk" in said
