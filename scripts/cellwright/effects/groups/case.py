"""One parallel group as a case of the search: its records, fits, noise and candidates.

A group is healthy if its branches differ from what is known of their cells by no more than the
declared spread. So most free parameters have bounds, and candidates are scored within them.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects.columns import frees_of
from cellwright.effects.floor import Floor, excess_volt
from cellwright.effects.groups.known import GroupGates, Shared, Spread
from cellwright.effects.groups.model import (
    at_branch,
    group_coupling,
    group_fields,
    group_frees,
    group_names,
    group_run,
)
from cellwright.effects.judge import FAR_STDS, READ_VOLT
from cellwright.effects.score import blocks_of, rms_of_blocks
from cellwright.effects.state import State
from cellwright.numerics import noise
from cellwright.numerics.least_squares import (
    Problem,
    derivatives,
    inverse,
)
from cellwright.numerics.statistics import rms, robust_std
from cellwright.records.conditions import low_current

PASSES = 2
SOC_APART = 0.005
SOC_STEP = 1e-3
SLOW_SECOND = (30.0, 100.0, 300.0)
FIRST_NOISE_VOLT = 2e-3
FIRST_NOISE_SHARE = 2e-3  # of the largest branch current


class Channels(NamedTuple):
    """Whitening of the channels of a stack, one after the other: voltage, then branch currents."""

    channels: tuple

    def apply(self, rows):
        """Whitened copy of rows (m,) or (m, k)."""
        parts = np.split(rows, len(self.channels))
        pairs = zip(self.channels, parts, strict=True)
        return np.concatenate([whitening.apply(part) for whitening, part in pairs])


class GroupFilters(NamedTuple):
    """Whitening of both stacks. noise : tuple of noise.Noise, one a channel. blocks : score.Blocks
    of the rows of one channel, by the group's SoC as it is counted before the search."""

    noise: tuple
    fit: Channels
    validation: Channels
    blocks: object


class GroupCase(NamedTuple):
    """A group, its records fitted and those that judge, tolerances and gates.

    cells : tuple of Branch. fit, validation : records.Stack, with the stated SoC at their starts.
    The methods are those that `search` needs.
    """

    cells: tuple
    fit: object
    validation: object
    spread: Spread = Spread()
    shared: Shared = Shared()
    gates: GroupGates = GroupGates()
    settled: float = 1.0

    @property
    def sensors(self):
        """Whether all records have branch currents."""
        logged = (self.fit.branch_current_ampere, self.validation.branch_current_ampere)
        return all(currents is not None for currents in logged)

    def possible(self, library):
        """Every effect in every branch; of the branch sensors only where there are any."""
        asked = [e for e in library.values() if self.sensors or e.stage != "current"]
        placed = [at_branch(effect, k) for effect in asked for k in range(len(self.cells))]
        return {effect.key: effect for effect in placed}

    def begun(self):
        """Free parameters of the healthy group, its first values, and filters of a first noise."""
        files = len(self.fit.first)
        names = group_names(files, len(self.cells))
        free = group_frees(self.cells, files, self.spread, self.shared, sensors=self.sensors)
        noises = [noise.Noise(FIRST_NOISE_VOLT, FIRST_NOISE_VOLT, 300.0)]
        if self.sensors:
            size = FIRST_NOISE_SHARE * np.abs(self.fit.branch_current_ampere).max() / 4
            noises += [noise.Noise(size, size, 200.0)] * len(self.cells)
        return free, dict.fromkeys(names, 0.0), _filters(self, tuple(noises))

    def with_effect(self, free, effect):
        """Free parameters and those of an effect; what it replaces is held at zero."""
        names = {f"{effect.position}.{name}" for name in effect.replaces}
        held = [f._replace(lower=0.0, upper=0.0) if f.name in names else f for f in free]
        return (*held, *frees_of(effect))

    def problem(self, effects, free, filters):
        """The fit of a healthy group and some effects to the records of role fit."""
        return Problem(
            lambda values: predicted(self, self.fit, values, effects),
            rows_of(self, self.fit),
            filters.fit.apply,
            free,
            group_coupling(free, self.cells, self.spread, self.shared),
        )

    def predict(self, side, values, effects):
        """Rows of `rows_of` of a side, "fit" or "validation", by the model (m,) [V, A]."""
        return predicted(self, self.fit if side == "fit" else self.validation, values, effects)

    def without_starts(self, columns, state, filters):
        """Whitened columns (m, k) of the records that judge, less what moves with the group's SoC
        at their starts."""
        stack, values = self.validation, state.values
        starts = [f"soc0[{k}]" for k in range(len(stack.first))]
        moved = values | {name: values[name] + SOC_STEP for name in starts}
        change = self.predict("validation", moved, state.effects)
        change = change - self.predict("validation", values, state.effects)
        white, files = filters.validation.apply(change / SOC_STEP), self.files_of(stack)
        columns = columns.copy()
        for k in range(len(starts)):
            rows = files == k
            mine = white[rows]
            share = (mine @ columns[rows]) / (mine @ mine + self.shared.soc**-2.0)
            columns[rows] -= np.outer(mine, share)
        return columns

    def filters_for(self, residual, filters, first):
        """Filters by the noise of a residual; with more effects the noise does not grow."""
        return _filters(self, noises_of(self, residual, None if first else filters.noise))

    def state(self, effects, solution, filters):
        """State of a fitted model: its errors on the records that judge, starts profiled out."""
        values = _started(self, solution.values, effects)
        volts = predicted(self, self.validation, values, effects)
        error = rows_of(self, self.validation) - volts
        error = error - _start_errors(self, values, effects, volts, error, filters)
        white = filters.validation.apply(error)
        sizes = error_volt(self, solution.residual), error_volt(self, error)
        return State(effects, solution, values, error, white, *sizes)

    def files_of(self, stack):
        """Number of the record of each row of `rows_of` (m,)."""
        return np.tile(stack.file, 1 + len(self.cells) * self.sensors)

    def floor(self, state, free, residual, filters):
        """Error that readings and the spread of healthy cells leave: floor.Floor.

        In the measure of `error_volt`, of the model without effects.
        """
        return _floor(self, state, free, filters)

    def excess(self, state, floor, filters):
        """Error beyond the floor by side, each block once, in the measure of `error_volt`: dict."""
        blocks = filters.blocks
        sides = {
            "fit": (state.solution.residual, blocks.fitted, ~blocks.judges),
            "validation": (state.validation, blocks.judging, blocks.judges),
        }
        found = {}
        for side, (residual, block, chosen) in sides.items():
            volts = currents_volt(self, residual)
            whole = rms_of_blocks(volts.ravel(), block[-volts.size :], chosen)
            found[side] = excess_volt(whole, getattr(floor, f"{side}_volt"))
        return found

    def denied(self, state):
        """No keys: no measurement outside the fit contradicts an effect of a branch."""
        return set()

    def ties(self, effect, state, tied, denied, library):
        """Keys that predict as well in its place: those of the fit alone."""
        return tied


