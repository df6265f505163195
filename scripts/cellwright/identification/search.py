"""Search of the non-linear parameters: SoC scale, kinetics, time constants."""

from functools import cache
from typing import NamedTuple

import numpy as np

from cellwright.circuits.circuit import UNRESOLVED_SECOND
from cellwright.identification.columns import (
    FAST_SECOND,
    Base,
    base_of,
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
from cellwright.numerics.statistics import rms
from cellwright.refusal import Refusal

WIDEST = 0.1  # change of the SoC's scale that is believed
SETTLED = 2e-4  # change of the SoC's scale that is small enough
STEADY = 0.003  # change of the charge-transfer resistance that is small enough, of its largest


class Shared(NamedTuple):
    """What fits of several members to the same data have in common, filled while they are made.

    base : columns.Base. searched : dict of searches that are finished, such as the time constants
    of two pairs. expected : dict of weighting → dict name → (k,) bool, which values of the last
    solution were above zero: the next one's are nearly the same. system : dict of the last Held
    and its system.
    """

    base: Base
    searched: dict
    expected: dict
    system: dict


def shared_of(data, *, like=None):
    """Shared of a set of data, with nothing searched yet.

    Parameters
    ----------
    data : columns.Data.
    like : Shared of data that differ in the OCV table or the bound of the hysteresis alone, on
        which the columns of resistances do not depend: they are taken over.
    """
    base = base_of(data) if like is None else like.base._replace(data=data)
    return Shared(base, {}, {}, {})


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

    The solution is that at the held SoC scale, the covariance that with a free one.
    """

    held: object
    system: object
    solution: object
    covariance: np.ndarray


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
        still = np.abs(solution.scale).max() < SETTLED or more == 1
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
        columns = columns_of(shared.base, held)
        shared.system[key] = system_of(columns, shared.base.data.knots)
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
        scale = np.array([held.missing, held.stretch]) + values["scale"]
        scale = np.clip(scale, -WIDEST, WIDEST)
        still = np.abs(values["scale"]).max() < SETTLED
        held = held._replace(missing=float(scale[0]), stretch=float(scale[1]))
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


class Free(NamedTuple):
    """The linear problem with time constants as further parameters, (p + m) in all.

    precision : (p + m, p + m) inverse covariance. slope : (p + m,) of half the cost, negative.
    """

    precision: np.ndarray
    slope: np.ndarray


def with_time_constants(shared, fit):
    """Precision and slope with the logarithms of the time constants free as well.

    Parameters
    ----------
    shared : Shared. fit : Fit.

    Returns
    -------
    free : Free.
    """
    held, system, solution = fit[:3]
    count = len(held.tau_second)
    changes = [_change(shared.base, held, n, solution.values) for n in range(count)]
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
    return Free(precision, slope)


def _change(base, held, number, values):
    """Derivative of the voltage by the logarithm of one time constant (n,) [V]."""
    sides = []
    for sign in (1, -1):
        tau = list(held.tau_second)
        tau[number] *= np.exp(sign * STEP)
        sides.append(resistance_columns(base, held._replace(tau_second=tuple(tau))))
    up, down = sides
    pairs = [(name, a, b) for (name, a), (_, b) in zip(up, down, strict=True) if a is not b]
    change = sum((a - b) @ values[name] for name, a, b in pairs)
    return change / (2 * STEP)


def refined(shared, fit, bounds, *, steps=3, enough=0.1):
    """Fit after Newton steps of the time constants, as long as they lower the cost.

    The search ends a few per cent from the optimum, and ran without hysteresis, kinetics and
    diffusion: an error above the stated deviations.

    Parameters
    ----------
    shared, fit : as in `with_time_constants`.
    bounds : (low, high) of time constants [s].
    steps : how many at most.
    enough : step that is small enough, over the standard deviation [1].

    Returns
    -------
    fit : Fit, as given where no step helps.
    """
    factor = fit.solution.factor
    best = cost_of(shared, fit.held, factor)
    for _ in range(steps):
        step, std = _step(with_time_constants(shared, fit), fit)
        tau = np.clip(np.asarray(fit.held.tau_second) * np.exp(np.clip(step, -0.5, 0.5)), *bounds)
        tried = fit.held._replace(tau_second=tuple(np.sort(tau)))
        cost = cost_of(shared, tried, factor)
        if cost >= best:
            break
        fit = settled(shared, tried, passes=3)
        best = cost_of(shared, fit.held, factor)
        if np.all(np.abs(step) <= enough * std):
            break
    return fit


def whole_covariance(free, fit):
    """Covariance with the time constants free, (p + m, p + m); NaN where a bound holds.

    Where the data do not tell the time constants apart, these have none, and all else is as known
    for given ones.

    Parameters
    ----------
    free : Free. fit : Fit.
    """
    size, diagonal = len(fit.covariance), np.diag(free.precision)
    loose = np.append(np.isfinite(np.diag(fit.covariance)), diagonal[size:] > 0)
    rows, scale = np.ix_(loose, loose), np.sqrt(diagonal[loose])
    unit = free.precision[rows] / np.outer(scale, scale)
    covariance = np.full(free.precision.shape, np.nan)
    if np.linalg.eigvalsh(unit)[0] > RESOLVED:
        covariance[rows] = np.linalg.inv(unit) / np.outer(scale, scale)
    else:
        covariance[:size, :size] = fit.covariance
    return covariance


def _step(free, fit):
    """Newton step of the logarithms of the time constants, and their standard deviations."""
    size = len(fit.covariance)
    covariance = whole_covariance(free, fit)[size:]
    std = np.sqrt(np.diag(covariance[:, size:]))
    return np.nan_to_num(covariance) @ free.slope, np.nan_to_num(std)


LINEAR_VOLT = 1e3  # a scale so wide that kinetics are linear
ABSENT_SECOND = 2e-4  # a diffusion time that stands for none
ABSENT_SHARE = 0.01  # of the capacity: charge constant of a hysteresis that was not found
AT_BOUND = 0.02  # of the logarithm of a time constant: as near as the search goes


class Element(NamedTuple):
    """A branch of a fitted circuit: its kind, and dicts name → (k,) of values and deviations."""

    kind: str
    values: dict
    stds: dict


class Condition(NamedTuple):
    """A fitted circuit over SoC at one temperature; a deviation is NaN at a bound or if held.

    soc : (k,). r0_ohm, r0_std_ohm, ocv_shift_volt : (k,). branches : tuple of Element.
    missing, stretch : the SoC at which the OCV table is read, see `regression.Held`.
    at_bound : names. fit_rmse_volt, samples : of the rows used. steady_std_ohm : (k,) of the sum of
    all resistances, which a steady load tells though it tells none of them apart.
    """

    soc: np.ndarray
    r0_ohm: np.ndarray
    r0_std_ohm: np.ndarray
    branches: tuple
    ocv_shift_volt: np.ndarray
    missing: float
    stretch: float
    at_bound: tuple
    fit_rmse_volt: float
    samples: int
    steady_std_ohm: np.ndarray


def condition_of(shared, member, fit, bounds):
    """Condition of a solution, with deviations of the time constants where these were searched.

    Parameters
    ----------
    shared : Shared. member : circuit.Member. fit : Fit.
    bounds : (low, high) of searched time constants [s]; None where they are a fixed series.

    Returns
    -------
    condition : Condition.
    """
    data, (held, system, solution, covariance) = shared.base.data, fit
    stds = named(system, np.sqrt(np.diag(covariance)))
    values, tau_stds, at_bound = solution.values, np.full(len(held.tau_second), np.nan), []
    if bounds is not None and held.tau_second:
        stds, tau_stds = _with_time_constants(shared, fit)
        log = np.log(held.tau_second)
        edge = (np.abs(log - np.log(bounds[0])) < AT_BOUND) | (
            np.abs(log - np.log(bounds[1])) < AT_BOUND
        )
        at_bound = [f"tau{n}" for n, is_at_bound in enumerate(edge, 1) if is_at_bound]
        tau_stds = np.where(edge, np.nan, tau_stds)
    bounded = [
        f"{name.upper()} at SoC {soc:.3f}"
        for name in system.names
        for soc, value in zip(data.knots, values[name], strict=True)
        if value == 0
    ]
    if held.charge_ampere_hour is not None and data.most_volt is not None:
        at_most = zip(data.knots, values["m"] >= data.most_volt, strict=True)
        bounded += [
            f"M at SoC {soc:.3f}, the most that the slow test allows"
            for soc, is_at_bound in at_most
            if is_at_bound
        ]
    return Condition(
        data.knots,
        values["r0"],
        stds["r0"],
        _elements(data, member, held, values, stds, tau_stds),
        values["shift"],
        held.missing,
        held.stretch,
        (*at_bound, *bounded),
        rms(solution.residual_volt),
        len(solution.residual_volt),
        _steady_std(system, covariance),
    )


def _steady_std(system, covariance):
    """Standard deviation of the sum of all resistances at each knot (k,) [ohm].

    One at its bound is no part of it; NaN where all are.
    """
    places = named(system, np.arange(len(covariance)))
    of_knot = np.array([places[name] for name in system.names if name != "m"]).T
    parts = [covariance[np.ix_(rows, rows)] for rows in of_knot]
    return np.array([np.sqrt(np.nansum(p)) if np.isfinite(p).any() else np.nan for p in parts])


def _elements(data, member, held, values, stds, tau_stds):
    """Branches of a member, the same at every temperature; one that was not fitted is near zero."""
    ones, elements = np.ones(len(data.knots)), []
    taus = zip(held.tau_second, tau_stds, strict=True)
    pairs = [(f"r{n}", tau, std) for n, (tau, std) in enumerate(taus, 1)]
    if member.kinetic:
        pairs.insert(0, ("rct", UNRESOLVED_SECOND, np.nan))
    for name, tau, tau_std in pairs:
        values_of = {"r_ohm": values.get(name, 0.0 * ones), "tau_second": tau * ones}
        std = {"r_ohm": stds.get(name, np.nan * ones), "tau_second": tau_std * ones}
        kinetic = member.kinetic and tau <= FAST_SECOND
        if kinetic:
            values_of["scale_volt"] = (held.scale_volt or LINEAR_VOLT) * ones
            std["scale_volt"] = np.nan * ones
        elements.append(Element("kinetic" if kinetic else "RC", values_of, std))
    if member.diffusion:
        second = held.diffusion_second or ABSENT_SECOND
        gain = second / 15.0 / 3600.0 / data.capacity_ampere_hour
        values_of = {"soc_per_ampere": gain * ones, "tau_second": second * ones}
        elements.append(Element("diffusion", values_of, dict.fromkeys(values_of, np.nan * ones)))
    if member.hysteresis:
        charge = held.charge_ampere_hour or ABSENT_SHARE * data.capacity_ampere_hour
        values_of = {"m_volt": values.get("m", 0.0 * ones), "charge_ampere_hour": charge * ones}
        std = {"m_volt": stds.get("m", np.nan * ones), "charge_ampere_hour": np.nan * ones}
        elements.append(Element("hysteresis", values_of, std))
    return tuple(elements)


def _with_time_constants(shared, fit):
    """Standard deviations with the time constants free: of the linear parameters, of tau [s]."""
    std = np.sqrt(np.diag(whole_covariance(with_time_constants(shared, fit), fit)))
    size = len(fit.solution.vector)
    return named(fit.system, std[:size]), std[size:] * np.asarray(fit.held.tau_second)
