"""The part of an identification that is linear: design matrix, non-negative solve, covariance."""

from typing import NamedTuple

import numpy as np

from cellwright.models.kernels import lag
from cellwright.refusal import Refusal


class Problem(NamedTuple):
    """Thinned records as the right-hand side and the fixed columns of a linear model."""

    steps: tuple
    drives: tuple
    used: tuple
    hold: str
    weight: np.ndarray
    fixed: np.ndarray
    target_volt: np.ndarray
    signed: int


def hats(soc, knots):
    """Hat functions of a piecewise linear course over the knots, held flat outside: (n, k)."""
    return np.column_stack([np.interp(soc, knots, row) for row in np.eye(len(knots))])


def problem_of(records, knots, ocv_soc, ocv_volt, *, hold, free_ocv, floor_volt, relative):
    """Right-hand side V − OCV(z), and the columns that no time constant enters.

    Parameters
    ----------
    records : sequence of Record.
    knots : (k,) ascending SoC [1].
    ocv_soc, ocv_volt : (p,) OCV table, ascending [1], [V].
    hold : hold of the current, see `kernels.lag_weights`.
    free_ocv : True adds a shift of the OCV at each knot (the table's error), of either sign.
    floor_volt, relative : rows weigh by 1/(floor_volt + relative·|V − OCV|) [V], [1].

    Returns
    -------
    problem : Problem; its fixed columns are the OCV shifts (where free), then R0.
    """
    shape = [hats(r.soc, knots) for r in records]
    drives = [h * r.current_ampere[:, None] for h, r in zip(shape, records, strict=True)]
    target = [r.voltage_volt - np.interp(r.soc, ocv_soc, ocv_volt) for r in records]
    used = tuple(r.used for r in records)
    target = _rows(target, used)
    weight = 1.0 / (floor_volt + relative * np.abs(target))
    weight /= weight.mean()
    shifts = [_rows(shape, used)] if free_ocv else []
    fixed = np.hstack([*shifts, _rows(drives, used)]) * weight[:, None]
    steps = tuple(np.diff(r.test_time_second) for r in records)
    signed = len(knots) * len(shifts)
    return Problem(steps, tuple(drives), used, hold, weight, fixed, target * weight, signed)


def lagged(problem, tau_second):
    """Columns of one RC branch with unit resistances at the knots: (rows, k) [A]."""
    pairs = zip(problem.steps, problem.drives, strict=True)
    columns = [lag(s, tau_second, d, hold=problem.hold) for s, d in pairs]
    return _rows(columns, problem.used) * problem.weight[:, None]


def design(problem, tau_second):
    """All columns of the linear model for given time constants."""
    return np.hstack([problem.fixed, *(lagged(problem, tau) for tau in tau_second)])


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


def _rows(columns, used):
    return np.concatenate([c[u] for c, u in zip(columns, used, strict=True)])
