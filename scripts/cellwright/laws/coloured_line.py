"""Linear regression where neighbours in time scatter alike, with an interval that owns up to it."""

from typing import NamedTuple

import numpy as np

# Correlation over one typical interval. Uncorrelated first; 0.95 is hard to tell from a trend.
CORRELATIONS = np.concatenate([[0.0], np.linspace(0.05, 0.95, 19)])


class Line(NamedTuple):
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
        return Line(unknown, unknown, np.nan, np.nan, rows - count, np.nan)
    fits = [_at(columns, target, place, correlation) for correlation in CORRELATIONS]
    residual = np.array([fit[2] for fit in fits])
    weight = np.exp(residual - residual.max())
    weight /= weight.sum()
    values = np.array([fit[0] for fit in fits])
    mean = weight @ values
    variance = weight @ (np.array([fit[1] for fit in fits]) + (values - mean) ** 2)
    return Line(
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
