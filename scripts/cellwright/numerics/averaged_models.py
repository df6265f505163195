"""Small linear models of one quantity, each of a few features, averaged by what they predict."""

from itertools import combinations
from math import comb
from typing import NamedTuple

import numpy as np
from scipy.special import stdtr
from scipy.stats import t as student

PRIOR_FREEDOM = 2  # rows that the prior of a model's error counts as
WORST_CONDITION = 1e6


class Rows(NamedTuple):
    """What the models are fitted to.

    features : (n, k), NaN where a row lacks one. target : (n,). groups : (n,) names of what rows
    have in common. offsets : (k,) standard deviation of a feature from group to group that fewer
    than three groups do not show. prior_std, repeat_std : of the target, what a model misses
    before the data speak, and what the target itself scatters by.
    """

    features: np.ndarray
    target: np.ndarray
    groups: np.ndarray
    offsets: np.ndarray
    prior_std: float
    repeat_std: float

    def where(self, kept):
        """The same with some rows only."""
        return self._replace(
            features=self.features[kept], target=self.target[kept], groups=self.groups[kept]
        )


class Models(NamedTuple):
    """Linear models that can predict one row, (m,) each; `terms` are numbers of features.

    score : logarithm of the density that the model gives to rows when fitted without them, for as
    many rows as the models usually have, and of the prior of its size. mean, std, freedom : of its
    Student distribution for the row asked for. beyond : how far outside the rows fitted that row
    lies, in spans of a feature; below 0 inside.
    """

    terms: list
    score: np.ndarray
    mean: np.ndarray
    std: np.ndarray
    freedom: np.ndarray
    beyond: np.ndarray


class Prediction(NamedTuple):
    """Average over models: mean, std, 95 % interval; weights (m,) and terms of the models.

    beyond : of the model in the middle of the weight, models ordered by how far outside they are.
    """

    mean: float
    std: float
    lower: float
    upper: float
    beyond: float
    weights: np.ndarray
    terms: list


def fitted_models(rows, asked, *, most_terms, asked_std=None):
    """Every linear model of up to `most_terms` features that the row asked for has.

    1. A model is fitted to the rows that have its features, at least three more than it has
    terms; beyond one term it needs four rows a term. 2. Its variance is that of the residuals
    with a weak prior, from three groups on also that of left-out groups, whichever is larger.
    3. Its score is the mean logarithm of the density at left-out rows (whole groups from three
    groups on), times the rows that models usually have.

    Parameters
    ----------
    rows : Rows. asked : (k,) features, NaN where there is none. most_terms : [1].
    asked_std : (k,) standard deviations of the features asked for, beyond those of the rows, which
        the residuals show. A model is widened by them and judged at that width.

    Returns
    -------
    models : Models; empty where none can be fitted.
    """
    has = np.flatnonzero(np.isfinite(asked))
    asked = np.stack([asked, np.zeros(len(asked)) if asked_std is None else asked_std])
    parts = []
    for size in range(1, most_terms + 1):
        prior = -np.log(comb(len(has), size)) if size <= len(has) else 0.0
        for kept, subsets in _by_rows(rows, has, size):
            part = _fitted(rows.where(kept), asked, subsets)
            parts.append((part, kept.sum(), prior))
    return _joined([part for part in parts if len(part[0].terms)])


