"""Analytic OCV functions: each recovers itself, the best is named."""

import numpy as np
import pytest
from quick import slow_but

from cellwright.protocols.ocv.functions import evaluate, fit_functions
from cellwright.refusal import Refusal

SOC = np.linspace(0, 1, 201)
TRUTH = {
    "log": [3.6, 0.003, -0.5, 0.02, -0.03],
    "two_exponentials": [3.0, 0.6, 0.4, 20.0, -0.3, 0.5],
    "inverse": [4.1, 0.005, -0.9, 0.5],
    "polynomial": [3.0, 3.0, -10.0, 22.0, -28.0, 19.0, -5.0],
}


def fits(volt, **settings):
    return {fit.function: fit for fit in fit_functions(SOC, volt, **settings)}


def curve(name):
    volt = np.full(len(SOC), np.nan)
    volt[1:-1] = evaluate(name, TRUTH[name], SOC[1:-1])
    return volt


@pytest.mark.parametrize("name", TRUTH)
def test_each_function_recovers_itself_and_is_the_best(name):
    functions = fits(curve(name))
    np.testing.assert_allclose(functions[name].parameters, TRUTH[name], rtol=2e-3)
    assert functions[name].rmse_volt < 1e-6
    assert functions[name].chosen
    assert sum(fit.chosen for fit in functions.values()) == 1


@pytest.mark.parametrize("name", slow_but("polynomial", TRUTH))
def test_noise_is_covered_by_the_standard_deviations(name):
    rng = np.random.default_rng(2)
    noisy = [curve(name) + 1e-3 * rng.standard_normal(len(SOC)) for _ in range(3)]
    functions = [fits(volt)[name] for volt in noisy]
    scores = np.array([(fit.parameters - TRUTH[name]) / fit.std for fit in functions])
    assert 0.4 < np.sqrt(np.mean(scores**2)) < 2
    assert functions[0].rmse_volt == pytest.approx(1e-3, rel=0.15)


def test_a_curve_of_no_function_is_best_told_by_its_table():
    functions = fits(3.3 + 0.3 * SOC + 0.05 * np.tanh((SOC - 0.3) / 0.02) + 0.04 * np.sin(25 * SOC))
    assert functions["table"].chosen
    assert len(functions["table"].parameters) == 0
    assert functions["polynomial"].rmse_volt < functions["polynomial"].cross_validation_rmse_volt


def test_too_few_points_are_refused():
    with pytest.raises(Refusal, match="9 points in range, fewer than 40"):
        fit_functions(np.linspace(0.1, 0.9, 9), np.linspace(3, 4, 9))