def _filters(case, noises):
    both = [
        Channels(tuple(noise.whitening(channel, stack) for channel in noises))
        for stack in (case.fit, case.validation)
    ]
    sides = [
        (stack.file, _counted_soc(case, stack), np.ones(len(stack.file), bool))
        for stack in (case.fit, case.validation)
    ]
    return GroupFilters(tuple(noises), *both, blocks_of(*sides, channels=len(noises)))


def _counted_soc(case, stack):
    """SoC of the group by counting its total current from the stated starts (n,) [1]."""
    rating = sum(cell.capacity_ampere_hour for cell in case.cells)
    before = np.append(0.0, stack.current_ampere[:-1]) * (1.0 - stack.fresh)
    moved = np.cumsum(before * stack.step_second / 3600.0 / rating)
    starts = np.mean(stack.soc_at_start, axis=1)
    return (starts - moved[stack.first])[stack.file] + moved


def rows_of(case, stack):
    """Measured rows of all channels (m,): voltage [V], then branch currents [A]."""
    if not case.sensors:
        return stack.voltage_volt
    return np.concatenate([stack.voltage_volt, stack.branch_current_ampere.T.ravel()])


def run_of(case, stack, values, effects):
    """GroupRun of records by the model."""
    return group_run(group_fields(case.cells, stack.soc_at_start, values, effects), stack)


def predicted(case, stack, values, effects):
    """Rows of `rows_of` by the model (m,) [V, A]."""
    run = run_of(case, stack, values, effects)
    if not case.sensors:
        return run.voltage
    return np.concatenate([run.voltage, run.current.T.ravel()])


def ohms(case):
    """Ohmic resistance of each cell before the search (b,) [ohm]."""
    return np.array([cell.r_ohm[0] for cell in case.cells])


def error_volt(case, residual):
    """Size of a residual as a voltage, root mean square [V].

    Of the branch currents times their cells' ohmic resistance; of the voltage, where no branch
    currents were logged.
    """
    return rms(currents_volt(case, residual))


def currents_volt(case, rows):
    """Rows of `rows_of` that `error_volt` measures, as voltages of channels one by one (c, n) [V].

    The branch currents times their cells' ohmic resistance; the voltage, where none were logged.
    """
    if not case.sensors:
        return rows[None]
    return rows.reshape(1 + len(case.cells), -1)[1:] * ohms(case)[:, None]


def _floor(case, state, free, filters):
    """Noise of the readings, and what the spread of healthy cells may leave on other records.

    Branches are known to within their posterior: the declared spread about their own tests or
    their type's, narrowed by the records fitted. Through the sensitivities of the records that
    judge, this is an error that no effect of a branch has made.
    """
    stack, solution = case.validation, state.solution
    shared = tuple(f for f in free if not f.name.startswith("soc0["))
    at = predicted(case, stack, state.values, state.effects)
    judging = Problem(
        lambda values: predicted(case, stack, values, state.effects),
        *(rows_of(case, stack), filters.validation.apply, shared),
    )
    columns = derivatives(judging, state.values, at)
    place = [solution.names.index(f.name) for f in shared]
    covariance = inverse(solution.precision)[np.ix_(place, place)]
    variance = np.einsum("ij,jk,ik->i", columns, covariance, columns)
    spread_volt = currents_volt(case, np.sqrt(np.maximum(variance, 0.0)))
    reads = filters.noise[1:] if case.sensors else filters.noise[:1]
    ohm = ohms(case) if case.sensors else np.ones(1)
    read_volt = np.array([channel.white_volt for channel in reads]) * ohm
    squares = np.mean(spread_volt**2 + read_volt[:, None] ** 2, axis=0)
    by_test = {
        test: float(np.sqrt(squares[stack.file == k].mean())) for k, test in enumerate(stack.tests)
    }
    return Floor(rms(read_volt), float(np.sqrt(squares.mean())), by_test)


