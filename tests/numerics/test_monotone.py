"""A rising curve: known values and slopes recovered, always rising, exact on lines, intervals."""

import numpy as np
import pytest

from cellwright.numerics import monotone, rising_curve

X = np.linspace(0, 2, 3000)


def whole_deviations(curve, rows):
    """Posterior standard deviations (m,) of linear functions of all coefficients."""
    solved = rising_curve.band_solution(curve.factor, rows.T)
    return np.sqrt(curve.variance * np.einsum("ij,ji->i", rows, solved))


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
        _, slope, _ = rising_curve.values(curve, place)
        std = whole_deviations(curve, rising_curve.gradients(curve, place, 1))
        _, true = logistic_steps(rising_curve.x_at(curve, place))
        inside.append(np.abs(slope - true) < 1.96 * std)
        error.append(slope / true - 1)
    assert 0.88 <= np.mean(inside) <= 0.995
    assert np.sqrt(np.mean(np.square(error))) < 0.06


def test_the_curve_always_rises_however_noisy():
    rng = np.random.default_rng(0)
    curve = fitted(X + rng.standard_normal(len(X)))
    assert np.all(rising_curve.values(curve, np.linspace(0, 200, 1000))[1] > 0)


def test_a_line_is_kept():
    curve = fitted(3 + 0.5 * X)
    value, slope, _ = rising_curve.values(curve, np.linspace(1, 199, 50))
    assert value == pytest.approx(
        3 + 0.5 * rising_curve.x_at(curve, np.linspace(1, 199, 50)), abs=1e-6
    )
    assert slope == pytest.approx(0.5, rel=1e-4)


def test_gradients_are_the_change_with_the_coefficients():
    y, _ = logistic_steps(X)
    curve = fitted(y + 1e-3 * np.sin(300 * X))
    place = np.array([20.3, 77.7, 140.2])
    for derivative in (0, 1, 2):
        rows = rising_curve.gradients(curve, place, derivative)
        values = rising_curve.values(curve, place)[derivative]
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


# A simulated 1C charge of a 32 Ah cell, read at growing intervals first, then every 0.534 Ah.
FEW_CHARGE = [0, 0.00018, 0.0008, 0.00169, 0.00435, 0.0088, 0.01769, 0.04435]
FEW_CHARGE = np.append(FEW_CHARGE, 0.04435 + 0.53372 * np.arange(1, 60))
FEW_VOLT = """
    2.8413 2.8428 2.8455 2.8500 2.8626 2.8803 2.9121 2.9883 3.4893 3.6699 3.7530 3.7941 3.8163
    3.8295 3.8388 3.8460 3.8529 3.8607 3.8700 3.8832 3.8961 3.9087 3.9210 3.9300 3.9384 3.9507
    3.9591 3.9657 3.9714 3.9768 3.9822 3.9888 3.9954 4.0038 4.0143 4.0254 4.0377 4.0494 4.0614
    4.0707 4.0788 4.0854 4.0896 4.0941 4.0962 4.0983 4.0995 4.1001 4.1007 4.1019 4.1034 4.1055
    4.1103 4.1181 4.1250 4.1289 4.1313 4.1325 4.1337 4.1346 4.1367 4.1394 4.1451 4.1541 4.1700
    4.1964 4.1997
"""


def test_few_readings_that_crowd_at_the_begin_make_a_rising_curve():
    volt = np.array(FEW_VOLT.split(), float)
    curve = monotone.rising_curve(FEW_CHARGE, volt, np.ones(len(volt)), cells=len(volt))
    place = np.linspace(0, len(volt), 2001)
    assert np.all(rising_curve.values(curve, place)[1] > 0)
    at = np.interp(FEW_CHARGE, rising_curve.x_at(curve, place), place)
    assert np.abs(rising_curve.values(curve, at)[0] - volt)[8:].max() < 5e-3


def test_deviations_between_places_are_those_of_the_difference():
    curve = fitted(logistic_steps(X)[0] + 1e-3 * np.random.default_rng(5).standard_normal(len(X)))
    place = np.array([30.5, 61.0, 61.2, 62.0, 180.0])
    rates = rising_curve.gradients(curve, place, 1)
    whole = whole_deviations(curve, rates - rates[2])
    one = rising_curve.local_gradients(curve, place[2:3], 1)
    found = rising_curve.deviations_between(
        curve, rising_curve.local_gradients(curve, place, 1), one
    )
    assert np.allclose(found, whole, rtol=1e-6, atol=1e-6 * whole.max())


def test_deviations_of_neighbouring_coefficients_are_those_of_all():
    curve = fitted(logistic_steps(X)[0] + 1e-3 * np.random.default_rng(4).standard_normal(len(X)))
    place = np.linspace(0, 200, 77)
    for derivative in (0, 1, 2):
        whole = whole_deviations(curve, rising_curve.gradients(curve, place, derivative))
        local = rising_curve.local_gradients(curve, place, derivative)
        assert np.allclose(rising_curve.local_deviations(curve, *local), whole, rtol=1e-7)
