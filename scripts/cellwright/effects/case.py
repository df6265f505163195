"""One cell as a case of the search: its training and validation records.

Also its fits, the noise of its residuals, and measurements that decide between tied effects.
"""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import place
from cellwright.effects import base, ties
from cellwright.effects.columns import frees_of
from cellwright.effects.floor import floor_of
from cellwright.effects.judge import (
    rests_of,
    started,
    unfitted,
    unsure_of,
)
from cellwright.effects.records import lacking
from cellwright.effects.score import blocks_of
from cellwright.effects.state import Filters
from cellwright.numerics import noise
from cellwright.numerics.least_squares import SETTLED, Problem, stds
from cellwright.protocols.ocv.gap import SlowGap, shows_hysteresis
from cellwright.settings import MissingEffect

UNUSED_VOLT = 1e4  # error of a row that is not compared: so large that it has no weight

SEARCH = MissingEffect()  # the schema's defaults


class Gates(NamedTuple):
    """When an effect counts.

    visible_chi_square : an effect of plausible size whose chi-square there stays below this cannot
    be tested. price : fall of the cost that an effect has to bring, too; None: the density alone
    decides. joins, counts, apart : standard
    errors of the gain in predictive density from which an effect joins the model, by its ranks from
    which it joins as well and may have a name, and up to which two are tied. elsewhere : by its
    ranks, of what a name gains where the block that tells most of it is not fitted.
    material_volt : what a name takes off the error beyond the floor of either side. unknown_volt,
    unknown_share : what is left without a name, of the plain model's excess, and is told as
    unknown. most_slow_volt, most_slow_second : slow noise that is believed; more would swallow
    hysteresis and slow diffusion. steep_volt : samples that `Tolerance.steep_soc` alone moves by
    more count in no rms error.
    """

    visible_chi_square: float = 25.0  # five standard deviations of one parameter
    joins: float = 1.645  # 95 %, one-sided
    counts: float = 3.0  # 99.7 %: of all that joins, what somebody is told
    price: float | None = None
    apart: float = 1.645  # 95 %, one-sided
    elsewhere: float = 2.0  # 95 %
    material_volt: float = SEARCH.material_volt
    unknown_volt: float = SEARCH.unknown_volt
    unknown_share: float = 0.5  # policy: no significance tells the right law from the nearest one
    most_slow_volt: float = 0.0012
    most_slow_second: float = 300.0
    steep_volt: float = 0.002


STEADY_C_RATE = 0.02
MOST_WHITE = 1.5  # times the scatter of neighbouring rows


