"""Planted copies and answers made up: what each is worth is known."""

import json

import pytest

from effect_benchmark import planted


def copy(cell, effect, size, accept=None, **parameters):
    told = {"effect": effect, "accept": accept or [effect], "visible_gap_millivolt": 10.0}
    told["parameters"] = parameters
    facts = {"control": "A_u", "campaign": "real", "base_volt": 0.01, "visible": True}
    facts["size"] = f"{size}base"
    return {"cell": cell, "kind": "single", "relative_size": size, "effects": [told], **facts}


def answer(cell, word, *effects, tied=(), partial=(), capacity=0.0):
    volt = {"before": 0.013, "after": 0.005}
    said = [
        {"effect": e, "alternatives": list(tied), "validation_rmse_volt": volt} for e in effects
    ]
    told = {"verdict": word, "effects": said, "partial": [{"effect": e} for e in partial]}
    told["nuisances"] = [{"name": "capacity", "value": capacity}] if capacity else []
    document = json.dumps(told) if word else ""
    return {"cell": cell, "document": document, "reason": "" if word else "why"}


UNPLANTED = {"cell": "A_u", "kind": "unplanted", "campaign": "real", "effects": []}
TRUTH = [
    UNPLANTED,
    copy("A_leak", "leakage", 1.0, ["leakage", "current_offset"]),
    copy("A_skew", "time_skew", 1.01),
    copy("A_heat", "self_heating", 0.5),
    copy("A_rsoc", "resistance_soc", 0.5),
    copy("A_gain", "current_gain", 0.2, gain_relative=0.05),
    copy("A_slow", "slow_diffusion", 2.0),
]
ANSWERS = [
    answer("A_u", "unknown", "resistance_soc"),
    answer("A_leak", "ambiguous", "resistance_soc", "current_offset", tied=["leakage"]),
    answer("A_skew", "named", "time_skew", "entropic_ocv"),
    answer("A_heat", "named", "resistance_temperature"),
    answer("A_rsoc", "named", "resistance_soc"),
    answer("A_gain", "unknown", "resistance_soc", partial=["current_gain"]),
    answer("A_slow", ""),
]


@pytest.fixture
def table(tmp_path):
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth" / "missing_effect.json").write_text(json.dumps(TRUTH))
    return planted.judged(tmp_path, ANSWERS)


def test_only_new_names_are_judged(table):
    assert table.set_index("cell")["outcome"].to_dict() == {
        "A_leak": "right, as one of a tie",
        "A_skew": "right",
        "A_heat": "wrong new name",
        "A_rsoc": "named without planting",
        "A_gain": "no new name",
        "A_slow": "no verdict",
    }
    by_cell = table.set_index("cell")
    assert by_cell.loc["A_skew", "wrong_names"] == 1
    assert by_cell.loc["A_leak", "wrong_names"] == 0
    assert by_cell.loc["A_slow", "reason"] == "why"
    assert by_cell.index[by_cell["nearest_right"]].tolist() == ["A_gain"]


def test_the_size_is_what_the_name_takes_away_over_what_was_planted(table):
    # sqrt(13² − 5²) = 12 mV of 10 mV
    assert table.set_index("cell").loc["A_skew", "size_ratio"] == pytest.approx(1.2)


def test_shares_are_by_size_over_the_base_error(table):
    rows = {row["band"]: row for row in planted.shares(table) if row["campaign"] == "all"}
    large, middle, small = (rows[band] for band in ("1 and more", "0.5 to 1", "below 0.5"))
    # Without a verdict a copy is not right.
    assert (large["right"].hits, large["right"].of) == (2, 3)
    assert (large["wrong"].hits, large["wrong"].of) == (1, 2)
    assert (middle["copies"], middle["known"]) == (2, 1)
    assert (middle["right"].hits, middle["right"].of) == (0, 1)
    assert middle["right"].reached is False
    assert small["right"].reached is None


def test_the_page_has_a_line_for_each_share_and_each_effect(table):
    page = planted.page(table)
    assert "| real | 1 and more | 3 | 0 | 2 of 3" in page
    assert "| `self_heating` | 0 | 0 | 1 | 0 | 0 |" in page


def test_without_an_answer_on_the_unplanted_copy_nothing_is_new(tmp_path):
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth" / "missing_effect.json").write_text(json.dumps(TRUTH))
    table = planted.judged(tmp_path, [answer("A_u", ""), *ANSWERS[1:]])
    assert set(table["outcome"]) == {"no verdict"}


def test_copies_of_other_sizes_are_not_judged(tmp_path):
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth" / "missing_effect.json").write_text(json.dumps(TRUTH))
    table = planted.judged(tmp_path, ANSWERS, ["0.5base"])
    assert set(table["cell"]) == {"A_heat", "A_rsoc"}


