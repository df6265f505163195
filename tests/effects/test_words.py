"""The verdict in words: what a reader needs to act, and no more certainty than there is."""

import tomllib
from pathlib import Path

import pytest

from cellwright.effects import library
from cellwright.effects.library import LIBRARY, known_effects
from cellwright.effects.story.places import largest_before, worsened
from cellwright.effects.story.words import (
    KNOWN,
    beside_worst_test,
    doubts,
    lacks_nothing_above,
    one_line,
    paragraph,
    sentences_by_part,
)

PLACE = {"file": "hot", "soc": [0.1, 0.2], "current": "charge_low", "share": 0.42}
PLACE |= {"temperature_celsius": [44.6]}


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
    }
    return made | changes


def verdict(word, **changes):
    made = {
        "cell": "h1",
        "verdict": word,
        "effects": [],
        "partial": [],
        "located_at": None,
        "floor_volt": 0.0015,
        "validation_rmse_volt": {"before": 0.0081, "after": 0.0019},
        "next_test": None,
    }
    return made | changes


def said(word, **changes):
    return paragraph(verdict(word, **changes), LIBRARY)


def test_the_words_of_the_library_are_of_its_effects_and_say_what_each_is_and_what_shows_it():
    table = Path(library.__file__).with_name("messages.toml").read_text(encoding="utf-8")
    effects = known_effects()
    assert set().union(*tomllib.loads(table).values()) <= {effect.id for effect in effects}
    assert all(effect.sentence and effect.short and effect.shows for effect in effects)
    # What the vocabulary has no name for changes nothing that a user could act on.
    silent = {effect.id for effect in effects if not effect.consequence}
    assert silent == library.outside.OUTSIDE.keys()


@pytest.mark.parametrize("effect", sorted(LIBRARY))
def test_every_effect_can_be_said(effect):
    text = said("named", effects=[step(effect)])
    assert text.startswith("Shows ")
    assert "it lowers the error on the validation tests from 8.1 mV to 1.9 mV" in text
    assert LIBRARY[effect].sentence[1:] in text
    assert LIBRARY[effect].consequence in text
    assert "cannot tell it from" not in text
    assert "Unsure" not in text
    assert "_" not in text
    assert "None" not in text
    assert "nan" not in text


def test_an_unknown_says_what_its_model_holds_without_a_name_and_what_that_leaves():
    held = {"small": ["polarisation_soc"], "against": {"polarisation_soc": "no_size"}}
    volts = {"plain": 0.0421, "names": 0.0421, "model": 0.0121}
    errors = {name: {"fit_volt": 0.01, "validation_volt": volt} for name, volt in volts.items()}
    text = said("unknown", errors=errors, **held)
    why = "too small to matter, or its value hit a limit of the fit"
    name = f"polarisation over state of charge ({why})"
    assert f"Also in the model, below the reporting threshold: {name}." in text
    told = "42.1 mV, with the named effects 42.1 mV, with all of this 12.1 mV"
    assert f"On the validation tests the plain model errs by {told}." in text
    assert "No effect of the vocabulary can be named for it." in text
    assert "with all of this" not in said("named", effects=[step()], errors=errors)


def test_what_names_alone_take_off_is_told_apart_from_what_the_whole_model_does():
    held = {"small": ["polarisation_soc"], "against": {"polarisation_soc": "no_size"}}
    volts = {"plain": 0.0081, "names": 0.0063, "model": 0.0019}
    errors = {name: {"fit_volt": 0.01, "validation_volt": volt} for name, volt in volts.items()}
    text = said("named", effects=[step()], errors=errors, **held)
    assert (
        "from 8.1 mV to 6.3 mV (1.9 mV with what is in the model below the reporting threshold)"
        in text
    )