def noises_of(case, residual, earlier=None):
    """Most likely noise of each channel, from the residual of a model with all candidates.

    Parameters
    ----------
    case : GroupCase. residual : (m,) [V, A]. earlier : noises with fewer effects, beyond which
        it does not grow, or None.
    """
    channels = np.split(residual, 1 + len(case.cells) if case.sensors else 1)
    shared = case.gates.shared_slow_volt
    most = [shared, *(case.gates.most_slow_volt / ohms(case))]
    if earlier is not None:
        most = [channel.slow_volt for channel in earlier]
    pairs = zip(channels, most, strict=False)
    voltage, *currents = [_noise_of(rows, case.fit, slow) for rows, slow in pairs]
    if case.sensors:
        voltage = noise.Noise(voltage.white_volt, shared, SLOW_SECOND[-1])
    return (voltage, *currents)


def _noise_of(residual, stack, most_slow):
    """Noise of a channel: white from differences of rows, the slow part from the rest."""
    step = np.diff(residual)[stack.fresh[1:] == 0]
    white = max(robust_std(step) / np.sqrt(2), noise.SMALLEST_VOLT)
    slow = min(np.sqrt(max(np.mean(residual**2) - white**2, 0.0)), most_slow)
    tried = [noise.Noise(white, slow, second) for second in SLOW_SECOND]
    return min(tried, key=lambda spread: _minus_log_likelihood(spread, residual, stack))


def _minus_log_likelihood(spread, residual, stack):
    whitening = noise.whitening(spread, stack)
    return whitening.log_variance + float(np.sum(whitening.apply(residual) ** 2))


def _started(case, values, effects):
    """Values with the shift of the group's SoC at the start of each validation record [1]."""
    stack, stated = case.validation, case.validation.soc_at_start
    rating = sum(cell.capacity_ampere_hour for cell in case.cells)
    loaded = ~low_current(stack.current_ampere, rating)
    values = values | {f"soc0[{k}]": 0.0 for k in range(len(stack.first))}
    for _ in range(PASSES):
        error = stack.voltage_volt - run_of(case, stack, values, effects).voltage
        shifts = {}
        for k in range(len(stack.first)):
            rows = np.flatnonzero(stack.file == k)
            rest = rows[: int(np.argmax(loaded[rows])) if loaded[rows].any() else len(rows)]
            shifts[f"soc0[{k}]"] = _shift(case, stated[k], values[f"soc0[{k}]"], error[rest])
        values = values | shifts
    return values


def _start_errors(case, values, effects, prediction, error, filters):
    """Errors of the group's SoC at the starts that explain most of an error, within what is unsure.

    Returns the change of the prediction (m,) by them; see `judge.tolerated`.
    """
    stack = case.validation
    starts = [f"soc0[{k}]" for k in range(len(stack.first))]
    moved = values | {name: values[name] + SOC_STEP for name in starts}
    change = predicted(case, stack, moved, effects) - prediction
    change /= SOC_STEP
    white, error = filters.validation.apply(np.stack([change, error], axis=1)).T
    files = case.files_of(stack)
    square, shared = np.bincount(files, white**2), np.bincount(files, white * error)
    return change * _shift_within(square, shared, case.shared.soc)[files]


def _shift(case, stated, shift, error):
    """Shift of the SoC by the error of a first rest [V], weighted against none [1]."""
    near = np.mean(stated) + shift + np.array([-SOC_APART, SOC_APART])
    ocv = np.mean([cell.ocv_volt for cell in case.cells], axis=0)
    slope = np.diff(np.interp(near, np.linspace(0, 1, len(ocv)), ocv))[0] / (2 * SOC_APART)
    if not len(error) or abs(slope) < READ_VOLT:
        return shift
    by_sheet = case.shared.soc**-2.0
    by_rest = slope**2 / (READ_VOLT**2 / len(error) + case.spread.type_ocv_volt**2)
    return float((shift + error.mean() / slope) * by_rest / (by_sheet + by_rest))


def _shift_within(square, shared, std):
    """Most likely shift of a start within `FAR_STDS` deviations.

    Parameters
    ----------
    square, shared : products of the whitened change by the shift with itself, and with the error.
    std : of the prior; all of one shape. Returns an array of that shape.
    """
    precision = square + std**-2.0
    return np.clip(shared / precision, -FAR_STDS * std, FAR_STDS * std)
