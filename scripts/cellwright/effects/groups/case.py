"""One parallel group as a case of the search: its records, fits, noise and candidates.

A group is healthy if its branches differ from what is known of their cells by no more than the
declared spread. So most free parameters have bounds, and candidates are scored within them.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects.columns import frees_of
from cellwright.effects.floor import floor_of
from cellwright.effects.groups.known import GroupGates, Shared, Spread
from cellwright.effects.groups.model import (
    at_branch,
    group_coupling,
    group_fields,
    group_frees,
    group_names,
    group_run,
)
from cellwright.effects.judge import READ_VOLT, Unsure, first_rest
from cellwright.effects.score import blocks_of
from cellwright.effects.state import Filters
from cellwright.numerics import noise
from cellwright.numerics.least_squares import Problem
from cellwright.numerics.statistics import robust_std
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


class GroupCase(NamedTuple):
    """A group, its training and validation records, tolerances and gates.

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

    @property
    def rating(self):
        """Sum of the capacities of its cells [Ah]."""
        return sum(cell.capacity_ampere_hour for cell in self.cells)

    @property
    def ohms(self):
        """Ohmic resistance of each cell before the search (b,) [ohm]."""
        return np.array([cell.r_ohm[0] for cell in self.cells])

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
            lambda values: self.predict("fit", values, effects),
            self.measured("fit"),
            filters.fit.apply,
            free,
            group_coupling(free, self.cells, self.spread, self.shared),
        )

    def stack(self, side):
        """Records of a side, "fit" or "validation"."""
        return self.fit if side == "fit" else self.validation

    def measured(self, side):
        """Measured rows of all channels of a side (m,): voltage [V], then branch currents [A]."""
        return self._channels(self.stack(side).voltage_volt, self.stack(side).branch_current_ampere)

    def run(self, side, values, effects):
        """GroupRun of the records of a side by the model."""
        stack = self.stack(side)
        return group_run(group_fields(self.cells, stack.soc_at_start, values, effects), stack)

    def predict(self, side, values, effects):
        """Rows of `measured` of a side by the model (m,) [V, A]."""
        return self._channels(*self.run(side, values, effects)[:2])

    def _channels(self, volt, ampere):
        return np.concatenate([volt, ampere.T.ravel()]) if self.sensors else volt

    def started(self, effects, solution):
        """Values with the shift of the group's SoC at the start of each record that judges [1]."""
        stack, stated = self.validation, self.validation.soc_at_start
        loaded = ~low_current(stack.current_ampere, self.rating)
        values = solution.values | {f"soc0[{k}]": 0.0 for k in range(len(stack.first))}
        for _ in range(PASSES):
            error = stack.voltage_volt - self.run("validation", values, effects).voltage
            shifts = {}
            for k in range(len(stack.first)):
                rest = first_rest(stack, k, loaded)
                shifts[f"soc0[{k}]"] = _shift(self, stated[k], values[f"soc0[{k}]"], error[rest])
            values = values | shifts
        return values

    def unsure(self, values, effects, prediction):
        """What is unsure of the validation records, the group's SoC at their starts: Unsure."""
        starts = [f"soc0[{k}]" for k in range(len(self.validation.first))]
        moved = values | {name: values[name] + SOC_STEP for name in starts}
        change = (self.predict("validation", moved, effects) - prediction) / SOC_STEP
        stds = np.full((len(starts), 1), self.shared.soc)
        # Of several channels, one after the other.
        file = np.tile(self.validation.file, 1 + len(self.cells) * self.sensors)
        return Unsure(change[:, None], stds, file, frozenset(range(len(starts))))

    def in_volt(self, rows):
        """Rows of `measured` by whose size errors are told, as voltages of channels (c, n) [V].

        The branch currents times their cells' ohmic resistance; the voltage, where none were
        logged.
        """
        if not self.sensors:
            return rows[None]
        return rows.reshape(1 + len(self.cells), -1)[1:] * self.ohms[:, None]

    def filters_for(self, residual, filters, first):
        """Filters by the noise of a residual; with more effects the noise does not grow."""
        return _filters(self, noises_of(self, residual, None if first else filters.noise))

    def floor(self, state, free, residual, filters):
        """Error that readings and the spread of healthy cells leave: floor.Floor."""
        reads = [channel.white_volt for channel in filters.noise]
        read_volt = reads[1:] * self.ohms if self.sensors else reads
        return floor_of(self, state, free, True, read_volt)

    def denied(self, state):
        """No keys: no measurement outside the fit contradicts an effect of a branch."""
        return set()

    def ties(self, effect, state, tied, denied, library):
        """Keys that predict as well in its place: those of the fit alone."""
        return tied


def _filters(case, noises):
    whitened, sides = [], []
    for stack in (case.fit, case.validation):
        whitened.append(Channels(tuple(noise.whitening(channel, stack) for channel in noises)))
        # SoC of the group by counting its total current from the stated starts.
        before = np.append(0.0, stack.current_ampere[:-1]) * (1.0 - stack.fresh)
        moved = np.cumsum(before * stack.step_second / 3600.0 / case.rating)
        starts = np.mean(stack.soc_at_start, axis=1)
        soc = (starts - moved[stack.first])[stack.file] + moved
        sides.append((stack.file, soc, np.ones(len(stack.file), bool)))
    every, blocks = slice(None), blocks_of(*sides, channels=len(noises))
    return Filters(tuple(noises), *whitened, every, every, blocks)


def noises_of(case, residual, earlier=None):
    """Most likely noise of each channel, from the residual of a model with all candidates.

    Parameters
    ----------
    case : GroupCase. residual : (m,) [V, A]. earlier : noises with fewer effects, beyond which
        it does not grow, or None.
    """
    channels = np.split(residual, 1 + len(case.cells) if case.sensors else 1)
    shared = case.gates.shared_slow_volt
    most = [shared, *(case.gates.most_slow_volt / case.ohms)]
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

    def minus_log_likelihood(spread):
        whitening = noise.whitening(spread, stack)
        return whitening.log_variance + float(np.sum(whitening.apply(residual) ** 2))

    tried = [noise.Noise(white, slow, second) for second in SLOW_SECOND]
    return min(tried, key=minus_log_likelihood)


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
