"""Two runs compared: what differs, beside the intervals, and why."""

import json
from contextlib import chdir
from pathlib import Path

import pytest

from cellwright.refusal import Refusal
from first_look import compare
from first_look import lineage as explain
from runtime import tables


def run(folder, soh, std="0.01", code="aa", digest="11", celsius=None):
    """A campaign that was run, with one cell whose summary was made from one raw file."""
    results = folder / "results"
    (results / "stages/basis").mkdir(parents=True)
    row = f"A,{soh},{std},2RC\n"
    (results / "summary.csv").write_text("cell,soh,soh_std,best_model\n" + row)
    about = {"rule": "summary", "params": {}, "code": "s"}
    about["inputs"] = {"results/stages/basis/A.json": "22"}
    (results / "summary.csv.provenance.json").write_text(json.dumps(about))
    facts = {"test": {"cycle": 3, "ambient_temperature_celsius": celsius}}
    made = {"rule": "basis", "params": facts, "code": code, "inputs": {"raw/a.csv": digest}}
    made["wildcards"] = {"cell": "A", "test": "slow"}
    (results / "stages/basis/A.json").write_text(json.dumps({"provenance": made}))
    return folder


def test_a_change_stands_beside_both_intervals_with_its_reason(tmp_path):
    """0.95 to 0.90 with 0.01 of either: 0.05/(0.01·√2) = 3.5 standard deviations."""
    before = run(tmp_path / "a", 0.95)
    after = run(tmp_path / "b", 0.90, code="bb", digest="33")
    (change,) = compare.compare(before, after)
    assert (change.row, change.quantity, change.before, change.after) == ("A", "soh", "0.95", "0.9")
    assert change.deviations == pytest.approx(3.54, abs=0.01)
    assert change.why == "file raw/a.csv; code of basis"
    table, page = compare.write([change], tmp_path / "not/there")
    assert table.read_text().splitlines()[1].startswith("summary,A,soh,0.95,0.9,3.54,")
    text = page.read_text()
    assert 'class="worst">3.54</td>' in text
    assert 'id="comparison/table-summary"' in text
    assert "file raw/a.csv; code of basis" in text


def test_the_same_numbers_are_no_change_and_rounding_is_none(tmp_path):
    before, after = run(tmp_path / "a", 0.95), run(tmp_path / "b", 0.9500000001)
    assert compare.compare(before, after) == []


def test_a_row_of_the_sheet_that_says_otherwise_is_named_and_its_numbers_stay_beside(tmp_path):
    """They are those of the same test, though its row now begins with another temperature."""
    folders = []
    for name, celsius in (("a", None), ("b", 25.0)):
        folders.append(run(tmp_path / name, 0.95, celsius=celsius))
        (folders[-1] / "results/tables").mkdir()
        rows = f"A,slow,{celsius or ''},2.5\nA,fast,,2.4\n"
        columns = "cell,test,ambient_temperature_celsius,capacity_ampere_hour\n"
        (folders[-1] / "results/tables/capacity.csv").write_text(columns + rows)
    (change,) = compare.compare(*folders)
    said = change.table, change.row, change.quantity, change.before, change.after
    assert said == ("capacity", "A slow", "ambient_temperature_celsius", "", "25.0")
    assert change.why == "setting ambient_temperature_celsius of slow"


def test_what_was_not_run_is_refused(tmp_path):
    with pytest.raises(Refusal, match=r"found no results/summary.csv"):
        compare.compare(run(tmp_path / "a", 0.95), tmp_path / "b")


def with_manifest(folder):
    """A campaign whose manifest has its files as they are now."""
    with chdir(folder):
        files = [path for path in Path("results").rglob("*") if path.is_file()]
        Path("results/stages/manifest.tsv").write_text(tables.manifest(map(str, files)))
    return folder


def test_an_edited_table_is_told_as_edited(tmp_path):
    before, after = (with_manifest(run(tmp_path / name, 0.95)) for name in "ab")
    table = after / "results/summary.csv"
    assert not any("EDITED" in line for line in explain.explain(table, ["2"]))
    table.write_text(table.read_text().replace("0.95", "0.85"))
    (change,) = compare.compare(before, after)
    assert change.why.startswith(f"results/summary.csv of {after} EDITED: not as the manifest")
    assert "other cells" not in change.why
    assert any("results/summary.csv, EDITED" in line for line in explain.explain(table, ["2"]))


def test_an_artefact_that_is_no_table_is_explained_without_a_row(tmp_path):
    basis = run(tmp_path, 0.95) / "results/stages/basis/A.json"
    said = explain.explain(basis, [])
    assert said[:2] == ["results/stages/basis/A.json", "made from"]
    assert "by rule basis, code aa" in said[2]
    assert "raw/a.csv, sha256 11, missing" in said[3]
    with pytest.raises(Refusal, match="found the row 2, wanted none: it is no table"):
        explain.explain(basis, ["2"])
    with pytest.raises(Refusal, match="found no row, wanted the number of a line"):
        explain.explain(tmp_path / "results/summary.csv", [])


@pytest.mark.parametrize(
    ("place", "found"),
    [("results/no.csv", "no such file"), ("results", "a folder"), ("raw.csv", "no result")],
)
def test_what_is_no_result_is_told_as_what_it_is(tmp_path, place, found):
    (run(tmp_path, 0.95) / "raw.csv").write_text("time\n")
    with pytest.raises(Refusal, match=f"found {found}, wanted a table below results/"):
        explain.explain(tmp_path / place, ["2"])


def test_a_row_shows_its_own_doubts_and_not_those_of_its_table(tmp_path):
    folder = run(tmp_path, 0.95)
    (folder / "results/tables").mkdir()
    table = folder / "results/tables/capacity.csv"
    table.write_text("cell,test\nA,slow\nA,fast\nB,slow\n")
    about = {"rule": "tables", "code": "t", "inputs": {}}
    about["doubts"] = {"A slow": "drifts", "A ": "worn", "B slow": "short"}
    (folder / "results/tables/capacity.csv.provenance.json").write_text(json.dumps(about))
    shown = {row: " ".join(explain.explain(table, [row])) for row in "234"}
    of = {row: [w for w in ("drifts", "worn", "short") if w in s] for row, s in shown.items()}
    assert of == {"2": ["drifts", "worn"], "3": ["worn"], "4": ["short"]}
