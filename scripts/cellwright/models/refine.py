"""Time constants that were searched, taken to their optimum beside all that was found since."""

from typing import NamedTuple

import numpy as np

from cellwright.models.design import columns_of
from cellwright.models.settle import cost_of, settled

STEP = 0.01  # of a logarithm, for central differences
TOLD_APART = 1e-12  # smallest eigenvalue of the scaled precision: below it is rounding


class Free(NamedTuple):
    """The linear problem with time constants as further parameters, (p + m) in all.

    precision : (p + m, p + m) inverse covariance. slope : (p + m,) of half the cost, negative.
    """

    precision: np.ndarray
    slope: np.ndarray


def with_time_constants(data, held, system, solution):
    """Precision and slope with the logarithms of the time constants free as well.

    Parameters
    ----------
    data : design.Data. held : design.Held.
    system, solution : regression.System, Solution of what is held.

    Returns
    -------
    free : Free.
    """
    moved = [_change(data, held, n, solution.values) for n in range(len(held.tau_second))]
    matrix = np.column_stack([system.matrix, *(one * system.weight for one in moved)])
    size = len(solution.vector)
    precision = solution.factor * matrix.T @ matrix
    precision[:size, :size] += system.prior
    slope = solution.factor * matrix.T @ (solution.residual_volt * system.weight)
    slope[:size] -= system.prior @ (solution.vector + system.held)
    return Free(precision, slope)


def _change(data, held, number, values):
    """Change of the voltage by the logarithm of one time constant, by central differences."""
    up, down = (
        columns_of(data, _moved(held, number, np.exp(sign * STEP))).resistances for sign in (1, -1)
    )
    change = sum((a - b) @ values[name] for (name, a), (_, b) in zip(up, down, strict=True))
    return change / (2 * STEP)


def _moved(held, number, factor):
    tau = list(held.tau_second)
    tau[number] *= factor
    return held._replace(tau_second=tuple(tau))


def refined(data, held, system, solution, bounds, *, steps=3, enough=0.1):
    """Newton steps of the time constants, as long as they lower the cost.

    The search stops a few per cent off, and ran before hysteresis, kinetics and diffusion were
    found: the stated deviations would be smaller than that.

    Parameters
    ----------
    data, held, system, solution : as in `with_time_constants`.
    bounds : (low, high) of time constants [s].
    steps : how many at most.
    enough : step that is small enough, over the standard deviation [1].

    Returns
    -------
    held, system, solution : as given where no step helps.
    """
    factor = solution.factor
    best = cost_of(data, held, factor)
    for _ in range(steps):
        step, std = _step(with_time_constants(data, held, system, solution), solution)
        tau = np.clip(np.asarray(held.tau_second) * np.exp(np.clip(step, -0.5, 0.5)), *bounds)
        tried = held._replace(tau_second=tuple(np.sort(tau)))
        cost = cost_of(data, tried, factor)
        if cost >= best:
            break
        held, system, solution = settled(data, tried, passes=3)
        best = cost_of(data, held, factor)
        if np.all(np.abs(step) <= enough * std):
            break
    return held, system, solution


def covariance_of(free, solution):
    """Covariance with the time constants free, (p + m, p + m); NaN where a bound holds.

    Where the data do not tell the time constants apart, these have none, and all else is as known
    for given ones.

    Parameters
    ----------
    free : Free. solution : regression.Solution.
    """
    size, diagonal = len(solution.vector), np.diag(free.precision)
    loose = np.append(np.isfinite(np.diag(solution.covariance)), diagonal[size:] > 0)
    at, scale = np.ix_(loose, loose), np.sqrt(diagonal[loose])
    unit = free.precision[at] / np.outer(scale, scale)
    found = np.full(free.precision.shape, np.nan)
    if np.linalg.eigvalsh(unit)[0] > TOLD_APART:
        found[at] = np.linalg.inv(unit) / np.outer(scale, scale)
    else:
        found[:size, :size] = solution.covariance
    return found


def _step(free, solution):
    """Step of the logarithms and their deviations; zero where there is no deviation."""
    covariance = covariance_of(free, solution)[len(solution.vector) :]
    std = np.sqrt(np.diag(covariance[:, len(solution.vector) :]))
    return np.nan_to_num(covariance) @ free.slope, np.nan_to_num(std)
