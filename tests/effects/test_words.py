"""The verdict in words: what a reader needs to act, and no more certainty than there is."""

import pytest

from cellwright.effects.library import LIBRARY
from cellwright.effects.story.places import millivolt, near, where, worsened
from cellwright.effects.story.words import doubts, one_line, paragraph

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
        "same_without_validation": True,
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


def test_nothing_missing_names_error_and_noise():
    text = said("none")
    assert text.startswith("Nothing is missing that these data could show")
    assert "the plain model (open-circuit voltage, a resistance, two RC pairs) is off by" in text
    assert "8.1 mV" in text
    assert "the noise alone is 1.5 mV" in text


def test_what_is_in_the_model_without_a_name_is_told_and_its_work_not_credited_to_the_name():
    after = {"validation_rmse_volt": {"before": 0.0081, "after": 0.004}}
    against = {"polarisation_soc": "in the model, too small for a name"}
    text = said("named", effects=[step(**after)], small=["polarisation_soc"], against=against)
    assert "from 8.1 mV to 4.0 mV (1.9 mV with what is in the model without a name)" in text
    assert "Without a name: polarisation over state of charge (in the model, too small" in text


@pytest.mark.parametrize("effect", sorted(LIBRARY))
def test_every_effect_can_be_said(effect):
    text = said("named", effects=[step(effect)])
    assert text.startswith("Shows ")
    assert "it takes the error on records that took no part in the fit from 8.1 mV to 1.9" in text
    assert LIBRARY[effect].sentence[1:] in text
    assert LIBRARY[effect].consequence in text
    assert "cannot tell it from" not in text
    assert "Unsure" not in text
    assert "_" not in text
    assert "None" not in text
    assert "nan" not in text


def test_the_first_sentence_has_the_names_one_total_and_where_the_rest_sits():
    two = [step("resistance_temperature"), step("slow_diffusion")]
    place = PLACE | {"soc": [0.0, 0.1]}
    first = said("named", effects=two, located_at=place).split(". ")[0]
    assert first == (
        "Shows resistance over temperature and slow diffusion: together they take the error on "
        "records that took no part in the fit from 8.1 mV to 1.9 mV; what is left sits near empty"
    )


def test_an_error_that_does_not_fall_is_not_said_to_fall():
    both = {"before": 0.004, "after": 0.005}
    text = said("named", effects=[step()], validation_rmse_volt=both)
    assert "does not fall: 4.0 mV before, 5.0 mV after" in text


def test_a_tie_says_both_and_what_to_test():
    tied = step("current_offset", alternatives=["leakage"])
    text = said("ambiguous", effects=[tied], next_test="rest it for 48 h.")
    assert "an offset of the current reading or self-discharge" in text
    assert f"cannot tell it from: {LIBRARY['leakage'].sentence}" in text
    assert text.endswith("To test next: rest it for 48 h.")


def test_what_is_unknown_has_no_name():
    assert "no effect of the vocabulary explains it" in said("unknown")
    text = said("unknown", partial=[step("slow_diffusion")])
    assert "The nearest explanation, slow diffusion, leaves 2.0 mV; it is no name: that" in text
    because = {"slow_diffusion": "harms some parts too much"}
    text = said("unknown", partial=[step("slow_diffusion")], against=because)
    assert text.startswith("Something is missing")
    assert "it is no name: harms some parts too much." in text


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"alternatives": ["leakage"]}, "another explains it as well"),
        ({"proof": "unproven"}, "no record that took no part in the fit can show it"),
        (
            {"validation_rmse_volt": {"before": 2e-3, "after": 2e-3}},
            "the error on records for proof does not fall",
        ),
        ({"probability": 0.68}, "other choices of the parts that judge it leave it out in 32 %"),
        ({"same_without_validation": False}, "fitted records alone would have named another"),
        (
            {"blocks": {"excited": 9, "helped": 6, "hurt": 3}},
            "of the 9 parts of the records for proof that excite it, 6 are better with it and 3",
        ),
    ],
)
def test_each_doubt_makes_a_name_unsure(changes, reason):
    (found,) = doubts(step(**changes))
    assert reason in found
    assert f"Unsure: {found}." in said("named", effects=[step(**changes)])


