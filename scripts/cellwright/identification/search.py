"""Search of the non-linear parameters: SoC scale, kinetics, time constants."""

from functools import cache
from typing import NamedTuple

import numpy as np

from cellwright.identification.columns import (
    FAST_SECOND,
    Data,
    columns_of,
    resistance_columns,
)
from cellwright.identification.regression import (
    cost_at,
    covariance_of,
    minimum,
    named,
    solved,
    system_of,
)
from cellwright.refusal import Refusal

WIDEST = 0.1  # change of the SoC's scale that is believed
SETTLED = 2e-4  # change of the SoC's scale that is small enough
STEADY = 0.003  # change of the charge-transfer resistance that is small enough, of its largest


class Shared(NamedTuple):
    """What fits of several members to the same data have in common, filled while they are made.

    data : columns.Data. searched : dict of searches that are finished, such as the time constants
    of two pairs. expected : dict of weighting → dict name → (k,) bool, which values of the last
    solution were above zero: the next one's are nearly the same. system : dict of the last Held
    and its system.
    """

    data: Data
    searched: dict
    expected: dict
    system: dict


def shared_of(data):
    """Shared of a set of data, with nothing searched yet.

    Parameters
    ----------
    data : columns.Data.
    """
    return Shared(data, {}, {}, {})


def once(shared, key, search):
    """Result of a search over the data, which another member may have asked for before.

    Parameters
    ----------
    shared : Shared. key : hashable, all that the search depends on beside the data.
    search : function of no argument.
    """
    if key not in shared.searched:
        shared.searched[key] = search()
    return shared.searched[key]


class Fit(NamedTuple):
    """Held parameters, the regression.System about them, its Solution, and a covariance (p, p).

    The solution is that at the held SoC scale, the covariance that with a free one. condition : the
    fitted circuit, once the search is over.
    """

    held: object
    system: object
    solution: object
    covariance: np.ndarray
    condition: object = None


def settled(shared, held, *, passes=10):
    """Fit after the SoC's scale and the kinetics have converged.

    Parameters
    ----------
    shared : Shared.
    held : columns.Held.
    passes : largest number of solutions, each about the scale and kinetics of the last.
    """
    done, still = 0, False
    while done < passes - 1 and not still:
        held, more = _approached(shared, held, passes - 1 - done)
        system, done = system_about(shared, held), done + more
        solution = _solved(shared, system)
        _, moved = _rescaled(held, solution.scale)
        still = moved < SETTLED or more == 1
    covariance = covariance_of(system, solution)
    # A last change of the scale that is not made would leave values that belong to another scale.
    solution = _solved(shared, system, scale_free=False)
    return Fit(_with_transfer(held, solution.values), system, solution, covariance)


def system_about(shared, held):
    """The linear problem about held parameters; the last one is kept, it is often asked for again.

    Parameters
    ----------
    shared : Shared. held : columns.Held.

    Returns
    -------
    system : regression.System.
    """
    key = key_of(held)
    if key not in shared.system:
        shared.system.clear()
        columns = columns_of(shared.data, held)
        shared.system[key] = system_of(columns, shared.data.knots)
    return shared.system[key]


def key_of(held):
    """Held parameters as a key of dictionaries.

    Parameters
    ----------
    held : columns.Held.
    """
    transfer = held.transfer_ohm
    return held._replace(transfer_ohm=None if transfer is None else tuple(transfer))


def _solved(shared, system, **settings):
    """Solution of a system, begun from which values the last one had above zero."""
    solution = solved(system, expected=shared.expected, **settings)
    for weighting, above_zero in solution.above_zero.items():
        shared.expected.setdefault(weighting, {}).update(above_zero)
    return solution


def _minimum(shared, system, factor, **settings):
    """Parameters (p,) of the lowest cost at a weight of the data, begun as in `_solved`."""
    expected = shared.expected.setdefault("found", {})
    vector = minimum(system, factor, expected=expected, **settings)
    expected.update(named(system, vector > 0))
    return vector


