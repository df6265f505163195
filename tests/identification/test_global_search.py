"""Global searches: the gradient's optimum is at least as good as theirs, and they come close."""

import numpy as np
import pytest
from pulse_train import CURRENT, TIME, TRUE, noisy, voltage

from cellwright.identification.methods.global_search import cost_function, evolve, evolve_by_genes
from cellwright.identification.methods.pulse import fit_circuit
from cellwright.refusal import Refusal

HOLD = {"hold": "zero_order"}
ROWS = slice(0, 1500)
RECORD = TIME[ROWS], CURRENT[ROWS], noisy(1)[ROWS], 3.7
BOUNDS = {
    "r0_ohm": (1e-3, 0.1),
    "r1_ohm": (1e-3, 0.1),
    "r2_ohm": (1e-3, 0.1),
    "tau1_second": (0.5, 20.0),
    "tau2_second": (10.0, 500.0),
}


def test_the_cost_is_the_mean_squared_error_of_the_simulation():
    error = voltage()[ROWS] - RECORD[2]
    cost = cost_function(RECORD, **HOLD)
    assert cost(np.log(TRUE)) == pytest.approx(np.mean(error**2), rel=1e-9)


@pytest.mark.parametrize("search", [evolve, evolve_by_genes])
def test_the_gradient_is_at_least_as_good(search):
    found = search(RECORD, BOUNDS, **HOLD)
    best = fit_circuit(*RECORD, **HOLD)
    cost = cost_function(RECORD, **HOLD)(np.log(best.values))
    assert cost <= found.mean_square_volt2 * (1 + 1e-9)
    assert found.mean_square_volt2 < 1.01 * cost
    np.testing.assert_allclose(found.values, best.values, rtol=0.25)
    assert best.iterations * 100 < found.evaluations


@pytest.mark.parametrize("search", [evolve, evolve_by_genes])
def test_a_seed_repeats_itself_and_the_best_never_gets_worse(search):
    short = HOLD | {"generations": 5, "population": 10}
    first, second = search(RECORD, BOUNDS, **short), search(RECORD, BOUNDS, **short)
    assert (first.values == second.values).all()
    assert (np.diff(first.course) <= 0).all()
    assert (first.values != search(RECORD, BOUNDS, **short, seed=1).values).any()


def test_a_hundred_generations_are_the_default():
    found = evolve_by_genes(RECORD, BOUNDS, **HOLD, population=10)
    assert len(found.course) == 101
    low, high = np.array([BOUNDS[name] for name in found.names]).T
    assert ((found.values >= low) & (found.values <= high)).all()


@pytest.mark.parametrize("search", [evolve, evolve_by_genes])
def test_refusals(search):
    with pytest.raises(Refusal, match="none for tau2_second"):
        search(RECORD, {k: v for k, v in BOUNDS.items() if k != "tau2_second"}, **HOLD)
    with pytest.raises(Refusal, match="above zero"):
        search(RECORD, BOUNDS | {"r0_ohm": (0.0, 1.0)}, **HOLD)
    with pytest.raises(Refusal, match="not finite"):
        search((*RECORD[:2], np.nan * RECORD[2], 3.7), BOUNDS, **HOLD)
