"""Which question of a verdict the next test is to answer, and which test answers it."""

import pytest
from small_plant import HEALTHY, Truth, searched

from cellwright.effects import advice
from cellwright.effects.advice import advised, question, ways_to_tell
from cellwright.effects.library import LIBRARY
from cellwright.effects.story.words import KNOWN, next_test
from cellwright.effects.verdict import NO_SIZE

PLACE = {
    "file": "judge_1",
    "soc": [0.1, 0.2],
    "current": "discharge_high",
    "temperature_celsius": [8.0],
    "share": 0.4,
}


def asked(truth, *, untestable=(), place=None):
    found, result, _ = searched(truth)
    return advised(found, result, LIBRARY, untestable, place), result


def test_nothing_is_advised_where_nothing_is_open():
    assert asked(HEALTHY)[0] is None
    assert asked(Truth(hysteresis=0.012))[0] is None
    assert next_test(None, LIBRARY) is None


def test_a_tie_is_asked_first():
    found, result = asked(Truth(leak=0.06))
    assert result.word == "ambiguous"
    assert found["code"] == "tell_apart"
    assert {found["effect"], *found["alternatives"]} >= {"leakage", "current_offset"}
    assert "the logged current at commanded open circuit (free)" in next_test(found, LIBRARY)


def test_a_name_without_proof_gets_the_test_that_shows_it(monkeypatch):
    monkeypatch.setattr(advice, "is_proven", lambda found, one: False)
    found, _ = asked(Truth(activation=2.5e4))
    assert (found["code"], found["effect"]) == ("prove", "resistance_temperature")
    assert next_test(found, LIBRARY) == (
        "To prove resistance over temperature on a test that is not fitted, run: the same drive at "
        "two temperatures, 15 K apart."
    )


def test_a_gap_without_a_name_is_sought_where_it_sits():
    found, result = asked(Truth(ripple=0.008), place=PLACE)
    assert result.word == "unknown"
    assert found == question("place", place=PLACE)
    sentence = next_test(found, LIBRARY)
    assert "at 10–20 % SoC on discharge above 0.7C in judge_1 (8 °C)" in sentence
    assert "rest before and after" in sentence


def test_of_an_unknown_whose_model_holds_what_has_no_sure_size_the_test_that_tells_it_is_asked():
    found, result, _ = searched(Truth(hysteresis=0.012))
    (named,) = result.names
    unsized = result._replace(word="unknown", names=(), unnamed=((named, NO_SIZE),), adequate=False)
    asked_of = advised(found, unsized, LIBRARY, (), PLACE)
    effect = named.effect
    assert asked_of == question("see_size", effect.id)
    wanted = f"To see by how much {effect.sentence}, run: {effect.shows}."
    assert next_test(asked_of, LIBRARY) == wanted


def test_at_one_temperature_resistance_over_temperature_is_asked():
    found, _ = asked(HEALTHY, untestable=("resistance_temperature",))
    assert found == question("see", "resistance_temperature")
    assert next_test(found, LIBRARY).startswith("To see whether resistances change")


@pytest.mark.parametrize(
    ("pair", "words"),
    [
        (("hysteresis_one_state", "slow_diffusion"), ("C/20", "two hours after a long load")),
        (("resistance_temperature", "self_heating"), ("in a chamber 15 K colder or warmer",)),
        (("leakage", "coulombic_inefficiency"), ("48 hours", "four full cycles")),
        (("time_skew",), ("sharp edges",)),
        (("current_offset", "leakage"), ("the logged current at commanded open circuit",)),
        (("lead_resistance",), ("four-wire",)),
        (("capacity_error", "current_gain"), ("reference shunt",)),
        (("voltage_offset", "ocv_shift"), ("a voltage reference",)),
    ],
)
def test_the_library_gives_the_test_that_tells_two_effects_apart_in_either_order(pair, words):
    effect, *others = pair
    ways = ways_to_tell(effect, others, KNOWN)
    assert len(ways) == len(words)
    assert all(word in way for word, way in zip(words, ways, strict=True))
    assert set(ways) == set(ways_to_tell(*([*others, effect][0], [*others, effect][1:]), KNOWN))


@pytest.mark.parametrize("effect", sorted(KNOWN))
def test_every_effect_has_a_test_that_shows_it_and_no_id_is_in_the_sentence(effect):
    for code in ("prove", "see", "see_size"):
        sentence = next_test(question(code, effect), LIBRARY)
        assert "_" not in sentence
        assert sentence.endswith(".")
    assert ways_to_tell(effect, (), KNOWN)
