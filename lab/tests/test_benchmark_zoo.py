"""The judge of the zoo on truths and verdicts made up: what each is worth is known."""

import json

import numpy as np
import pytest

from effect_benchmark.zoo import judging, page
from effect_benchmark.zoo.__main__ import line
from effect_benchmark.zoo.settled import is_settled, question_of

NAN = float("nan")


def hidden(cell, kind, *effects, visible=True, **more):
    entries = [
        {"effect": e, "validation_gap_millivolt": 6.0, "accept": [e], "form": "own"} | more
        for e in effects
    ]
    facts = {"kind": kind, "visible": visible, "none_acceptable": not visible}
    return {"cell": cell, **facts, "effects": entries}


def answer(cell, word, *effects, gap=0.97, sizes=None, **more):
    entries = [
        {"effect": e, "alternatives": [], "gap_closed": gap, "parameters": sizes or {}}
        for e in effects
    ]
    document = {"verdict": word, "effects": entries, "floor_volt": 1e-3, "paragraph": "It is so."}
    document["validation_rmse_volt"] = {"before": 6e-3, "after": 1e-3}
    row = {"cell": cell, "campaign": "", "verdict": word, "rounds": len(effects) + 1}
    return row | {"cpu_second": 3.0, "reason": "", "document": json.dumps(document | more)}


def test_an_effect_that_the_judging_records_do_not_show_has_no_strength():
    """A gap of 0 mV on them is a measured one; only where there is none do others stand for it."""
    one = hidden("a4", "single", "leakage", validation_gap_millivolt=0.0, visible_gap_millivolt=5.0)
    assert judging.strength(one) == 0.0
    one["effects"][0]["validation_gap_millivolt"] = None
    assert judging.strength(one) == 5.0
    assert judging.strength(hidden("a2", "none")) == 0.0


TRUTH = [
    hidden("a1", "reference", visible=False),
    hidden("a2", "none", visible=False),
    hidden("a3", "none", visible=False),
    hidden("a4", "single", "leakage"),
    hidden("a5", "single", "self_heating"),
    hidden("a6", "single", "slow_diffusion", parts=["polarisation_soc"]),
    hidden("a7", "two", "time_skew", "leakage"),
    hidden("a8", "unknown", "contact", accept=[]),
    hidden("a9", "unknown", "pick_up", accept=["time_skew"]),
    hidden("b1", "sheet", "voltage_offset", visible=False),
    hidden("b2", "sheet", "voltmeter_drift", visible=False),
    hidden("b3", "single", "entropic_ocv") | {"unproven": True},
    hidden("b4", "single", "voltage_gain", visible=False),
]
ANSWERS = [
    answer("a2", "none"),
    answer("a3", "unknown"),
    answer("a4", "named", "leakage", "ocv_edge"),
    answer("a5", "named", "resistance_temperature"),
    answer("a6", "named", "slow_diffusion", "polarisation_soc", gap=0.8),
    answer("a7", "named", "time_skew"),
    answer("a8", "named", "resistance_soc"),
    answer("a9", "named", "time_skew"),
    answer("b1", "named", "voltage_offset"),
    answer("b2", "named", "leakage"),
    answer("b3", "none", unproven=["entropic_ocv"]),
    answer("b4", "none"),
]
WORTH = {
    "a2": "right",
    "a3": "false alarm",
    "a4": "right",
    "a5": "false name",
    "a6": "right",
    "a7": "one of two",
    "a8": "false name",
    "a9": "right",
    "b1": "right",
    "b2": "false name",
    "b3": "right",
    "b4": "rightly silent",
}


@pytest.fixture
def folder(tmp_path):
    for name in ("truth", "config"):
        (tmp_path / name).mkdir()
    (tmp_path / "truth" / "missing_effect.json").write_text(json.dumps(TRUTH))
    (tmp_path / "config" / "cells.tsv").write_text("cell\n")
    return tmp_path


@pytest.fixture
def rows(folder):
    return judging.of_part("forms", folder, ANSWERS)


def test_each_answer_is_worth_what_it_is(rows):
    assert {row.cell: row.outcome for row in rows} == WORTH
    assert {row.cell: row.extra for row in rows if row.extra} == {"a4": 1}


