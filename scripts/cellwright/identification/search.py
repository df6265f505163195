"""Search of the non-linear parameters: SoC scale, kinetics, time constants."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.circuit import UNRESOLVED_SECOND
from cellwright.identification.regression import (
    FAST_SECOND,
    SCALES,
    columns_of,
    named,
    solved,
    system_of,
)
from cellwright.numerics.statistics import rms

WIDEST = 0.1  # change of the SoC's scale that is believed
SETTLED = 2e-4  # change of the SoC's scale that is small enough
STEADY = 0.003  # change of the charge-transfer resistance that is small enough, of its largest


class Fit(NamedTuple):
    """Held parameters, the regression.System about them, and its Solution."""

    held: object
    system: object
    solution: object


def settled(data, held, *, passes=10):
    """Fit after the SoC's scale and the kinetics have converged.

    Parameters
    ----------
    data : regression.Data.
    held : regression.Held.
    passes : largest number of solutions, each about the scale and kinetics of the last.
    """
    if held.scale_volt is not None and held.transfer_ohm is None:
        linear = solved(system_of(columns_of(data, held._replace(scale_volt=None)), data.knots))
        held = held._replace(transfer_ohm=_transfer(held, linear.values, half=True))
    last, share = 0.0, 1.0
    for _ in range(passes - 1):
        solution = solved(system_of(columns_of(data, held), data.knots))
        scale = np.clip(np.array([held.missing, held.stretch]) + solution.scale, -WIDEST, WIDEST)
        still = np.abs(solution.scale).max() < SETTLED
        held = held._replace(missing=float(scale[0]), stretch=float(scale[1]))
        if held.scale_volt is not None:
            change = _transfer(held, solution.values) - held.transfer_ohm
            # More resistance damps itself more: in whole steps the two may take turns for ever.
            share = share / 2 if np.sum(change * last) < 0 else share
            held = held._replace(transfer_ohm=held.transfer_ohm + share * change)
            still = still and np.abs(change).max() < STEADY * held.transfer_ohm.max()
            last = change
        if still:
            break
    system = system_of(columns_of(data, held), data.knots)
    solution = at_scale(system, solved(system))
    if held.scale_volt is not None:
        held = held._replace(transfer_ohm=_transfer(held, solution.values))
    return Fit(held, system, solution)


def at_scale(system, solution):
    """Solution at the held SoC scale, with the deviations of a free scale.

    A last change that is not made would leave values that belong to another scale.

    Parameters
    ----------
    system, solution : regression.System, its Solution with the scale's change.
    """
    count = len(system.knots)
    matrix = system.matrix.copy()
    matrix[:, count : count + SCALES] = 0.0
    held = solved(system._replace(matrix=matrix))
    return held._replace(stds=solution.stds, covariance=solution.covariance)


def _transfer(held, values, *, half=False):
    """Charge-transfer resistance at the knots (k,) [ohm]; at first half of the ohmic one."""
    fast = [values[f"r{n}"] for n, tau in enumerate(held.tau_second, 1) if tau <= FAST_SECOND]
    return sum(fast, 0.5 * values["r0"] if half else values["rct"])


def cheapest(data, tries, factor):
    """Held parameters of the lowest cost at one weight of the data, after two passes each.

    Parameters
    ----------
    data : regression.Data. tries : list of regression.Held.
    factor : weight of the data, of one solution.

    Returns
    -------
    held : regression.Held.
    """
    candidates = [settled(data, held, passes=2).held for held in tries]
    costs = [cost_of(data, held, factor) for held in candidates]
    return candidates[int(np.argmin(costs))]


def cost_of(data, held, factor):
    """Cost of held parameters at a given weight of the data (see `regression.Solution`).

    Parameters
    ----------
    data : regression.Data. held : regression.Held. factor : weight of the data.
    """
    return solved(system_of(columns_of(data, held), data.knots), factor=factor).cost


STEP = 0.01  # of a logarithm, for central differences
RESOLVED = 1e-12  # smallest eigenvalue of the scaled precision: below it is rounding


class Free(NamedTuple):
    """The linear problem with time constants as further parameters, (p + m) in all.

    precision : (p + m, p + m) inverse covariance. slope : (p + m,) of half the cost, negative.
    """

    precision: np.ndarray
    slope: np.ndarray


def with_time_constants(data, fit):
    """Precision and slope with the logarithms of the time constants free as well.

    Parameters
    ----------
    data : regression.Data. fit : Fit.

    Returns
    -------
    free : Free.
    """
    held, system, solution = fit
    changes = [_change(data, held, n, solution.values) for n in range(len(held.tau_second))]
    matrix = np.column_stack([system.matrix, *(change * system.weight for change in changes)])
    size = len(solution.vector)
    precision = solution.factor * matrix.T @ matrix
    precision[:size, :size] += system.prior
    slope = solution.factor * matrix.T @ (solution.residual_volt * system.weight)
    slope[:size] -= system.prior @ (solution.vector + system.held)
    return Free(precision, slope)


def _change(data, held, number, values):
    """Derivative of the voltage by the logarithm of one time constant (n,) [V]."""
    sides = []
    for sign in (1, -1):
        tau = list(held.tau_second)
        tau[number] *= np.exp(sign * STEP)
        sides.append(columns_of(data, held._replace(tau_second=tuple(tau))).resistances)
    up, down = sides
    change = sum((a - b) @ values[name] for (name, a), (_, b) in zip(up, down, strict=True))
    return change / (2 * STEP)


def refined(data, fit, bounds, *, steps=3, enough=0.1):
    """Fit after Newton steps of the time constants, as long as they lower the cost.

    The search ends a few per cent from the optimum, and ran without hysteresis, kinetics and
    diffusion: an error above the stated deviations.

    Parameters
    ----------
    data, fit : as in `with_time_constants`.
    bounds : (low, high) of time constants [s].
    steps : how many at most.
    enough : step that is small enough, over the standard deviation [1].

    Returns
    -------
    fit : Fit, as given where no step helps.
    """
    factor = fit.solution.factor
    best = cost_of(data, fit.held, factor)
    for _ in range(steps):
        step, std = _step(with_time_constants(data, fit), fit.solution)
        tau = np.clip(np.asarray(fit.held.tau_second) * np.exp(np.clip(step, -0.5, 0.5)), *bounds)
        tried = fit.held._replace(tau_second=tuple(np.sort(tau)))
        cost = cost_of(data, tried, factor)
        if cost >= best:
            break
        fit = settled(data, tried, passes=3)
        best = cost_of(data, fit.held, factor)
        if np.all(np.abs(step) <= enough * std):
            break
    return fit


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
    rows, scale = np.ix_(loose, loose), np.sqrt(diagonal[loose])
    unit = free.precision[rows] / np.outer(scale, scale)
    covariance = np.full(free.precision.shape, np.nan)
    if np.linalg.eigvalsh(unit)[0] > RESOLVED:
        covariance[rows] = np.linalg.inv(unit) / np.outer(scale, scale)
    else:
        covariance[:size, :size] = solution.covariance
    return covariance


def _step(free, solution):
    """Newton step of the logarithms of the time constants, and their standard deviations."""
    covariance = covariance_of(free, solution)[len(solution.vector) :]
    std = np.sqrt(np.diag(covariance[:, len(solution.vector) :]))
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
    at_bound : names. fit_rmse_volt, samples : of the rows used.
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


def condition_of(data, member, fit, bounds):
    """Condition of a solution, with deviations of the time constants where these were searched.

    Parameters
    ----------
    data : regression.Data. member : circuit.Member. fit : Fit.
    bounds : (low, high) of searched time constants [s]; None where they are a fixed series.

    Returns
    -------
    condition : Condition.
    """
    held, system, solution = fit
    values, stds, tau_stds = solution.values, solution.stds, np.full(len(held.tau_second), np.nan)
    at_bound = []
    if bounds is not None and held.tau_second:
        stds, tau_stds = _with_time_constants(data, fit)
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
    )


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


def _with_time_constants(data, fit):
    """Standard deviations with the time constants free: of the linear parameters, of tau [s]."""
    std = np.sqrt(np.diag(covariance_of(with_time_constants(data, fit), fit.solution)))
    size = len(fit.solution.vector)
    return named(fit.system, std[:size]), std[size:] * np.asarray(fit.held.tau_second)
