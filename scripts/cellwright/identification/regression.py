"""Linear least squares of an identification: its columns over SoC, priors and solution.

For given time constants, charge constant of the hysteresis and scale of the kinetics, the voltage
is V = U(z') + Σ over knots of (shift, R0, R_j, M) × column, where z' is the counted SoC stretched
by a factor. Each quantity is a course over the same SoC knots, straight between them.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.circuits.circuit import SPHERE_MODES, UNRESOLVED_SECOND
from cellwright.circuits.temperature import table_soc
from cellwright.numerics.lags import lag, lag_by_charge
from cellwright.numerics.linear import hats, solve
from cellwright.numerics.statistics import correlation_factor
from cellwright.refusal import Refusal

SOC_WINDOW = 0.01  # over which the slope of an OCV table is taken
FAST_SECOND = 5.0  # what relaxes faster may be charge transfer, what is slower is diffusion


class Held(NamedTuple):
    """Parameters that are held while the linear ones are solved for.

    tau_second : (m,) time constants of the RC pairs [s].
    charge_ampere_hour : charge constant of the hysteresis [Ah], None without.
    scale_volt : scale of the kinetics [V], None for linear resistance.
    transfer_ohm : (k,) charge-transfer resistance at the knots that the scale acts on [ohm], None
        at first: linear.
    missing, stretch : the OCV table is read at 1 − missing − (1 − SoC)·(1 + stretch): what a full
        charge left out (in the cold it ends early), and by how much the capacity is smaller [1].
    """

    tau_second: tuple
    charge_ampere_hour: float | None = None
    scale_volt: float | None = None
    transfer_ohm: np.ndarray | None = None
    missing: float = 0.0
    stretch: float = 0.0
    diffusion_second: float | None = None


class Data(NamedTuple):
    """Records, OCV table and SoC knots of an identification.

    records : tuple of Record. knots : (k,) SoC, ascending [1]. ocv_soc, ocv_volt : (p,) table.
    hold : hold of the current between samples. most_volt : (k,) largest hysteresis at the knots
    [V], None where no slow test bounds it.
    """

    records: tuple
    knots: np.ndarray
    ocv_soc: np.ndarray
    ocv_volt: np.ndarray
    hold: str
    capacity_ampere_hour: float
    most_volt: np.ndarray | None = None


class Columns(NamedTuple):
    """A linear problem over the used rows.

    target_volt : (n,) V − U(z'). shift : (n, k). scale : (n, 2) change of U by what is missing at
    full, and by the stretch [V].
    resistances : list of (name, (n, k)), each not negative. slope_volt : (n,) of U over SoC [V].
    held_scale : (2,) the SoC's scale about which all this holds [1]. most_volt : as in Data.
    """

    target_volt: np.ndarray
    shift: np.ndarray
    scale: np.ndarray
    resistances: list
    slope_volt: np.ndarray
    held_scale: np.ndarray
    most_volt: np.ndarray | None = None


def on_table(soc, held):
    """SoC of the OCV table that belongs to a counted SoC."""
    return table_soc(soc, held.missing, held.stretch)


def ocv_of(data, soc_of_table):
    """OCV at a SoC of the table (n,), on its first and last slope outside the table [V].

    What is missing at full would else hit the table's flat end.
    """
    table, volt = data.ocv_soc, data.ocv_volt
    low = (volt[1] - volt[0]) / (table[1] - table[0])
    high = (volt[-1] - volt[-2]) / (table[-1] - table[-2])
    beyond = (
        np.minimum(soc_of_table - table[0], 0.0) * low
        + np.maximum(soc_of_table - table[-1], 0.0) * high
    )
    return np.interp(soc_of_table, table, volt) + beyond


def slope_of(data, soc_of_table):
    """Slope of `ocv_of`, as the difference over a window [V]."""
    half = SOC_WINDOW / 2
    return (ocv_of(data, soc_of_table + half) - ocv_of(data, soc_of_table - half)) / SOC_WINDOW


def columns_of(data, held):
    """All columns of the linear problem for what is held.

    Parameters
    ----------
    data : Data.
    held : Held.

    Returns
    -------
    columns : Columns; "r0" first, then one entry a time constant, then "m" with hysteresis. With
        kinetics the ohmic "r0" is followed by "rct", the transfer that no sample resolves.
    """
    parts = [_record_columns(data, record, held) for record in data.records]
    used = [record.used for record in data.records]

    def joined(values):
        return np.concatenate([value[u] for value, u in zip(values, used, strict=True)])

    names = [name for name, _ in parts[0]]
    stacked = [joined([part[i][1] for part in parts]) for i in range(len(names))]
    soc = joined([record.soc for record in data.records])
    volt = joined([record.voltage_volt for record in data.records])
    surface_soc = on_table(soc, held)
    if held.diffusion_second is not None:
        surface_soc = surface_soc + joined(
            [lead(data, record, held.diffusion_second) for record in data.records]
        )
    slope = slope_of(data, surface_soc)
    return Columns(
        volt - ocv_of(data, surface_soc),
        hats(soc, data.knots),
        -slope[:, None] * np.column_stack([np.ones(len(soc)), 1.0 - soc]),
        list(zip(names, stacked, strict=True)),
        slope,
        np.array([held.missing, held.stretch]),
        data.most_volt,
    )


def _record_columns(data, record, held):
    """Columns (name, (n, k)) of each resistance and of the hysteresis over a record."""
    shape = hats(record.soc, data.knots)
    ohmic = shape * (record.current_ampere * record.resistance_factor)[:, None]
    damped = ohmic if held.scale_volt is None else ohmic * damping(record, shape, held)[:, None]
    columns = [("r0", ohmic)]
    step = np.diff(record.test_time_second)
    if held.scale_volt is not None:
        columns.append(("rct", lag(step, UNRESOLVED_SECOND, damped, hold=data.hold)))
    for number, tau in enumerate(held.tau_second, 1):
        drive = damped if tau <= FAST_SECOND else ohmic
        columns.append((f"r{number}", lag(step, tau, drive, hold=data.hold)))
    if held.charge_ampere_hour is not None:
        columns.append(("m", _hysteresis(record, shape, held.charge_ampere_hour, data.hold)))
    return columns


def lead(data, record, diffusion_second):
    """SoC at the particles' surface less the mean SoC (n,) [1].

    In the steady state tau/15 times the rate of change of the SoC (a sphere under constant flux).
    """
    step = np.diff(record.test_time_second)
    gain = diffusion_second / 15.0 / 3600.0 / data.capacity_ampere_hour
    drive = gain * record.current_ampere * record.resistance_factor
    return sum(
        share * lag(step, diffusion_second * constant, drive, hold=data.hold)
        for constant, share in SPHERE_MODES
    )


def damping(record, shape, held):
    """Factor asinh(x)/x, x = r·I/scale, of kinetics relative to their small-current resistance."""
    if held.transfer_ohm is None:
        return np.ones(len(record.soc))
    over = np.abs(shape @ held.transfer_ohm * record.current_ampere * record.resistance_factor)
    x = np.maximum(over / held.scale_volt, 1e-6)
    return np.arcsinh(x) / x


def _hysteresis(record, shape, charge_ampere_hour, hold):
    current = record.current_ampere
    mean = current[:-1] if hold == "zero_order" else (current[:-1] + current[1:]) / 2
    passed = np.abs(mean) * np.diff(record.test_time_second) / 3600.0
    return lag_by_charge(passed, charge_ampere_hour, shape[:-1] * np.sign(mean)[:, None])


SCALES = 2  # numbers of the SoC's scale: what is missing at full, and the stretch


class Noise(NamedTuple):
    """Standard deviations of a row's error, whose variances add.

    floor_volt : at rest [V]. relative : of the overpotential [1]. soc : of the counted SoC [1],
    which counts where the OCV is steep.
    """

    floor_volt: float = 0.003
    relative: float = 0.03
    soc: float = 0.003


class Prior(NamedTuple):
    """Standard deviations of the parameters before the data.

    Without priors a knot without data could take any value, and a fit of a drive's blocks would
    say nothing of the SoC between them. The priors are weak and physical: resistances change
    smoothly with SoC, faster near empty; an OCV table is right to some tens of millivolts; capacity
    is known to a few per cent. They count only where the data say little.

    shift_volt : of the OCV table. shift_walk_volt : of its change over the whole of SoC.
    walk : relative change of a resistance over the whole of SoC [1].
    missing, stretch : of what a full charge leaves out, and of the capacity [1].
    empty : SoC near empty within which things change as much as over all the rest [1].
    """

    shift_volt: float = 0.02
    shift_walk_volt: float = 0.05
    walk: float = 1.0
    missing: float = 0.02
    stretch: float = 0.04
    empty: float = 0.1


class System(NamedTuple):
    """A weighted linear problem: k shifts, a change of the SoC's scale (2), then k columns a name.

    prior : (p, p) precision. held : (p,) what the priors count and the columns do not: the scale
    about which the problem holds, so that the prior is of the scale and not of its last change.
    most : (p,) upper bounds, None without any.
    """

    matrix: np.ndarray
    target: np.ndarray
    weight: np.ndarray
    prior: np.ndarray
    held: np.ndarray
    names: tuple
    knots: np.ndarray
    most: np.ndarray | None = None


class Solution(NamedTuple):
    """Solution of a weighted linear problem.

    values, stds : dict name → (k,), with "shift". scale : (2,) change of the SoC's scale [1].
    vector, covariance : (p,), (p, p) of all parameters, NaN where a bound holds.
    residual_volt : (n,) measured minus modelled. factor : weight of a row's square: one over the
    residuals' variance and correlation. cost : factor·Σ residual² + priors' penalty.
    """

    values: dict
    stds: dict
    scale: np.ndarray
    vector: np.ndarray
    covariance: np.ndarray
    residual_volt: np.ndarray
    factor: float
    cost: float


def system_of(columns, knots, *, noise=None, prior=None):
    """The weighted problem of a set of columns, with the priors' precision.

    Parameters
    ----------
    columns : Columns.
    knots : (k,) SoC [1].
    noise, prior : Noise, Prior; None: the defaults.

    Returns
    -------
    system : System.

    Raises
    ------
    Refusal : fewer rows than parameters at one SoC, or a load that excites nothing.
    """
    noise, prior = noise or Noise(), prior or Prior()
    names = tuple(name for name, _ in columns.resistances)
    if len(columns.target_volt) < 3 * (len(names) + 2):
        raise Refusal(f"{len(columns.target_volt)} rows cannot carry {len(names) + 2} parameters")
    scales = (
        noise.floor_volt,
        noise.relative * columns.target_volt,
        noise.soc * columns.slope_volt,
    )
    weight = 1.0 / np.sqrt(sum(np.square(scale) for scale in scales))
    blocks = [columns.shift, columns.scale, *(c for _, c in columns.resistances)]
    matrix = np.hstack(blocks) * weight[:, None]
    target = columns.target_volt * weight
    sizes = _typical_sizes(columns, matrix, target, len(knots))
    precision = _precision(knots, sizes, prior)
    held = np.zeros(len(precision))
    held[len(knots) : len(knots) + SCALES] = columns.held_scale
    most = _upper_bounds(columns.most_volt, names, len(precision))
    return System(matrix, target, weight, precision, held, names, knots, most)


def _upper_bounds(most_volt, names, size):
    """Upper bounds of all parameters: only the hysteresis, "m", has one, and it comes last."""
    if most_volt is None or "m" not in names:
        return None
    return np.append(np.full(size - len(most_volt), np.inf), most_volt)


def _typical_sizes(columns, matrix, target, knots):
    """Size of each resistance if constant over SoC [ohm], the scale of the smoothness prior."""
    count = len(columns.resistances)
    ends = SCALES + knots + knots * np.arange(count + 1)
    groups = [matrix[:, :knots].sum(axis=1)]
    groups += [matrix[:, a:b].sum(axis=1) for a, b in pairwise(ends)]
    reduced = np.column_stack(groups)
    norm = np.linalg.norm(reduced, axis=0)
    names = [name for name, _ in columns.resistances]
    silent = [name for name, size in zip(names, norm[1:], strict=True) if not size > 0]
    if silent:
        raise Refusal(f"nothing in the data excites {', '.join(silent)}: the current never flows")
    gram = reduced.T @ reduced
    gram += np.diag(1e-6 * np.diag(gram))  # two columns may say the same
    sizes = solve(gram, reduced.T @ target, 1)[1:]
    ohmic = np.array([name != "m" for name in names])
    if not sizes[ohmic].any():
        raise Refusal("no resistance above zero: the voltage moves against the current's sign")
    least = np.where(ohmic, 0.05 * sizes[ohmic].max(), 0.005)
    return np.maximum(sizes, least)


def _precision(knots, sizes, prior):
    """Inverse covariance of all parameters before the data."""
    count = len(knots)
    near_empty = np.diff(np.log(np.maximum(knots, 0.0) + 0.02))  # counting may end below zero
    path = np.diff(knots) + prior.empty * near_empty
    change = np.diff(np.eye(count), axis=0)
    smooth = change.T @ (change / path[:, None])
    size = count + SCALES + count * len(sizes)
    precision = np.zeros((size, size))
    precision[:count, :count] = smooth / prior.shift_walk_volt**2
    precision[:count, :count] += np.eye(count) / prior.shift_volt**2
    precision[count, count] = 1.0 / prior.missing**2
    precision[count + 1, count + 1] = 1.0 / prior.stretch**2
    for number, typical in enumerate(sizes):
        block = slice(count + SCALES + number * count, count + SCALES + (number + 1) * count)
        precision[block, block] = smooth / (prior.walk * typical) ** 2
        precision[block, block] += np.eye(count) / ((10.0 * typical) ** 2 * count)
    return precision


def solved(system, *, factor=None, rounds=2):
    """Solution of a system, weighted by the residuals and their correlation.

    Parameters
    ----------
    system : System.
    factor : weight of the data; None: found here. Costs compare only at one factor.
    rounds : how often it is taken anew where it is found.

    Returns
    -------
    solution : Solution.
    """
    gram, moment = system.matrix.T @ system.matrix, system.matrix.T @ system.target
    signed, weight, pull = len(system.knots) + SCALES, factor or 1.0 / 30.0, pull_of(system)
    for _ in range(rounds if factor is None else 1):
        normal = weight * gram + system.prior
        vector = solve(normal, weight * moment - pull, signed, system.most)
        residual = system.target - system.matrix @ vector
        if factor is None:
            spread = max(np.mean(residual**2), 1e-12) * max(correlation_factor(residual), 1.0)
            weight = 1.0 / spread
    covariance = _covariance(weight * gram + system.prior, vector, signed, system.most)
    total = vector + system.held
    cost = weight * (residual @ residual) + total @ system.prior @ total
    values, stds = named(system, vector), named(system, np.sqrt(np.diag(covariance)))
    volt = residual / system.weight
    return Solution(values, stds, values["scale"], vector, covariance, volt, weight, float(cost))


def pull_of(system):
    """Gradient of the priors at the held scale (p,)."""
    return system.prior @ system.held


def named(system, vector):
    """Parts of a parameter vector, name → (k,).

    Parameters
    ----------
    system : System.
    vector : (p,).
    """
    count = len(system.knots)
    ends = np.cumsum([count, SCALES] + [count] * len(system.names))[:-1]
    return dict(zip(("shift", "scale", *system.names), np.split(vector, ends), strict=True))


def _covariance(precision, vector, signed, most):
    """Covariance of the free parameters; NaN for those at a bound, zero or the largest allowed."""
    free = np.append(np.ones(signed, bool), vector[signed:] > 0)
    free &= vector < (np.inf if most is None else most)
    covariance = np.full(precision.shape, np.nan)
    covariance[np.ix_(free, free)] = np.linalg.inv(precision[np.ix_(free, free)])
    return covariance


def held_out(system, solution, fold):
    """Residuals [V] of rows predicted from the other folds, (n,).

    Parameters
    ----------
    system, solution : System, Solution of all rows.
    fold : (n,) number of the fold of each row, 0, 1, …; −1: never left out.
    """
    gram, moment = system.matrix.T @ system.matrix, system.matrix.T @ system.target
    signed, pull = len(system.knots) + SCALES, pull_of(system)
    residual_volt, factor = solution.residual_volt.copy(), solution.factor
    for number in range(fold.max() + 1):
        fold_rows = fold == number
        matrix, target = system.matrix[fold_rows], system.target[fold_rows]
        rest = factor * (gram - matrix.T @ matrix) + system.prior
        vector = solve(rest, factor * (moment - matrix.T @ target) - pull, signed, system.most)
        residual_volt[fold_rows] = (target - matrix @ vector) / system.weight[fold_rows]
    return residual_volt
