"""Averaged linear models: left-out densities as by fitting anew, weights, intervals that cover."""

import numpy as np
import pytest
from scipy.stats import t as student

from cellwright.numerics.averaged_models import PRIOR_FREEDOM, Rows, averaged, fitted_models


def rows_of(seed, count=24, features=4, groups=6, noise=0.02):
    """Rows whose target is 0.5 x0 − 0.3 x1 with noise; further features say nothing."""
    random = np.random.default_rng(seed)
    values = random.standard_normal((count, features))
    target = 0.5 * values[:, 0] - 0.3 * values[:, 1] + noise * random.standard_normal(count)
    names = np.array([f"cell {k % groups}" for k in range(count)])
    return Rows(values, target, names, np.zeros(features), 0.01, 0.002)


def fit(design, target):
    return np.linalg.lstsq(design, target, rcond=None)[0]


def test_densities_of_left_out_rows_are_those_of_models_fitted_anew():
    rows = rows_of(1, count=9, groups=1)
    models = fitted_models(rows, np.zeros(4), most_terms=1)
    design = np.column_stack([np.ones(9), rows.features[:, 0]])
    densities = []
    for row in range(9):
        kept = np.arange(9) != row
        slopes = fit(design[kept], rows.target[kept])
        residual = rows.target[kept] - design[kept] @ slopes
        freedom = 8 - 2 + PRIOR_FREEDOM
        variance = (residual @ residual + PRIOR_FREEDOM * 0.01**2) / freedom
        leverage = design[row] @ np.linalg.inv(design[kept].T @ design[kept]) @ design[row]
        scale = np.sqrt(variance * (1 + leverage) + 0.002**2)
        missed = rows.target[row] - design[row] @ slopes
        densities.append(student.logpdf(missed / scale, freedom) - np.log(scale))
    expected = np.mean(densities) * 9 - np.log(4)
    assert models.score[models.terms.index((0,))] == pytest.approx(expected, abs=1e-6)


def test_left_out_groups_are_missed_by_as_much_as_by_models_fitted_anew():
    """The variance is that of whole groups left out where it is larger than the residuals'."""
    rows = rows_of(2)
    apart = {name: 0.3 * k for k, name in enumerate(sorted(set(rows.groups)))}
    rows = rows._replace(target=rows.target + [apart[name] for name in rows.groups])
    models = fitted_models(rows, np.zeros(4), most_terms=2)
    place = models.terms.index((0, 1))
    design = np.column_stack([np.ones(24), rows.features[:, :2]])
    total = PRIOR_FREEDOM * 0.01**2
    for name in apart:
        out = rows.groups == name
        slopes = fit(design[~out], rows.target[~out])
        missed = rows.target[out] - design[out] @ slopes
        near = design[out] @ np.linalg.inv(design[~out].T @ design[~out]) @ design[out].T
        total += np.sum(missed**2 / (1 + np.diag(near)))
    at = np.r_[1, 0, 0]
    leverage = at @ np.linalg.inv(design.T @ design) @ at
    expected = np.sqrt(total / (24 + PRIOR_FREEDOM) * (1 + leverage) + 0.002**2)
    assert models.std[place] == pytest.approx(expected, rel=1e-6)


def test_the_weight_is_with_the_features_that_tell():
    found = averaged(fitted_models(rows_of(3, count=40), np.ones(4), most_terms=3))
    telling = sum(w for w, t in zip(found.weights, found.terms, strict=True) if {0, 1} <= {*t})
    assert telling > 0.99
    assert found.mean == pytest.approx(0.2, abs=0.02)
    assert found.weights.sum() == pytest.approx(1)


@pytest.mark.slow
def test_intervals_hold_new_rows_as_often_as_they_say():
    held = []
    for seed in range(150):
        rows = rows_of(seed, count=16)
        asked = np.random.default_rng(1000 + seed).standard_normal(5)
        new = 0.5 * asked[0] - 0.3 * asked[1] + 0.02 * asked[4]
        found = averaged(fitted_models(rows, asked[:4], most_terms=2))
        held.append(found.lower <= new <= found.upper)
    assert 0.90 <= np.mean(held) <= 0.99


def test_a_missing_feature_only_removes_the_models_that_need_it():
    rows = rows_of(4)
    asked = np.array([0.0, np.nan, 0.0, 0.0])
    assert not any(1 in term for term in fitted_models(rows, asked, most_terms=2).terms)
    assert fitted_models(rows, np.full(4, np.nan), most_terms=2).terms == []


def test_too_few_rows_give_no_model_and_few_rows_none_of_two_terms():
    few, some = rows_of(5, count=3, groups=1), rows_of(5, count=6, groups=1)
    assert fitted_models(few, np.zeros(4), most_terms=2).terms == []
    assert {len(term) for term in fitted_models(some, np.zeros(4), most_terms=2).terms} == {1}


def test_features_that_say_the_same_are_not_fitted_together():
    rows = rows_of(6)
    rows.features[:, 1] = 2 * rows.features[:, 0] + 1
    assert (0, 1) not in fitted_models(rows, np.zeros(4), most_terms=2).terms


def test_how_far_outside_is_counted_in_spans():
    rows = rows_of(7)
    low, high = rows.features[:, 0].min(), rows.features[:, 0].max()
    asked = np.array([high + 2 * (high - low), np.nan, np.nan, np.nan])
    assert averaged(fitted_models(rows, asked, most_terms=1)).beyond == pytest.approx(2)


def test_an_unsure_feature_widens_the_models_that_need_it_and_lessens_their_weight():
    rows = rows_of(3)
    asked = np.array([0.4, -0.2, 0.1, 0.0])
    sure = fitted_models(rows, asked, most_terms=2)
    unsure = fitted_models(rows, asked, most_terms=2, asked_std=np.array([0.3, 0, 0, 0]))
    np.testing.assert_array_equal(unsure.mean, sure.mean)
    needs = np.array([0 in term for term in sure.terms])
    np.testing.assert_array_equal(unsure.std[~needs], sure.std[~needs])
    both = sure.terms.index((0, 1))
    design = np.column_stack([np.ones(24), rows.features[:, :2]])
    expected = np.hypot(sure.std[both], 0.3 * fit(design, rows.target)[1])
    assert unsure.std[both] == pytest.approx(expected, rel=1e-9)
    assert unsure.score[both] - unsure.score[~needs].max() < sure.score[both] - (
        sure.score[~needs].max()
    )


@pytest.mark.slow
def test_intervals_cover_where_the_features_asked_for_are_unsure():
    held, random = [], np.random.default_rng(9)
    for seed in range(200):
        rows = rows_of(seed)
        true = random.standard_normal(4)
        std = np.array([0.2, 0.1, 0.0, 0.0])
        models = fitted_models(
            rows, true + std * random.standard_normal(4), most_terms=2, asked_std=std
        )
        found = averaged(models)
        target = 0.5 * true[0] - 0.3 * true[1] + 0.02 * random.standard_normal()
        held.append(found.lower <= target <= found.upper)
    assert 0.9 <= np.mean(held) <= 0.99
