"""Rounds: an effect that another makes needless is taken out, and where a search ends."""

from functools import cache

import numpy as np
import pytest
from small_plant import HEALTHY, Truth, case, rounds

from cellwright.effects import search
from cellwright.effects.case import Gates
from cellwright.effects.finding import ranking_of
from cellwright.effects.library import LIBRARY
from cellwright.effects.library.vocabulary import in_order
from cellwright.effects.proof import prominent
from cellwright.effects.verdict import outcome
from cellwright.numerics.least_squares import fit

HYSTERESIS = Truth(hysteresis=0.012)
RIVAL, TRUE = "charge_transfer_nonlinearity", "hysteresis_instant"
SMALL = "resistance_temperature"


@cache
def together(truth, names):
    """(case, model of the search with these effects in, filters)."""
    made, steps = case(truth), rounds(truth)
    plain, values, _ = made.begun()
    filters = steps[0].filters
    effects, free = in_order([LIBRARY[name] for name in names], LIBRARY), plain
    for effect in effects:
        free, start = made.with_effect(free, effect), effect.starts[0]
        values |= {f"{effect.id}.{p.name}": start.get(p.name, p.neutral) for p in effect.parameters}
    solution = fit(made.problem(effects, free, filters), values)
    return made, search._Model(plain, effects, free, solution), filters


def kept(truth, *names):
    """Names that stay in the model, and those that are taken out of it."""
    made, model, filters = together(truth, names)
    model, dropped, beside = search._needed(made, model, filters, rounds(truth))
    # The fit that is handed on is one of just these effects.
    fitted = {name for name in model.solution.values if name.rpartition(".")[0]}
    assert {one.name for one in model.free} == set(model.solution.names)
    assert all(name in fitted for effect in model.effects for name in effect.names)
    # Of each that stays it is told what it does beside the others.
    assert [one.trial.effect.id for one in beside] == [effect.id for effect in model.effects]
    return {effect.id for effect in model.effects}, set(dropped)


def test_a_wrong_name_is_taken_out_once_the_true_one_is_in():
    """Alone it takes up half of what hysteresis makes, at a size that no cell has."""
    steps = rounds(HYSTERESIS, without=(TRUE, "hysteresis_one_state"))
    alone = next(trial for trial in steps[0].trials if trial.effect.id == RIVAL)
    assert alone.at_limit
    assert outcome(steps, Gates()).word == "unknown"
    assert kept(HYSTERESIS, RIVAL, TRUE) == ({TRUE}, {RIVAL})


def test_two_effects_that_are_both_there_both_stay():
    both = Truth(hysteresis=0.012, activation=2.5e4)
    names = {TRUE, "resistance_temperature"}
    assert kept(both, *sorted(names)) == (names, set())


def test_all_go_that_a_healthy_cell_has_not():
    names = {TRUE, "resistance_asymmetry"}
    assert kept(HEALTHY, *sorted(names)) == (set(), names)


@pytest.mark.parametrize(("taken", "stays"), [(0.45, False), (0.55, True)])
@pytest.mark.parametrize("proven", [True, False])
def test_a_name_takes_off_at_least_half_of_what_is_left_beside_it(proven, taken, stays):
    """Of the side that proves it; beside a large error of another kind nobody knows whose it is."""
    step = rounds(HYSTERESIS)[0]
    state, floor = step.chosen.state, step.floor
    name, lowest = ("validation_rmse_volt", floor.validation_volt)
    if not proven:
        name, lowest = ("rmse_volt", floor.fit_volt)
    left = 0.02
    before = step.before._replace(**{name: np.hypot(np.hypot(left, lowest), taken * left)})
    trial = step.chosen._replace(state=state._replace(**{name: np.hypot(left, lowest)}))
    trial = trial._replace(proven=proven)
    assert prominent(before, trial, floor) == stays
    made = case(HYSTERESIS)
    assert search.stays(made, step.before, before, trial, floor) == stays


def test_what_is_too_small_to_act_on_joins_without_a_name_and_hides_nothing():
    """1.7 kJ/mol explain most, and less than anyone acts on; hysteresis is named beside them."""
    steps = rounds(Truth(hysteresis=0.0022, activation=1.7e3))
    assert [[trial.effect.id for trial in step.small] for step in steps] == 2 * [[SMALL]]
    last = steps[-1].before
    assert {effect.id for effect in last.effects} == {SMALL, TRUE}
    assert [step.chosen.effect.id for step in outcome(steps, Gates()).steps] == [TRUE]
    energy = last.solution.values[f"{SMALL}.activation_energy_joule_per_mole"]
    assert energy == pytest.approx(1.7e3, abs=0.8e3)


def test_nothing_small_joins_a_model_that_leaves_nothing_anyone_would_act_on():
    for step in rounds(HEALTHY):
        assert step.small == ()


def nothing_at_first(best_of, *, rounds):
    """`best_of` by which nothing counts in so many rounds, as where all harm what others lack."""
    asked = []

    def none_at_first(*of):
        asked.append(of)
        return (None, ()) if len(asked) <= rounds else best_of(*of)

    return none_at_first


BOTH = Truth(hysteresis=0.012, activation=2.5e4)


def test_two_that_only_count_beside_each_other_are_found_by_looking_ahead(monkeypatch):
    monkeypatch.setattr(search, "best_of", nothing_at_first(search.best_of, rounds=1))
    first, second, last = search.search(case(BOTH), LIBRARY)
    names = [step.chosen.effect.id for step in (first, second)]
    assert set(names) == {TRUE, "resistance_temperature"}
    assert last.chosen is None
    # The first is told as it counts beside the second, in the ranking as well.
    assert any(trial is first.chosen for trial in first.trials)
    beside = next(one.trial for one in second.beside if one.trial.effect.id == names[0])
    assert (first.chosen.proof, first.chosen.j) == (beside.proof, beside.j)


@pytest.mark.parametrize(("truth", "rounds"), [(HEALTHY, 1), (BOTH, 99)])
def test_what_counts_neither_alone_nor_beside_another_is_not_taken(monkeypatch, truth, rounds):
    monkeypatch.setattr(search, "best_of", nothing_at_first(search.best_of, rounds=rounds))
    steps = search.search(case(truth), LIBRARY)
    assert [step.chosen for step in steps] == [None]


def test_an_effect_whose_size_is_at_its_limit_is_no_name():
    """What the records ask for beyond that limit is something else."""
    hysteresis = LIBRARY[TRUE]
    amplitude = hysteresis.parameters[0]
    small = hysteresis._replace(parameters=(amplitude._replace(upper=0.006),))
    steps = search.search(case(HYSTERESIS), {TRUE: small})
    (trial,) = steps[0].trials
    assert trial.at_limit
    assert [step.chosen for step in steps] == [None]
    ranking = ranking_of(case(HYSTERESIS), steps)
    assert "at the limit of what it can be" in ranking["against"][0]