def test_shares_count_right_false_extra_and_none(rows):
    shares = {one.name: one for one in judging.shares(rows, "forms")}
    counts = {
        "visible effects right": (3, 5),
        "false names": (1, 6),
        "extra names": (1, 6),
        "healthy anything but none": (1, 2),
        "sheet or sensor wrong: anything else": (1, 2),
        "outside the vocabulary, given a name": (1, 2),
    }
    assert {name: (shares[name].hits, shares[name].of) for name in counts} == counts
    assert shares["visible effects right"].wanted == 0.8
    assert shares["visible effects right"].reached is False
    # Of the two right names that were proven: 0.97 and 0.8.
    assert shares["gap closed, median"].value == pytest.approx(0.885)
    assert shares["CPU a cell and round, median"].value == pytest.approx(1.5)
    named = {one.name: one for one in judging.shares(rows)}["visible effects right"]
    assert named.reached is None


def test_a_cell_without_an_answer_counts_as_not_right(folder):
    rows = judging.of_part("forms", folder, [])
    assert {row.outcome for row in rows} == {"no verdict"}
    assert judging.shares(rows)[0].share == 0
    assert all(one.of == 0 for one in judging.shares(rows)[1:])


def test_sizes_are_compared_as_people_use_them_where_the_truth_tells_these(folder):
    """An amplitude of a wave is no entropic coefficient, though both are V/K."""
    truth = hidden("a4", "single", "entropic_ocv", sizes=[0.2, None, -0.1])
    truth["effects"][0]["parameters"] = {"coefficient_volt_per_kelvin": 5e-4}
    (folder / "truth" / "missing_effect.json").write_text(json.dumps([truth]))
    own = {"coefficient_volt_per_kelvin": {"value": 5e-4, "std": 1e-5, "unit": "V/K"}}
    one = answer("a4", "named", "entropic_ocv", sizes=own)
    document = json.loads(one["document"])
    told = [(0.21, 0.01), (9.0, 0.01), (-0.2, 0.01)]
    document["effects"][0]["sizes"] = [{"value": value, "std": std} for value, std in told]
    row = judging.of_part("forms", folder, [one | {"document": json.dumps(document)}])[0]
    assert row.sizes_inside == (True, False)


def test_of_a_tie_only_the_sizes_of_its_own_name_are_compared(folder):
    truth = hidden("a4", "single", "polarisation_soc", sizes=[23.0])
    (folder / "truth" / "missing_effect.json").write_text(json.dumps([truth]))
    one = answer("a4", "ambiguous", "slow_diffusion")
    document = json.loads(one["document"])
    document["effects"][0] |= {
        "alternatives": ["polarisation_soc"],
        "sizes": [{"value": 3.5, "std": 0.4}],
    }
    row = judging.of_part("forms", folder, [one | {"document": json.dumps(document)}])[0]
    assert row.content
    assert row.sizes_inside == ()


def test_sizes_and_probabilities_are_held_against_the_truth(folder):
    truth = hidden("a4", "single", "leakage", parameters={"leak_ampere": 0.02, "shape": "even"})
    (folder / "truth" / "missing_effect.json").write_text(json.dumps([truth]))
    sizes = {"leak_ampere": {"value": 0.0225, "std": 0.001, "unit": "A"}}
    said = {"leakage": 0.7, "none": 0.2, "leakage + time_skew": 0.1}
    one = answer("a4", "named", "leakage", sizes=sizes, probabilities=said)
    row = judging.of_part("forms", folder, [one])[0]
    assert row.sizes_inside == (False,)
    assert dict(row.said_probabilities) == {0.7: True, 0.2: False, 0.1: True}
    bins = judging.calibration([row])
    assert [(round(k["said"], 2), k["right"].hits, k["right"].of) for k in bins] == [
        (0.1, 1, 1),
        (0.2, 0, 1),
        (0.7, 1, 1),
    ]
    told = {one.name: one for one in judging.shares([row])}
    assert told["best answer: said minus right"].value == pytest.approx(0.3)


def test_several_campaigns_make_one_part(folder, tmp_path_factory):
    part = tmp_path_factory.mktemp("planted")
    for name in ("a123", "panasonic"):
        (part / name).mkdir()
        for inside in ("truth", "config"):
            (part / name / inside).mkdir()
        (part / name / "config" / "cells.tsv").write_text("cell\n")
        (part / name / "truth" / "missing_effect.json").write_text(json.dumps(TRUTH[1:2]))
    answers = [ANSWERS[0] | {"campaign": "a123"}]
    rows = judging.of_part("planted", part, answers)
    assert {row.cell: row.outcome for row in rows} == {
        "a123/a2": "right",
        "panasonic/a2": "no verdict",
    }


def test_a_line_and_the_page_say_what_is_wrong(rows):
    by_cell = {row.cell: row for row in rows}
    assert "WRONG false name" in line(by_cell["a5"])
    assert "WRONG right +1 extra" in line(by_cell["a4"])
    assert "ok    right" in line(by_cell["a6"])
    text = page.markdown(rows, {"physics": "no solver"}, "seed 1")
    wrong = text.split("## Where it is wrong")[1]
    assert {cell for cell in WORTH if f"| {cell} |" in wrong} == {
        "a3",
        "a4",
        "a5",
        "a7",
        "a8",
        "b2",
    }
    assert "skipped: no solver" in text
    assert "60.0 % (" in text
    assert "**missed**" in text


