"""A fitted rising curve: its places, value, slope, second derivative, and their deviations.

The curve is a cubic B-spline over equal cells of a stretched abscissa; `monotone` fits it.
"""

from typing import NamedTuple

import numpy as np


class RisingCurve(NamedTuple):
    """A fitted rising curve y(x) over equal cells of a stretched abscissa.

    coefficients : (cells + 3,) of the cubic B-splines. factor : lower banded Cholesky factor of
    the posterior precision, times variance; inverse : band of the inverse of that product
    (5, cells + 3). variance : of one reading with weight 1.
    stretch : callable, cumulative stretch of x, with derivatives. first, span : its value at the
    first reading, and its range. x_range : of the readings. decade : strength of the penalty.
    """

    coefficients: np.ndarray
    factor: np.ndarray
    inverse: np.ndarray
    variance: float
    stretch: object
    first: float
    span: float
    x_range: tuple
    decade: float


def b_splines(place, cells, derivative):
    """First coefficient (n,) and weights (4, n) of uniform cubic B-splines, or of a derivative."""
    first = np.clip(place.astype(int), 0, cells - 1)
    t = place - first
    if derivative == 0:
        weights = [(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, 1 + 3 * t * (1 + t - t**2), t**3]
    elif derivative == 1:
        weights = [-3 * (1 - t) ** 2, 9 * t**2 - 12 * t, 3 + 6 * t - 9 * t**2, 3 * t**2]
    else:
        weights = [6 * (1 - t), 18 * t - 12, 6 - 18 * t, 6 * t]
    return first, np.array(weights) / 6


def cells_of(curve):
    """Number of cells of a fitted curve."""
    return len(curve.coefficients) - 3


def x_at(curve, place):
    """Abscissa x (m,) at places (m,) counted in cells."""
    fine = np.linspace(*curve.x_range, 16 * cells_of(curve) + 1)
    cells = (curve.stretch(fine) - curve.first) / curve.span * cells_of(curve)
    return np.interp(place, cells, fine)


def local_gradients(curve, place, derivative, x=None):
    """Derivatives of y or of dy/dx, d2y/dx2 at places by the four coefficients that they depend on.

    Parameters
    ----------
    curve : RisingCurve. place : (m,) in cells. derivative : 0, 1 or 2 [1].
    x : (m,) abscissa at the places, where it is known already.

    Returns
    -------
    first : (m,) number of the first of them. weights : (4, m).
    """
    first, weights = b_splines(place, cells_of(curve), derivative)
    if derivative == 0:
        return first, weights
    scale = cells_of(curve) / curve.span
    x = x_at(curve, place) if x is None else x
    weights = weights * (curve.stretch(x, 1) * scale) ** derivative
    if derivative == 2:
        weights += b_splines(place, cells_of(curve), 1)[1] * curve.stretch(x, 2) * scale
    return first, weights


def gradients(curve, place, derivative, x=None):
    """The same by all coefficients: (m, cells + 3), for functions of several places."""
    first, weights = local_gradients(curve, place, derivative, x)
    rows = np.zeros((len(place), cells_of(curve) + 3))
    rows[np.arange(len(place))[:, None], first[:, None] + np.arange(4)] = weights.T
    return rows


def values(curve, place):
    """Value y, slope dy/dx and second derivative (m,) each, at places counted in cells."""
    return course(curve, place)[1:]


def course(curve, place):
    """Abscissa x, value y, slope dy/dx and second derivative (m,) each, at places.

    Parameters
    ----------
    curve : RisingCurve. place : (m,) in cells, not falling.
    """
    cells = cells_of(curve)
    scale = cells / curve.span
    x = x_at(curve, place)
    found = []
    for derivative in (0, 1, 2):
        first, weights = b_splines(place, cells, derivative)
        found.append(sum(weights[k] * curve.coefficients[first + k] for k in range(4)))
    rate, bend = curve.stretch(x, 1) * scale, curve.stretch(x, 2) * scale
    return np.array([x, found[0], found[1] * rate, found[2] * rate**2 + found[1] * bend])


def covariance(curve, rows):
    """Posterior covariance (m, m) of linear functions of the coefficients, rows (m, cells + 3)."""
    return curve.variance * rows @ band_solution(curve.factor, rows.T)


def local_deviations(curve, first, weights):
    """Posterior standard deviations (m,) of functions of few neighbouring coefficients.

    Parameters
    ----------
    curve : RisingCurve. first : (m,) number of the first coefficient. weights : (k, m), k to 5.
    """
    square = np.zeros(len(first))
    for a in range(len(weights)):
        square += weights[a] ** 2 * curve.inverse[0][first + a]
        for b in range(a + 1, len(weights)):
            square += 2 * weights[a] * weights[b] * curve.inverse[b - a][first + a]
    return np.sqrt(curve.variance * np.maximum(square, 0.0))


def deviations_between(curve, several, one):
    """Posterior standard deviations (m,) of functions of four coefficients each, less another one.

    Parameters
    ----------
    curve : RisingCurve. several, one : results of `local_gradients` at m places and at one.
    """
    first, weights = several
    row = np.zeros(len(curve.coefficients))
    row[one[0][0] + np.arange(4)] = one[1][:, 0]
    solved = curve.variance * band_solution(curve.factor, row)
    shared = sum(weights[k] * solved[first + k] for k in range(4))
    square = local_deviations(curve, first, weights) ** 2 + row @ solved - 2 * shared
    return np.sqrt(np.maximum(square, 0.0))


def band_factor(matrix):
    """Lower banded Cholesky factor of a symmetric matrix, given by its lower bands (b, n).

    By LAPACK itself: scipy's functions of the same purpose check so much around it that a fit,
    which asks for some two hundred factors of small matrices, would take twice as long.

    Raises
    ------
    numpy.linalg.LinAlgError : a matrix that is not positive definite, or not finite.
    """
    from scipy.linalg.lapack import dpbtrf

    factor, failed = dpbtrf(matrix, lower=1)
    if failed or not np.isfinite(factor[0]).all():
        raise np.linalg.LinAlgError("the normal equations of the curve are singular")
    return factor


def band_solution(factor, right):
    """Solution (n,) or (n, m) of the equations that `band_factor` has factorised."""
    from scipy.linalg.lapack import dpbtrs

    return dpbtrs(factor, right, lower=1)[0]
