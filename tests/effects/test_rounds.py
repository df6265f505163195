"""Rounds: an effect that another makes needless is taken out, and what has no name in the end."""

import numpy as np
import pytest
from small_plant import HEALTHY, Truth, case, names_of, searched

from cellwright.effects import search
from cellwright.effects.candidates import has_size
from cellwright.effects.finding import ranking_of
from cellwright.effects.library import LIBRARY
from cellwright.effects.library.vocabulary import in_order
from cellwright.effects.verdict import outcome
from cellwright.numerics.least_squares import fit

HYSTERESIS = Truth(hysteresis=0.012)
RIVAL, TRUE = "charge_transfer_nonlinearity", "hysteresis_instant"
SMALL = "resistance_temperature"
BOTH = Truth(hysteresis=0.012, activation=2.5e4)


def kept(truth, *names):
    """Names that stay in a model fitted with all of them, and those that are taken out of it."""
    made, filters = case(truth), searched(truth)[0].rounds[0].filters
    plain, values, _ = made.begun()
    effects, free = tuple(LIBRARY[name] for name in names), plain
    for effect in effects:
        free, start = made.with_effect(free, effect), effect.starts[0]
        values |= {f"{effect.id}.{p.name}": start.get(p.name, p.neutral) for p in effect.parameters}
    solution = fit(made.problem(in_order(effects, LIBRARY), free, filters), values)
    model = search._Model(plain, effects, solution)
    model, beside, dropped = search._needed(made, LIBRARY, model, filters)
    # The fit that is handed on is one of just these effects.
    fitted = {name for name in model.solution.names if name.rpartition(".")[0]}
    assert {name.partition(".")[0] for name in fitted} == {effect.id for effect in model.effects}
    # Of each that stays it is told what it does beside the others.
    assert [one.effect.id for one in beside] == [effect.id for effect in model.effects]
    return {effect.id for effect in model.effects}, set(dropped)


def test_a_wrong_name_is_taken_out_once_the_true_one_is_in():
    """Alone it takes up half of what hysteresis makes, at a size that no cell has."""
    assert kept(HYSTERESIS, RIVAL, TRUE) == ({TRUE}, {RIVAL})
    result = searched(HYSTERESIS, without=(TRUE, "hysteresis_one_state"))[1]
    assert result.word == "unknown"


def test_two_effects_that_are_both_there_both_stay():
    names = {TRUE, SMALL}
    assert kept(BOTH, *sorted(names)) == (names, set())


def test_all_go_that_a_healthy_cell_has_not():
    names = {TRUE, "resistance_asymmetry"}
    assert kept(HEALTHY, *sorted(names)) == (set(), names)


@pytest.mark.slow
def test_what_is_too_small_to_act_on_joins_without_a_name_and_hides_nothing():
    """1 kJ/mol are there, and less than anyone acts on; hysteresis is named beside them."""
    result = searched(Truth(hysteresis=0.012, activation=1.0e3))[1]
    assert names_of(result) == [TRUE]
    assert [one.effect.id for one, _ in result.unnamed] == [SMALL]
    energy = result.last.solution.values[f"{SMALL}.activation_energy_joule_per_mole"]
    assert energy == pytest.approx(1.0e3, abs=0.6e3)


def test_nothing_joins_a_model_that_leaves_nothing_anyone_would_act_on():
    found, result, _ = searched(HEALTHY)
    assert found.last.effects == ()
    assert result.unnamed == ()


@pytest.mark.slow
def test_an_effect_whose_size_is_at_its_limit_is_no_name():
    """What the records ask for beyond that limit is something else."""
    hysteresis = LIBRARY[TRUE]
    amplitude = hysteresis.parameters[0]
    small = hysteresis._replace(parameters=(amplitude._replace(upper=0.006),))
    found = search.search(case(HYSTERESIS), {TRUE: small})
    (trial,) = found.rounds[0].trials
    assert trial.at_limit
    result = outcome(found, {f"{TRUE}.amplitude_volt": 1e-4})
    assert result.word == "unknown"
    ranking = ranking_of(found, result)
    assert "at its limit" in ranking["against"][0]


@pytest.mark.parametrize(("deviation", "sized"), [(0.005, True), (0.007, False), (np.inf, False)])
def test_a_size_within_two_deviations_of_none_is_no_name(deviation, sized):
    last = searched(HYSTERESIS)[1].last
    deviations = {f"{TRUE}.amplitude_volt": deviation}
    assert has_size(LIBRARY[TRUE], last.solution, deviations) is sized


def test_what_takes_off_little_of_what_is_lacking_is_no_name():
    """A fifth of what the plain model leaves, at least a millivolt, at most what would be told."""
    found, _, _ = searched(HYSTERESIS)
    made, floor, first = case(HYSTERESIS), found.floor, found.first
    made = made._replace(gates=made.gates._replace(unknown_volt=1.0))
    excess = np.sqrt(first.rmse_volt**2 - floor.fit_volt**2)
    for share, counts in ((0.15, False), (0.3, True)):
        taken = share * excess
        assert taken > made.gates.material_volt / 2
        after = first._replace(rmse_volt=float(np.sqrt(first.rmse_volt**2 - taken**2)))
        assert made.matters(first, first, after, None, floor) is counts
    told = made._replace(gates=made.gates._replace(unknown_volt=0.1 * excess))
    assert told.matters(first, first, after._replace(rmse_volt=0.98 * first.rmse_volt), None, floor)
