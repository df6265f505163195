"""Straight lines: weighted, with extra scatter, and with correlated residuals."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.uncertainty import (
    covariance_from_jacobian,
    standard_deviations,
    t_interval,
)

HALVINGS = 60  # of the interval in which the excess scatter is sought: to the last digit


class Line(NamedTuple):
    """A linear least-squares fit; the arrays hold one number per parameter, shape (p,).

    excess_std : scatter of the points beyond their own standard deviations, in the unit of the
    target; NaN where no degree of freedom is left to tell. degrees_of_freedom : n − p.
    """

    values: np.ndarray
    std: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    excess_std: float
    degrees_of_freedom: int


def fit_line(columns, target, target_std=None, *, level=0.95):
    """Weighted linear least squares with the scatter beyond the stated errors estimated.

    Each point is weighted by 1/(its variance + s²). The excess scatter s (a chamber that is some
    tenths of a kelvin off, a cell that has not settled) is the one at which the weighted squares
    sum to n − p; it is 0 where the stated errors explain all scatter, and these then stand: they
    are never made smaller. Without stated errors this is ordinary least squares.

    Parameters
    ----------
    columns : (n, p) design matrix.
    target : (n,).
    target_std : (n,) standard deviation of each point in the unit of target; NaN counts as not
        known, and then none is used: a point must not weigh more for saying nothing.
    level : coverage of the confidence limits.

    Returns
    -------
    line : Line; std and limits are NaN where the data leave no degree of freedom.

    Source: Paule & Mandel, J. Res. Natl. Bur. Stand. 87 (1982) 377, for a line instead of a mean.
    """
    columns, target = np.asarray(columns, float), np.asarray(target, float)
    variance = _known_variance(target_std, len(target))
    degrees = len(target) - columns.shape[1]
    excess = _excess_variance(columns, target, variance, degrees)
    values, residual, scaled = _weighted(columns, target, variance + excess)
    covariance = covariance_from_jacobian(scaled, residual)
    squares = residual @ residual / max(degrees, 1)
    # The sum of squares is n − p where an excess was found; below it the stated errors stand.
    if excess == 0 and 0 < squares < 1 and variance.any():
        covariance = covariance / squares
    std = standard_deviations(covariance)
    return Line(
        values, std, *t_interval(values, std, degrees, level=level), *_left(excess, degrees)
    )


def _left(excess, degrees):
    return (float(np.sqrt(excess)) if degrees > 0 else np.nan), degrees


def _known_variance(std, count):
    std = np.full(count, np.nan) if std is None else np.asarray(std, float)
    return std**2 if np.isfinite(std).all() else np.zeros(count)


def _weighted(columns, target, variance):
    """Solution, weighted residual and weighted design; points without any error weigh the same."""
    root = 1 / np.sqrt(variance) if (variance > 0).all() else np.ones(len(target))
    scaled = columns * root[:, None]
    values = np.linalg.lstsq(scaled, target * root, rcond=None)[0]
    return values, (target - columns @ values) * root, scaled


def _excess_variance(columns, target, variance, degrees):
    """s² by bisection between none and all of the unweighted scatter."""
    _, plain, _ = _weighted(columns, target, np.zeros(len(target)))
    low, high = 0.0, plain @ plain / max(degrees, 1)
    if degrees < 1 or high == 0 or _squares(columns, target, variance) <= degrees:
        return 0.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        too_small = _squares(columns, target, variance + middle) > degrees
        low, high = (middle, high) if too_small else (low, middle)
    return high


def _squares(columns, target, variance):
    if not (variance > 0).all():
        return np.inf
    return float(np.sum(_weighted(columns, target, variance)[1] ** 2))


def r_squared(value, predicted):
    """Share of the variance that a prediction explains; NaN where nothing varies.

    Parameters
    ----------
    value, predicted : (n,) in one unit.
    """
    spread = np.sum((value - value.mean()) ** 2)
    return float(1 - np.sum((value - predicted) ** 2) / spread) if spread > 0 else np.nan


# Correlation over one typical interval. Uncorrelated first; 0.95 is hard to tell from a trend.
CORRELATIONS = np.concatenate([[0.0], np.linspace(0.05, 0.95, 19)])


class CorrelatedLine(NamedTuple):
    """Fitted coefficients, averaged over what the correlation of the noise may be.

    values, std : (p,). correlation : its mean over one typical interval [1]. scatter : standard
    deviation of the noise, in the unit of the data. degrees_of_freedom : rows − p.
    log_likelihood : at the best correlation, for comparing sets of columns.
    """

    values: np.ndarray
    std: np.ndarray
    correlation: float
    scatter: float
    degrees_of_freedom: int
    log_likelihood: float


# ASSUME: What neighbouring cycles have in common beyond fade and temperature forgets itself
# exponentially with time (Ornstein-Uhlenbeck noise).
def coloured_line(columns, target, place):
    """Generalised least squares with exponentially correlated noise of unknown memory.

    The residual likelihood (REML) of each correlation weighs its solution; the variance is the
    mean of theirs plus the spread between them, so that not knowing the memory widens it.

    Parameters
    ----------
    columns : (n, p). target : (n,). place : (n,) rising position of the rows, in typical
        intervals.

    Returns
    -------
    Line; all NaN where n ≤ p.

    Source: D. A. Harville, J. Am. Stat. Assoc. 72 (1977) 320 (residual likelihood).
    """
    rows, count = columns.shape
    if rows <= count:
        unknown = np.full(count, np.nan)
        return CorrelatedLine(unknown, unknown, np.nan, np.nan, rows - count, np.nan)
    fits = [_at(columns, target, place, correlation) for correlation in CORRELATIONS]
    residual = np.array([fit[2] for fit in fits])
    weight = np.exp(residual - residual.max())
    weight /= weight.sum()
    values = np.array([fit[0] for fit in fits])
    mean = weight @ values
    variance = weight @ (np.array([fit[1] for fit in fits]) + (values - mean) ** 2)
    return CorrelatedLine(
        mean,
        np.sqrt(variance),
        float(weight @ CORRELATIONS),
        float(np.sqrt(weight @ np.array([fit[4] for fit in fits]))),
        rows - count,
        float(max(fit[3] for fit in fits)),
    )


def whitened(values, place, correlation):
    """Rows (n, …) made independent, and half the logarithm of what that divided by."""
    if correlation == 0:
        return values, 0.0
    kept = correlation ** np.diff(place)
    left = np.sqrt(1 - kept**2)
    shape = (-1, *[1] * (values.ndim - 1))
    later = (values[1:] - kept.reshape(shape) * values[:-1]) / left.reshape(shape)
    return np.concatenate([values[:1], later]), float(np.log(left).sum())


def _at(columns, target, place, correlation):
    """Values, variances, residual and plain log-likelihood, and noise variance at one memory."""
    design, logarithm = whitened(columns, place, correlation)
    seen, _ = whitened(target, place, correlation)
    orthogonal, triangle = np.linalg.qr(design)
    inverse = np.linalg.inv(triangle)
    values = inverse @ (orthogonal.T @ seen)
    squares = max(float(np.sum((seen - design @ values) ** 2)), np.finfo(float).tiny)
    rows, count = columns.shape
    variance = squares / (rows - count)
    spread = np.log(np.abs(np.diagonal(triangle))).sum()
    residual = -0.5 * (rows - count) * np.log(variance) - logarithm - spread
    plain = -0.5 * rows * np.log(squares / rows) - logarithm
    return values, variance * np.sum(inverse**2, axis=1), residual, plain, variance
