"""Weighted linear least squares for three kinds of errors, and the axis of an Arrhenius law.

`fit_line`: independent errors, stated or not, with scatter beyond them. `generalised_line`: errors
of a known covariance. `coloured_line`: errors correlated in time.
"""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.statistics import (
    covariance_from_jacobian,
    standard_deviations,
    t_interval,
)


class Line(NamedTuple):
    """Coefficients of linear least squares with their errors; what a fit does not give is NaN.

    values, std : (p,) estimates and standard deviations; the latter NaN where not known.
    degrees_of_freedom : n − p.
    excess_std : of `fit_line`: scatter of the points beyond their own standard deviations, in the
    unit of the target; NaN where there is no degree of freedom.
    reduced_chi_square : of `generalised_line`: squared residual over what the covariance lets
    expect; 1 where there is no degree of freedom.
    correlation, log_likelihood : of `coloured_line`: mean correlation of the noise over one typical
    interval [1]; at the best correlation, for comparing sets of columns.
    """

    values: np.ndarray
    std: np.ndarray
    degrees_of_freedom: int
    excess_std: float = np.nan
    reduced_chi_square: float = np.nan
    correlation: float = np.nan
    log_likelihood: float = np.nan

    def interval(self, *, level=0.95):
        """Lower and upper confidence limits (p,), (p,), of that coverage, by Student's t."""
        return t_interval(self.values, self.std, self.degrees_of_freedom, level=level)


def fit_line(columns, target, target_std=None):
    """Weighted linear least squares, with scatter beyond the stated errors estimated and added.

    Each point is weighted by 1/(its variance + s²). The excess scatter s (a chamber that is some
    tenths of a kelvin off, a cell that has not settled) is the one at which the weighted squares
    sum to n − p; it is 0 where the stated errors explain all scatter, and these then stand: they
    are never made smaller. Without stated errors this is ordinary least squares.

    Parameters
    ----------
    columns : (n, p) design matrix.
    target : (n,).
    target_std : (n,) standard deviation of each point in the unit of target; where one is NaN none
        is used: a point must not weigh more for saying nothing.

    Returns
    -------
    line : Line; std is NaN where the data leave no degree of freedom.

    Source: Paule & Mandel, J. Res. Natl. Bur. Stand. 87 (1982) 377, for a line instead of a mean.
    """
    columns, target = np.asarray(columns, float), np.asarray(target, float)
    std = np.full(len(target), np.nan) if target_std is None else np.asarray(target_std, float)
    variance = std**2 if np.isfinite(std).all() else np.zeros(len(target))
    degrees = len(target) - columns.shape[1]
    excess = _excess_variance(columns, target, variance, degrees)
    values, residual, scaled = _weighted(columns, target, variance + excess)
    covariance = covariance_from_jacobian(scaled, residual)
    squares = residual @ residual / max(degrees, 1)
    # The sum of squares is n − p where an excess was found; below it the stated errors stand.
    if excess == 0 and 0 < squares < 1 and variance.any():
        covariance = covariance / squares
    excess_std = float(np.sqrt(excess)) if degrees > 0 else np.nan
    return Line(values, standard_deviations(covariance), degrees, excess_std=excess_std)


def residuals(columns, target):
    """Residuals of ordinary least squares of a target on columns, in the unit of the target.

    Parameters
    ----------
    columns : (n, p). target : (n,) or (n, m).
    """
    return target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0]


def _weighted(columns, target, variance):
    """Solution, weighted residual and weighted design; all weights are 1 where a variance is 0."""
    root = 1 / np.sqrt(variance) if (variance > 0).all() else np.ones(len(target))
    scaled = columns * root[:, None]
    values = np.linalg.lstsq(scaled, target * root, rcond=None)[0]
    return values, (target - columns @ values) * root, scaled


def _excess_variance(columns, target, variance, degrees):
    """Excess variance s² at which the weighted squares sum to the degrees of freedom."""
    _, plain, _ = _weighted(columns, target, np.zeros(len(target)))
    low, high = 0.0, plain @ plain / max(degrees, 1)
    if degrees < 1 or high == 0:
        return 0.0
    if not variance.any():
        return high
    if _squares(columns, target, variance) <= degrees:
        return 0.0
    # Halves the interval until its last digit.
    for _ in range(60):
        middle = (low + high) / 2
        too_small = _squares(columns, target, variance + middle) > degrees
        low, high = (middle, high) if too_small else (low, middle)
    return high


def _squares(columns, target, variance):
    """Sum of weighted squared residuals; infinite where a variance is 0."""
    if not (variance > 0).all():
        return np.inf
    return float(np.sum(_weighted(columns, target, variance)[1] ** 2))


