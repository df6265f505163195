"""Small campaigns (tests/campaigns): what is planned for which tests, and that it runs."""

import csv
import gzip
import json
import re
import shutil
import sys
from pathlib import Path

import pandas as pd
import pytest

sys.path.insert(0, str(Path(__file__).parent))
import starts
from quick import slow_but
from report_text import unpacked

ROOT = Path(__file__).resolve().parents[2]
CAMPAIGNS = ROOT / "tests" / "campaigns"
# Planned for every campaign, and for every one with a capacity test, with a model of its own.
ALWAYS = "tables_of_tests tables_of_models tables_of_health missing_effect summary report "
ALWAYS += "manifest contents crate figure_overview figures fleet fleet_health protocols_compared "
CAPACITY = "series capacity basis relaxation between_rests check_ups health effect_search "
CAPACITY += "witnesses "
MODELLED = "repeats identify model thermal export prediction effect_search_own "
# Of each campaign the other rules, among them the search, which says what it would need.
PLANNED = {
    name: set(f"{ALWAYS} {rules}".split())
    for name, rules in {
        "bad_file_only": f"{CAPACITY} no_model",
        "capacity_only": f"{CAPACITY} no_model",
        "loads_and_drive": f"{CAPACITY} {MODELLED} ica ica_discharge ocv_load",
        "ocv_pulses_drive": f"{CAPACITY} {MODELLED} ocv ica_discharge pulses polarisation",
        "spectra_only": "spectrum spectra_together impedance basis no_model temperature cold_limit",
        "pulses_over_temperature": f"{CAPACITY} repeats pulses temperature resistance_surface "
        "cold_limit no_model",
        "parallel_group": "series basis branches model export pack missing_effect_group "
        "pack_checks pack_decisions pack_model",
    }.items()
}


def snakemake(folder, *arguments):
    """Run Snakemake on a campaign; returns what it said."""
    done = starts.forked("--cores", "1", "--quiet", "host", "--directory", str(folder), *arguments)
    assert done.status == 0, done.said
    return done.said


def rules(said):
    """Rules of the jobs that Snakemake lists before it starts."""
    return set(re.findall(r"^(\w+) +\d+$", said.split("Job stats:")[1].split("\ntotal")[0], re.M))


def copied(name, folder):
    """A campaign in a place of its own."""
    made = shutil.ignore_patterns("results", "logs", ".snakemake")
    return shutil.copytree(CAMPAIGNS / name, folder / name, ignore=made)


