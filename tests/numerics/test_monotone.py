"""A rising curve: known values and slopes recovered, always rising, exact on lines, intervals."""

import numpy as np
import pytest

from cellwright.numerics import monotone

X = np.linspace(0, 2, 3000)


def logistic_steps(x):
    """A curve whose slope changes by a factor of forty, and that slope."""
    y = 0.05 * x + sum(0.2 / (1 + np.exp(-(x - c) / 0.03)) for c in (0.6, 1.3))
    slope = 0.05 + sum(0.2 / 0.03 / 4 / np.cosh((x - c) / 0.06) ** 2 for c in (0.6, 1.3))
    return y, slope


def fitted(y, weight=None):
    return monotone.rising_curve(X, y, np.ones(len(X)) if weight is None else weight, cells=200)


def test_slope_and_its_interval_hold_the_truth():
    inside, error = [], []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        y, _ = logistic_steps(X)
        curve = fitted(y + 1e-3 * rng.standard_normal(len(X)))
        place = np.linspace(5, 195, 60)
        _, slope, _ = monotone.values(curve, place)
        std = monotone.standard_deviations(curve, monotone.gradients(curve, place, 1))
        _, true = logistic_steps(monotone.x_at(curve, place))
        inside.append(np.abs(slope - true) < 1.96 * std)
        error.append(slope / true - 1)
    assert 0.88 <= np.mean(inside) <= 0.995
    assert np.sqrt(np.mean(np.square(error))) < 0.06


def test_the_curve_always_rises_however_noisy():
    rng = np.random.default_rng(0)
    curve = fitted(X + rng.standard_normal(len(X)))
    assert np.all(monotone.values(curve, np.linspace(0, 200, 1000))[1] > 0)


def test_a_line_is_kept():
    curve = fitted(3 + 0.5 * X)
    value, slope, _ = monotone.values(curve, np.linspace(1, 199, 50))
    assert value == pytest.approx(3 + 0.5 * monotone.x_at(curve, np.linspace(1, 199, 50)), abs=1e-6)
    assert slope == pytest.approx(0.5, rel=1e-4)


def test_gradients_are_the_change_with_the_coefficients():
    y, _ = logistic_steps(X)
    curve = fitted(y + 1e-3 * np.sin(300 * X))
    place = np.array([20.3, 77.7, 140.2])
    for derivative in (0, 1, 2):
        rows = monotone.gradients(curve, place, derivative)
        values = monotone.values(curve, place)[derivative]
        assert rows @ curve.coefficients == pytest.approx(values, rel=1e-9, abs=1e-9)


def test_variance_is_that_of_the_readings():
    rng = np.random.default_rng(1)
    y, _ = logistic_steps(X)
    curve = fitted(y + 2e-3 * rng.standard_normal(len(X)))
    assert np.sqrt(curve.variance) == pytest.approx(2e-3, rel=0.1)


@pytest.mark.parametrize("y", [X[::-1], np.zeros(len(X))])
def test_readings_that_do_not_rise_are_refused(y):
    with pytest.raises(ValueError, match="twelve readings that rise"):
        fitted(y)