def test_the_picture_has_a_panel_a_goal_and_a_point_a_part(rows):
    drawn = page.picture([*rows, *(row._replace(part="fast") for row in rows)])
    panels = [axes for axes in drawn.axes if axes.get_title() or axes.get_title(loc="left")]
    assert len(panels) == page.DRAWN
    assert [label.get_text() for label in panels[0].get_xticklabels()] == ["fast", "forms"]


def test_columns_have_a_value_for_each_cell(rows):
    columns = judging.columns(rows)
    assert set(columns) == set(judging.COLUMNS)
    assert all(len(values) == len(rows) for values in columns.values())
    assert np.isfinite(columns["cpu_second"]).all()


def test_an_answer_that_is_not_right_says_why(folder):
    told = {"leakage": "harms some parts too much"}
    one = answer("a4", "unknown", against=told)
    two = answer("a6", "unknown", against=told)
    hidden_one = answer("a5", "unknown", not_testable=["self_heating"])
    rows = {row.cell: row for row in judging.of_part("forms", folder, [one, two, hidden_one])}
    assert rows["a4"].against == "harms some parts too much"
    assert rows["a6"].against == "no candidate: others promise to explain more"
    assert rows["a5"].against == judging.HIDDEN
    right = judging.of_part("forms", folder, [answer("a4", "named", "leakage")])
    assert {row.cell: row for row in right}["a4"].against == ""


def test_of_a_planted_copy_the_names_count_that_the_unplanted_one_has_not():
    truth = {"u": hidden("u", "unplanted")}
    truth |= {
        cell: hidden(cell, "single", effect) | {"control": "u"}
        for cell, effect in (("p1", "leakage"), ("p2", "leakage"), ("p3", "time_skew"))
    }
    answers = [
        answer("u", "named", "time_skew"),
        answer("p1", "named", "time_skew", "leakage"),
        answer("p2", "named", "time_skew"),
        answer("p3", "named", "time_skew"),
    ]
    found, missed, known = judging.judged("planted", truth, answers)
    assert (found.outcome, found.extra, found.said) == ("right", 0, "leakage")
    assert (missed.outcome, missed.said) == ("called unknown", "")
    assert found.visible
    assert not known.visible, "named without planting"
    shares = {one.name: one for one in judging.shares([found, missed, known])}
    assert (shares["visible effects right"].hits, shares["visible effects right"].of) == (1, 2)
    assert shares["false names"].hits == 0


def said(word, *names):
    """A verdict with names; "a|b" is a tie, "a?" is not proven."""
    effects = []
    for name in names:
        first, *others = name.rstrip("?").split("|")
        proof = "unproven" if name.endswith("?") else "proven"
        effects.append({"effect": first, "alternatives": others, "proof": proof})
    return {"verdict": word, "effects": effects}


HEAT = {"effect": "self_heating", "accept": ["self_heating"], "parts": ["resistance_temperature"]}
OWN_HEAT = {"kind": "single", "visible": True, "effects": [HEAT]}


@pytest.mark.parametrize(
    ("verdict", "question", "well"),
    [
        (said("ambiguous", "self_heating|resistance_temperature"), "tie", False),
        (said("named", "self_heating?"), "unproven name", False),
        (said("unknown"), "unknown", False),
        (said("none"), "none", False),
        (said("named", "self_heating"), "named", True),
        (said("named", "self_heating", "resistance_temperature"), "named", True),
        (said("named", "self_heating", "leakage"), "named", False),
        (said("named", "leakage"), "named", False),
    ],
)
def test_a_question_is_settled_by_all_names_alone_and_proven(verdict, question, well):
    assert question_of(verdict) == question
    assert is_settled(OWN_HEAT, verdict) == well


def test_a_cell_outside_the_vocabulary_is_settled_by_unknown_and_a_healthy_one_by_none():
    outside = {"kind": "unknown", "visible": True, "effects": [{"effect": "drifting_resistance"}]}
    healthy = {"kind": "none", "visible": False, "effects": []}
    for hidden, well, ill in ((outside, "unknown", "none"), (healthy, "none", "unknown")):
        assert is_settled(hidden, said(well))
        assert not is_settled(hidden, said(ill))
    # A test that was advised and leaves nothing to say has settled nothing.
    assert not is_settled(OWN_HEAT | {"none_acceptable": True}, said("none"))
