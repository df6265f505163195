"""Cells of a type beside each other: what all show, what one shows alone."""

import pytest

from cellwright.effects.story.fleet import fleet


def entry(effect, before=5e-3, after=3e-3, alternatives=(), proof="proven"):
    both = {"before": before, "after": after}
    return {
        "effect": effect,
        "alternatives": list(alternatives),
        "parameters": {},
        "rmse_volt": {"before": 13e-3, "after": 5e-3},
        "validation_rmse_volt": both,
        "proof": proof,
        "blocks": None,
    }


def verdict(cell, *effects, word="named", partial=(), not_testable=()):
    return {
        "cell": cell,
        "verdict": word,
        "effects": list(effects),
        "partial": list(partial),
        "not_testable": list(not_testable),
    }


def of(*verdicts, types=None, witnesses=()):
    return fleet(verdicts, types or {v["cell"]: "NMC, 5 Ah" for v in verdicts}, witnesses)


def shown(result):
    return {(e.cell, e.effect): e.shown for e in result.entries}


def test_what_all_share_and_what_one_has_alone():
    kinetics = entry("charge_transfer_nonlinearity")
    rows = [verdict(f"Cell{k}", kinetics) for k in range(1, 5)]
    result = of(*rows, verdict("Cell7", kinetics, entry("leakage")))
    assert result.sentences == {
        "NMC, 5 Ah": "all 5 cells show charge-transfer kinetics; Cell7 alone shows self-discharge"
    }
    assert shown(result)["Cell1", "leakage"] == "no"
    assert shown(result)["Cell7", "leakage"] == "sure"
    assert len(result.entries) == 10


def test_the_size_is_what_an_effect_takes_off_the_error():
    unproven = entry("self_heating", proof="unproven")
    result = of(verdict("A", entry("leakage")), verdict("B", unproven, word="named"))
    sizes = {e.effect: e.size_volt for e in result.entries if e.shown != "no"}
    assert sizes["leakage"] == pytest.approx(4e-3)
    assert sizes["self_heating"] == pytest.approx(12e-3)


def test_ties_parts_and_unproven_names_are_unsure():
    tie = entry("leakage", alternatives=["current_offset"])
    result = of(
        verdict("A", tie, word="ambiguous"),
        verdict("B", word="unknown", partial=[entry("leakage")]),
        verdict("C", word="none", not_testable=["leakage"]),
    )
    assert shown(result) == {
        ("A", "leakage"): "unsure",
        ("B", "leakage"): "unsure",
        ("C", "leakage"): "not testable",
        ("A", "current_offset"): "or another",
        ("B", "current_offset"): "no",
        ("C", "current_offset"): "no",
    }
    assert result.sentences["NMC, 5 Ah"] == (
        "A, B of 3 show self-discharge (unsure); "
        "A alone shows an offset of the current reading (unsure); "
        "something without a name is left in B"
    )


def test_what_looks_like_something_outside_the_vocabulary_shows_no_name():
    drifts = verdict("B", word="unknown", partial=[entry("leakage")])
    drifts["outside"] = [{"effect": "resistance_drift"}]
    result = of(verdict("A", word="none"), drifts)
    assert result.entries == ()
    assert result.sentences["NMC, 5 Ah"] == (
        "none of 2 cells shows an effect; something without a name is left in B"
    )


def test_a_witness_that_contradicts_makes_a_name_unsure():
    told = {"cell": "A", "effect": "leakage", "name": "rest", "says": "contradicts", "shown": False}
    result = of(verdict("A", entry("leakage")), verdict("B", entry("leakage")), witnesses=[told])
    assert shown(result)["A", "leakage"] == "unsure"
    assert result.sentences["NMC, 5 Ah"] == "both cells show self-discharge (unsure in 1)"


def test_a_cell_alone_of_its_type_or_of_none_is_not_compared():
    result = of(verdict("A", entry("leakage")), verdict("B"), types={"A": "NMC, 5 Ah"})
    assert result == fleet((), {})
