"""Answers made up, truth made up: what each is worth is known."""

import json

import numpy as np
import pytest

from effect_benchmark import answers as methods
from effect_benchmark import page, scoring

NAMES = ("effects", "gap_closed", "floor_volt", "validation_before_volt", "validation_after_volt")


def hidden(cell, kind, *effects, visible=True, millivolt=6.0):
    said = [{"effect": e, "target_gap_millivolt": millivolt, "accept": [e]} for e in effects]
    facts = {"kind": kind, "visible": visible, "none_acceptable": not visible}
    return {"cell": cell, **facts, "effects": said}


def answer(cell, word, *effects, method=methods.SEARCH, tied=(), gap=0.97):
    said = [{"effect": e, "alternatives": list(tied)} for e in effects]
    row = {"cell": cell, "method": method, "verdict": word, **dict.fromkeys(NAMES, np.nan)}
    row |= {"gap_closed": gap, "rounds": 2, "cpu_second": 1.5, "reason": ""}
    return row | {"document": json.dumps({"verdict": word, "effects": said})}


TRUTH = [
    hidden("h0000", "reference", visible=False),
    hidden("h0001", "none", visible=False),
    hidden("h0002", "none", visible=False),
    hidden("h0003", "single", "leakage"),
    hidden("h0004", "single", "self_heating", millivolt=2.5),
    hidden("h0005", "unknown", "ripple"),
    hidden("h0006", "two", "time_skew", "leakage"),
    hidden("h0007", "single", "voltage_gain"),
]
ANSWERS = [
    answer("h0001", "none"),
    answer("h0002", "named", "leakage"),
    answer("h0003", "ambiguous", "current_offset", tied=["leakage"]),
    answer("h0004", "named", "resistance_soc"),
    answer("h0005", "unknown"),
    answer("h0006", "named", "time_skew", "leakage", "ocv_edge"),
    answer("h0003", "unknown", method=methods.LEFT_OUT),
    answer("h0004", "named", "resistance_temperature", method=methods.LEFT_OUT),
    answer("h0003", "none", method=methods.RANDOM, gap=0.01),
]


@pytest.fixture
def table(tmp_path):
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth" / "missing_effect.json").write_text(json.dumps(TRUTH))
    return scoring.judged(tmp_path, ANSWERS)


def test_each_answer_is_worth_what_it_is(table):
    mine = table[table["method"] == methods.SEARCH].set_index("cell")["outcome"]
    assert mine.to_dict() == {
        "h0001": "right",
        "h0002": "false alarm",
        "h0003": "right, as one of a tie",
        "h0004": "false name",
        "h0005": "right",
        "h0006": "right",
        "h0007": "no verdict",
    }


def test_goals_count_what_they_say(table):
    found = {one.name: one for one in scoring.goals(table)}
    dynamic = found["right class of visible dynamic effects"]
    assert (dynamic.hits, dynamic.of, dynamic.reached) == (1, 2, False)
    assert found["the same at 6 mV"].reached is True
    assert found["false alarms on healthy cells"].share == 0.5
    assert found["an extra name beside two effects"].hits == 1
    assert found["cells by physics, paired: right class"].reached is None
    assert found["CPU time a cell and round, median"].value == pytest.approx(0.75)


@pytest.mark.parametrize(("names", "handled"), [(["leakage", "time_skew"], 1), (["time_skew"], 0)])
def test_of_two_names_one_that_the_log_at_rest_resolves_may_be_told_first(tmp_path, names, handled):
    both = hidden("h0001", "two", "time_skew", "leakage")
    both["effects"][1]["accept"] = ["leakage", "current_offset"]
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth" / "missing_effect.json").write_text(json.dumps([both]))
    judged = scoring.judged(tmp_path, [answer("h0001", "named", *names)])
    goals = {one.name: one for one in scoring.goals(judged)}
    found = goals["offset or leak: as a tie, or by the log at rest"]
    assert (found.hits, found.of) == (handled, handled)


def test_without_its_class_unknown_is_right(table):
    found = {one.name: one.hits for one in scoring.left_out(table)}
    assert found["called unknown"] == 1
    assert found["another name"] == 1


def test_a_cell_without_an_answer_counts_as_not_right(table):
    rows = {row["effect"]: row["right"] for row in scoring.power(table)}
    assert (rows["voltage_gain"].hits, rows["voltage_gain"].of) == (0, 1)
    assert [row["cell"] for row in scoring.misses(table)] == ["h0002", "h0004", "h0007"]


def test_confusion_counts_every_answer_once(table):
    assert scoring.confusion(table).to_numpy().sum() == 6


def test_columns_have_no_gaps_in_their_texts(table):
    columns = scoring.flat(table)
    assert all(isinstance(value, str) for value in columns["verdict"])
    assert columns["extra_names"].dtype == float


def test_the_page_says_every_goal_and_marks_what_was_missed(table):
    text = page.markdown(table, "seed=1")
    assert all(one.name in text for one in scoring.goals(table))
    assert "50.0 % (9.5–90.5), 1 of 2 | **no** |" in text
    assert "1 were not" in text


def test_figures_are_drawn(table):
    assert len(page.power(table).axes) >= 4
    assert page.confusion(table).axes[0].get_xlabel() == "first answer"


BRANCH = {"branch": 2}
GROUP_TRUTH = [
    hidden("g0001", "single", "branch_capacity"),
    hidden("g0002", "none", visible=False),
    hidden("g0003", "single", "branch_temperature"),
]
for one in (e for row in GROUP_TRUTH for e in row["effects"]):
    one["parameters"] = BRANCH


def group_answer(cell, word, *effects, method=methods.SEARCH, branch=2, tied=()):
    row = answer(cell, word, *effects, method=method, tied=tied)
    document = json.loads(row["document"])
    document["effects"] = [one | {"branch": branch} for one in document["effects"]]
    return row | {"document": json.dumps(document)}


GROUP_ANSWERS = [
    group_answer("g0001", "named", "branch_capacity"),
    group_answer("g0002", "none"),
    group_answer("g0003", "named", "branch_temperature", branch=1),
    group_answer("g0001", "ambiguous", "branch_current_gain", method=methods.BLIND, tied=BRANCH),
    group_answer("g0002", "none", method=methods.BLIND),
]


def test_groups_are_told_by_what_was_logged(tmp_path):
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth" / "missing_effect.json").write_text(json.dumps(GROUP_TRUTH))
    table = scoring.judged(tmp_path, GROUP_ANSWERS)
    logged, one_temperature, blind = scoring.groups(table)
    counts = {name: (logged[name].hits, logged[name].of) for name in ("first", "branch", "alarms")}
    assert counts == {"first": (2, 2), "branch": (1, 2), "alarms": (0, 1)}
    assert one_temperature["first"].of == 0
    assert (blind["first"].hits, blind["sensors"].hits, blind["sensors"].of) == (0, 1, 2)
    assert "the group's voltage and current only" in page.markdown(table, "seed=1")
