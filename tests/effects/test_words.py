"""The verdict in words: what a reader needs to act, and no more certainty than there is."""

import pytest

from cellwright.effects.library import LIBRARY
from cellwright.effects.verdict import paragraph


def step(effect="resistance_soc", **changes):
    parameters = {
        p.name: {"value": 0.1234, "std": 0.01, "unit": p.unit, "at_bound": False}
        for p in LIBRARY[effect].parameters
    }
    made = {
        "effect": effect,
        "alternatives": [],
        "parameters": parameters,
        "validation_rmse_volt": {"before": 0.008, "after": 0.002},
        "same_without_validation": True,
    }
    return made | changes


def verdict(word, **changes):
    made = {
        "verdict": word,
        "effects": [],
        "partial": [],
        "located_at": None,
        "floor_volt": 0.0015,
        "validation_rmse_volt": {"before": 0.0081, "after": 0.0019},
        "next_test": None,
    }
    return paragraph(made | changes, LIBRARY)


def test_nothing_missing_names_error_and_noise():
    text = verdict("none")
    assert text.startswith("Nothing is missing that these data could show")
    assert "8.1 mV" in text
    assert "1.5 mV" in text


@pytest.mark.parametrize("effect", sorted(LIBRARY))
def test_every_effect_can_be_said(effect):
    text = verdict("named", effects=[step(effect)])
    assert f"What was missing: {LIBRARY[effect].sentence}" in text
    assert "falls from 8.0 mV to 2.0 mV" in text
    assert "cannot tell it from" not in text
    assert LIBRARY[effect].consequence in text
    assert "_" not in text
    assert "None" not in text


def test_sizes_have_units_and_deviations():
    text = verdict("named", effects=[step("lead_resistance")])
    assert "0.123 ± 0.01 Ohm" in text


def test_a_tie_says_both_and_what_to_test():
    tied = step("current_offset", alternatives=["leakage"])
    text = verdict("ambiguous", effects=[tied], next_test="rest it for 48 h.")
    assert f"cannot tell it from: {LIBRARY['leakage'].sentence}" in text
    assert text.endswith("To test next: rest it for 48 h.")


def test_two_effects_stand_in_their_order():
    text = verdict("named", effects=[step("hysteresis_instant"), step("leakage")])
    first, second = (LIBRARY[n].sentence for n in ("hysteresis_instant", "leakage"))
    assert text.index(first) < text.index("Then: what was missing") < text.index(second)


def test_what_is_unknown_has_no_name():
    assert "no effect of the vocabulary explains it" in verdict("unknown")
    text = verdict("unknown", partial=[step("slow_diffusion")])
    assert "too much for it to be named" in text
    assert "What was missing" not in text


def test_doubts_are_said():
    parameters = step()["parameters"]
    parameters["bowl"]["at_bound"] = True
    text = verdict("named", effects=[step(parameters=parameters, same_without_validation=False)])
    assert "Its bowl ended on a bound: take its size with care" in text
    assert "would have named another effect" in text


def test_the_remainder_is_located():
    place = {"file": "hot", "soc": [0.1, 0.2], "current": "charge_low", "share": 0.42}
    place |= {"temperature_celsius": [44.6]}
    text = verdict("unknown", located_at=place)
    assert "42 % of it) in hot, 10 to 20 % state of charge, charge, low, at 45 °C" in text
