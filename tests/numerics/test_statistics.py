"""Covariances against closed forms, and intervals against their stated coverage."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cellwright.numerics.statistics import (
    covariance_from_jacobian,
    delta_method,
    standard_deviations,
    t_interval,
)


def line(count=12, seed=1):
    rng = np.random.default_rng(seed)
    x = np.linspace(-1, 3, count)
    columns = np.stack([np.ones(count), x], axis=1)
    y = 2 + 0.5 * x + 0.1 * rng.standard_normal(count)
    values = np.linalg.lstsq(columns, y, rcond=None)[0]
    return x, columns, y - columns @ values, values


def test_covariance_of_a_line_is_the_textbook_one():
    x, columns, residual, _ = line()
    variance = residual @ residual / (len(x) - 2)
    slope_variance = variance / np.sum((x - x.mean()) ** 2)
    covariance = covariance_from_jacobian(columns, residual)
    assert covariance[1, 1] == pytest.approx(slope_variance, rel=1e-12)
    assert covariance[0, 1] == pytest.approx(-x.mean() * slope_variance, rel=1e-12)


@given(st.floats(1e-9, 1e9), st.floats(1e-9, 1e9))
def test_units_of_the_parameters_only_scale_the_covariance(first, second):
    _, columns, residual, _ = line()
    scale = np.array([first, second])
    expected = covariance_from_jacobian(columns, residual) / np.outer(scale, scale)
    np.testing.assert_allclose(covariance_from_jacobian(columns * scale, residual), expected, 1e-6)


def test_only_the_undetermined_parameters_are_nan():
    _, columns, residual, _ = line()
    columns = np.column_stack([columns, columns[:, 1] * 3, np.zeros(len(columns))])
    std = standard_deviations(covariance_from_jacobian(columns, residual))
    assert np.isfinite(std).tolist() == [True, False, False, False]


def test_no_scatter_without_spare_data():
    jacobian = np.eye(3)
    assert np.isnan(covariance_from_jacobian(jacobian, np.zeros(3))).all()


def test_not_finite_is_unknown():
    jacobian = np.full((5, 1), np.inf)
    assert np.isnan(covariance_from_jacobian(jacobian, np.ones(5))).all()


def test_delta_method_of_a_product():
    covariance = np.array([[0.04, 0.01], [0.01, 0.09]])
    value, std = delta_method(lambda p: p[0] * p[1], [3.0, 5.0], covariance)
    assert value == 15
    assert std == pytest.approx(np.sqrt(25 * 0.04 + 9 * 0.09 + 2 * 15 * 0.01), rel=1e-8)


def test_delta_method_of_several_numbers_at_once():
    value, std = delta_method(lambda p: np.array([p[0], np.exp(p[1])]), [1.0, 0.0], np.eye(2))
    np.testing.assert_allclose(value, [1, 1])
    np.testing.assert_allclose(std, [1, 1], rtol=1e-8)


def test_t_interval_covers_as_often_as_it_says():
    rng = np.random.default_rng(3)
    samples = rng.normal(7, 2, (4000, 4))
    lower, upper = t_interval(samples.mean(1), samples.std(1, ddof=1) / 2, 3, level=0.9)
    assert np.mean((lower < 7) & (upper > 7)) == pytest.approx(0.9, abs=0.015)


def test_t_interval_without_degrees_of_freedom_is_unknown():
    assert np.isnan(t_interval(np.ones(2), np.ones(2), 0)).all()
