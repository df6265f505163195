"""The record of real cells: what counts as worse, how it is renewed, what the page shows."""

import pandas as pd
import pytest

from real_cells import record

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


def test_campaigns_that_were_not_run_are_not_missing():
    others = table().assign(campaign="other")
    rows = record.compare(pd.concat([table(), others]), table())
    assert set(rows["campaign"]) == {"made_up"}
    assert record.not_recorded(others, table())[0].startswith("made_up: measured, and nothing")


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


@pytest.mark.parametrize("why", [None, "", "  ", "better"])
def test_a_renewal_without_a_reason_is_refused(why):
    with pytest.raises(ValueError, match="says why"):
        record.reason_of_renewal(why)


def test_faults_of_an_edited_record_are_named():
    broken = pd.concat([table(), table().iloc[:1]])
    broken.iloc[0, broken.columns.get_loc("tolerance_absolute")] = "a little"
    found = record.faults_of(broken)
    assert found[0] == "line 2, tolerance_absolute: found 'a little', wanted a number from 0"
    assert "stands twice" in found[-1]


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
