"""Courses from features: recovery with honest intervals, few cells shrink, errors left out."""

import numpy as np
import pytest

from cellwright.numerics import shrunk_regression as regression

COURSE = np.linspace(0.5, 1.5, 5)


def population(random, count, *, noise, bend=0.0):
    """Cells of two hidden traits that six noisy features show, and their courses."""
    traits = random.uniform(0.0, 1.0, (count, 2))
    mixing = np.array([[1, 0, 1, 0.5, -1, 0.2], [0, 1, 0.5, 1, 0.3, -1]])
    features = traits @ mixing + 0.01 * random.normal(size=(count, 6))
    first, second = traits.T
    level = first - 0.5 * second + bend * first**2
    return features, level[:, None] * COURSE + noise * random.normal(size=(count, 5))


@pytest.mark.parametrize("bend", [0.0, 0.8])
def test_intervals_of_new_cells_hold_as_stated(bend):
    """95 % intervals over ten calibrations, and errors near the noise of the cells."""
    inside, errors = [], []
    for seed in range(10):
        features, changes = population(np.random.default_rng(seed), 80, noise=0.05, bend=bend)
        fit = regression.shrunk(features[:30], changes[:30])
        for x, true in zip(features[30:], changes[30:], strict=True):
            found = regression.predicted(fit, x)
            inside.append(np.abs(found.change - true) <= found.half_interval)
            errors.append(found.change - true)
    assert 0.90 <= np.mean(inside) <= 0.98
    assert np.sqrt(np.mean(np.square(errors))) < 1.3 * 0.05


def test_errors_left_out_are_those_of_fits_without_the_cell():
    random, cells = np.random.default_rng(3), regression.FEW + 1
    features, changes = population(random, cells, noise=0.05)
    fit = regression.shrunk(features, changes)
    assert fit.degree
    scaled = features / fit.scale
    for place in range(cells):
        others = np.arange(cells) != place
        kernel = (1 + scaled @ scaled.T / 6) ** fit.degree
        within = kernel[np.ix_(others, others)] + fit.penalty * np.eye(cells - 1)
        predicted = kernel[place, others] @ np.linalg.solve(within, changes[others])
        np.testing.assert_allclose(predicted - changes[place], fit.left_out[place], atol=1e-9)


def test_of_few_cells_each_is_left_out_of_the_choice_as_well():
    features, changes = population(np.random.default_rng(3), regression.FEW, noise=0.05)
    fit = regression.shrunk(features, changes)
    assert fit.degree
    without = regression.shrunk(features[1:], changes[1:], judged_again=False)
    left_out = regression.predicted(without, features[0]).change - changes[0]
    np.testing.assert_allclose(left_out, fit.left_out[0])


def test_cells_without_a_pattern_shrink_to_no_change():
    """Pure noise is taken for a pattern in few of fifty calibrations of five cells."""
    taken = []
    for seed in range(50):
        random = np.random.default_rng(seed)
        fit = regression.shrunk(random.normal(size=(5, 6)), random.normal(size=(5, 4)))
        taken.append(fit.degree > 0)
    assert np.mean(taken) <= 0.1


@pytest.mark.parametrize("cells", [0, 1, 2])
def test_too_few_cells_carry_nothing(cells):
    fit = regression.shrunk(np.ones((cells, 3)), np.ones((cells, 4)))
    found = regression.predicted(fit, np.ones(3))
    assert fit.degree == 0
    np.testing.assert_array_equal(found.change, np.zeros(4))
    assert np.isfinite(found.half_interval).all() == (cells > 1)


def test_a_cell_far_out_is_told_and_has_a_wider_interval():
    features, changes = population(np.random.default_rng(5), 30, noise=0.05)
    fit = regression.shrunk(features, changes)
    near, far = (regression.predicted(fit, k * features.mean(axis=0)) for k in (1.0, 6.0))
    assert near.remoteness <= 1 < far.remoteness
    assert (far.half_interval > 1.5 * near.half_interval).all()


def test_a_scaled_model_too_is_less_sure_far_out():
    random = np.random.default_rng(2)
    fit = regression.shrunk(random.normal(size=(4, 3)), random.normal(size=(4, 2)), degrees=())
    near, far = (regression.predicted(fit, np.full(3, x)) for x in (0.1, 10.0))
    assert (far.half_interval > 3 * near.half_interval).all()


def test_smaller_errors_of_three_cells_have_to_be_so_alike():
    before = np.array([[1.0], [1.0], [1.0]])
    assert regression.clearly_less(before, before / 10)
    assert not regression.clearly_less(before, np.array([[0.1], [0.1], [1.6]]))
    assert not regression.clearly_less(before, np.array([[0.5], [0.99], [1.0]]))