def _approached(shared, held, passes):
    """Held parameters after so many passes, fewer where the SoC's scale and kinetics are still.

    The weight of the data is found in the first pass.

    Returns
    -------
    held : columns.Held. done : number of passes.
    """
    if held.scale_volt is not None and held.transfer_ohm is None:
        values, _ = _values_about(shared, held._replace(scale_volt=None), None)
        held = held._replace(transfer_ohm=_transfer(held, values, half=True))
    factor, done, last, share = None, 0, 0.0, 1.0
    for _ in range(passes):
        done += 1
        values, factor = _values_about(shared, held, factor)
        held, moved = _rescaled(held, values["scale"])
        still = moved < SETTLED
        if held.scale_volt is not None:
            change = _transfer(held, values) - held.transfer_ohm
            # More resistance damps itself more: in whole steps the two may take turns for ever.
            share = share / 2 if np.sum(change * last) < 0 else share
            held = held._replace(transfer_ohm=held.transfer_ohm + share * change)
            still = still and np.abs(change).max() < STEADY * held.transfer_ohm.max()
            last = change
        if still:
            break
    return held, done


def _rescaled(held, change):
    """Held parameters after a change of the SoC's scale (2,), within its limits, and its size."""
    scale = np.array([held.missing, held.stretch])
    changed = np.clip(scale + change, -WIDEST, WIDEST)
    moved = held._replace(missing=float(changed[0]), stretch=float(changed[1]))
    return moved, float(np.abs(changed - scale).max())


def _values_about(shared, held, factor):
    """Values of the solution about held parameters by name, and the weight of the data in it."""
    system = system_about(shared, held)
    if factor is None:
        solution = _solved(shared, system)
        return solution.values, solution.solved_with
    return named(system, _minimum(shared, system, factor)), factor


def _with_transfer(held, values):
    """Held parameters with the charge transfer of a solution, where there are kinetics."""
    if held.scale_volt is None:
        return held
    return held._replace(transfer_ohm=_transfer(held, values))


def _transfer(held, values, *, half=False):
    """Charge-transfer resistance at the knots (k,) [ohm]; at first half of the ohmic one."""
    fast = [values[f"r{n}"] for n, tau in enumerate(held.tau_second, 1) if tau <= FAST_SECOND]
    return sum(fast, 0.5 * values["r0"] if half else values["rct"])


def cheapest(shared, tries, factor):
    """Held parameters of the lowest cost at one weight of the data, after one pass each.

    One with which no resistance is left, as with a diffusion that alone makes a larger drop than
    was measured, is none of them.

    Parameters
    ----------
    shared : Shared. tries : list of columns.Held.
    factor : weight of the data, of one solution.

    Returns
    -------
    held : columns.Held.

    Raises
    ------
    Refusal : all of them are refused.
    """
    candidates, refused = [], None
    for held in tries:
        try:
            candidates.append(_after_one_pass(shared, held))
        except Refusal as refusal:
            refused = refusal
    if not candidates:
        raise refused
    if len(candidates) == 1:
        return candidates[0]
    costs = [cost_of(shared, held, factor) for held in candidates]
    return candidates[int(np.argmin(costs))]


def lowest(cost, count, *, start=0):
    """Number of the lowest of costs that fall to it and rise from there, as few asked as need be.

    Parameters
    ----------
    cost : function (number) → cost. count : how many there are.
    start : the number to begin at; from there in the direction in which they fall.
    """
    cost, best = cache(cost), start
    step = 1 if start + 1 < count and cost(start + 1) < cost(start) else -1
    while 0 <= best + step < count and cost(best + step) < cost(best):
        best += step
    return best


def _after_one_pass(shared, held):
    # At its own weight of the data: at that of the best a poor candidate runs to its limits.
    held, _ = _approached(shared, held, 1)
    if held.scale_volt is None:
        return held
    solution = _solved(shared, system_about(shared, held), scale_free=False)
    return _with_transfer(held, solution.values)


def cost_of(shared, held, factor):
    """Cost of held parameters at a given weight of the data (see `regression.Solution`).

    Parameters
    ----------
    shared : Shared. held : columns.Held. factor : weight of the data.
    """
    system = system_about(shared, held)
    return cost_at(system, _minimum(shared, system, factor), factor)


