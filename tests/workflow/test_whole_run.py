"""Whole runs on a tiny campaign: what comes out, what bad files cost, what runs again and when."""

import csv
import html
import json
import os
import re
import shutil
import sys
from contextlib import chdir
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import pytest

sys.path.insert(0, str(Path(__file__).parent))
import starts
import tiny
from report_text import unpacked

from cellwright.refusal import Refusal
from first_look import lineage
from runtime import artefact, use_page

ROOT = Path(__file__).resolve().parents[2]


class Run(NamedTuple):
    """A campaign's folder, and how Snakemake ended and what it said."""

    folder: Path
    status: int
    said: str


def snakemake(folder, *arguments, house=ROOT, start=starts.forked):
    asked = ("--cores", "2", "--quiet", "host", "--directory", str(folder), *arguments)
    done = start(*asked, folder=house)
    return Run(folder, *done)


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """The one whole run that all tests here look at; what is to be changed is copied first."""
    folder = tiny.write(tmp_path_factory.mktemp("run") / "tiny")
    return snakemake(folder, start=starts.anew)


@pytest.fixture
def copy(first, tmp_path):
    """The finished campaign in another place, for tests that change it."""
    return Path(shutil.copytree(first.folder, tmp_path / "copy"))


def table(run, name):
    with open(run.folder / "results/tables" / f"{name}.csv", encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def jobs(said):
    """Rule → number of jobs, from what Snakemake lists before it starts."""
    listed = said.split("Job stats:")[1].split("total")[0]
    return {rule: int(count) for rule, count in re.findall(r"^(\w+) +(\d+)$", listed, re.M)}


def report_of(folder):
    return (folder / "results/report.html").read_bytes()


def read(folder):
    """The report's text as its reader sees it."""
    return unpacked(report_of(folder).decode())


def test_bad_files_do_not_end_the_run(first):
    assert first.status == 0, first.said[-4000:]
    assert re.search(r"^Report: +results/report.html", first.said, re.M)
    assert "Traceback" not in first.said
    assert artefact.FAILED not in read(first.folder)


def test_a_row_is_explained_down_to_the_bytes_of_its_file(first, copy):
    """Of a table of all cells only what this row was made from; a file that changed is said."""
    raw = tiny.digest(copy / "raw/A_capacity.csv")[:12]
    table_of_capacities = copy / "results/tables/capacity.csv"
    row = ["cell=A", "test=capacity", "direction=charge"]
    said = lineage.explain(table_of_capacities, row)
    assert any("raw/A_capacity.csv" in line and raw in line for line in said)
    assert not any("/B/" in line for line in said)
    assert not any("CHANGED" in line or "missing" in line for line in said)
    (copy / "raw/A_capacity.csv").write_text("other")
    changed = [line for line in lineage.explain(table_of_capacities, row) if "CHANGED" in line]
    assert changed
    assert all("raw/A_capacity.csv" in line for line in changed)
    with pytest.raises(Refusal, match="found 2 lines"):
        lineage.explain(table_of_capacities, row[:2])
    with pytest.raises(Refusal, match="wanted the number of a line or COLUMN=VALUE"):
        lineage.explain(table_of_capacities, ["cells=A"])
    with pytest.raises(Refusal, match="wanted a table below results/"):
        lineage.explain(copy / "config/cells.tsv", ["2"])


def test_the_lines_for_python_work_as_the_page_prints_them(first):
    document = first.folder / "results/models/A"
    used = use_page.table("A", 2.0, document / "lookup.csv", document / "pybamm_thevenin.json")
    lines = {row[0].text: row[3].text for row in used.rows}
    with chdir(first.folder):
        for tool in ("Python", "Simulink and other tables"):
            *before, last = lines[tool].splitlines()
            names = {}
            exec("\n".join(before), names)
            assert len(eval(last, names)) > 1
    assert (first.folder / "results/models/thevenin.py").is_file()


def test_the_crate_says_which_job_made_each_file_of_what(first):
    document = json.loads((first.folder / "results/ro-crate-metadata.json").read_text())
    entities = {entity["@id"]: entity for entity in document["@graph"]}
    assert len(entities) == len(document["@graph"]), "an identity stands for one thing"
    for entity in document["@graph"]:
        for key in ("object", "result", "hasPart", "instrument", "step", "workExample", "mentions"):
            for other in (
                [entity[key]] if isinstance(entity.get(key), dict) else entity.get(key, [])
            ):
                assert other["@id"] in entities, f"{entity['@id']} names {other['@id']}"
    for path, digest in (line.split("\t")[::-1] for line in manifest_of(first.folder)):
        assert entities[path.removeprefix("results/")]["sha256"] == digest
    job = entities["#job/capacity/A/capacity"]
    assert job["result"] == {"@id": "stages/capacity/A/capacity.parquet"}
    assert {"@id": "stages/clean/A/capacity.parquet"} in job["object"]
    assert entities["#job/series/A/capacity"]["object"] == {"@id": "#raw/A_capacity.csv"}
    workflow = entities["stages/workflow/Snakefile"]
    assert workflow["programmingLanguage"]["@id"] in entities
    assert workflow["version"]
    assert workflow["encodingFormat"] == "text/plain"
    assert {"@id": "#job/capacity/A/capacity"} in entities["./"]["mentions"]
    tool = entities[job["instrument"]["@id"]]
    assert tool["@id"].startswith("swh:1:cnt:")
    assert tool["@id"].endswith(";path=/scripts/protocols/capacity.py")
    assert tool["softwareVersion"] in job["description"]
    assert datetime.fromisoformat(job["endTime"])
    assert "agent" not in job, "the campaign does not state its authors"


def manifest_of(folder):
    return (folder / "results/stages/manifest.tsv").read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize("bad", tiny.BAD)
def test_a_bad_file_is_out_with_what_was_found(first, bad):
    (row,) = [row for row in table(first, "excluded") if row["test"] == bad]
    raw = first.folder / row["file"]
    digest = tiny.digest(raw) if raw.is_file() else ""
    assert (row["cell"], row["stage"]) == ("B", "ingest")
    assert raw.name.startswith(bad)
    assert tiny.BAD[bad].format(digest=digest) in row["reason"]
    assert row["reason"] in html.unescape(read(first.folder))


def test_nothing_else_is_out(first):
    assert {row["test"] for row in table(first, "excluded")} == set(tiny.BAD)


@pytest.mark.parametrize("cell", tiny.TRUTH)
def test_capacity_of_every_good_test(first, cell):
    """A discharge at 2 A ends where the OCV lies the drop over R0 and R1 above the cut-off."""
    rows = [row for row in table(first, "capacity") if row["cell"] == cell]
    found = {(row["test"], row["direction"]): float(row["capacity_ampere_hour"]) for row in rows}
    tests = {"A": ["capacity", "ocv"], "B": ["capacity"]}[cell]
    assert set(found) == {(test, way) for test in tests for way in ("charge", "discharge")}
    assert found["capacity", "discharge"] == pytest.approx(tiny.delivered(cell, 2.0), abs=0.006)


def test_pulses_give_the_true_resistance(first):
    rows = [row for row in table(first, "resistance") if float(row["delay_second"]) == 0]
    assert {row["direction"] for row in rows} == {"charge", "discharge"}
    assert len(rows) >= 18
    for row in rows:
        error = max(3 * float(row["resistance_std_ohm"]), 1e-3)
        assert float(row["resistance_ohm"]) == pytest.approx(tiny.TRUTH["A"].r0_ohm, abs=error)


def test_models_carry_the_true_parameters(first):
    rows = [row for row in table(first, "models") if row["model"] == "1RC"]
    for cell, truth in tiny.TRUTH.items():
        r0 = [float(r["value"]) for r in rows if (r["cell"], r["parameter"]) == (cell, "r0")]
        assert sum(r0) / len(r0) == pytest.approx(truth.r0_ohm, rel=0.05)


def test_every_validation_drive_is_scored(first):
    """A by its own pulses; B by A's, scaled by what its discharge shows."""
    rows = [row for row in table(first, "validation") if row["chosen"] == "True"]
    errors = {(row["cell"], row["test"]): float(row["rmse_volt"]) for row in rows}
    assert errors == {
        ("A", "drive"): pytest.approx(0, abs=1e-3),
        ("B", "drive"): pytest.approx(0, abs=5e-3),
    }


def test_every_cell_with_a_test_for_proof_has_a_verdict(first):
    """Which verdict is for tests of the science: these records are a few minutes of a toy."""
    rows = table(first, "missing_effect")
    assert {row["cell"] for row in rows} == {"A", "B"}
    said = {row["cell"]: row["verdict"] for row in rows}
    assert set(said.values()) <= {"none", "named", "ambiguous", "unknown"}
    with open(first.folder / "results/summary.csv", encoding="utf-8", newline="") as file:
        assert {row["cell"]: row["verdict"] for row in csv.DictReader(file)} == said
    page = read(first.folder)
    assert page.count("What its model lacks") >= len(tiny.TRUTH)
    assert page.count("Effects that were tried") >= 1


@pytest.mark.slow
def test_a_cell_without_a_test_for_proof_is_told_why_it_has_no_verdict(copy):
    """That is no fault of any file: nothing is left out for it."""
    sheet = copy / "config/tests.tsv"
    rows = sheet.read_text().splitlines(keepends=True)
    sheet.write_text("".join(row for row in rows if not row.startswith("B\tdrive\t")))
    run = snakemake(copy, "missing_effect", "results/tables/excluded.csv")
    assert run.status == 0, run.said
    assert {row["cell"] for row in table(run, "missing_effect")} == {"A"}
    about = json.loads((copy / "results/missing_effect/B/verdict.json").read_text())["provenance"]
    assert "validation" in about["reason"]
    assert "missing_effect" not in {row["stage"] for row in table(run, "excluded")}


def test_a_group_with_one_test_is_told_why_it_has_no_verdict(first):
    path = first.folder / "results/missing_effect/pair/verdict.json"
    about = json.loads(path.read_text())["provenance"]
    assert "one of role validation, or three of role fit" in about["reason"]
    assert "What one of its branches has of its own" in read(first.folder)


def test_the_parallel_pair_is_scored(first):
    rows = table(first, "packs")
    assert [(row["group"], row["cell"]) for row in rows] == [("pair", "A"), ("pair", "B")]
    assert all(float(row["current_rmse_ampere"]) < 0.03 for row in rows)
    assert all(float(row["kcl_residual_ampere"]) < 1e-9 for row in rows)


def test_results_hold_the_laws_of_tests_artefacts(first):
    with open(first.folder / "results/tables/checks.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert rows
    assert [row for row in rows if row["outcome"] == "failed"] == []


def test_a_second_run_finds_nothing_to_do(copy):
    """New file times of the same bytes are no change."""
    before = report_of(copy)
    for path in [*copy.glob("raw/*"), *copy.glob("config/*")]:
        path.touch()
    assert "Nothing to be done" in snakemake(copy).said
    assert report_of(copy) == before


def test_a_file_replaced_by_an_older_one_is_seen(copy):
    """As `cp -p` and `rsync -a` leave it; the sheet's checksum says that it is another one."""
    path = tiny.save(copy, "B", "drive", seed=2)
    os.utime(path, (1e9, 1e9))
    target = "results/stages/clean/B/drive.parquet"
    made = snakemake(copy, target)
    assert jobs(made.said) == {"series": 1}
    with pytest.raises(artefact.Passed, match=r"B_drive.csv: SHA-256 is .*, tests.tsv says"):
        artefact.load(copy / target)


def test_a_changed_file_runs_only_what_comes_from_it(copy):
    tiny.restate(copy, tiny.save(copy, "B", "drive", seed=2))
    planned = snakemake(copy, "--dry-run").said
    on_the_way = "series prediction effect_search witnesses missing_effect missing_effect_group "
    on_the_way += "effect_search_own fleet "
    together = "figure_overview tables_of_models summary report manifest crate campaign "
    # Two of its rests may tell the capacity.
    on_the_way += "between_rests tables_of_health "
    # What the search says may change, and the model has it in it: Snakemake cannot know before.
    maybe = "model export thermal pack pack_checks pack_decisions pack_model"
    once = dict.fromkeys((on_the_way + together + maybe).split(), 1)
    # What the drive repeats of other tests; what tests for fits repeat does not hang on it.
    # Figures: of the cell and of its group.
    assert jobs(planned) == once | {"repeats": 1, "figures": 2}
    assert "Read B drive" in planned
    assert "Figures of A." not in planned


@pytest.mark.slow
def test_an_artefact_has_the_same_bytes_in_another_place(first, tmp_path):
    target = "results/stages/capacity/A/capacity.parquet"
    other = snakemake(tiny.write(tmp_path / "elsewhere"), target)
    assert other.status == 0
    assert (other.folder / target).read_bytes() == (first.folder / target).read_bytes()


def test_a_figure_that_cannot_be_drawn_says_why_and_takes_no_other_with_it(first):
    """The pair has one test alone: nothing was searched. B has bad files, and its other figures."""
    drawn = first.folder / "results/figures/B"
    assert len(list(drawn.glob("*.svg"))) >= 5
    blank = {path.stem for path in drawn.glob("*.svg") if "<path" not in path.read_text()}
    reasons = [json.loads(figure_about(drawn / f"{name}.svg"))["reason"] for name in blank]
    assert all(reasons)
    assert {"capacity", "records", "validation_drive", "soc_drive"} <= {
        path.stem for path in drawn.glob("*.svg")
    } - blank


def figure_about(path):
    """What a figure that could not be drawn says of itself."""
    return html.unescape(re.search(r"<desc>(.*?)</desc>", path.read_text(), re.S)[1])


@pytest.mark.slow
def test_a_report_made_again_has_the_same_bytes(copy):
    before = report_of(copy)
    (copy / "results/report.html").unlink()
    again = snakemake(copy)
    assert jobs(again.said) == {"report": 1, "manifest": 1, "crate": 1, "campaign": 1}
    assert report_of(copy) == before


@pytest.mark.slow
def test_a_strict_run_fails_but_writes_its_report(copy):
    (copy / "results/report.html").unlink()
    (copy / "config/config.yaml").write_text("title: Tiny\nstrict: true\n")
    run = snakemake(copy)
    assert run.status != 0
    assert "B empty: raw/empty.csv: the file is empty (0 bytes)" in run.said
    assert b"raw/empty.csv: the file is empty" in report_of(copy)


@pytest.mark.slow
def test_a_model_that_cannot_be_made_has_its_reason(copy):
    """Without a slow test or pulses the record of its group alone is left: it tells nothing."""
    sheet = copy / "config/tests.tsv"
    lines = sheet.read_text().splitlines(keepends=True)
    sheet.write_text("".join(row for row in lines if not {"ocv", "hppc"} & set(row.split("\t"))))
    path = "results/models/A.json"
    run = snakemake(copy, path)
    assert run.status == 0, run.said
    reason = artefact.read_about(copy / path)["reason"]
    assert reason.startswith("the record has no charge between two rests")


@pytest.mark.slow
def test_a_group_kept_for_validation_is_never_fitted(copy):
    """Its cells have no tests of their own: they stay without a model, and the run goes on."""
    roles = {"fitted": "fit", "kept": "validation"}
    cells, tests = copy / "config/cells.tsv", copy / "config/tests.tsv"
    row = next(row for row in tests.read_text().splitlines() if row.startswith("pair\t"))
    for group, role in roles.items():
        members = [f"{group}{position}" for position in (1, 2)]
        cells.write_text(cells.read_text() + "".join(f"{m}\t\t\t3.0\t4.2\t\n" for m in members))
        with open(copy / "config/groups.tsv", "a", encoding="utf-8") as groups:
            groups.writelines(f"{group}\t{k}\t{m}\n" for k, m in enumerate(members, start=1))
        # A file of its own, for what is fitted may not be kept for validation.
        raw = copy / f"raw/{group}.csv"
        raw.write_text((copy / "raw/pair.csv").read_text() + "\n" * (role == "validation"))
        fields = [group, *row.split("\t")[1:3], f"raw/{raw.name}", "25", "", role, tiny.digest(raw)]
        tests.write_text(tests.read_text() + "\t".join(fields) + "\n")
    run = snakemake(copy, "--dry-run")
    assert run.status == 0, run.said
    assert jobs(run.said)["branches"] == 1
    assert "Models of the cells of group fitted from" in run.said


@pytest.mark.slow
def test_verify_finds_what_was_edited_by_hand(copy):
    assert "Every artefact is as the manifest says.\n" in snakemake(copy, "verify").said
    edited = copy / "results/tables/capacity.csv"
    edited.write_text(edited.read_text().replace("discharge", "charge", 1))
    run = snakemake(copy, "verify")
    assert run.status != 0
    assert "results/tables/capacity.csv: changed since the run that made it" in run.said
    assert run.said.count("changed since the run") == 1
    assert "Report:" not in run.said, "it ends in its sentence"


def test_faults_of_the_sheets_are_told_at_once_before_any_job(tmp_path):
    folder = tiny.write(tmp_path / "tiny")
    tests, config = folder / "config/tests.tsv", folder / "config/config.yaml"
    rows = tests.read_text().splitlines()
    rows[1] = rows[1].replace("\tocv\tocv\t", "\tocv\tocvv\t")
    rows[2] = rows[2].replace("\t25\t", "\twarm\t")
    tests.write_text("\n".join([f"{rows[0]}\tcolour", *rows[1:], rows[3]]) + "\n")
    config.write_text("titel: Tiny\n")
    run = snakemake(folder)
    assert run.status != 0
    said = [line for line in run.said.splitlines() if "config/" in line]
    wanted = [
        ("config/config.yaml, line 1", "'titel'", "did you mean 'title'"),
        ("config/tests.tsv, line 1", "'colour'", "one of the columns"),
        ("config/tests.tsv, row 1 (line 2), kind", "'ocvv'", "did you mean 'ocv'"),
        ("config/tests.tsv, row 2 (line 3), ambient_temperature_celsius", "'warm'", "a number"),
        ("config/tests.tsv, row 19 (line 20), cell and test", "'A capacity'", "each once"),
    ]
    for parts in wanted:
        assert any(all(part in line for part in parts) for line in said), (parts, said)
    assert not (folder / "results").exists()


@pytest.mark.slow
def test_a_mended_contract_makes_anew_what_it_had_refused_and_nothing_else(tmp_path):
    house, folder = tmp_path / "house", tiny.write(tmp_path / "tiny")
    for name in ("workflow", "scripts"):
        shutil.copytree(ROOT / name, house / name)
    for name in ("Snakefile", "environment.lock"):
        shutil.copy(ROOT / name, house / name)
    schema = house / "workflow/schemas/artefacts.yaml"
    right = schema.read_text()
    place = right.index("    capacity_ampere_hour:", right.index("\ncapacity:\n"))
    narrow = right[place:].replace("range: [0, null]", "range: [0, 0.1]", 1)
    capacities = [f"results/stages/capacity/{cell}/capacity.parquet" for cell in tiny.TRUTH]
    wanted = [*capacities, "results/stages/segment/B/drive.parquet"]

    def made():
        run = snakemake(folder, *wanted, house=house)
        assert run.status == 0, run.said
        return run.said, {artefact.read_about(folder / path)["reason"] for path in capacities}

    schema.write_text(right[:place] + narrow)
    for reason in made()[1]:
        assert reason.startswith("left out of capacity: ")
        assert reason.endswith(" Ah, wanted 0 to 0.1; no row is left")
    schema.write_text(right)
    said, reasons = made()
    assert jobs(said) == {"capacity": 2}
    assert reasons == {None}
    schema.write_text(f"# Other words.\n{right.replace('discharge or charge', 'which way')}")
    assert "Nothing to be done" in made()[0]