class Case(NamedTuple):
    """A cell, its training and validation records (records.Stack), tolerances and gates.

    gap : voltage between the branches of the slow test, gap.SlowGap. start, log_std : values of the
    companion of a given model and how well they are known (`own`), else None. otherwise : the same
    Case with the other hold of the current, or None. first_capacity : where a fit begins, relative
    to the measured one [1]. holds_declared : whether both branches of the slow test that tells
    the OCV are among the records fitted, so that it and the capacity stay within their tolerances.
    healthy : effects, each its id and parameters by name, whose courses the stacks have of healthy
    cells. The methods are those that `search` needs.
    """

    cell: base.Cell
    fit: object
    validation: object
    tolerance: base.Tolerance = base.Tolerance()
    gates: Gates = Gates()
    gap: SlowGap = SlowGap()
    settled: float = SETTLED
    start: dict | None = None
    log_std: dict | None = None
    otherwise: object = None
    first_capacity: float = 0.0
    holds_declared: bool = False
    healthy: tuple = ()

    @property
    def steady_ampere(self):
        """Change of the current between two rows up to which it counts as steady [A]."""
        return STEADY_C_RATE * self.cell.capacity_ampere_hour

    def possible(self, library):
        """Effects, by key, that the records excite and that current and voltage can show."""
        return {
            key: effect
            for key, effect in library.items()
            if not not_excited(self, effect) and not effect.invisible
        }

    def begun(self):
        """Free parameters of the plain model, its first values, and filters of a first noise."""
        values, free = unfitted(self)
        return free, values, self.filters(noise.FIRST, values)

    def filters(self, spread, values):
        """Filters by a noise; rows are on a steep OCV, or not, by some values."""
        extra = []
        for stack in (self.fit, self.validation):
            soc = base.fields_of(self.cell, stack, values | base.stated_starts(stack)).soc
            unused = np.where(stack.used, 0.0, UNUSED_VOLT)
            extra.append(unused + base.steep_volt(self.cell, soc, self.tolerance))
        return self._filters_beside(spread, tuple(extra))

    def _filters_beside(self, spread, extra):
        """Filters by a noise and the error of each row of both stacks beyond it [V]."""
        stacks, sides = (self.fit, self.validation), []
        for stack in stacks:
            absent = dict.fromkeys(base.base_names(len(stack.first)), 0.0)
            fields = base.fields_of(self.cell, stack, absent | base.stated_starts(stack))
            sides.append((stack.file, fields.soc, stack.used))
        pairs = zip(stacks, extra, strict=True)
        return Filters(
            spread,
            *(noise.whitening(spread, stack, extra_volt=volt) for stack, volt in pairs),
            *(volt <= self.gates.steep_volt for volt in extra),
            blocks_of(*sides),
            extra,
        )

    def with_effect(self, free, effect):
        """Free parameters with those of an effect after them."""
        return (*free, *frees_of(effect))

    def problem(self, effects, free, filters):
        """The fit of a model with these effects to the records of role fit."""

        def own_rows(values):
            """Parameters that move rows of their own, for `Problem.apart`.

            SoC at the start of a record: its rows. Every other knot of the OCV's error: those
            around it.
            """
            soc = base.fields_of(self.cell, self.fit, values, effects).soc
            below = place(np.clip(soc, 0.0, 1.0), base.OCV_KNOTS)[0]
            starts = base.start_names(len(self.fit.first))
            even, odd = base.OCV_NAMES[::2], base.OCV_NAMES[1::2]
            return [(starts, self.fit.file), (even, (below + 1) // 2), (odd, below // 2)]

        return Problem(
            lambda values: self.predict("fit", values, effects),
            self.fit.voltage_volt,
            filters.fit.apply,
            free,
            base.coupling(free, self.tolerance),
            own_rows,
        )

    def stack(self, side):
        """Records of a side, "fit" or "validation"."""
        return self.fit if side == "fit" else self.validation

    def predict(self, side, values, effects):
        """Voltage over the records of a side (n,) [V]."""
        return base.voltage(self.cell, self.stack(side), values, effects)

    def unsure(self, values, effects, prediction):
        """What is unsure of the validation records, by a model and its prediction: judge.Unsure."""
        about = self.cell, self.validation, values, effects, self.tolerance
        return unsure_of(*about, prediction, self.shared)

    @property
    def shared(self):
        """Records of which one part is fitted and another judges: their number in either."""
        tests = self.fit.tests
        return [(k, tests.index(t)) for k, t in enumerate(self.validation.tests) if t in tests]

    def in_volt(self, rows):
        """Rows of a prediction (n,) as voltages of one channel (1, n) [V]."""
        return rows[None]

    def filters_for(self, residual, filters, first):
        """Filters by the noise of the residual with all candidates in the model."""
        limits = {
            name: getattr(self.gates, name) for name in ("most_slow_volt", "most_slow_second")
        }
        extra = filters.extra_volt[0]
        spread = noise.estimate_noise(residual, self.fit, extra_volt=extra, **limits)
        # What a reading scatters by, neighbouring rows show; more of it is misfit of the model.
        read = noise.read_volt(residual, self.fit, steady_ampere=self.steady_ampere)
        spread = spread._replace(white_volt=min(spread.white_volt, MOST_WHITE * read))
        return self._filters_beside(spread, filters.extra_volt)

    def measured(self, side):
        """Measured rows of a side (n,) [V]."""
        return self.stack(side).voltage_volt

    def started(self, effects, solution):
        """Values of a fitted model with the SoC at the starts of the records that judge."""
        stack, rests = self.validation, rests_of(self.cell, self.fit, solution)
        # The template's scale by the records fitted says nothing where it is hardly above noise.
        values = solution.values | {"known": 1.0}
        return started(self.cell, stack, values, effects, self.tolerance, self.shared, rests)

    def floor(self, state, free, residual, filters):
        """Error that readings and stated tolerances leave, of the plain model: floor.Floor."""
        read = noise.read_volt(residual, self.fit, steady_ampere=self.steady_ampere)
        read = min(read, filters.noise.white_volt)
        # Every slope upwards, also of a parameter that its upper bound holds.
        free = [one._replace(upper=np.inf) for one in free]
        return floor_of(self, state, free, filters.validation_rows, read)

    def denied(self, state):
        """Keys of effects of a fitted model that a measurement outside the fit contradicts.

        The current logged at rest decides between an offset and a leak. A gap between the branches
        of the slow test that no resistance explains is hysteresis, and no slow diffusion.
        """
        by_log = (e for e in state.effects if e.in_rest_log is not None)
        against = [e for e in by_log if _by_rest_log(self, e, state) is (not e.in_rest_log)]
        slow = (e for e in state.effects if e.slow_gap == "resistance")
        against += [e for e in slow if _in_place_of_hysteresis(self, e, state)]
        return {effect.key for effect in against}

    def ties(self, effect, state, tied, denied, library):
        """The ties of an effect with their structural partners, without those that are denied."""
        tied = ties.with_partners(effect.id, tied, library, state.solution.values)
        ampere_hour = self.cell.capacity_ampere_hour
        tied = (*tied, *ties.at_one_temperature(effect, self.fit, ampere_hour))
        tied = (*tied, *ties.in_order_of_temperature(effect, self.fit))
        if effect.in_rest_log is not None and _by_rest_log(self, effect, state) is not None:
            denied = denied | {e.id for e in library.values() if e.in_rest_log is not None}
        return tuple(name for name in tied if name not in denied)


def not_excited(case, effect):
    """What the records fitted lack to excite this effect, in words; empty: nothing."""
    return lacking(effect, case.fit, case.cell.capacity_ampere_hour)


def _by_rest_log(case, effect, state):
    """Whether the log at rest shows the size of an effect; None where it does not decide."""
    name = effect.names[0]
    size, std = state.solution.values[name], stds(state.solution)[name]
    rest = ties.rest_current(case.fit, capacity_ampere_hour=case.cell.capacity_ampere_hour)
    return ties.is_in_rest_log(rest, size_ampere=size, std_ampere=std)


def _in_place_of_hysteresis(case, effect, state):
    """Whether a resistance is fitted to a gap that is hysteresis by the slow test's branches."""
    values = state.solution.values
    ohm = sum(np.exp(values[name]) for name in ("log_r0", "log_r1", "log_r2"))
    modelled = any(other.slow_gap == "hysteresis" for other in state.effects)
    ohm = ohm + values[effect.names[0]]
    return not modelled and shows_hysteresis(case.gap, ohm)