def generalised_line(columns, target, covariance):
    """Generalised least squares: a target whose errors have a known covariance.

    Parameters
    ----------
    columns : (n, p). target : (n,). covariance : (n, n) of the target; scaled up, never down, by
        what the residual shows.

    Returns
    -------
    line : Line with `reduced_chi_square`.
    """
    root = np.linalg.cholesky(covariance)
    whitened = np.linalg.solve(root, np.column_stack([columns, target]))
    design, seen = whitened[:, :-1], whitened[:, -1]
    values = np.linalg.lstsq(design, seen, rcond=None)[0]
    degrees = len(target) - design.shape[1]
    chi_square = np.sum((seen - design @ values) ** 2) / degrees if degrees > 0 else 1.0
    spread = np.linalg.pinv(design.T @ design) * max(chi_square, 1.0)
    std = standard_deviations(spread)
    return Line(values, std, degrees, reduced_chi_square=float(chi_square))


# Correlations over one typical interval that are tried; above 0.95 noise resembles a trend.
CORRELATIONS = np.concatenate([[0.0], np.linspace(0.05, 0.95, 19)])


# ASSUME: What neighbouring cycles have in common beyond fade and temperature decays exponentially
# with time (Ornstein-Uhlenbeck noise).
def coloured_line(columns, target, place):
    """Generalised least squares with exponentially correlated noise of unknown correlation.

    The residual likelihood (REML) of each correlation weighs its solution; the variance is the
    mean of theirs plus the spread between them, so that not knowing the memory widens it.

    Parameters
    ----------
    columns : (n, p). target : (n,). place : (n,) rising position of the rows, in typical
        intervals.

    Returns
    -------
    line : Line with `correlation` and `log_likelihood`; all NaN where n ≤ p.

    Source: D. A. Harville, J. Am. Stat. Assoc. 72 (1977) 320 (residual likelihood).
    """
    rows, count = columns.shape
    if rows <= count:
        unknown = np.full(count, np.nan)
        return Line(unknown, unknown, rows - count)
    fits = zip(
        *(_fit_at(columns, target, place, correlation) for correlation in CORRELATIONS), strict=True
    )
    values, variances, restricted, likelihood = map(np.array, fits)
    weight = np.exp(restricted - restricted.max())
    weight /= weight.sum()
    mean = weight @ values
    variance = weight @ (variances + (values - mean) ** 2)
    return Line(
        mean,
        np.sqrt(variance),
        rows - count,
        correlation=float(weight @ CORRELATIONS),
        log_likelihood=float(likelihood.max()),
    )


def whitened(values, place, correlation):
    """Rows (n, …) with the correlation of neighbours removed, and Σ ln of what divided them.

    Parameters
    ----------
    values : (n, …). place, correlation : as in `coloured_line`.
    """
    if correlation == 0:
        return values, 0.0
    carried = correlation ** np.diff(place)
    innovation = np.sqrt(1 - carried**2)
    shape = (-1, *[1] * (values.ndim - 1))
    later = (values[1:] - carried.reshape(shape) * values[:-1]) / innovation.reshape(shape)
    return np.concatenate([values[:1], later]), float(np.log(innovation).sum())


def _fit_at(columns, target, place, correlation):
    """Values, variances, residual (REML) and plain log-likelihood at one correlation."""
    design, logarithm = whitened(columns, place, correlation)
    seen, _ = whitened(target, place, correlation)
    orthogonal, triangle = np.linalg.qr(design)
    inverse = np.linalg.inv(triangle)
    values = inverse @ (orthogonal.T @ seen)
    squares = max(float(np.sum((seen - design @ values) ** 2)), np.finfo(float).tiny)
    rows, count = columns.shape
    variance = squares / (rows - count)
    spread = np.log(np.abs(np.diagonal(triangle))).sum()
    restricted = -0.5 * (rows - count) * np.log(variance) - logarithm - spread
    plain = -0.5 * rows * np.log(squares / rows) - logarithm
    return values, variance * np.sum(inverse**2, axis=1), restricted, plain


GAS_CONSTANT = 8.314462618  # J/(mol K)
FARADAY = 96485.33212  # C/mol
ZERO_CELSIUS_KELVIN = 273.15
REFERENCE_KELVIN = 298.15


def inverse_temperature(celsius):
    """(1/T − 1/298.15 K)/R [mol/J], the axis on which the log of an Arrhenius law is a line.

    Parameters
    ----------
    celsius : scalar or (n,) [°C].
    """
    kelvin = np.asarray(celsius, float) + ZERO_CELSIUS_KELVIN
    return (1 / kelvin - 1 / REFERENCE_KELVIN) / GAS_CONSTANT
