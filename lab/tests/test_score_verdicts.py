"""Verdicts against what was hidden, and the page that tells it all."""

import json
import re

import pandas as pd
import pytest

from runtime import contract
from virtual_lab.score import files, page, summary, verdicts


def hidden(kind, *effects, visible=True, silent=False, accept=()):
    known = [{"effect": e, "accept": [e, *accept], "parameters": {"x_ohm": 1.0}} for e in effects]
    return {"kind": kind, "visible": visible, "none_acceptable": silent, "effects": known}


def said(verdict, *effects, alternatives=()):
    one = {"alternatives": list(alternatives), "gap_closed": 0.9}
    one["parameters"] = {"x_ohm": {"value": 1.1, "std": 0.1, "unit": "Ohm"}}
    return {"verdict": verdict, "effects": [{"effect": e, **one} for e in effects]}


CASES = [
    (hidden("none"), said("none"), "right"),
    (hidden("reference"), said("named", "leakage"), "false alarm"),
    (hidden("none"), said("unknown"), "false alarm"),
    (hidden("single", "leakage"), said("named", "leakage"), "right"),
    (
        hidden("single", "leakage", accept=["current_offset"]),
        said("named", "current_offset"),
        "right",
    ),
    (hidden("single", "leakage"), said("named", "ocv_edge"), "false name"),
    (
        hidden("single", "leakage"),
        said("ambiguous", "ocv_edge", alternatives=["leakage"]),
        "right, as one of a tie",
    ),
    (hidden("single", "leakage"), said("none"), "missed"),
    (hidden("single", "leakage", silent=True), said("none"), "rightly silent"),
    (hidden("single", "leakage"), said("unknown"), "called unknown"),
    (hidden("two", "leakage", "time_skew"), said("named", "time_skew", "leakage"), "right"),
    (hidden("two", "leakage", "time_skew"), said("named", "time_skew"), "one of two"),
    (hidden("two", "leakage", "time_skew"), said("named", "ocv_edge"), "false name"),
    (hidden("unknown"), said("unknown"), "right"),
    (hidden("unknown"), said("named", "leakage"), "false name"),
    (hidden("single", "leakage"), None, "no verdict"),
]


@pytest.mark.parametrize(("truth", "verdict", "outcome"), CASES)
def test_a_verdict_is_worth_what_it_says(truth, verdict, outcome):
    assert verdicts.outcome(truth, verdict) == outcome


def test_one_name_does_not_count_for_two_hidden_effects():
    truth = hidden("two", "leakage", "current_offset", accept=["leakage", "current_offset"])
    assert verdicts.outcome(truth, said("named", "leakage")) == "one of two"
    assert verdicts.outcome(truth, said("named", "leakage", "current_offset")) == "right"


@pytest.fixture
def place(tmp_path):
    """A campaign of verdicts only: each of the cases a cell."""
    place = files.campaign(tmp_path)
    place.truth.mkdir()
    cells = {f"c{k:02d}": case for k, case in enumerate(CASES)}
    truth = json.dumps({cell: case[0] for cell, case in cells.items()})
    (place.truth / "missing_effect.json").write_text(truth)
    for cell, (_, verdict, _) in cells.items():
        path = place.results / "missing_effect" / cell / "verdict.json"
        path.parent.mkdir(parents=True)
        path.write_text(json.dumps(verdict))
    return place


def test_every_cell_counts_once_in_the_confusion(place):
    judged = verdicts.compare(place)
    assert judged["outcome"].tolist() == [outcome for _, _, outcome in CASES]
    assert verdicts.confusion(judged).to_numpy().sum() == len(CASES)
    assert verdicts.answers(judged).to_numpy().sum() == len(CASES)
    assert verdicts.confusion(judged).loc["two effects", "one of two"] == 1


def test_rates_are_shares_of_the_cells_that_they_are_about(place):
    rates = {name: (hits, of) for name, hits, of in verdicts.rates(verdicts.compare(place))}
    assert rates["false alarm on a healthy cell"] == (2, 3)
    assert rates["unknown effect called unknown"] == (1, 2)
    assert rates["both names of two visible effects"] == (1, 3)
    assert rates["right name of one visible effect"] == (3, 7)
    assert rates["false name of a hidden effect"] == (3, 12)


def test_power_counts_cells_of_one_effect_by_strength(place):
    judged = verdicts.compare(place).assign(strength_millivolt=6.0)
    counts = verdicts.power(judged).loc["leakage, 6 mV"]
    of = [case for case in CASES if case[0]["kind"] == "single"]
    outcomes = [outcome for *_, outcome in of]
    assert counts["cells"] == counts["visible"] == len(of)
    assert counts["named right"] == sum(outcome in verdicts.NAMED for outcome in outcomes)
    assert counts["right or rightly silent"] == counts["named right"] + 1
    assert not len(verdicts.power(judged[judged["kind"] != "single"]))


def test_parameters_of_rightly_named_effects_are_scored(place):
    rows = verdicts.parameters(place)
    assert set(rows["quantity"]) == {"leakage: x_ohm", "time_skew: x_ohm"}
    assert rows["error"].to_numpy() == pytest.approx(0.1)
    assert rows["inside_95"].all()


def test_truth_as_rows_and_under_cells_is_the_same(place):
    path = place.truth / "missing_effect.json"
    plain, known = verdicts.compare(place), json.loads(path.read_text())
    for form in ({"cells": known}, [{"cell": cell, **row} for cell, row in known.items()]):
        path.write_text(json.dumps(form))
        pd.testing.assert_frame_equal(verdicts.compare(place), plain)


def test_every_table_of_the_contract_is_scored_or_said_not_to_be(place):
    made = {stage.removeprefix("tables/") for stage in contract.stages() if "tables/" in stage}
    known = set(summary.score(place).summary["table"])
    # The fleet says of verdicts, which are scored, which cells of a type share them.
    assert made - {"checks", "fleet"} <= known
    assert set(page.ABOUT) < known == set(summary.QUANTITIES)


def test_a_table_without_truth_or_results_says_so(place):
    rows = {"cell": ["a"], "test": ["t"], "direction": ["charge"], "c_rate": [1.0]}
    rows = pd.DataFrame(rows | {"capacity_ampere_hour": [5.0]})
    (place.results / "tables").mkdir()
    rows.to_csv(place.truth / "capacity.csv", index=False)
    rows.assign(peak=1).to_csv(place.results / "tables" / "ica.csv", index=False)
    states = summary.score(place).summary.groupby("table")["state"].unique().map(list)
    assert states["capacity"] == ["not made by the pipeline yet"]
    assert states["ica"] == ["no truth"]
    assert states["packs"] == ["no truth, and not made by the pipeline yet"]


def test_the_page_is_whole_by_itself_and_the_same_each_time(place):
    page.write(place, title="A score & more")
    folder = place.results / "score"
    first = {path.name: path.read_bytes() for path in folder.iterdir()}
    page.write(place, title="A score & more")
    assert first == {path.name: path.read_bytes() for path in folder.iterdir()}
    assert set(first) == {"score.csv", "errors.csv", "verdicts.csv", "score.html"}
    text = first["score.html"].decode()
    assert "A score &amp; more" in text
    assert not re.findall(r'(?:src|href)="(?!#|data:)', text)
    for name, (title, _) in page.ABOUT.items():
        assert f'<section id="table-{name}">\n<h1>{title}</h1>' in text


def test_markdown_has_the_same_cells_in_every_row(place):
    lines = [line for line in page.markdown(summary.score(place)).splitlines() if line[:1] == "|"]
    assert len({line.count("|") for line in lines}) == 1
    assert len(lines) > 5
