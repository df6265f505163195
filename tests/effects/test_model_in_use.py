"""Where the story of the gap ends: the model in use, and its parts beside what was named."""

import pytest

from cellwright.effects.library import LIBRARY
from cellwright.effects.library.vocabulary import why_no_part
from cellwright.effects.story.in_use import part_of, sentences_in_use
from cellwright.identification.messages import say
from cellwright.identification.particle import WITHOUT
from runtime import tables


def own(**without_volt):
    """Verdict on a particle that errs by 16 mV without nothing, and by these without its parts."""
    parts = [
        {"part": name, "left_out_rmse_volt": volt, "standard_errors": 0.0, "worth": volt > 0.02}
        for name, volt in without_volt.items()
    ]
    known = {"model": "P", "left_out_rmse_volt": 0.016, "parts": parts}
    errors = {"fit": 0.017, "validation": 0.036}
    member = {"fit_volt": 0.017, "validation_volt": 0.036}
    return verdict("unknown") | {
        "as_given_rmse_volt": errors,
        "in_use": known,
        "errors": {"member": member},
    }


def verdict(word, *names, against=None):
    both = {"before": 0.1, "after": 0.03}
    effects = [
        {"effect": name, "alternatives": [], "parameters": {}}
        | {"rmse_volt": both, "validation_rmse_volt": both}
        for name in names
    ]
    about = {"located_at": None, "floor_volt": 1e-3, "next_test": None, "against": against or {}}
    about["validation_rmse_volt"] = both
    return {"cell": "A", "verdict": word, "effects": effects} | about


@pytest.mark.parametrize("effect", LIBRARY.values(), ids=LIBRARY)
def test_every_effect_is_a_part_of_the_particle_or_says_why_not(effect):
    if effect.in_particle:
        assert effect.in_particle in WITHOUT
        assert say(f"part.{effect.in_particle}")
    else:
        assert why_no_part(effect)


def test_every_part_of_the_particle_is_an_effect():
    assert {effect.in_particle for effect in LIBRARY.values() if effect.in_particle} == set(WITHOUT)


def test_the_model_in_use_says_which_parts_hold_what_was_named_and_what_speaks_against_it():
    named = "resistance_temperature", "polarisation_soc", "hysteresis_one_state", "time_skew"
    against = {"charge_transfer_nonlinearity": "no_size"}
    parts = {"temperature": 0.124, "relaxing_soc": 0.041, "ohmic_soc": 0.053}
    parts |= {"hysteresis": 0.0165, "kinetics": 0.031}
    errs, held, worthless, unnamed, no_part = sentences_in_use(
        verdict("named", *named, against=against), own(**parts)
    )
    assert errs.startswith("The model in use, P, errs by 17.0 mV on the tests fitted and by 36.0")
    assert "resistance over temperature (124 mV without activation energies)" in held
    assert "polarisation over state of charge (41.0 mV without" in held
    assert "hysteresis (16.5 mV without hysteresis)" in worthless
    # R0 over SoC shares charge transfer with a part that is named.
    assert "charge-transfer kinetics (31.0 mV" in unnamed
    assert "; for the search: too small to matter" in unnamed
    assert "resistance over state of charge" not in unnamed
    assert no_part.startswith("No part of the model in use: a time shift between voltage and")


def test_a_part_of_two_effects_is_missed_once():
    (_, unnamed) = sentences_in_use(verdict("none"), own(hysteresis=0.03))
    assert unnamed.count("without hysteresis") == 1


@pytest.mark.parametrize(
    "about", [{"references": ["B"]}, {"not_testable": ["slow_diffusion"]}], ids=str
)
def test_what_the_search_did_not_ask_for_is_no_contradiction(about):
    told = sentences_in_use(verdict("none") | about, own(diffusion=0.03))
    assert len(told) == 1
    assert "not named" in sentences_in_use(verdict("none"), own(diffusion=0.03))[1]


def test_of_a_circuit_its_error_alone_and_of_no_search_nothing():
    of_circuit = own()
    of_circuit["in_use"] |= {"model": "DRT+K", "parts": None}
    (sentence,) = sentences_in_use(verdict("named", "slow_diffusion"), of_circuit)
    assert "The model in use, DRT+K, errs by" in sentence
    assert part_of("slow_diffusion", of_circuit) == {}
    assert sentences_in_use(verdict("none"), None) == []


def test_the_table_has_both_numbers_beside_each_name():
    found = verdict("named", "slow_diffusion", "time_skew")
    of_own = {"A": own(diffusion=0.0186)}
    diffusion, skew = tables.verdicts([found], (), of_own)
    ends = diffusion["with_part_volt"], diffusion["without_part_volt"], diffusion["part"]
    assert ends == (0.016, 0.0186, "diffusion")
    assert diffusion["part_worth"] is False
    assert skew["part"] is skew["without_part_volt"] is None
    assert diffusion["in_use"] == skew["in_use"] == "P"
