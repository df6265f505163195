"""Lines: exact on their columns, honest errors under each kind of noise; one Arrhenius fit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cellwright.numerics.lines import (
    coloured_line,
    fit_line,
    generalised_line,
    residuals,
)
from cellwright.numerics.statistics import r_squared, rms

X = np.linspace(-1.0, 1.0, 9)
COLUMNS = np.stack([np.ones(9), X], axis=1)
NUMBER = st.floats(-100, 100)


@given(NUMBER, NUMBER)
def test_every_line_is_exact_on_its_own_columns(offset, slope):
    truth, target = [offset, slope], offset + slope * X
    lines = [
        fit_line(COLUMNS, target),
        fit_line(COLUMNS, target, np.geomspace(0.1, 1, 9)),
        generalised_line(COLUMNS, target, np.eye(9) + 0.5),
        coloured_line(COLUMNS, target, np.arange(9.0)),
    ]
    for line in lines:
        np.testing.assert_allclose(line.values, truth, atol=1e-9)
        assert line.degrees_of_freedom == 7
    np.testing.assert_allclose(residuals(COLUMNS, target), 0, atol=1e-9)


def test_without_stated_errors_a_line_is_ordinary_least_squares():
    noise = np.random.default_rng(0).standard_normal(9)
    line = fit_line(COLUMNS, noise)
    rest = noise - COLUMNS @ line.values
    spread = rest @ rest / 7
    covariance = spread * np.linalg.inv(COLUMNS.T @ COLUMNS)
    np.testing.assert_allclose(line.std, np.sqrt(np.diag(covariance)))
    assert line.excess_std == pytest.approx(np.sqrt(spread))
    equal = fit_line(COLUMNS, noise, np.full(9, 1e-6))
    np.testing.assert_allclose(equal.std, line.std, rtol=1e-6)


def test_an_error_that_all_points_share_does_not_shrink_with_their_number():
    common = generalised_line(np.ones((9, 1)), np.zeros(9), 0.01 * np.eye(9) + 1.0)
    assert common.std[0] == pytest.approx(np.sqrt(1.0 + 0.01 / 9))
    assert common.reduced_chi_square == 0


def test_a_covariance_is_scaled_up_by_what_the_residual_shows_and_never_down():
    noise = np.random.default_rng(1).standard_normal(9)
    small, large = (generalised_line(COLUMNS, noise, size * np.eye(9)) for size in (1e-4, 1e4))
    assert small.reduced_chi_square == pytest.approx(1e8 * large.reduced_chi_square)
    np.testing.assert_allclose(small.std, fit_line(COLUMNS, noise).std)
    np.testing.assert_allclose(
        large.std, 100 * np.sqrt(np.diag(np.linalg.inv(COLUMNS.T @ COLUMNS)))
    )


def test_as_many_points_as_columns_leave_no_error_and_no_interval():
    line = fit_line(COLUMNS[:2], [1.0, 2.0])
    assert np.isnan(line.std).all()
    assert np.isnan(np.array(line.interval())).all()


def test_the_interval_is_that_of_students_t():
    line = fit_line(np.ones((3, 1)), [1.0, 2.0, 3.0])
    lower, upper = line.interval()
    # t(0.975, 2) = 4.303 (any table of Student's t); std of the mean 1/√3.
    assert (upper[0] - lower[0]) / 2 == pytest.approx(4.3027 / np.sqrt(3), rel=1e-4)


@given(st.lists(NUMBER, min_size=1, max_size=20), NUMBER)
def test_rms_scales_and_lies_between_mean_and_largest(values, factor):
    size = np.abs(values)
    assert size.mean() - 1e-9 <= rms(values) <= size.max() + 1e-9
    assert rms(np.array(values) * factor) == pytest.approx(abs(factor) * rms(values), abs=1e-9)


def test_scores_of_nothing_are_not_known():
    assert np.isnan(rms([]))
    assert np.isnan(r_squared(np.ones(3), np.ones(3)))
    assert r_squared(X, X) == 1
    assert r_squared(X, np.zeros(9)) == pytest.approx(0)