def table(folder, name):
    with open(folder / "results" / name, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_every_campaign_is_told_of_and_planned_here():
    folders = {path.parents[1].name for path in CAMPAIGNS.glob("*/config/tests.tsv")}
    page = (CAMPAIGNS / "README.md").read_text(encoding="utf-8")
    assert folders == set(PLANNED) == set(re.findall(r"^\| `(\w+)` \|", page, re.M))


# The campaign of one bad file is run whole, and what was planned of it is looked at there.
@pytest.mark.parametrize(
    "name", slow_but("ocv_pulses_drive", sorted(set(PLANNED) - {"bad_file_only"}))
)
def test_what_is_planned_is_what_its_tests_carry(name, tmp_path):
    said = snakemake(copied(name, tmp_path), "--dry-run", "all")
    assert rules(said) - {"all"} == PLANNED[name]


@pytest.mark.slow
def test_a_campaign_of_one_bad_file_ends_with_a_report_that_names_it(tmp_path):
    folder = copied("bad_file_only", tmp_path)
    assert rules(snakemake(folder, "all")) - {"all"} == PLANNED["bad_file_only"]
    row, no_model = table(folder, "tables/excluded.csv")
    assert (no_model["cell"], no_model["stage"]) == ("X", "models")
    assert no_model["reason"].startswith("no model: loads at one rate only")
    assert (row["cell"], row["test"], row["stage"]) == ("X", "capacity", "ingest")
    assert row["reason"].startswith("raw/letter.csv: of no instrument known here")
    page = unpacked((folder / "results/report.html").read_text(encoding="utf-8"))
    assert "raw/letter.csv: of no instrument known here" in page
    assert "itself failed" not in page
    assert [row["cell"] for row in table(folder, "summary.csv")] == ["X"]


@pytest.mark.slow
def test_spectra_alone_are_fitted_and_nothing_is_left_out(tmp_path):
    """They are no series of current and voltage, and none of the rules for those is asked."""
    folder = copied("spectra_only", tmp_path)
    snakemake(folder, "results/tables/eis.csv")
    rows = table(folder, "tables/eis.csv")
    assert [row["test"] for row in rows] == [f"eis_{celsius}C_soc50" for celsius in (20, 10, 0)]
    transfer = [float(row["r_charge_transfer_ohm"]) for row in rows]
    assert transfer == sorted(transfer), "charge transfer is slower in the cold"
    assert not (folder / "results/ingest").exists()


def with_simulated_files(folder):
    """Give the drive and the pulses a simulated file, the capacity test one that is too short.

    The simulator is a perfect one: what was measured. Each file ends with the clock of its test.
    """
    sheet = folder / "config/tests.tsv"
    head, *rows = sheet.read_text(encoding="utf-8").splitlines()
    (folder / "raw").mkdir()
    lines = [f"{head}\tsimulated_file"]
    for row in rows:
        cells = row.split("\t")
        name, measured = cells[1], pd.read_csv(ROOT / cells[3])
        columns = {"Test Time / s": measured["Test Time / s"]}
        columns["Simulated Voltage / V"] = measured["Voltage / V"]
        rows_kept = len(measured) // 2 if name == "capacity_25C" else len(measured)
        pd.DataFrame(columns).iloc[:rows_kept].to_csv(folder / f"raw/{name}.csv", index=False)
        lines.append(row if name == "ocv_25C" else f"{row}\traw/{name}.csv")
    sheet.write_text("\n".join(lines) + "\n", encoding="utf-8")


@pytest.mark.slow
def test_a_simulator_of_the_users_is_asked_what_it_lacks(tmp_path):
    folder = copied("ocv_pulses_drive", tmp_path)
    with_simulated_files(folder)
    assert "effect_search_external" in rules(snakemake(folder, "--dry-run", "all"))
    path = "results/missing_effect/C5/external/verdict.json"
    snakemake(folder, path)
    verdict = json.loads((folder / path).read_text(encoding="utf-8"))
    assert (verdict["base"], verdict["verdict"]) == ("external", "none")
    (short,) = [note for note in verdict["provenance"]["notes"] if "capacity_25C" in note]
    assert "raw/capacity_25C.csv: simulated from 0.01 to" in short
    assert "the test has rows from 0.01 to" in short


@pytest.mark.slow
def test_a_raw_file_that_grows_makes_its_own_series_again_and_no_other(tmp_path):
    """A cycler writes on while the campaign is evaluated; another file is only touched."""
    folder = copied("ocv_pulses_drive", tmp_path)
    sheet = folder / "config/tests.tsv"
    text = sheet.read_text(encoding="utf-8")
    lines = {}
    for test in ("capacity_25C", "hppc_25C"):
        path = f"data/C5/{test}.bdf.csv.gz"
        text = text.replace(path, f"{test}.csv")
        lines[test] = gzip.decompress((ROOT / path).read_bytes()).splitlines(keepends=True)
        rows = len(lines[test])
        (folder / f"{test}.csv").write_bytes(b"".join(lines[test][: rows // 2]))
    # A checksum would say that a file is to stay as it is.
    sheet.write_text(re.sub(r"\b[0-9a-f]{64}\b", "", text), encoding="utf-8")
    wanted = [f"results/stages/segment/C5/{test}.parquet" for test in lines]
    snakemake(folder, *wanted)
    (folder / "capacity_25C.csv").write_bytes(b"".join(lines["capacity_25C"]))
    (folder / "hppc_25C.csv").touch()
    before = [(folder / path).stat().st_mtime_ns for path in wanted]
    snakemake(folder, *wanted)
    after = [(folder / path).stat().st_mtime_ns for path in wanted]
    assert [a > b for a, b in zip(after, before, strict=True)] == [True, False]
    assert len(pd.read_parquet(folder / wanted[0].replace("segment", "clean"))) > 0.9 * len(
        lines["capacity_25C"]
    )


def test_a_path_of_a_simulation_outside_the_campaign_is_a_fault_of_the_sheet(tmp_path):
    folder = copied("ocv_pulses_drive", tmp_path)
    with_simulated_files(folder)
    sheet = folder / "config/tests.tsv"
    text = sheet.read_text(encoding="utf-8").replace("raw/hppc_25C.csv", "../hppc_25C.csv")
    sheet.write_text(text, encoding="utf-8")
    done = starts.forked("--cores", "1", "--directory", str(folder), "--dry-run", "all")
    assert done.status != 0
    assert "simulated_file: found '../hppc_25C.csv'" in done.said


@pytest.mark.slow
def test_cells_in_series_and_groups_in_groups_have_rules_of_their_own(tmp_path):
    folder = copied("parallel_group", tmp_path)
    header, pair = (folder / "config/tests.tsv").read_text().splitlines()[:2]
    group = pair.split("\t")[0]
    with (folder / "config/cells.tsv").open("a") as cells:
        cells.writelines(f"X{k}\n" for k in (1, 2))
    wired = (folder / "config/groups.tsv").read_text().splitlines()
    columns = wired[0].split("\t")
    rows = [dict(zip(columns, line.split("\t"), strict=False)) for line in wired[1:]]
    first, second = (row["cell"] for row in rows[:2])
    string = [("string", 1, first), ("string", 2, second)]
    block = [("block", 1, group), ("block", 2, "X1")]
    head = "group\tposition\tcell\tconnection\n"
    lines = [f"{row['group']}\t{row['position']}\t{row['cell']}\n" for row in rows]
    lines += ["\t".join(map(str, row)) + "\tseries\n" for row in (*string, *block)]
    (folder / "config/groups.tsv").write_text(head + "".join(lines))
    tests = [pair, pair.replace(group, "string", 1), pair.replace(group, "block", 1)]
    (folder / "config/tests.tsv").write_text("\n".join([header, *tests]) + "\n")
    jobs = rules(snakemake(folder, "--dry-run", "all"))
    assert {"pack", "series_pack", "nested_pack", "pack_checks", "pack_model", "report"} <= jobs
