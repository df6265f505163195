"""Courses predicted from few features of few cells: shrunk to nothing unless the cells carry more.

Gaussian process regression (ridge regression in its dual form) of several outputs with one kernel,
1 + x·x'/p or its square, whose noise is chosen by the errors of the cells left out one by one.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from cellwright.numerics.compare import compare

PENALTIES = 10.0 ** np.arange(-5.0, 3.1, 0.5)
DEGREES = (1, 2)
LEVEL = 0.95
FEW = 12  # cells, of which a choice among many fits deceives about errors


class Shrunk(NamedTuple):
    """A regression of courses on features.

    features : (c, p) scaled by `scale` (p,). degree : of the kernel, 0 where the features carry
    nothing. penalty : variance of the noise over that of the kernel [1], infinite where degree is
    0. weights : (c, k) of the cells. left_out : (c, k) error of each cell, predicted from the
    others alone (predicted minus true). variance : (c,) of those predictions, in units of the
    kernel. spread : (k,) standard deviation of an error of unit variance.
    """

    features: np.ndarray
    scale: np.ndarray
    degree: int
    penalty: float
    weights: np.ndarray
    left_out: np.ndarray
    variance: np.ndarray
    spread: np.ndarray


class Prediction(NamedTuple):
    """change (k,), its half interval of 95 % (k,), and how far out it is.

    remoteness : standard deviation of this prediction over the largest of the calibrating cells,
    each left out; above 1 no cell of the calibration stands for it.
    stretch : (c,) its standard deviation over that of each of them.
    """

    change: np.ndarray
    half_interval: np.ndarray
    remoteness: float
    stretch: np.ndarray


def shrunk(features, changes, *, degrees=DEGREES, judged_again=True):
    """Regression of courses on features, with the noise that serves cells left out best.

    Nothing is predicted (degree 0) unless the errors of the cells left out are clearly smaller:
    few cells shrink to no change at all. Of noises that serve them alike (within the standard error
    of the difference) the largest is taken.

    Parameters
    ----------
    features : (c, p) differences from the reference, zero for the reference itself.
    changes : (c, k) of the cells.
    degrees : kernels that are tried, 1 linear, 2 with squares and products.
    judged_again : of few cells, whether each is left out of the choice of the noise as well.

    Returns
    -------
    shrunk : Shrunk.

    Source: C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning (2006), 2.2
    and 5.4.2 (errors left out without fitting again).
    """
    cells, terms = np.shape(features)
    scale = np.sqrt(np.mean(np.square(features), axis=0)) if cells else np.ones(terms)
    scaled = features / np.where(scale > 0, scale, 1.0)
    none = _without(scaled, scale, changes)
    if cells < 3 or not terms or not degrees:
        return none
    tried = [fit for degree in degrees for fit in _fitted(scaled, scale, changes, degree)]
    best = _stiffest(tried)
    best = best._replace(spread=_spread(best.left_out, best.variance))
    if not clearly_less(none.left_out, best.left_out):
        return none
    if judged_again and cells <= FEW:
        return _judged_again(best, features, changes, degrees)
    return best


def _judged_again(fit, features, changes, degrees):
    """A fit of few cells with the errors of cells left out of the choice of its noise as well."""
    left_out = []
    for place in range(len(features)):
        others = np.arange(len(features)) != place
        found = shrunk(features[others], changes[others], degrees=degrees, judged_again=False)
        left_out.append(predicted(found, features[place]).change - changes[place])
    left_out = np.array(left_out)
    return fit._replace(left_out=left_out, spread=_spread(left_out, fit.variance))


def _stiffest(tried):
    """Of the fits that serve cells left out about as well as the best, that of the most noise."""
    squares = np.mean(np.square([fit.left_out for fit in tried]), axis=2)
    place = int(np.argmin(squares.mean(axis=1)))
    best = tried[place]
    alike = [
        fit
        for fit, each in zip(tried, squares, strict=True)
        if fit.degree <= best.degree and compare(each, squares[place]).z <= 1.0
    ]
    return max(alike, key=lambda fit: (fit.penalty, -fit.degree))


def clearly_less(before, after):
    """Whether errors of cells left out are smaller by more than chance.

    They have to be smaller as a whole, and typically: the logarithms of the ratios of their squares
    have a mean below zero at 95 % (Student's t, one side), so that three cells need three errors
    that are smaller alike.

    Parameters
    ----------
    before, after : (c, k) errors of the same cells, of which fewer than three tell nothing.

    Returns
    -------
    less : bool.
    """
    squares = [np.mean(np.square(errors), axis=1) for errors in (before, after)]
    if not squares[1].mean() < squares[0].mean():
        return False
    # Smaller errors than a hundredth of the typical one are alike: none.
    least = 1e-4 * squares[0].mean()
    scores = [-np.log(np.maximum(each, least)) for each in (squares[1], squares[0])]
    return bool(compare(*scores).z > stdtrit(len(squares[0]) - 1, LEVEL))


def _without(scaled, scale, changes):
    """No prediction at all; its error grows with the distance from the reference."""
    variance = 1.0 + np.mean(np.square(scaled), axis=1) if scaled.shape[1] else np.ones(len(scaled))
    left_out = -np.asarray(changes, float)
    spread = _spread(left_out, variance)
    return Shrunk(scaled, scale, 0, np.inf, np.zeros_like(left_out), left_out, variance, spread)


def _fitted(scaled, scale, changes, degree):
    """Fits with each of the noises, solved at once; their spread is asked of one of them alone."""
    noises = np.multiply.outer(np.asarray(PENALTIES, float), np.eye(len(scaled)))
    inverses = np.linalg.inv(_kernel(scaled, scaled, degree) + noises)
    weights = inverses @ changes
    variances = 1.0 / np.diagonal(inverses, axis1=1, axis2=2)
    left_out = -weights * variances[:, :, None]
    of_each = zip(PENALTIES, weights, left_out, variances, strict=True)
    return [Shrunk(scaled, scale, degree, *of_one, None) for of_one in of_each]


def _kernel(a, b, degree):
    return (1.0 + a @ b.T / a.shape[1]) ** degree


def _spread(left_out, variance):
    if not len(left_out):
        return np.full(left_out.shape[1], np.nan)
    return np.sqrt(np.mean(np.square(left_out) / variance[:, None], axis=0))


def predicted(fit, features):
    """Course of a new cell from its features.

    Parameters
    ----------
    fit : Shrunk. features : (p,) as of `shrunk`.

    Returns
    -------
    prediction : Prediction; its interval is NaN below two calibrating cells.
    """
    cells = len(fit.variance)
    x = np.asarray(features, float) / np.where(fit.scale > 0, fit.scale, 1.0)
    if fit.degree == 0:
        change = np.zeros(fit.weights.shape[1])
        variance = 1.0 + (np.mean(np.square(x)) if len(x) else 0.0)
    else:
        towards = _kernel(x[None], fit.features, fit.degree)[0]
        change = towards @ fit.weights
        covariance = _kernel(fit.features, fit.features, fit.degree) + fit.penalty * np.eye(cells)
        known = towards @ np.linalg.solve(covariance, towards)
        variance = _kernel(x[None], x[None], fit.degree)[0, 0] + fit.penalty - known
    quantile = stdtrit(cells - 1, 0.5 + LEVEL / 2) if cells > 1 else np.nan
    stretch = np.sqrt(variance / fit.variance)
    remoteness = float(stretch.min()) if cells else np.inf
    return Prediction(change, quantile * fit.spread * np.sqrt(variance), remoteness, stretch)