def test_all_that_a_verdict_may_hold_is_said_with_its_numbers_and_no_gap():
    """Place, remainder, floors, declared values at their limit, answers: each with its number."""
    declared = [
        {"name": "capacity", "test": None, "soc": None, "value": -0.12, "std": 0.004},
        {"name": "open_circuit_voltage", "test": None, "soc": 0.9, "value": 0.0045, "std": None},
        {"name": "temperature", "test": "us06", "soc": None, "value": -4.62, "std": None},
        *({"name": "soc_at_start", "test": k, "soc": None, "value": 0.01} for k in "abcd"),
    ]
    units = zip(("1", "V", "K", *"1111"), (0.003, 1.5e-3, 2.0, *4 * [0.02]), strict=True)
    known = [{"unit": unit, "prior_std": std} for unit, std in units]
    left = {"excess_volt": 6e-3, "located_at": PLACE}
    text = said(
        "ambiguous",
        effects=[step("current_offset", alternatives=["leakage"])],
        small=["polarisation_soc"],
        against={"polarisation_soc": "small"},
        remainder=left,
        floors=[{"test": "a", "volt": 0.002}, {"test": "b", "volt": 0.0045}],
        nuisances=[one | more for one, more in zip(declared, known, strict=True)],
        next_test="Rest it for 48 h.",
    )
    numbers = ("8.1 mV", "6.0 mV", "12 %", "4.5 mV", "4.6 K", "10–20 % SoC")
    assert [number for number in numbers if number not in text] == []
    assert [word for word in ("_", "None", "nan") if word in text] == []
    assert text.endswith("\nRest it for 48 h.")


def test_an_error_that_does_not_fall_is_not_said_to_fall():
    both = {"before": 0.004, "after": 0.005}
    text = said("named", effects=[step()], validation_rmse_volt=both)
    assert "does not fall: 4.0 mV before, 5.0 mV after" in text


def test_a_fall_that_is_not_an_effects_own_is_not_said_to_be():
    both, own = {"before": 0.005, "after": 0.004}, {"before": 0.0039, "after": 0.004}
    one = step() | {"validation_rmse_volt": own}
    text = said("named", effects=[one], validation_rmse_volt=both)
    assert "from 5.0 mV to 4.0 mV, but because of what was fitted beside this effect" in text
    assert "it lowers the error" not in text


def test_what_is_unknown_has_no_name():
    assert "No effect of the vocabulary explains it." in said("unknown")
    rest = {"excess_volt": 0.0062, "adequate": False}
    text = said("unknown", partial=[step("slow_diffusion")], remainder=rest)
    part = "Slow diffusion explains a part of it; 6.2 mV RMS remain (every SoC block weighted "
    part += "equally), too much for a name."
    assert text.startswith("Something is missing")
    assert part in text


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"alternatives": ["leakage"]}, "another explains it as well"),
        ({"proof": "unproven"}, "the validation tests do not show it by themselves"),
        (
            {"validation_rmse_volt": {"before": 2e-3, "after": 2e-3}},
            "the error on the validation tests does not fall",
        ),
        ({"probability": 0.68}, "68 % were right in our tests"),
    ],
)
def test_each_doubt_makes_a_name_unsure(changes, reason):
    (found,) = doubts(step(**changes)).values()
    assert reason in found
    assert f"Unsure: {found}." in said("named", effects=[step(**changes)])


def test_a_size_at_its_bound_and_a_witness_against_it_are_doubts():
    parameters = step()["parameters"]
    parameters["step_to_10_percent"] = parameters["step_to_10_percent"] | {"at_bound": True}
    assert doubts(step(parameters=parameters)) == {
        "at_bound": "one of its parameters ended at a limit of the fit: step to 10 percent"
    }
    heard = [{"name": "pulses", "says": "contradicts", "shown": False}]
    heard += [{"name": "impedance", "says": "agrees", "shown": True}]
    heard += [{"name": "relaxations", "says": "contradicts", "shown": True}]
    assert doubts(step(), heard) == {"witness": "contradicted by pulses"}
    assert doubts(step(), heard[1:]) == {}


def fields(**columns):
    made = {"role": ["validation"] * 4, "test": ["a"] * 4, "rate": ["discharge_high"] * 4}
    made |= {"soc_low": [0.1, 0.2, 0.5, 0.6], "soc_high": [0.2, 0.3, 0.6, 0.7], "rows": [10] * 4}
    return made | columns


