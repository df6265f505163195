"""What a search in a group is about, and the fits it is made of.

is not healthy. Gauss–Newton steps, each the exact minimum of its quadratic within the bounds.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects.groups.model import (
    Shared,
    Spread,
    group_coupling,
    group_fields,
    group_frees,
    group_names,
    group_run,
)
from cellwright.effects.judge import rms
from cellwright.numerics import noise
from cellwright.numerics.least_squares import Problem, derivatives

STEPS, SETTLE_PASSES, HALVES = 4, 5, 5
WORTH = 1e-6
SETTLED = 1.0  # a fall of the cost below this ends the walk


class Chart(NamedTuple):
    """The lie of the land: white (m, k) whitened derivatives, precision (k, k) with priors."""

    columns: np.ndarray | None
    white: np.ndarray
    precision: np.ndarray


class Settled(NamedTuple):
    """Most likely values within bounds.

    values : dict. prediction : (m,). cost : chi-square with priors. chart : Chart.
    names : of the free parameters. at_bound : of those on a bound.
    """

    values: dict
    prediction: np.ndarray
    cost: float
    chart: Chart
    names: tuple
    at_bound: tuple


def priors(problem):
    """Prior precision (k, k) and its product with the prior means (k,)."""
    weight = np.array([f.std**-2.0 for f in problem.free])
    prior = np.diag(weight)
    if problem.coupling is not None:
        prior = prior + problem.coupling
    return prior, weight * np.array([f.prior for f in problem.free])


def within(precision, moment, lower, upper, start):
    """Minimum of x'Px/2 − m'x between bounds, by the primal active-set method.

    Parameters
    ----------
    precision : (k, k) positive definite P. moment : (k,) m. lower, upper, start : (k,).

    Returns
    -------
    x : (k,).

    Source: J. Nocedal, S. Wright, Numerical Optimization, 2nd ed., 2006, algorithm 16.3.
    """
    x = np.clip(start, lower, upper)
    held = (x <= lower) | (x >= upper)
    for _ in range(SETTLE_PASSES * len(x)):
        slope = precision @ x - moment
        free = np.flatnonzero(~held)
        way = np.zeros(len(x))
        way[free] = -np.linalg.solve(precision[np.ix_(free, free)], slope[free])
        share, stop = _blocked(x, way, lower, upper)
        x = x + share * way
        if stop is not None:
            x[stop], held[stop] = (upper if way[stop] > 0 else lower)[stop], True
            continue
        gain = _gains(precision, precision @ x - moment, x, held, lower, upper)
        if gain.max(initial=0.0) < WORTH:
            return x
        held[int(np.argmax(gain))] = False
    return x


def _blocked(x, way, lower, upper):
    """Share of the way to the first bound, and whose it is; (1, None) where none is met."""
    room = np.where(way > 0, upper - x, lower - x)
    shares = np.divide(room, way, out=np.full(len(x), np.inf), where=way != 0)
    first = int(np.argmin(shares))
    return (float(shares[first]), first) if shares[first] < 1.0 else (1.0, None)


def _gains(precision, slope, x, held, lower, upper):
    """Fall of the cost that letting go of each held parameter promises."""
    inward = ((x <= lower) & (slope < 0)) | ((x >= upper) & (slope > 0))
    return np.where(held & inward & (upper > lower), slope**2 / np.diag(precision), 0.0)


def surveyed(problem, values, prediction):
    """Chart of a problem at a place, whose prediction (m,) is known."""
    return whitened(problem, derivatives(problem, values, prediction))


def whitened(problem, columns):
    """Chart from derivatives (m, k) that are known, by the noise of the problem."""
    white = problem.whiten(columns)
    return Chart(columns, white, white.T @ white + priors(problem)[0])


def beside(chart, own):
    """Chart with one more parameter without a prior, of whitened derivative own (m,)."""
    mixed = chart.white.T @ own
    precision = np.block([[chart.precision, mixed[:, None]], [mixed[None], own @ own]])
    return Chart(None, np.column_stack([chart.white, own]), precision)


def settle(problem, values, *, chart=None, columns=None, renew=None, steps=STEPS):
    """Walk to the most likely values within the bounds.

    Parameters
    ----------
    problem : problem.Problem. values : dict, start.
    chart : Chart to walk by, or None: surveyed at every step.
    columns : (m, k) derivatives at the start, where they are known.
    renew : name of the last parameter, where its derivative is made anew at each further step.
    steps : at most so many.

    Returns
    -------
    settled : Settled.
    """
    known = priors(problem)
    limits = np.array([f.lower for f in problem.free]), np.array([f.upper for f in problem.free])
    here, by = _judged(problem, values, *known), chart
    for step in range(steps):
        if chart is None:
            known_here = columns is not None and step == 0
            by = whitened(problem, columns) if known_here else surveyed(problem, *here[:2])
        elif renew and step:
            fresh = derivatives(problem, here[0], here[1], (renew,))
            by = beside(_but_last(by), problem.whiten(fresh)[:, 0])
        new = _stepped(problem, here, by, known, limits)
        fell, here = here[3] - new[3], new
        if fell < SETTLED:
            break
    at = np.array([here[0][f.name] for f in problem.free])
    on = ((at <= limits[0]) | (at >= limits[1])) & (limits[1] > limits[0])
    bound = tuple(f.name for f, held in zip(problem.free, on, strict=True) if held)
    names = tuple(f.name for f in problem.free)
    return Settled(here[0], here[1], here[3], by, names, bound)


def _but_last(chart):
    return Chart(None, chart.white[:, :-1], chart.precision[:-1, :-1])


def _judged(problem, values, prior, pull):
    """Values, prediction, whitened residual, cost."""
    prediction = problem.predict(values)
    white = problem.whiten(problem.measured - prediction)
    at = np.array([values[f.name] for f in problem.free])
    return values, prediction, white, float(white @ white + at @ prior @ at - 2 * pull @ at)


def _stepped(problem, here, chart, known, limits):
    prior, pull = known
    names = [f.name for f in problem.free]
    at = np.array([here[0][name] for name in names])
    moment = chart.white.T @ here[2] + pull + (chart.precision - prior) @ at
    aim = within(chart.precision, moment, *limits, at)
    share = 1.0
    for _ in range(HALVES):
        moved = here[0] | dict(zip(names, (at + share * (aim - at)).tolist(), strict=True))
        new = _judged(problem, moved, prior, pull)
        if np.isfinite(new[3]) and new[3] <= here[3]:
            return new
        share /= 3
    return here


LOADED_C_RATE = 0.01
READ_VOLT = 2e-3
PASSES = 2
SOC_APART = 0.005
SLOW_SECOND = (30.0, 100.0, 300.0)


class GroupGates(NamedTuple):
    """When an effect of a branch counts; meanings as those of a cell's gates.

    material_volt : fall of the gap of the branch currents on validation records, times their
    cells' ohmic resistance, below which nobody would act on it [V]. adequate_volt : such a gap
    that may be left [V]. most_slow_volt : largest slow noise of a branch current, times its cell's
    ohmic resistance [V]. shared_slow_volt : slow error of the model's voltage that all branches
    share, and that must not move their currents [V].
    """

    refits: int = 6
    bic: float = 10.0
    validation_chi_square: float = 25.0
    validation_fall: float = 0.03
    material_volt: float = 0.1e-3
    nothing_ratio: float = 1.15
    adequate_ratio: float = 1.3
    adequate_volt: float = 0.5e-3
    adequate_closed: float = 0.85
    partial_closed: float = 0.5
    tie_absolute: float = 6.0
    tie_relative: float = 0.003
    rounds: int = 3
    most_slow_volt: float = 0.3e-3
    shared_slow_volt: float = 2e-3


class GroupCase(NamedTuple):
    """cells : tuple of Branch. fit, validation : GroupStack. fit_soc, validation_soc : (f, b)
    stated SoC at the start of each record."""

    cells: tuple
    fit: object
    validation: object
    fit_soc: np.ndarray
    validation_soc: np.ndarray
    spread: Spread = Spread()
    shared: Shared = Shared()
    gates: GroupGates = GroupGates()

    @property
    def sensors(self):
        """Whether all records have branch currents."""
        logged = (self.fit.branch_current_ampere, self.validation.branch_current_ampere)
        return all(one is not None for one in logged)


class Filters(NamedTuple):
    """Whitening of the channels of a stack, one after the other: voltage, then branch currents."""

    channels: tuple

    def apply(self, rows):
        """Whitened copy of rows (m,) or (m, k)."""
        parts = np.split(rows, len(self.channels))
        return np.concatenate([w.apply(one) for w, one in zip(self.channels, parts, strict=True)])


class GroupState(NamedTuple):
    """A model fitted: its effects (tuple of Placed), and how it does on both kinds of records.

    residual, validation : (m,) voltage then branch currents [V, A]. gap_volt, validation_gap_volt :
    of the branch currents times their cells' ohmic resistance (of the voltage, where they were not
    logged), root mean square [V].
    """

    placed: tuple
    solution: object
    values_at_validation: dict
    residual: np.ndarray
    validation: np.ndarray
    gap_volt: float
    validation_gap_volt: float
    validation_chi_square: float


def rows_of(case, stack):
    """What was measured, as one column of rows (m,)."""
    if not case.sensors:
        return stack.voltage_volt
    return np.concatenate([stack.voltage_volt, stack.branch_current_ampere.T.ravel()])


def predicted(case, stack, soc, values, placed):
    """The same rows by the model (m,)."""
    run = group_run(group_fields(case.cells, soc, values, placed), stack)
    if not case.sensors:
        return run.voltage
    return np.concatenate([run.voltage, run.current.T.ravel()])


def problem_of(case, placed, free, filters):
    """The fit of a healthy group and some effects."""
    return Problem(
        lambda values: predicted(case, case.fit, case.fit_soc, values, placed),
        rows_of(case, case.fit),
        filters.apply,
        free,
        group_coupling(free, case.cells, case.spread, case.shared),
    )


def first_free(case):
    """Free parameters of the healthy group, and where they begin."""
    files = len(case.fit.first)
    names = group_names(files, len(case.cells))
    free = group_frees(case.cells, files, case.spread, case.shared, sensors=case.sensors)
    return free, dict.fromkeys(names, 0.0)


def ohms(case):
    """Ohmic resistance of each cell beforehand (b,) [ohm]."""
    return np.array([cell.r_ohm[0] for cell in case.cells])


def gap_volt(case, residual):
    """Size of a residual as a voltage [V], see GroupState."""
    if not case.sensors:
        return rms(residual)
    currents = residual.reshape(1 + len(case.cells), -1)[1:]
    return rms(currents * ohms(case)[:, None])


def floor_volt(case, noises):
    """Size of the noise alone, in the same measure [V]."""
    if not case.sensors:
        return noises[0].volt
    return rms([one.volt * ohm for one, ohm in zip(noises[1:], ohms(case), strict=True)])


def noises_of(case, residual, known=None):
    """Most likely noise of each channel, from the residual of a model that lacks nothing.

    Parameters
    ----------
    case : GroupCase. residual : (m,) [V, A]. known : noises found with fewer effects, beyond which
        it does not grow, or None.
    """
    channels = np.split(residual, 1 + len(case.cells) if case.sensors else 1)
    shared = case.gates.shared_slow_volt
    most = [shared, *(case.gates.most_slow_volt / ohms(case))]
    if known is not None:
        most = [one.slow_volt for one in known]
    found = zip(channels, most, strict=False)
    voltage, *currents = [_noise_of(one, case.fit, slow) for one, slow in found]
    if case.sensors:
        voltage = noise.Noise(voltage.white_volt, shared, SLOW_SECOND[-1])
    return (voltage, *currents)


def _noise_of(residual, stack, most_slow):
    """Beside a quiet ammeter's white noise, what the model leaves is mostly slow."""
    step = np.diff(residual)[stack.fresh[1:] == 0]
    white = max(1.4826 * float(np.median(np.abs(step))) / np.sqrt(2), noise.SMALLEST_VOLT)
    slow = min(np.sqrt(max(np.mean(residual**2) - white**2, 0.0)), most_slow)
    tried = [noise.Noise(white, slow, second) for second in SLOW_SECOND]
    return min(tried, key=lambda one: _unlikely(one, residual, stack))


