"""The record of real cells: what counts as worse, how it is renewed, what the page shows."""

import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from real_cells import page, record
from real_cells.measured import QUANTITIES

ROOT = Path(__file__).resolve().parents[2]
PLACE = {"cell": "A", "where": "25 °C"}
ROWS = [
    ("error of the chosen member", 10.0),
    ("gap closed", 80.0),
    ("capacity", 2.0),
    ("verdict", "none"),
    ("left out", 3),
    ("time of all jobs", 100.0),
]


def table(changes=None, without=(), **columns):
    """Numbers of a made-up campaign, some of them changed or left out."""
    values = {**dict(ROWS), **(changes or {})}
    rows = [{"quantity": q, "value": v, **PLACE} for q, v in values.items() if q not in without]
    return record.described(pd.DataFrame(rows), "made_up").assign(**columns)


def outcomes(changes=None, recorded=None, **options):
    recorded = table() if recorded is None else recorded
    rows = record.compare(recorded, table(changes, **options))
    return dict(zip(rows["quantity"], rows["outcome"], strict=True))


def test_the_same_numbers_are_the_same():
    assert set(outcomes().values()) == {record.SAME}


@pytest.mark.parametrize(
    ("quantity", "value", "wanted"),
    [
        ("error of the chosen member", 10.7, record.SAME),  # 5 % + 0.3 mV
        ("error of the chosen member", 10.9, record.WORSE),
        ("error of the chosen member", 9.0, record.BETTER),
        ("gap closed", 77.5, record.SAME),
        ("gap closed", 76.0, record.WORSE),
        ("gap closed", 90.0, record.BETTER),
        ("capacity", 2.003, record.SAME),
        ("capacity", 2.005, record.WORSE),
        ("capacity", 1.995, record.WORSE),
        ("verdict", "named", record.WORSE),
        ("left out", 4, record.WORSE),
        ("left out", 2, record.BETTER),
        ("time of all jobs", 1e6, record.SAME),
    ],
)
def test_what_counts_as_worse(quantity, value, wanted):
    found = outcomes({quantity: value})
    assert found.pop(quantity) == wanted
    assert set(found.values()) == {record.SAME}


def test_a_number_nearer_to_the_published_one_is_better():
    recorded = table().assign(published="2.1")
    assert outcomes({"capacity": 2.05}, recorded)["capacity"] == record.BETTER
    assert outcomes({"capacity": 1.95}, recorded)["capacity"] == record.WORSE


def test_missing_and_new_numbers_are_told_and_missing_ones_fail():
    assert outcomes(without=["capacity"])["capacity"] == record.MISSING
    assert outcomes(without=["verdict"])["verdict"] == record.MISSING
    assert outcomes(recorded=table(without=["capacity"]))["capacity"] == record.NEW
    assert record.MISSING in record.FAILING
    assert record.NEW not in record.FAILING


def test_of_what_is_not_left_out_any_more_there_is_none():
    assert outcomes(without=["left out"])["left out"] == record.BETTER


def test_campaigns_that_were_not_run_are_not_missing():
    others = table().assign(campaign="other")
    rows = record.compare(pd.concat([table(), others]), table())
    assert set(rows["campaign"]) == {"made_up"}
    assert record.not_recorded(others, table())[0].startswith("made_up: measured, and nothing")


def test_what_is_worse_is_told_with_place_values_and_tolerance():
    rows = record.compare(table(), table({"error of the chosen member": 20.0}))
    said = "\n".join(record.differences(rows))
    assert "Worse than recorded, beyond the tolerance (1):" in said
    assert (
        "made_up, A, error of the chosen member, 25 °C: recorded 10, found 20 mV, tolerance 0.8"
        in said
    )
    assert "5 of 6 numbers as recorded" in said


def test_a_tolerance_edited_by_hand_stays_and_a_blank_one_is_filled():
    recorded = table()
    capacity = recorded["quantity"] == "capacity"
    recorded.loc[capacity, "tolerance_relative"] = "0.05"
    recorded.loc[~capacity, "tolerance_relative"] = ""
    new = record.renewed(recorded, table({"capacity": 2.5, "gap closed": 90.0}))
    assert outcomes({"capacity": 2.6}, new)["capacity"] == record.SAME
    new = new.set_index("quantity")
    assert new["tolerance_relative"]["capacity"] == "0.05"
    assert new["tolerance_relative"]["error of the chosen member"] == "0.05"
    assert new["value"]["capacity"] == "2.5"


