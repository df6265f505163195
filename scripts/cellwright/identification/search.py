"""What is searched beside the linear part: SoC scale, kinetics, time constants."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.circuit import UNRESOLVED_SECOND
from cellwright.identification.columns import FAST_SECOND, columns_of
from cellwright.identification.regression import SCALES, named, solved, system_of
from cellwright.numerics.statistics import rms

WIDEST = 0.1  # change of the SoC's scale that is believed
SETTLED = 2e-4  # change of the SoC's scale that is small enough
STEADY = 0.003  # change of the charge-transfer resistance that is small enough, of its largest


def settled(data, held, *, passes=10):
    """Let the SoC's scale and the kinetics settle: (held, system, solution).

    Parameters
    ----------
    data : design.Data.
    held : design.Held.
    passes : how often at most the problem is solved about what was found before.
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
            way = _transfer(held, solution.values) - held.transfer_ohm
            # More resistance damps itself more: in whole steps the two may take turns for ever.
            share = share / 2 if np.sum(way * last) < 0 else share
            held = held._replace(transfer_ohm=held.transfer_ohm + share * way)
            still = still and np.abs(way).max() < STEADY * held.transfer_ohm.max()
            last = way
        if still:
            break
    system = system_of(columns_of(data, held), data.knots)
    solution = at_scale(system, solved(system))
    if held.scale_volt is not None:
        held = held._replace(transfer_ohm=_transfer(held, solution.values))
    return held, system, solution


def at_scale(system, solution):
    """What belongs to the scale as it is held, with the deviations of a scale that is free.

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
    """Charge-transfer resistance at the knots; before it was told apart, half of the ohmic one."""
    fast = [values[f"r{n}"] for n, tau in enumerate(held.tau_second, 1) if tau <= FAST_SECOND]
    return sum(fast, 0.5 * values["r0"] if half else values["rct"])


def cheapest(data, tries, factor):
    """What costs least, all measured by one noise, after two passes each.

    Parameters
    ----------
    data : design.Data. tries : list of design.Held. factor : weight of the data, of one solution.

    Returns
    -------
    held : design.Held.
    """
    near = [settled(data, held, passes=2)[0] for held in tries]
    costs = [cost_of(data, held, factor) for held in near]
    return near[int(np.argmin(costs))]


def cost_of(data, held, factor):
    """Cost of what is held, at a given weight of the data (see `regression.Solution`).

    Parameters
    ----------
    data : design.Data. held : design.Held. factor : weight of the data.
    """
    return solved(system_of(columns_of(data, held), data.knots), factor=factor).cost


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
    missing, stretch : the SoC at which the OCV table is read, see `design.Held`.
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


def condition_of(data, member, held, system, solution, bounds):
    """Name the pieces, with the deviations of the time constants where these were searched.

    Parameters
    ----------
    data : design.Data. member : members.Member. held : design.Held.
    system, solution : regression.System, Solution of what is held.
    bounds : (low, high) of searched time constants [s]; None where they are a fixed series.

    Returns
    -------
    condition : Condition.
    """
    values, stds, tau_stds = solution.values, solution.stds, np.full(len(held.tau_second), np.nan)
    at_bound = []
    if bounds is not None and held.tau_second:
        stds, tau_stds = _with_time_constants(data, held, system, solution)
        log = np.log(held.tau_second)
        edge = (np.abs(log - np.log(bounds[0])) < AT_BOUND) | (
            np.abs(log - np.log(bounds[1])) < AT_BOUND
        )
        at_bound = [f"tau{n}" for n, at in enumerate(edge, 1) if at]
        tau_stds = np.where(edge, np.nan, tau_stds)
    zero = [
        f"{name.upper()} at SoC {soc:.3f}"
        for name in system.names
        for soc, value in zip(data.knots, values[name], strict=True)
        if value == 0
    ]
    if held.charge_ampere_hour is not None and data.most_volt is not None:
        full = zip(data.knots, values["m"] >= data.most_volt, strict=True)
        zero += [
            f"M at SoC {soc:.3f}, the most that the slow test allows" for soc, at in full if at
        ]
    return Condition(
        data.knots,
        values["r0"],
        stds["r0"],
        _elements(data, member, held, values, stds, tau_stds),
        values["shift"],
        held.missing,
        held.stretch,
        (*at_bound, *zero),
        rms(solution.residual_volt),
        len(solution.residual_volt),
    )


def _elements(data, member, held, values, stds, tau_stds):
    """Branches of a member, the same at every temperature: what was not found there is nothing."""
    same, found = np.ones(len(data.knots)), []
    taus = zip(held.tau_second, tau_stds, strict=True)
    pairs = [(f"r{n}", tau, std) for n, (tau, std) in enumerate(taus, 1)]
    if member.kinetic:
        pairs.insert(0, ("rct", UNRESOLVED_SECOND, np.nan))
    for name, tau, tau_std in pairs:
        what = {"r_ohm": values.get(name, 0.0 * same), "tau_second": tau * same}
        std = {"r_ohm": stds.get(name, np.nan * same), "tau_second": tau_std * same}
        kinetic = member.kinetic and tau <= FAST_SECOND
        if kinetic:
            what["scale_volt"] = (held.scale_volt or LINEAR_VOLT) * same
            std["scale_volt"] = np.nan * same
        found.append(Element("kinetic" if kinetic else "RC", what, std))
    if member.diffusion:
        second = held.diffusion_second or ABSENT_SECOND
        gain = second / 15.0 / 3600.0 / data.capacity_ampere_hour
        what = {"soc_per_ampere": gain * same, "tau_second": second * same}
        found.append(Element("diffusion", what, dict.fromkeys(what, np.nan * same)))
    if member.hysteresis:
        charge = held.charge_ampere_hour or ABSENT_SHARE * data.capacity_ampere_hour
        what = {"m_volt": values.get("m", 0.0 * same), "charge_ampere_hour": charge * same}
        std = {"m_volt": stds.get("m", np.nan * same), "charge_ampere_hour": np.nan * same}
        found.append(Element("hysteresis", what, std))
    return tuple(found)


def _with_time_constants(data, held, system, solution):
    """Deviations with the time constants free as well."""
    free = with_time_constants(data, held, system, solution)
    std = np.sqrt(np.diag(covariance_of(free, solution)))
    size = len(solution.vector)
    return named(system, std[:size]), std[size:] * np.asarray(held.tau_second)
