"""Rounds: an effect that another makes needless is taken out, and where a search ends."""

from functools import cache

import numpy as np
import pytest
from small_plant import HEALTHY, Truth, case, rounds

from cellwright.effects import candidates, search, verdict
from cellwright.effects.candidates import form_of
from cellwright.effects.case import Gates
from cellwright.effects.finding import ranking_of
from cellwright.effects.library import LIBRARY
from cellwright.effects.library.vocabulary import in_order
from cellwright.effects.proof import prominent
from cellwright.effects.verdict import IMPOSSIBLE, Searched, _of_possible_sizes, outcome
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


@pytest.mark.parametrize("name", ["slow_diffusion", TRUE, RIVAL])
def test_a_trial_begun_where_it_ended_by_another_noise_ends_where_one_begun_anew_does(name):
    """By noise twice as large the optimum is as good, whatever is kept of what came before."""
    made, step = case(HYSTERESIS), rounds(HYSTERESIS)[0]
    plain, _, _ = made.begun()
    louder = made.filters_for(2 * step.before.solution.residual, step.filters, ())
    problem = made.problem((), plain, louder)
    before = made.state((), fit(problem, step.before.solution.values), louder)
    score = next(one for one in step.scores if one.candidate.effect.id == name)
    form = score.candidate.form
    end = next(
        trial.state
        for trial in step.trials
        if trial.effect.id == name and form_of(trial.effect, trial.state.values) == form
    )
    about = made, LIBRARY, plain, before
    anew, kept = (candidates.tried(*about, score, louder, one) for one in (None, end))
    gains = [before.solution.cost - one.state.solution.cost for one in (anew, kept)]
    assert gains[1] > 0.98 * gains[0]


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


def test_what_was_chosen_and_counts_no_more_ends_the_search(monkeypatch):
    """No rival that explains less may take the place of a choice at the edge."""
    made, few = case(HYSTERESIS), {name: LIBRARY[name] for name in (TRUE, RIVAL)}
    needed, calls = search._needed, []

    def without(case, model, filters, earlier):
        calls.append([effect.id for effect in model.effects])
        choice = earlier[-1].chosen._replace(delta_bic=0.0)
        return needed(case, model, filters, earlier)[0], {TRUE: choice}, ()

    monkeypatch.setattr(search, "_needed", without)
    steps = search.search(made, few)
    assert calls == [[TRUE]]
    assert [step.chosen for step in steps] == [None]
    assert steps[0].dropped == (TRUE,)
    result = outcome(steps, Gates())
    assert (result.word, result.steps) == ("unknown", ())


def test_an_earlier_name_is_not_needless_beside_a_choice_that_does_not_count(monkeypatch):
    """Else a last choice at the edge would take a right name with it."""
    truth = Truth(hysteresis=0.012, activation=2.5e4)
    needed = search._needed

    def none_of_two(case, model, filters, earlier):
        if len(model.effects) < 2:
            return needed(case, model, filters, earlier)
        choice = earlier[-1].chosen._replace(delta_bic=0.0)
        return model, {effect.key: choice for effect in model.effects}, ()

    monkeypatch.setattr(search, "_needed", none_of_two)
    steps = search.search(case(truth), LIBRARY)
    result = outcome(steps, Gates())
    first, second = steps
    assert (first.chosen is not None, second.chosen) == (True, None)
    assert [step.chosen.effect.key for step in result.steps] == [first.chosen.effect.key]
    assert len(second.dropped) == 1
    assert not set(second.dropped) & {effect.key for effect in result.last.effects}


def test_an_effect_that_was_chosen_stays_with_less_than_makes_a_choice():
    """Else a size near the limit would come and go with the last digit of a fit."""
    first = rounds(HYSTERESIS)[0]
    made, trial = case(HYSTERESIS), first.trials[0]
    size = Gates().material_volt
    near = (trial.state.validation_rmse_volt**2 + (0.8 * size) ** 2) ** 0.5
    about = trial.state.rmse_volt
    before = first.before._replace(validation_rmse_volt=near, rmse_volt=about)
    asked = first.before, before, trial, first.floor
    assert not made.matters(*asked)
    assert made.matters(*asked, share=search.STAYS)


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


@pytest.mark.parametrize("truth", [HYSTERESIS, HEALTHY])
def test_a_round_holds_the_filters_by_which_it_was_judged(truth):
    """The cost of its model is that of a fit with them: what reads a round needs no others."""
    for step in rounds(truth):
        solution = step.before.solution
        again = step.filters.fit.apply(solution.residual)
        assert again @ again == pytest.approx(solution.chi_square, rel=1e-9)
        assert step.noise == step.filters.noise


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


def test_forms_of_one_effect_take_no_place_of_another():
    """Every effect among the best so many is tried, in each of its forms."""
    made = case(HYSTERESIS, gates=Gates(refits=3))
    step = search.search(made, LIBRARY)[0]
    asked = dict.fromkeys(score.candidate.effect.key for score in step.scores)
    assert {trial.effect.key for trial in step.trials} == set(list(asked)[:3])


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


def test_a_name_whose_size_ends_on_its_bound_once_all_is_refitted_is_taken_back():
    made, steps = case(HYSTERESIS), rounds(HYSTERESIS)
    result = outcome(steps, made.gates)
    found = Searched(made, list(steps), result, {})
    assert _of_possible_sizes(found) is found
    leading = LIBRARY[TRUE].names[0]
    solution = result.last.solution._replace(at_bound=(leading,))
    extreme = result._replace(last=result.last._replace(solution=solution))
    taken_back = _of_possible_sizes(found._replace(result=extreme))
    assert taken_back.result.steps == ()
    assert taken_back.result.refused is steps[0]
    ranking = ranking_of(made, taken_back.rounds, taken_back.result)
    assert IMPOSSIBLE in ranking["against"]


def test_what_would_drive_a_name_onto_its_bound_does_not_join_beside_it(monkeypatch):
    """As slow diffusion beside the 30Q's polarisation over SoC: 67 ± 200 mΩ at 10 % SoC."""
    truth = Truth(entropy=1e-3, activation=1.2e3)
    made, steps = case(truth), rounds(truth)
    found = Searched(made, list(steps), outcome(steps, made.gates), {})
    joined = verdict._beside_small(found)
    assert [trial.effect.id for trial in joined.rounds[-1].small] == [SMALL]
    (step,) = found.result.steps
    fitted = verdict._fit_of

    def on_its_bound(*model):
        return fitted(*model)._replace(at_bound=step.chosen.effect.names[:1])

    monkeypatch.setattr(verdict, "_fit_of", on_its_bound)
    assert verdict._beside_small(found) is found


def test_a_round_is_asked_anew_from_where_its_choice_led_the_model_without_it(monkeypatch):
    """A cell by physics that leaks began at 57 mV, where its fit stayed, and ended there."""
    needed, asked = search._needed, []

    def further(made, model, filters, earlier):
        asked.append(len(earlier))
        if len(asked) > 1:
            return needed(made, model, filters, earlier)
        step = earlier[-1]
        least = step.before.solution._replace(cost=step.before.solution.cost - 50.0)
        bare = model._replace(effects=(), free=model.plain, solution=least)
        return bare, {step.chosen.effect.key: step.chosen._replace(delta_bic=0.0)}, ()

    monkeypatch.setattr(search, "_needed", further)
    steps = search.search(case(HYSTERESIS), LIBRARY)
    assert asked == [1, 1]
    assert [step.chosen.effect.id for step in outcome(steps, Gates()).steps] == [TRUE]
