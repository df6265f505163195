"""Linear least squares: piecewise linear columns, bounded solve, Savitzky-Golay filter."""

from functools import lru_cache

import numpy as np

from cellwright.refusal import Refusal


def hats(soc, knots):
    """Columns (n, k) of a piecewise linear function of SoC over the knots, constant beyond them."""
    return np.column_stack([np.interp(soc, knots, row) for row in np.eye(len(knots))])


ROUNDS = 30  # of the active set; it has always settled in fewer than ten
FULL_EXCHANGES = 3  # without fewer signs wrong, before a single parameter is exchanged
RESOLVED = 1e-11  # smallest eigenvalue of a scaled Gram matrix that tells parameters apart
LEAST_PULL = 1e-12  # of the largest moment: below it a gradient is rounding


def solve(gram, moment, signed, most=None, *, free=None):
    """Least squares with non-negative parameters and upper bounds, from the normal equations.

    Parameters
    ----------
    gram, moment : (p, p), (p,) XᵀX and Xᵀy.
    signed : number of leading parameters that may have either sign.
    most : (p,) upper bounds, infinite where there is none; None: none at all.
    free : (p,) bool, which parameters are expected to be off their bound at zero, such as those of
        a similar problem; None: all. The solution is unique, so that this changes the time alone.

    Returns
    -------
    parameters : (p,); exactly zero, or the upper bound, where a bound holds.

    Raises
    ------
    Refusal : the data do not determine the parameters (rank).

    Source: block principal pivoting after J. Kim and H. Park, SIAM J. Sci. Comput. 33 (2011) 3261.
    """
    free = np.ones(len(gram), bool) if free is None else free
    parameters = _nonnegative(gram, moment, signed, free)
    if most is None or np.all(parameters <= most):
        return parameters
    return _bounded(gram, moment, signed, most, parameters)


def _bounded(gram, moment, signed, most, parameters):
    """Solution below upper bounds by an active set: who exceeds its bound is held on it."""
    held = parameters > most
    for _ in range(ROUNDS):
        free, expected = ~held, parameters > 0
        rest = moment[free] - gram[np.ix_(free, held)] @ most[held]
        parameters = np.where(held, most, 0.0)
        parameters[free] = _nonnegative(gram[np.ix_(free, free)], rest, signed, expected[free])
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


def _nonnegative(gram, moment, signed, free):
    """Least squares in which only the leading parameters may be negative."""
    scale = np.sqrt(np.diag(gram))
    if np.any(scale < 1e-9 * scale.max()):
        raise Refusal(f"{np.sum(scale < 1e-9 * scale.max())} parameters are not excited at all")
    unit, target = gram / scale / scale[:, None], moment / scale
    _refuse_singular(unit)
    free, fewest, exchanges = free.copy(), len(unit) + 1, FULL_EXCHANGES
    free[:signed] = True
    least_pull = LEAST_PULL * np.abs(target).max()
    for _ in range(ROUNDS):
        solution = _free_solution(unit, target, free)
        wrong = np.where(free, solution < 0, unit @ solution - target < -least_pull)
        wrong[:signed] = False
        count = wrong.sum()
        if count == 0:
            return solution / scale
        exchanges = FULL_EXCHANGES if count < fewest else exchanges - 1
        fewest = min(count, fewest)
        if exchanges < 0:  # all at once may take turns for ever, one at a time may not
            wrong[: np.flatnonzero(wrong)[-1]] = False
        free ^= wrong
    return _one_by_one(unit, target, signed) / scale


def _refuse_singular(unit):
    """Refuse a scaled Gram matrix whose smallest eigenvalue is not above `RESOLVED`.

    A matrix less a multiple of the identity has a Cholesky factor where all its eigenvalues are
    larger than that multiple: a tenth of the work of the eigenvalues.
    """
    try:
        np.linalg.cholesky(unit - RESOLVED * np.eye(len(unit)))
    except np.linalg.LinAlgError:
        raise Refusal(
            "the load does not tell OCV, resistance and relaxation apart (rank)"
        ) from None


def _one_by_one(unit, target, signed):
    """Solution for an active set that does not settle: one parameter freed at a time.

    Source: C. Lawson and R. Hanson, Solving Least Squares Problems (1974), algorithm NNLS, from the
    normal equations as in R. Bro and S. de Jong, J. Chemometrics 11 (1997) 393.
    """
    free = np.arange(len(unit)) < signed
    solution = _free_solution(unit, target, free)
    least_pull = LEAST_PULL * np.abs(target).max()
    for _ in range(ROUNDS * len(unit)):
        pull = np.where(free, -np.inf, target - unit @ solution)
        if not np.any(pull > least_pull):
            return solution
        free[np.argmax(pull)] = True
        solution = _stepped(unit, target, signed, free, solution)
    raise Refusal("the bounds of the parameters do not settle: the data hardly tell them apart")


def _stepped(unit, target, signed, free, solution):
    """Solution of the free parameters; those that reach zero on the way to it stay there."""
    wanted = _free_solution(unit, target, free)
    falling = free & (wanted <= 0)
    falling[:signed] = False
    while falling.any():
        share = solution[falling] / (solution[falling] - wanted[falling])
        solution = solution + share.min() * (wanted - solution)
        free[np.flatnonzero(falling)[share <= share.min()]] = False
        wanted = _free_solution(unit, target, free)
        falling = free & (wanted <= 0)
        falling[:signed] = False
    return wanted


def _free_solution(unit, target, free):
    solution = np.zeros(len(unit))
    solution[free] = np.linalg.solve(unit[np.ix_(free, free)], target[free])
    return solution


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
