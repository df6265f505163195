"""Two runs compared: what differs, beside the intervals, and why."""

import json

import pytest

from cellwright.refusal import Refusal
from first_look import compare


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
    table, page = compare.write([change], tmp_path)
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
