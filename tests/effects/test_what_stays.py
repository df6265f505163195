"""What stays in a model once all are fitted exactly, and what has no name in the end."""

from types import SimpleNamespace

import numpy as np
import pytest
from small_plant import HEALTHY, Truth, case, names_of, searched

from cellwright.effects import search
from cellwright.effects.case import Gates
from cellwright.effects.finding import ranking_of
from cellwright.effects.floor import fallen_volt
from cellwright.effects.library import LIBRARY
from cellwright.effects.search import Model, Search, _best
from cellwright.effects.state import Yardstick
from cellwright.effects.story.sizes import Fitted, has_size
from cellwright.effects.verdict import outcome
from cellwright.numerics.compare import Difference

HYSTERESIS = Truth(hysteresis=0.012)
RIVAL, TRUE = "charge_transfer_nonlinearity", "hysteresis_instant"
SMALL = "resistance_temperature"
BOTH = Truth(hysteresis=0.012, activation=2.5e4)


def blank(yardstick, models, made=None, possible=None, free=()):
    """A search of some models that were fitted."""
    return Search(made, possible or {}, free, yardstick, models, set(), [], set())


def kept(truth, *names):
    """Names that stay in a model fitted with all of them, and those that are taken out of it."""
    made, found = case(truth), searched(truth)[0]
    begun = blank(found.yardstick, {(): found.plain}, made, LIBRARY, made.begun()[0])
    effects, values = tuple(LIBRARY[name] for name in names), dict(found.first.solution.values)
    for effect in effects:
        start = effect.starts[0]
        values |= {f"{effect.id}.{p.name}": start.get(p.name, p.neutral) for p in effect.parameters}
    whole = search._fit_model(begun, effects, values)
    begun.models[whole.keys] = whole
    model = search._drop_worthless(begun, whole)
    # The fit that is handed on is one of just these effects.
    fitted = {name for name in model.state.solution.names if name.rpartition(".")[0]}
    assert {name.partition(".")[0] for name in fitted} == set(model.keys)
    return set(model.keys), set(names) - set(model.keys)


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
    """1 kJ/mol take a millivolt off; who acts on two of them only is told of hysteresis alone."""
    found, _, fitted = searched(Truth(hysteresis=0.012, activation=1.0e3))
    gates = found.case.gates._replace(material_volt=2e-3)
    result = outcome(found._replace(case=found.case._replace(gates=gates)), fitted)
    assert names_of(result) == [TRUE]
    assert [one.effect.id for one, _ in result.unnamed] == [SMALL]
    energy = result.last.solution.values[f"{SMALL}.activation_energy_joule_per_mole"]
    assert energy == pytest.approx(1.0e3, abs=0.6e3)


@pytest.mark.parametrize(
    ("gain", "joins"),
    [((5.0, 1.7, 0.0), True), ((5.0, 0.5, 3.1), True), ((5.0, 1.5, 2.9), False)],
)
def test_an_effect_joins_by_its_sum_or_by_what_would_let_it_be_a_name(gain, joins):
    assert search.joins(Difference(*gain), Gates()) is joins
    assert not search.joins(Difference(-1.0, *gain[1:]), Gates())


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
    assert found.last.solution.values[f"{TRUE}.amplitude_volt"] == 0.006
    result = outcome(found, fitted_to(1e-4))
    assert result.word == "unknown"
    ranking = ranking_of(found, result)
    assert "its value hit a limit" in ranking["against"][-1]


@pytest.mark.parametrize(("deviation", "sized"), [(0.005, True), (0.007, False), (np.inf, False)])
def test_a_size_within_two_deviations_of_none_is_no_name(deviation, sized):
    last = searched(HYSTERESIS)[1].last
    fitted = fitted_to(deviation)
    assert has_size(LIBRARY[TRUE], last.solution, last.solution.values, fitted) is sized


def fitted_to(deviation):
    """How sure the size of the hysteresis alone is."""
    return Fitted((f"{TRUE}.amplitude_volt",), (np.array([[deviation**2]]),))


@pytest.mark.parametrize(("left_volt", "falls_volt"), [(2e-3, 0.4e-3), (1.2e-3, 1.2e-3)])
def test_what_counts_is_the_fall_of_the_error_beyond_the_floor(left_volt, falls_volt):
    """From 2.4 mV beyond the noise to 2.0 is no millivolt, though squares differ by 1.3."""
    found, _, _ = searched(HYSTERESIS)
    floor, first = found.floor, found.first
    excess = left_volt + falls_volt, left_volt
    before, after = (
        first._replace(rmse_volt=float(np.hypot(floor.fit_volt, one)), validation_rmse_volt=0.01)
        for one in excess
    )
    assert fallen_volt(before, after, floor) == pytest.approx(falls_volt, abs=1e-9)
    assert fallen_volt(after, before, floor) <= 0.0


def test_where_a_branch_has_a_price_the_cost_decides():
    """Its twins together may imitate it in the density, and be far from as good a model."""
    by_cost = Yardstick(None, price=32.0, by_cost=True)
    with_it, without = by_cost.worth((), 1000.0, 1), by_cost.worth((), 1100.0, 0)
    assert with_it > without
    assert by_cost.worth((), 1050.0, 1) < without
    assert Yardstick(None).worth([-3.0, -2.0], 0.0, 2) == -7.0


def test_a_model_that_errs_more_on_what_judges_than_the_plain_one_is_not_the_best():
    """It follows nine blocks closely and misses one by half a volt, as behind an empty end."""

    def model(volt, squares):
        state = SimpleNamespace(
            effects=(), solution=SimpleNamespace(cost=0.0), validation_rmse_volt=volt
        )
        return Model((), state, np.array(squares, float))

    plain = model(0.06, [40.0] * 10)
    misses = model(0.16, [4.0] * 9 + [900.0])
    follows = model(0.05, [20.0] * 10)
    models = {(): plain, ("misses",): misses, ("follows",): follows}
    found = blank(Yardstick(None, scale=1.0), models)
    assert _best(found) is misses
    found = found._replace(most_volt=0.061)
    assert _best(found) is follows
    assert _best(found._replace(models={("misses",): misses})) is misses  # where there is no other