STEP = 0.01  # of a logarithm, for central differences
RESOLVED = 1e-12  # smallest eigenvalue of the scaled precision: below it is rounding


def with_time_constants(shared, fit):
    """Covariance and slope with the logarithms of the time constants free as well.

    Where the data do not tell the time constants apart, these have no deviation, and all else is
    as known for given ones.

    Parameters
    ----------
    shared : Shared. fit : Fit, of p linear parameters and m time constants.

    Returns
    -------
    covariance : (p + m, p + m); NaN where a bound holds.
    slope : (p + m,) of half the cost, negative.
    """
    held, system, solution = fit[:3]
    count = len(held.tau_second)
    changes = [_change(shared.data, held, n, solution.values) for n in range(count)]
    weighted = np.column_stack(changes) * system.weight[:, None]
    size = len(solution.vector)
    precision = np.empty((size + count, size + count))
    precision[:size, :size] = solution.factor * system.gram + system.prior
    precision[:size, size:] = solution.factor * system.matrix.T @ weighted
    precision[size:, :size] = precision[:size, size:].T
    precision[size:, size:] = solution.factor * weighted.T @ weighted
    residual = solution.residual_volt * system.weight
    slope = solution.factor * np.append(system.matrix.T @ residual, weighted.T @ residual)
    slope[:size] -= system.prior @ (solution.vector + system.held)
    return _covariance(precision, fit), slope


def _change(data, held, number, values):
    """Derivative of the voltage by the logarithm of one time constant (n,) [V]."""
    sides = []
    for sign in (1, -1):
        tau = list(held.tau_second)
        tau[number] *= np.exp(sign * STEP)
        sides.append(resistance_columns(data, held._replace(tau_second=tuple(tau))))
    up, down = sides
    pairs = [(name, a, b) for (name, a), (_, b) in zip(up, down, strict=True) if a is not b]
    change = sum((a - b) @ values[name] for name, a, b in pairs)
    return change / (2 * STEP)


def refined(shared, fit, bounds):
    """Fit after up to three Newton steps of the time constants, as long as they lower the cost.

    The search ends a few per cent from the optimum, and ran without hysteresis, kinetics and
    diffusion: an error above the stated deviations.

    Parameters
    ----------
    shared, fit : as in `with_time_constants`.
    bounds : (low, high) of time constants [s].

    Returns
    -------
    fit : Fit, as given where no step helps.
    """
    factor = fit.solution.factor
    best = cost_of(shared, fit.held, factor)
    for _ in range(3):
        covariance, slope = with_time_constants(shared, fit)
        size = len(slope) - len(fit.held.tau_second)
        step = np.nan_to_num(covariance[size:]) @ slope  # Newton's, of the logarithms
        std = np.nan_to_num(np.sqrt(np.diag(covariance[size:, size:])))
        tau = np.clip(np.asarray(fit.held.tau_second) * np.exp(np.clip(step, -0.5, 0.5)), *bounds)
        tried = fit.held._replace(tau_second=tuple(np.sort(tau)))
        cost = cost_of(shared, tried, factor)
        if cost >= best:
            break
        fit = settled(shared, tried, passes=3)
        best = cost_of(shared, fit.held, factor)
        if np.all(np.abs(step) <= 0.1 * std):
            break
    return fit


def _covariance(precision, fit):
    """Inverse (p + m, p + m) over all parameters that no bound holds."""
    size, diagonal = len(fit.covariance), np.diag(precision)
    loose = np.append(np.isfinite(np.diag(fit.covariance)), diagonal[size:] > 0)
    rows, scale = np.ix_(loose, loose), np.sqrt(diagonal[loose])
    unit = precision[rows] / np.outer(scale, scale)
    covariance = np.full(precision.shape, np.nan)
    if np.linalg.eigvalsh(unit)[0] > RESOLVED:
        covariance[rows] = np.linalg.inv(unit) / np.outer(scale, scale)
    else:
        covariance[:size, :size] = fit.covariance
    return covariance
