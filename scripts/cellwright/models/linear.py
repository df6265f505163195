"""The part of an identification that is linear: hat functions, non-negative solve, residuals."""

import numpy as np

from cellwright.refusal import Refusal


def hats(soc, knots):
    """Hat functions of a piecewise linear course over the knots, held flat outside: (n, k)."""
    return np.column_stack([np.interp(soc, knots, row) for row in np.eye(len(knots))])


def solve(gram, moment, signed):
    """Least squares with non-negative resistances, from the normal equations.

    Parameters
    ----------
    gram, moment : (p, p), (p,) XᵀX and Xᵀy.
    signed : number of leading parameters that may have either sign.

    Returns
    -------
    parameters : (p,); exactly zero where the bound holds.

    Raises
    ------
    Refusal : the data do not tell the parameters apart.
    """
    from scipy.optimize import nnls

    scale = np.sqrt(np.diag(gram))
    if np.any(scale < 1e-9 * scale.max()):
        raise Refusal(f"{np.sum(scale < 1e-9 * scale.max())} parameters are not excited at all")
    unit = gram / np.outer(scale, scale)
    if np.linalg.eigvalsh(unit)[0] < 1e-11:
        raise Refusal("the load does not tell OCV, resistance and relaxation apart (rank)")
    factor = np.linalg.cholesky(unit)
    both = np.hstack([factor.T, -factor.T[:, :signed]])
    found = nnls(both, np.linalg.solve(factor, moment / scale))[0]
    found[:signed] -= found[len(scale) :]
    return found[: len(scale)] / scale


def correlation_factor(residual):
    """By how much the variance of a mean grows because neighbouring residuals agree.

    1 + 2·Σ of the autocorrelation up to its first zero crossing; 1 for white noise. A model's
    errors are never white, and without this factor the error bars would be far too small.

    Source: Geyer, Statistical Science 7 (1992) 473, initial positive sequence, simplified.
    """
    centred = residual - residual.mean()
    power = np.abs(np.fft.rfft(centred, 2 * len(centred))) ** 2
    auto = np.fft.irfft(power)[: len(centred)]
    if auto[0] <= 0:
        return 1.0
    crossing = np.argmax(auto <= 0) or len(auto)
    return float(1.0 + 2.0 * auto[1:crossing].sum() / auto[0])