def _unlikely(spread, residual, stack):
    by = noise.whitening(spread, stack)
    return by.log_variance + float(np.sum(by.apply(residual) ** 2))


def filters_of(stack, noises):
    """Filters of a stack by the noise of each channel."""
    return Filters(tuple(noise.whitening(one, stack) for one in noises))


def state_of(case, placed, free, solution, noises):
    """A fitted model, judged on the validation records too."""
    values = _started(case, solution.values, placed)
    predictions = predicted(case, case.validation, case.validation_soc, values, placed)
    validation = rows_of(case, case.validation) - predictions
    residual = rows_of(case, case.fit) - solution.prediction
    white = filters_of(case.validation, noises).apply(validation)
    gaps = gap_volt(case, residual), gap_volt(case, validation)
    return GroupState(placed, solution, values, residual, validation, *gaps, float(white @ white))


def _started(case, values, placed):
    """Shift of the whole group's SoC at the start of each validation record, by its first rest."""
    stack, soc = case.validation, case.validation_soc
    rating = sum(cell.capacity_ampere_hour for cell in case.cells)
    loaded = np.abs(stack.current_ampere) > LOADED_C_RATE * rating
    values = values | {f"soc0[{k}]": 0.0 for k in range(len(stack.first))}
    for _ in range(PASSES):
        run = group_run(group_fields(case.cells, soc, values, placed), stack)
        error = stack.voltage_volt - run.voltage
        shifts = {}
        for k in range(len(stack.first)):
            rows = np.flatnonzero(stack.file == k)
            rest = rows[: int(np.argmax(loaded[rows])) if loaded[rows].any() else len(rows)]
            shifts[f"soc0[{k}]"] = _shift(case, soc[k], values[f"soc0[{k}]"], error[rest])
        values = values | shifts
    return values


def _shift(case, stated, shift, error):
    near = np.mean(stated) + shift + np.array([-SOC_APART, SOC_APART])
    ocv = np.mean([cell.ocv_volt for cell in case.cells], axis=0)
    slope = np.diff(np.interp(near, np.linspace(0, 1, len(ocv)), ocv))[0] / (2 * SOC_APART)
    if not len(error) or abs(slope) < READ_VOLT:
        return shift
    known = case.shared.soc**-2.0
    told = slope**2 / (READ_VOLT**2 / len(error) + case.spread.type_ocv_volt**2)
    return float((shift + error.mean() / slope) * told / (known + told))
