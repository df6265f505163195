"""Linear least squares: piecewise linear columns, bounded solve, Savitzky-Golay filter."""

from functools import lru_cache

import numpy as np

from cellwright.refusal import Refusal


def hats(soc, knots):
    """Columns (n, k) of a piecewise linear function of SoC over the knots, constant beyond them."""
    return np.column_stack([np.interp(soc, knots, row) for row in np.eye(len(knots))])


ROUNDS = 30  # of the active set; it has always settled in fewer than ten


def solve(gram, moment, signed, most=None):
    """Least squares with non-negative parameters and upper bounds, from the normal equations.

    Parameters
    ----------
    gram, moment : (p, p), (p,) XᵀX and Xᵀy.
    signed : number of leading parameters that may have either sign.
    most : (p,) upper bounds, infinite where there is none; None: none at all.

    Returns
    -------
    parameters : (p,); exactly zero, or the upper bound, where a bound holds.

    Raises
    ------
    Refusal : the data do not determine the parameters (rank).
    """
    parameters = _nonnegative(gram, moment, signed)
    if most is None or np.all(parameters <= most):
        return parameters
    return _bounded(gram, moment, signed, most, parameters)


def _bounded(gram, moment, signed, most, parameters):
    """Solution below upper bounds by an active set: who exceeds its bound is held on it."""
    held = parameters > most
    for _ in range(ROUNDS):
        free = ~held
        rest = moment[free] - gram[np.ix_(free, held)] @ most[held]
        parameters = np.where(held, most, 0.0)
        parameters[free] = _nonnegative(gram[np.ix_(free, free)], rest, signed)
        pull = gram @ parameters - moment
        wrong = (held & (pull > 0)) | (free & (parameters > most))
        if not wrong.any():
            return parameters
        held = held ^ wrong
    return _by_scipy(gram, moment, signed, most)


def _by_scipy(gram, moment, signed, most):
    """Solution by scipy's bounded solver, for an active set that does not settle."""
    from scipy.optimize import lsq_linear

    factor = np.linalg.cholesky(gram)
    least = np.append(np.full(signed, -np.inf), np.zeros(len(gram) - signed))
    return lsq_linear(factor.T, np.linalg.solve(factor, moment), bounds=(least, most)).x


def _nonnegative(gram, moment, signed):
    """Least squares in which only the leading parameters may be negative."""
    from scipy.optimize import nnls

    scale = np.sqrt(np.diag(gram))
    if np.any(scale < 1e-9 * scale.max()):
        raise Refusal(f"{np.sum(scale < 1e-9 * scale.max())} parameters are not excited at all")
    unit = gram / np.outer(scale, scale)
    if np.linalg.eigvalsh(unit)[0] < 1e-11:
        raise Refusal("the load does not tell OCV, resistance and relaxation apart (rank)")
    factor = np.linalg.cholesky(unit)
    both = np.hstack([factor.T, -factor.T[:, :signed]])
    solution = nnls(both, np.linalg.solve(factor, moment / scale))[0]
    solution[:signed] -= solution[len(scale) :]
    return solution[: len(scale)] / scale


SAVITZKY_GOLAY_ORDER = 5


def savitzky_golay_weights(half, width, derivative):
    """Weights of the 2·half + 1 points about a point for a derivative of the local polynomial.

    Own code, for the import of scipy.signal takes longer than a job.

    Parameters
    ----------
    half : points to either side. width : distance of the points, in any unit.
    derivative : 0 smooths, 1 gives the slope.

    Returns
    -------
    weights : (2·half + 1,).

    Source: Savitzky & Golay, Anal. Chem. 36 (1964) 1627; least squares by the pseudo-inverse.
    """
    return _polynomial_weights(half)[derivative] / (half * width) ** derivative


@lru_cache(maxsize=64)
def _polynomial_weights(half):
    """Polynomial coefficients from the values at 2·half + 1 points: (order + 1, 2·half + 1)."""
    powers = (np.arange(-half, half + 1) / half)[:, None] ** np.arange(SAVITZKY_GOLAY_ORDER + 1)
    return np.linalg.pinv(powers)