def test_a_size_at_its_bound_and_a_witness_against_it_are_doubts():
    parameters = step()["parameters"]
    parameters["step_to_10_percent"] = parameters["step_to_10_percent"] | {"at_bound": True}
    assert doubts(step(parameters=parameters)) == ("step to 10 percent ended on a bound",)
    heard = [{"name": "pulses", "says": "contradicts", "shown": False}]
    heard += [{"name": "impedance", "says": "agrees", "shown": True}]
    heard += [{"name": "relaxations", "says": "contradicts", "shown": True}]
    assert doubts(step(), heard) == ("contradicted by pulses",)
    assert doubts(step(), heard[1:]) == ()


@pytest.mark.parametrize("second", [None, 9.0])
def test_sizes_that_are_all_smaller_than_their_deviations_are_a_doubt(second):
    sizes = [
        {"name": "", "value": -2.8, "std": 7.4, "unit": "K/W"},
        {"name": "time constant", "value": 5.0, "std": second, "unit": "min"},
    ]
    assert doubts(step(sizes=sizes)) == ("its size is smaller than its own deviation",)
    assert doubts(step(sizes=[sizes[0] | {"value": 8.0}, sizes[1]])) == ()


def test_what_speaks_for_a_name_is_no_doubt():
    good = {
        "proof": "proven",
        "probability": 0.93,
        "blocks": {"excited": 9, "helped": 9, "hurt": 0},
    }
    assert doubts(step(**good)) == ()


def test_the_remainder_is_located():
    text = said("unknown", located_at=PLACE)
    assert "largest part of what is left, 42 %, sits at 10–20 % SoC on charge up to 0.7C" in text
    assert "in hot (45 °C)" in text


@pytest.mark.parametrize(
    ("learnable", "words"),
    [
        (True, "can learn it, down to 3.0 mV."),
        (False, "learns it from the fitted records."),
        (None, "tolerances allow: 6.0 mV."),
    ],
)
def test_a_remainder_says_whether_it_can_be_learned(learnable, words):
    left = {"excess_volt": 6e-3, "learnable": learnable, "ceiling_volt": 3e-3, "located_at": PLACE}
    text = said("named", effects=[step()], remainder=left)
    assert "Left beyond what noise and declared tolerances allow: 6.0 mV" in text
    assert words in text
    assert "what is left sits at 10–20 % SoC" in text


def test_bases_have_their_own_model():
    assert "the model in use is off by 8.1 mV" in said("none", base="own")
    assert "your model is off by 8.1 mV" in said("none", base="external")
    assert said("none", base="plain") == said("none")


def test_what_ends_beyond_its_tolerance_is_told():
    capacity = {"name": "capacity", "test": None, "soc": None, "value": -0.12, "std": 0.004}
    ocv = {"name": "open_circuit_voltage", "test": None, "soc": 0.9, "value": 0.0045, "std": None}
    starts = [
        {"name": "soc_at_start", "test": test, "soc": None, "value": 0.01, "unit": "1"}
        for test in ("a", "b", "c", "d")
    ]
    known = {"unit": "1", "prior_std": 0.003}, {"unit": "V", "prior_std": 1.5e-3}
    text = said("none", nuisances=[capacity | known[0], ocv | known[1], *starts])
    assert "the capacity 12 % below the measured one (± 0.4 %; tolerance 0.3 %)" in text
    assert "at 90 % SoC 4.5 mV above its curve (as far as it may; tolerance 1.5 mV)" in text
    assert (
        "the SoC at the start of a, b, c and 1 more is at the limit that rest and sheet allow"
        in text
    )
    assert "Off what was declared" not in said("none", nuisances=[])


@pytest.mark.parametrize(("value", "way"), [(-4.62, "colder"), (4.62, "warmer")])
def test_a_temperature_that_the_sheet_states_wrongly_is_told(value, way):
    known = {"name": "temperature", "test": "us06", "soc": None, "std": None}
    text = said("named", nuisances=[known | {"value": value, "unit": "K", "prior_std": 2.0}])
    assert f"us06 was 4.6 K {way} than the sheet states (no sensor told; tolerance 2 K)" in text


def test_floors_stand_for_the_noise_where_they_are_known():
    floors = [{"test": "a", "volt": 0.002}, {"test": "b", "volt": 0.0045}]
    text = said("none", floors=floors)
    assert "noise and declared tolerances may leave 2.0 mV to 4.5 mV in a record" in text
    assert "noise alone" not in text