def run(folder, verdicts, members):
    """Results of a run of the pipeline: verdicts of base own, and the members chosen."""
    (folder / "truth").mkdir()
    (folder / "truth" / "missing_effect.json").write_text(json.dumps(TRUTH))
    for cell, (names, millivolt) in verdicts.items():
        place = folder / "results" / "missing_effect" / cell / "own"
        place.mkdir(parents=True)
        document = json.loads(answer(cell, "named" if names else "unknown", *names)["document"])
        document["as_given_rmse_volt"] = {"fit": 0.01, "validation": 1e-3 * millivolt}
        (place / "verdict.json").write_text(json.dumps(document))
    (folder / "results" / "member").mkdir(parents=True)
    for cell, member in members.items():
        path = folder / "results" / "member" / f"{cell}.json"
        path.write_text(json.dumps({"chosen": member}))


def test_what_the_chosen_model_has_taken_up_is_told_apart_from_a_right_name(tmp_path):
    verdicts = {"A_u": ([], 5.0), "A_leak": (["leakage"], 12.0), "A_skew": ([], 6.0)}
    verdicts |= {"A_heat": ([], 11.0), "A_slow": (["ocv_shift"], 14.0), "A_rsoc": ([], 11.0)}
    members = {"A_u": "DRT+H", "A_slow": "DRT+D", "A_heat": "DRT+K", "A_rsoc": "DRT+H"}
    run(tmp_path, verdicts, members)
    told = planted.answers_of_run(tmp_path, "own")
    table = planted.judged(tmp_path, told, members=planted.members_of_run(tmp_path))
    # 10 mV planted: the error of the model as it is rises by 3.3 mV of A_skew, by 9.8 of A_heat.
    assert table.set_index("cell")["outcome"].to_dict() == {
        "A_leak": "right",
        "A_skew": "followed by the model",
        "A_heat": "no new name",
        "A_rsoc": "no new name",
        "A_gain": "no verdict",
        "A_slow": "told by the model's branches",
    }
    assert "no verdict.json of base own" in table.set_index("cell").loc["A_gain", "reason"]


def test_what_a_model_has_taken_up_is_no_right_name_in_the_shares(tmp_path):
    run(tmp_path, {"A_u": ([], 5.0), "A_slow": ([], 5.0)}, {"A_u": "2RC", "A_slow": "DRT+D"})
    told = planted.answers_of_run(tmp_path, "own")
    table = planted.judged(tmp_path, told, ["2.0base"], planted.members_of_run(tmp_path))
    (whole,) = [row for row in planted.shares(table) if row["campaign"] == "all"]
    assert (whole["right"].hits, whole["right"].of) == (0, 1)
    assert "| told by the model's branches |" in planted.page(table)


def test_why_there_is_no_right_name(tmp_path):
    """Not testable; taken up by the tolerances; else what spoke last against it."""
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth" / "missing_effect.json").write_text(json.dumps(TRUTH))

    def said(cell, millivolt, **more):
        document = {"verdict": "unknown", "effects": [], "partial": [], "against": {}} | more
        document |= {"rmse_volt": {"before": 1e-3}}
        document |= {"validation_rmse_volt": {"before": 1e-3 * millivolt}}
        return {"cell": cell, "document": json.dumps(document), "reason": ""}

    uneven = {"self_heating": "harms some parts too much"}
    answers = [
        *(said("A_u", 10.0), said("A_leak", 10.5), said("A_heat", 15.0, against=uneven)),
        *(said("A_skew", 10.0, not_testable=["time_skew"]), said("A_slow", 15.0)),
    ]
    table = planted.judged(tmp_path, answers)
    assert set(planted.reasons(table)) == {
        ("1 and more", planted.WITHIN, 1),
        ("1 and more", "the records fitted cannot show it", 1),
        ("1 and more", "no candidate: others promise to explain more", 1),
        ("0.5 to 1", "harms some parts too much", 1),
    }
    # sqrt(15² − 10²) mV more on the records that judge, of 10 mV planted
    assert table.set_index("cell").loc["A_heat", "rise_millivolt"] == pytest.approx(11.18, abs=0.01)
    assert "| 1 and more | the records fitted cannot show it | 1 |" in planted.page(table)


@pytest.mark.parametrize(
    ("effect", "size", "told", "outcome"),
    [
        ("capacity_error", {"relative": -0.1}, 0.08, "no name, told as declared wrongly"),
        ("capacity_error", {"relative": -0.1}, 0.03, "no new name"),  # less than half of it
        ("capacity_error", {"relative": 0.1}, 0.08, "no new name"),  # the other way
        ("current_gain", {"gain_relative": 0.1}, 0.08, "no name, told as declared wrongly"),
        ("leakage", {"leak_ampere": 0.1}, 0.08, "no new name"),
    ],
)
def test_a_capacity_told_as_declared_wrongly_is_no_right_name_and_counted(
    tmp_path, effect, size, told, outcome
):
    truth = [UNPLANTED, copy("A_wrong", effect, 1.0, **size)]
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth" / "missing_effect.json").write_text(json.dumps(truth))
    answers = [answer("A_u", "named", "self_heating", capacity=-0.009)]
    answers.append(answer("A_wrong", "named", "self_heating", capacity=told))
    table = planted.judged(tmp_path, answers)
    assert table["outcome"].tolist() == [outcome]
    assert not planted.right(table).any()
