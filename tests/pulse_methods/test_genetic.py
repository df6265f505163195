"""Genetic algorithm: the gradient's optimum is at least as good, and the search comes close."""

import numpy as np
import pytest
from pulse_train import CURRENT, TIME, TRUE, noisy, voltage

from cellwright.numerics.lags import HOLDS
from cellwright.refusal import Refusal
from pulse_methods.genetic import cost_function, evolve_by_genes
from pulse_methods.pulse import fit_circuit

HOLD = {"hold": "zero_order"}
ROWS = slice(0, 1000)
RECORD = TIME[ROWS], CURRENT[ROWS], noisy(1)[ROWS], 3.7
BOUNDS = {
    "r0_ohm": (1e-3, 0.1),
    "r1_ohm": (1e-3, 0.1),
    "r2_ohm": (1e-3, 0.1),
    "tau1_second": (0.5, 20.0),
    "tau2_second": (10.0, 500.0),
}


@pytest.mark.parametrize("hold", HOLDS)
def test_the_cost_is_the_mean_squared_error_of_the_simulation(hold):
    cost = cost_function(RECORD, hold=hold)
    others = np.array([TRUE, 1.3 * TRUE, [0.03, 0.02, 0.01, 1.0, 90.0]])
    errors = [voltage(values, hold)[ROWS] - RECORD[2] for values in others]
    np.testing.assert_allclose(cost(np.log(others)), np.mean(np.square(errors), axis=1), rtol=1e-9)


@pytest.mark.slow
def test_the_gradient_is_at_least_as_good():
    evolved = evolve_by_genes(RECORD, BOUNDS, **HOLD)
    best = fit_circuit(*RECORD, **HOLD)
    (cost,) = cost_function(RECORD, **HOLD)(np.log(best.values[None]))
    assert cost <= evolved.mean_square_volt2 * (1 + 1e-9)
    assert evolved.mean_square_volt2 < 1.01 * cost
    np.testing.assert_allclose(evolved.values, best.values, rtol=0.25)
    assert best.iterations * 100 < evolved.evaluations


def test_a_seed_repeats_itself_and_the_best_never_gets_worse():
    short = HOLD | {"generations": 5, "population": 10}
    first, second = (
        evolve_by_genes(RECORD, BOUNDS, **short),
        evolve_by_genes(RECORD, BOUNDS, **short),
    )
    assert (first.values == second.values).all()
    assert (np.diff(first.course) <= 0).all()
    assert (first.values != evolve_by_genes(RECORD, BOUNDS, **short, seed=1).values).any()


def test_refusals():
    with pytest.raises(Refusal, match="none for tau2_second"):
        evolve_by_genes(RECORD, {k: v for k, v in BOUNDS.items() if k != "tau2_second"}, **HOLD)
    with pytest.raises(Refusal, match="above zero"):
        evolve_by_genes(RECORD, BOUNDS | {"r0_ohm": (0.0, 1.0)}, **HOLD)
    with pytest.raises(Refusal, match="not finite"):
        evolve_by_genes((*RECORD[:2], np.nan * RECORD[2], 3.7), BOUNDS, **HOLD)
