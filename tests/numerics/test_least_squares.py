"""Rates from poor starts and within bounds; deviations of parameters whose units lie far apart."""

import numpy as np
import pytest

from cellwright.numerics import least_squares
from cellwright.numerics.least_squares import best_logarithms, bounded_minimum, inverse
from cellwright.numerics.lines import residuals

TIME = np.linspace(0.0, 10.0, 60)


def decays(logs):
    return np.exp(-TIME[:, None] * np.exp(logs))


def rest_of(target):
    """Residual of the best amplitudes at given logarithms of the rates."""
    return lambda logs: residuals(decays(logs), target)


@pytest.mark.parametrize("start", [(-3.0, 2.0), (0.0, 0.1)])
def test_two_rates_are_found(start):
    target = decays(np.log([0.3, 2.0])) @ [1.0, -0.5]
    logarithms = best_logarithms(rest_of(target), [start], bounds=(-6, 4))
    np.testing.assert_allclose(np.sort(np.exp(logarithms)), [0.3, 2.0], rtol=1e-4)


def test_the_start_that_leads_to_the_least_error_counts():
    def two_valleys(logs):
        return np.array([1.0 + 0.1 * logs[0]]) if logs[0] < 0 else np.array([logs[0] - 2.0])

    logarithms = best_logarithms(two_valleys, [[-1.0], [1.0]], bounds=(-3, 3))
    assert logarithms[0] == pytest.approx(2.0, abs=1e-6)


def test_a_rate_beyond_its_bounds_ends_on_them():
    target = decays(np.log([8.0])) @ [1.0]
    logarithms = best_logarithms(rest_of(target), [[0.0]], bounds=(-6.0, 1.0))
    assert logarithms[0] == pytest.approx(1.0, abs=1e-3)


def test_a_model_without_rates_has_nothing_to_search():
    assert best_logarithms(rest_of(TIME), [()], bounds=(-1, 1)).shape == (0,)


def test_deviations_do_not_hang_on_the_units_of_parameters():
    """An ohm is known to a microohm, a time constant to ten minutes: squares 18 decades apart."""
    deviations = np.array([1e-6, 600.0, 1e-4])
    correlations = np.array([[1.0, 0.6, 0.0], [0.6, 1.0, 0.3], [0.0, 0.3, 1.0]])
    precision = np.linalg.inv(correlations) / np.outer(deviations, deviations)
    covariance = inverse(precision) / np.outer(deviations, deviations)
    np.testing.assert_allclose(covariance, correlations, rtol=1e-9, atol=1e-9)


def test_what_nothing_tells_of_takes_no_other_parameter_with_it():
    covariance = inverse(np.array([[4.0, 0.0], [0.0, 0.0]]))
    np.testing.assert_allclose(covariance, [[0.25, 0.0], [0.0, 0.0]])


@pytest.mark.parametrize("exchanges", [12, 0], ids=["at once", "one by one"])
@pytest.mark.parametrize("seed", range(5))
def test_the_minimum_within_bounds_meets_its_conditions(monkeypatch, exchanges, seed):
    monkeypatch.setattr(least_squares, "EXCHANGES", exchanges)
    random = np.random.default_rng(seed)
    root = random.normal(size=(30, 30))
    precision, moment = root @ root.T + np.eye(30), 20 * random.normal(size=30)
    low, up = np.full(30, -0.3), np.full(30, 0.2)
    x = bounded_minimum(precision, moment, low, up)
    slope = precision @ x - moment
    inside = (x > low) & (x < up)
    assert 5 < inside.sum() < 25
    assert slope[inside] == pytest.approx(0.0, abs=1e-6)
    assert (slope[x <= low] >= -1e-3).all()
    assert (slope[x >= up] <= 1e-3).all()