def test_fields_that_got_worse_are_joined_and_said():
    before, after = [5e-3, 5e-3, 5e-3, 30e-3], [8e-3, 8e-3, 6.5e-3, 32.5e-3]
    found = worsened(fields(before_rms_volt=before, after_rms_volt=after))
    assert len(found) == 1, "1.5 mV is not worth a word, nor 2.5 of 30"
    assert found[0]["soc"] == [0.1, 0.3]
    assert found[0]["volt"] == pytest.approx(3e-3)
    text = said("named", effects=[step()], worsened=found)
    assert (
        "The error is larger than before by 3.0 mV at 10–30 % SoC on discharge above 0.7C in a."
        in text
    )
    assert "larger than before" not in said("unknown", worsened=found), "no effect was added"
    assert worsened({}) == []


def test_the_field_with_the_largest_part_of_the_gap_is_named_with_what_it_is_now():
    """Many rows of a middling error hold more of it than few of a large one."""
    fields = {"rows": [10, 1000], "before_rms_volt": [0.1, 0.02], "after_rms_volt": [0.1, 0.001]}
    fields |= {"soc_low": [0.9, 0.2], "soc_high": [1.0, 0.3], "test": ["slow", "drive"]}
    fields |= {"rate": ["rest", "charge_high"]}
    share = 100 * 0.4 / 0.5
    said = largest_before(fields)
    assert said.startswith(f"The largest part of the error, {share:.0f} %, was at 20–30 % SoC")
    assert said.endswith("in drive: 20.0 mV by the plain model, 1.0 mV with what was found.")
    assert largest_before({}) is None


@pytest.mark.parametrize("logged", [True, False])
def test_a_group_is_told_part_by_part_in_its_own_words(logged):
    """Of its branches, and of no plain model; where they were not logged, how blind that is."""
    size = {"value": 0.002, "std": 1e-4, "unit": "Ohm", "at_bound": False}
    wire = step("resistance_soc", branch=2, cell="C4", branch_alternatives=[1])
    wire |= {"effect": "branch_wire_resistance", "parameters": {"excess_ohm": size}}
    sat = {"file": "drive", "soc": [0.2, 0.4], "current": "discharge", "branch": 2, "share": 0.61}
    found = verdict("ambiguous", effects=[wire], gap_at=sat, branch_currents=logged)
    story = {}
    for part, sentence in sentences_by_part(found, KNOWN):
        story.setdefault(part, []).append(sentence)
    read = "branch currents" if logged else "the group's voltage"
    assert f"Shows wire resistance (branch 2): it lowers the error in {read}" in story["gap"][0]
    sat = (
        "The largest part of the error, 61 %, was at 20–40 % SoC on discharge in branch 2 in drive."
    )
    assert story["left"] == [sat]
    assert "In branch 2 (C4) the connection of one branch" in story["names"][0]
    assert "It could as well be branch 1." in story["names"][0]
    assert [text.startswith("Branch currents were not") for text in story.get("sure", [])] == (
        [] if logged else [True]
    )
    healthy = verdict("none", branch_currents=logged)
    assert "healthy cells within the declared spread err by" in paragraph(healthy, KNOWN)
    assert one_line(healthy) == "shows no branch that differs by more than healthy cells do"


def test_a_test_in_which_the_model_errs_by_far_more_than_it_lacks_is_told_beside_it():
    """By the numbers of the verdict, not by those in its sentence."""
    own = verdict("none", validation_rmse_volt={"before": 0.003, "after": 0.003})
    above = lacks_nothing_above(own)
    line = one_line(verdict("named", effects=[step("leakage")]), own)
    assert line == "shows self-discharge; its model lacks nothing above 3 mV"
    assert beside_worst_test(line, above, {"us06": 0.0059, "udds": 0.004}) == line
    far = {"us06": 0.0121, "udds": 0.004}
    assert beside_worst_test(line, above, far) == f"{line}, yet errs by 12.1 mV in us06"
    assert beside_worst_test(line, None, far) == line
    assert lacks_nothing_above(verdict("unknown")) is None
    assert lacks_nothing_above(None) is None