def _by_rows(rows, has, size):
    """Masks of rows, each with the subsets of features that all and only these rows have."""
    subsets = np.array(list(combinations(has, size)), int).reshape(-1, size)
    usable = np.isfinite(rows.features)[:, subsets].all(axis=2)
    patterns, which = np.unique(usable, axis=1, return_inverse=True)
    counts = patterns.sum(axis=0)
    enough = (counts >= size + 3) & (size <= np.maximum(1, (counts - 1) // 4))
    for number in np.flatnonzero(enough):
        yield patterns[:, number], subsets[which.ravel() == number]


def _joined(parts):
    """Models of all sizes and rows as one."""
    if not parts:
        return Models([], *np.empty((5, 0)))
    usual = np.median(np.concatenate([np.full(len(part.terms), n) for part, n, _ in parts]))
    scored = [part._replace(score=part.score * usual + prior) for part, _, prior in parts]
    terms = [term for part in scored for term in part.terms]
    return Models(
        terms, *(np.concatenate(values) for values in list(zip(*scored, strict=True))[1:])
    )


def _fitted(rows, asked, subsets):
    """Models of one size on the same rows; the score still the mean log density of a row.

    asked : (2, k) features of the row asked for, and their further standard deviations.
    """
    asked, asked_std = asked
    count, size = len(rows.target), subsets.shape[1]
    values = rows.features[:, subsets].transpose(1, 0, 2)
    centre, scale = values.mean(axis=1), values.std(axis=1)
    scale = np.where(scale > 1e-12, scale, np.inf)
    scaled = (values - centre[:, None]) / scale[:, None]
    design = np.concatenate([np.ones((*scaled.shape[:2], 1)), scaled], axis=2)
    normal = design.transpose(0, 2, 1) @ design
    kept = np.linalg.cond(normal) < WORST_CONDITION
    inverse = np.linalg.inv(np.where(kept[:, None, None], normal, np.eye(size + 1)))
    slopes = np.einsum("mij,mnj,n->mi", inverse, design, rows.target)
    # Of two groups the scatter from group to group does not show in the residuals.
    few = len(set(rows.groups)) < 3
    moved = slopes[:, 1:] / scale * rows.offsets[subsets] * few
    blurred = slopes[:, 1:] / scale * asked_std[subsets]
    extra = (moved**2 + blurred**2).sum(axis=1) + rows.repeat_std**2
    residual = rows.target - np.einsum("mnj,mj->mn", design, slopes)
    leave = _rows_left_out if few else _groups_left_out
    spread = design @ inverse
    freedom = count - size - 1 + PRIOR_FREEDOM
    score, variance, whole = leave(residual, design, spread, rows, extra, freedom)
    at = np.concatenate([np.ones((len(subsets), 1)), (asked[subsets] - centre) / scale], axis=1)
    leverage = np.einsum("mi,mij,mj->m", at, inverse, at)
    outside = np.maximum(values.min(axis=1) - asked[subsets], asked[subsets] - values.max(axis=1))
    beyond = (outside / np.maximum(np.ptp(values, axis=1), 1e-12)).max(axis=1)
    mean, std = np.einsum("mi,mi->m", at, slopes), np.sqrt(variance * (1 + leverage) + extra)
    kept &= whole
    numbers = (score, mean, std, np.full(len(subsets), float(freedom)), beyond)
    return Models([tuple(s) for s in subsets[kept].tolist()], *(n[kept] for n in numbers))


def _variance(residual, rows, freedom):
    prior = PRIOR_FREEDOM * rows.prior_std**2
    return ((residual**2).sum(axis=1) + prior) / freedom


def _rows_left_out(residual, design, spread, rows, extra, freedom):
    """Mean log density of each row by the model fitted without it, from the fit with it."""
    leverage = np.einsum("mni,mni->mn", spread, design)
    whole = leverage.max(axis=1) < 1 - 1e-6
    rest = np.maximum(1 - leverage, 1e-6)
    variance = _variance(residual, rows, freedom)
    without = (variance[:, None] * freedom - residual**2 / rest) / (freedom - 1)
    scale = np.sqrt(np.maximum(without, 1e-10) / rest + extra[:, None])
    density = student.logpdf(residual / rest / scale, freedom - 1) - np.log(scale)
    return density.mean(axis=1), variance, whole


def _groups_left_out(residual, design, spread, rows, extra, freedom):
    """The same with whole groups left out, and the variance that they show where it is larger."""
    missed, widened = np.zeros_like(residual), np.ones_like(residual)
    whole = np.ones(len(residual), bool)
    for at in _rows_of_groups(rows.groups):
        hat = np.einsum("mgik,mgjk->mgij", spread[:, at], design[:, at])
        rest = np.eye(at.shape[1]) - hat
        known = np.linalg.cond(rest) < WORST_CONDITION
        inverse = np.linalg.inv(np.where(known[..., None, None], rest, np.eye(at.shape[1])))
        missed[:, at] = np.einsum("mgij,mgj->mgi", inverse, residual[:, at])
        widened[:, at] = np.maximum(np.einsum("mgii->mgi", inverse), 1.0)
        whole &= known.all(axis=1)
    shown = (missed**2 / widened).sum(axis=1) + PRIOR_FREEDOM * rows.prior_std**2
    variance = np.maximum(
        _variance(residual, rows, freedom), shown / (residual.shape[1] + PRIOR_FREEDOM)
    )
    scale = np.sqrt(variance[:, None] * widened + extra[:, None])
    density = student.logpdf(missed / scale, freedom - 1) - np.log(scale)
    return density.mean(axis=1), variance, whole


def _rows_of_groups(groups):
    """Numbers of the rows of each group (groups, rows), groups of one size together."""
    _, number, sizes = np.unique(groups, return_inverse=True, return_counts=True)
    by_group = np.split(np.argsort(number, kind="stable"), np.cumsum(sizes)[:-1])
    return [np.array([r for r in by_group if len(r) == size]) for size in np.unique(sizes)]


def averaged(models):
    """Average of the models' predictions by their weights, with the 95 % interval of the mixture.

    Parameters
    ----------
    models : Models, at least one.

    Returns
    -------
    prediction : Prediction.

    Source: Hoeting et al., Statist. Sci. 14 (1999) 382; weights by the density at left-out rows:
    Yao et al., Bayesian Anal. 13 (2018) 917.
    """
    weights = np.exp(models.score - models.score.max())
    weights /= weights.sum()
    mean = float(weights @ models.mean)
    tails = models.freedom / np.maximum(models.freedom - 2, 0.5)
    std = float(np.sqrt(weights @ (models.std**2 * tails + (models.mean - mean) ** 2)))
    grid = mean + std * np.linspace(-8, 8, 401)
    # Lighter models do not move a quantile by its last digit told.
    heavy = weights > 1e-4
    centre, scale, freedom = (
        values[heavy, None] for values in (models.mean, models.std, models.freedom)
    )
    below = weights[heavy] @ stdtr(freedom, (grid - centre) / scale) / weights[heavy].sum()
    lower, upper = np.interp([0.025, 0.975], below, grid)
    order = np.argsort(models.beyond)
    middle = order[min(np.searchsorted(np.cumsum(weights[order]), 0.5), len(order) - 1)]
    beyond = float(models.beyond[middle])
    return Prediction(mean, std, float(lower), float(upper), beyond, weights, models.terms)