def test_answers_have_their_probabilities_the_likeliest_first():
    answers = {
        "none": 0.04,
        "resistance_soc+slow_diffusion": 0.9,
        "unknown": 0.055,
        "leakage": 5e-3,
    }
    text = said("none", probabilities=answers)
    words = "resistance over state of charge and slow diffusion 90 %, something unknown 6 %"
    assert f"How likely: {words}, nothing missing 4 %." in text


def test_no_text_for_fields_that_are_missing_or_empty():
    plain = said("named", effects=[step()])
    empty = {"base": None, "remainder": None, "floors": [], "nuisances": [], "probabilities": {}}
    assert said("named", effects=[step(proof=None, blocks=None)], **empty, worsened=[]) == plain
    for word in (
        "How likely",
        "Worse",
        "Off what was declared",
        "Left beyond",
        "To test next",
        "Unsure",
    ):
        assert word not in plain


def test_one_line_for_both_models():
    shown = verdict("named", effects=[step("resistance_temperature"), step("slow_diffusion")])
    assert one_line(shown) == "shows resistance over temperature and slow diffusion"
    own = verdict("none", validation_rmse_volt={"before": 3e-3, "after": 3e-3})
    assert one_line(shown, own).endswith("slow diffusion; its model lacks nothing above 3 mV")
    own = verdict("named", effects=[step("leakage", proof="unproven")])
    assert one_line(shown, own).endswith("; its model lacks self-discharge (unproven)")
    own = verdict("unknown", located_at=PLACE | {"soc": [0.9, 1.0]})
    assert one_line(verdict("none"), own) == (
        "shows nothing beyond a plain circuit; "
        "its model lacks something without a name, 1.9 mV near full"
    )
    assert one_line(verdict("unknown")) == "shows something without a name, 1.9 mV"
    like = verdict("unknown") | {"outside": [{"effect": "resistance_drift"}]}
    told = "1.9 mV, which looks like a resistance that drifts while a test runs"
    assert one_line(like) == f"shows something without a name, {told}"
    bent = own | {"as_given_rmse_volt": {"fit": 2e-3, "validation": 1.2e-3}}
    assert one_line(verdict("none"), bent).endswith("without a name, 1.2 mV near full")


def test_one_line_tells_of_the_users_simulator_last():
    lacking = verdict("named", effects=[step("self_heating")])
    line = one_line(verdict("none"), verdict("none"), lacking)
    assert line.endswith(" mV; your simulation lacks self-heating")
    assert one_line(verdict("none"), None, lacking).count(";") == 1


@pytest.mark.parametrize(
    ("base", "opening"),
    [
        ("plain", "Shows self-heating"),
        ("own", "The model in use lacks self-heating"),
        ("external", "Your model lacks self-heating"),
    ],
)
def test_a_paragraph_begins_with_whose_lack_it_is(base, opening):
    named = verdict("named", effects=[step("self_heating")], base=base)
    given = {"as_given_rmse_volt": {"fit": 4e-3, "validation": 1e-3}} if base != "plain" else {}
    text = paragraph(named | given, LIBRARY)
    assert text.startswith(opening)
    assert ("freed to follow the records fitted, by more on the others" in text) == bool(given)


def test_places_in_words():
    assert where(PLACE, file=False) == "at 10–20 % SoC on charge up to 0.7C (45 °C)"
    assert [near({"soc": ends}) for ends in ([0, 0.1], [0.4, 0.5], [0.9, 1.0])] == [
        *("near empty", "at 40–50 % SoC", "near full"),
    ]
    assert [millivolt(volt) for volt in (0.0123, 0.155)] == ["12.3 mV", "155 mV"]


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
    assert "Worse than before by 3.0 mV at 10–30 % SoC on discharge above 0.7C in a." in text
    assert "Worse" not in said("unknown", worsened=found), "no effect was added"
    assert worsened({}) == []


def test_bands_of_other_records_are_not_joined():
    volts = {"before_rms_volt": [5e-3] * 4, "after_rms_volt": [8e-3, 9e-3, 5e-3, 5e-3]}
    found = worsened(fields(test=["a", "b", "b", "b"], **volts))
    assert [(one["file"], one["soc"]) for one in found] == [("b", [0.2, 0.3]), ("a", [0.1, 0.2])]
