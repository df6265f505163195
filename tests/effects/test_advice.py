"""Which question of a verdict the next test is to answer."""

import pytest
import small_plant
from small_plant import HEALTHY, Truth, searched

from cellwright.effects.library import LIBRARY
from cellwright.effects.planning import advice
from cellwright.effects.planning.advice import advised
from cellwright.effects.verdict import NO_SIZE

PLACE = {
    "file": "judge_1",
    "soc": [0.1, 0.2],
    "current": "discharge_high",
    "temperature_celsius": [8.0],
    "share": 0.4,
}


def asked(truth, *, untestable=(), place=None, change=lambda found: found):
    found, result, _ = searched(truth)
    return advised(change(found), result, LIBRARY, untestable, place), result


def test_nothing_is_advised_where_nothing_is_open():
    assert asked(HEALTHY)[0] == ({}, None, None)
    assert asked(Truth(hysteresis=0.012))[0] == ({}, None, None)


def test_a_tie_is_asked_first():
    (menu, sentence, _), result = asked(Truth(leak=0.06))
    assert result.word == "ambiguous"
    assert sentence.startswith("To tell ")
    assert "rest_48h" in menu["test"]


def test_a_tie_that_no_test_tells_apart_better_than_the_records_do_is_not_asked(monkeypatch):
    """Both predict as well because neither is right, and not for want of a test; a look at what
    the tester logged at rest is free."""
    monkeypatch.setattr(advice, "DOUBLED", 1e9)
    (_, sentence, test), result = asked(Truth(leak=0.06))
    assert result.word == "ambiguous"
    assert test is None
    assert sentence is None or "(free)" in sentence


@pytest.mark.slow
def test_a_name_without_proof_gets_the_test_that_proves_it(monkeypatch):
    """Unless the records on hand say nearly as much already."""
    monkeypatch.setattr(advice, "is_proven", lambda found, one: False)
    assert asked(Truth(activation=2.5e4))[0] == ({}, None, None)
    monkeypatch.setattr(advice, "DOUBLED", 1.0)
    (menu, sentence, _), _ = asked(Truth(activation=2.5e4))
    assert sentence.startswith("To prove resistance temperature on a record that is not fitted: ")
    assert menu["test"][0].endswith(("_warm", "_cold"))
    assert menu["chi_square"][0] > 1000.0


@pytest.mark.slow
def test_a_gap_without_a_near_explanation_is_sought_where_it_sits(monkeypatch):
    monkeypatch.setattr(advice, "NEARER", 0)
    (menu, sentence, _), result = asked(Truth(ripple=0.008), place=PLACE)
    assert result.word == "unknown"
    assert menu == {}
    assert "at 10–20 % SoC on discharge above 0.7C in judge_1 (8 °C)" in sentence
    assert "rest before and after" in sentence


def test_an_unknown_always_has_advice():
    (_, sentence, _), result = asked(Truth(ripple=0.008), place=PLACE)
    assert result.word == "unknown"
    assert sentence.startswith("To ")


def test_of_an_unknown_whose_model_holds_what_has_no_sure_size_the_test_that_tells_it_is_asked():
    found, result, _ = searched(Truth(hysteresis=0.012))
    (named,) = result.names
    unsized = result._replace(word="unknown", names=(), unnamed=((named, NO_SIZE),), adequate=False)
    effect = named.effect
    (menu, sentence, test) = advised(found, unsized, LIBRARY, (), PLACE)
    assert sentence == f"To see by how much {effect.sentence}: {effect.shows}."
    assert (menu, test) == ({}, None)


def test_at_one_temperature_resistance_over_temperature_is_asked():
    truth = small_plant.HEALTHY
    (menu, sentence, _), _ = asked(truth, untestable=("resistance_temperature",))
    assert sentence.startswith("To see resistance temperature")
    assert menu["test"]