def test_renewing_leaves_campaigns_that_were_not_measured():
    others = table().assign(campaign="other")
    both = record.renewed(pd.concat([others, table()]), table(without=["capacity"]))
    assert (both["campaign"] == "other").sum() == len(ROWS)
    assert (both["campaign"] == "made_up").sum() == len(ROWS) - 1


def test_a_renewal_says_why_and_what(tmp_path, monkeypatch):
    monkeypatch.setattr(record, "RENEWALS", tmp_path / "renewals.md")
    path = tmp_path / "recorded.csv"
    record.renew(table(), "first record of all", path)
    record.renew(table({"capacity": 2.5}), "a better counter of charge", path)
    lines = (tmp_path / "renewals.md").read_text().splitlines()
    assert lines[-2].startswith("* recorded: first record of all (made_up: 5 of 5 numbers")
    assert lines[-1].startswith("* recorded: a better counter of charge (made_up: 1 of 5 numbers")
    assert record.last_reason("recorded").startswith("a better counter of charge")
    assert record.faults_of(record.read(path)) == []


def test_of_each_table_the_newest_renewals_are_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(record, "RENEWALS", tmp_path / "renewals.md")
    record.renew(table(), "as it was", tmp_path / "before.csv")
    for number in range(record.RENEWALS_KEPT + 3):
        record.renew(table(), f"reason {number}", tmp_path / "recorded.csv")
    lines = [x for x in (tmp_path / "renewals.md").read_text().splitlines() if x[:1] == "*"]
    assert len(lines) == 1 + record.RENEWALS_KEPT
    assert record.last_reason("before").startswith("as it was")
    assert lines[1].startswith("* recorded: reason 3 ")


@pytest.mark.parametrize("why", [None, "", "  ", "better"])
def test_a_renewal_without_a_reason_is_refused(why):
    with pytest.raises(ValueError, match="says why"):
        record.reason_of_renewal(why)


def test_the_command_refuses_without_a_reason_and_writes_nothing():
    before = record.RECORDED.read_bytes()
    command = [sys.executable, ROOT / "scripts/tools/real_record.py"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "--why" in done.stderr
    assert record.RECORDED.read_bytes() == before


def test_faults_of_an_edited_record_are_named():
    broken = pd.concat([table(), table().iloc[:1]])
    broken.iloc[0, broken.columns.get_loc("tolerance_absolute")] = "a little"
    found = record.faults_of(broken)
    assert found[0] == "line 2, tolerance_absolute: found 'a little', wanted a number from 0"
    assert "stands twice" in found[-1]


def test_the_page_has_a_column_for_each_temperature_and_the_numbers_before():
    cold = table({"capacity": 1.7}).replace({"where": {"25 °C": "-10 °C"}})
    before = table({"capacity": 2.4})
    text = page.text(pd.concat([table(), cold]).assign(published=""), before)
    assert "| cell | quantity | unit | -10 °C | 25 °C | may change by |" in text
    assert "| A | capacity | Ah | 1.7 | 2<br>before 2.4 | 0.2 % |" in text
    assert "| made_up | 10 |" in text


def test_every_quantity_has_a_side_and_words_have_no_tolerance():
    sides = {"lower", "higher", "near", "equal", "shown"}
    assert {one.better for one in QUANTITIES.values()} <= sides
    words = [one for one in QUANTITIES.values() if one.unit == "word"]
    assert all(one.absolute == one.relative == 0 for one in words)


def test_errors_against_the_truth_are_numbers_like_the_others():
    columns = ["table", "quantity", "unit", "state", "rms_error", "share", "n_missing"]
    scored = [
        ["capacity", "capacity_ampere_hour", "Ah", "scored", 0.004, None, 2],
        ["faults", "spike", "count", "scored", None, 0.5, 1],
        ["health", "soh", "1", "not made by the pipeline yet", None, None, None],
    ]
    found = list(record.errors_against_truth(pd.DataFrame(scored, columns=columns)))
    rows = record.described(
        pd.DataFrame(found, columns=["cell", "quantity", "where", "value", "unit"]), "demo"
    )
    assert rows[["where", "value", "unit", "better"]].values.tolist() == [
        ["capacity, capacity_ampere_hour", "0.004", "Ah", "lower"],
        ["capacity, capacity_ampere_hour", "2", "count", "lower"],
        ["faults, spike", "50", "%", "higher"],
        ["faults, spike", "1", "count", "lower"],
    ]
