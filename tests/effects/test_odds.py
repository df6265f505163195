"""How likely each answer of a search is."""

import numpy as np
import pytest
from small_plant import CAPACITY, HEALTHY, Truth, case, drive, measured, rounds

from cellwright.effects import odds
from cellwright.effects.case import Gates
from cellwright.effects.library import LIBRARY
from cellwright.effects.odds import UNSEEN, probabilities
from cellwright.effects.proof import block_sums, consistency, consistency_of
from cellwright.effects.records import stacked
from cellwright.effects.search import search
from cellwright.effects.verdict import outcome, verdict_of


def said(truth, **options):
    steps = rounds(truth)
    return probabilities(case(truth), steps, outcome(steps, Gates()), **options)


@pytest.mark.parametrize(
    ("truth", "answer"),
    [
        (HEALTHY, "none"),
        (Truth(hysteresis=0.012), "hysteresis_instant"),
        (Truth(ripple=0.008), "unknown"),
        (
            Truth(hysteresis=0.012, activation=2.5e4),
            "hysteresis_instant + resistance_temperature",
        ),
    ],
)
def test_a_clear_answer_is_the_likeliest_but_never_certain(truth, answer):
    weighed = said(truth)
    assert next(iter(weighed)) == answer
    assert 0.7 < weighed[answer] < 1.0
    assert sum(weighed.values()) == pytest.approx(1.0)
    assert weighed == said(truth)


def test_told_shares_are_sharper_and_keep_their_order():
    shares = {"none": 0.6, "leakage": 0.3, "unknown": 0.1}
    sharp = odds.sharpened(shares)
    assert list(sharp) == list(shares)
    assert sum(sharp.values()) == pytest.approx(1.0)
    assert sharp["none"] > 0.6
    assert sharp["leakage"] / sharp["unknown"] == pytest.approx(3**odds.SHARPER)


def test_a_proof_that_can_hardly_show_a_name_does_not_make_it_unsure():
    """Ten minutes of a mild load at the temperature of the slow test, which was fitted."""
    truth = Truth(activation=1.2e4)
    mild = measured("mild", 0.3 * drive(103)[:300], 19.0, 0.95, truth, seed=13)
    made = case(truth)._replace(validation=stacked([mild], capacity_ampere_hour=CAPACITY))
    steps = search(made, LIBRARY)
    weighed = probabilities(made, steps, outcome(steps, Gates()))
    assert weighed["resistance_temperature"] > 0.75
    assert not steps[0].chosen.proven


def test_two_effects_that_no_fit_tells_apart_share_their_probability():
    weighed = said(Truth(leak=0.06))
    assert weighed["leakage"] == pytest.approx(weighed["current_offset"])
    assert weighed["leakage"] > 0.35


def test_weaker_effects_are_less_sure():
    sizes = [said(Truth(hysteresis=volt), unseen=0.0) for volt in (0.012, 0.0012)]
    assert sizes[0].get("hysteresis_instant", 0.0) > sizes[1].get("hysteresis_instant", 0.0)


def test_without_draws_that_differ_the_search_itself_is_the_answer():
    alike = said(Truth(hysteresis=0.012), spread=1e-6, unseen=0.0)
    assert alike["hysteresis_instant"] == pytest.approx(1.0)
    assert 0.0 < UNSEEN < 0.5


def test_a_block_of_weight_two_counts_as_if_it_were_there_twice():
    random = np.random.default_rng(3)
    before, after = random.normal(0.0, 3e-3, (2, 120))
    block, record = np.repeat(np.arange(4), 30), np.repeat([0, 0, 1, 1], 30)
    twice = [np.append(column, column[-30:]) for column in (before, after)]
    more = np.append(block, np.full(30, 4)), np.append(record, np.ones(30, int))
    limit = {"material_volt": 1e-3}
    wanted = consistency(*twice, *more, **limit)
    sums = block_sums(before, after, block, record)
    weights = np.array([[1.0, 1.0, 1.0, 2.0]])
    assert consistency_of(sums, weights, **limit)[0] == pytest.approx(wanted)


COURSES = Truth(activation=2.5e4, falling=0.9)
COURSE, NUMBER = "resistance_temperature", "hysteresis_instant"
PAIR = Truth(hysteresis=0.012, activation=2.5e4)


@pytest.mark.parametrize(
    ("truth", "both", "names"),
    [(COURSES, 0.95, 2), (COURSES, 0.85, 1), (PAIR, 0.6, 2)],
    ids=["a sure one", "one that is not", "one number"],
)
def test_beside_the_likeliest_name_only_one_that_is_sure_or_of_one_number_is_a_name(
    truth, both, names
):
    steps = rounds(truth)
    first, other = (step.chosen.effect.id for step in outcome(steps, Gates()).steps)
    shares = {" + ".join(sorted([first, other])): both, first: 1.0 - both}
    steps = odds.sure_beside(steps, outcome(steps, Gates()), shares)
    result = outcome(steps, Gates())
    verdict = verdict_of("cell", result, steps, None)
    assert [one["effect"] for one in verdict["effects"]] == [first, other][:names]
    assert verdict["small"] == [other][: 2 - names]
    assert {effect.id for effect in result.last.effects} == {first, other}
    told, whole = verdict["effects"][0]["validation_rmse_volt"], verdict["validation_rmse_volt"]
    assert told["after"] > whole["after"]


def test_a_name_by_itself_may_be_unsure():
    truth = Truth(hysteresis=0.012)
    steps = rounds(truth)
    shares = {"hysteresis_instant": 0.6, "none": 0.4}
    assert odds.sure_beside(steps, outcome(steps, Gates()), shares) == steps
