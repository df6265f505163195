"""A cell as the search sees it: its records, its fits, its noise, and what is known beside them."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base, plain
from cellwright.effects.judge import by_starts, rests_of, started
from cellwright.effects.library.vocabulary import in_order
from cellwright.effects.records import lacking
from cellwright.effects.screen import candidates, screened
from cellwright.effects.search import State, frees_of
from cellwright.effects.ties import offset_or_leak, rest_current, tie_of, with_partners
from cellwright.numerics import noise
from cellwright.numerics.least_squares import SETTLED, Problem, stds
from cellwright.numerics.statistics import rms
from cellwright.protocols.ocv.gap import HYSTERESIS, SlowGap, shows_hysteresis

UNUSED_VOLT = 1e4  # error of a row that is not compared: so large that it tells nothing


class Gates(NamedTuple):
    """When an effect counts; meaning and source in config/README.md (missing_effect)."""

    refits: int = 8
    bic: float = 10.0
    validation_chi_square: float = 25.0
    validation_fall: float = 0.03
    visible_chi_square: float = 25.0
    material_volt: float = 3e-4
    material_share: float = 0.005
    nothing_ratio: float = 1.15
    nothing_volt: float = 1.5e-3
    adequate_ratio: float = 1.3
    adequate_closed: float = 0.85
    partial_closed: float = 0.7
    unknown_ratio: float = 1.5
    tie_absolute: float = 6.0
    tie_relative: float = 0.03
    rounds: int = 4
    most_slow_volt: float = 1.2e-3
    most_slow_second: float = 300.0
    steep_volt: float = 2e-3


STEADY_C_RATE = 0.02
LOGGED = {"current_offset", "leakage"}  # told apart by the current logged at rest
SLOW = "slow_diffusion"
FAR_LOG = 0.2  # of a resistance or time constant: beyond it kept derivatives mislead


class Filters(NamedTuple):
    """Whitening of both stacks by one noise, and which of their rows an rms error counts.

    noise : noise.Noise. extra_volt : of `steep`. Rows on a steep end of the OCV, where a little
    charge is many millivolts, do not count.
    """

    noise: noise.Noise
    extra_volt: tuple
    fit: noise.Whitening
    validation: noise.Whitening
    fit_rows: np.ndarray
    validation_rows: np.ndarray


class Case(NamedTuple):
    """A cell, the records fitted and those that judge (records.Stack), tolerances and gates.

    gap : what the slow test's branches leave between them, slow_gap.SlowGap. The methods are those
    that `search` asks of what it searches.
    """

    cell: base.Cell
    fit: object
    validation: object
    tolerance: plain.Tolerance = plain.Tolerance()
    gates: Gates = Gates()
    gap: SlowGap = SlowGap()
    polish_share: float = 0.3  # of the best J, from which a misled trial is refitted
    settled: float = SETTLED
    keeps_derivatives: bool = True

    def possible(self, library):
        """Effects that the records excite and that current and voltage could ever show."""
        excited = {key: one for key, one in library.items() if not not_excited(self, one)}
        return {key: one for key, one in excited.items() if tie_of(one.id) is None}

    def begun(self):
        """Free parameters of the plain model, its first values, and filters of a first noise."""
        values = plain.first_values(self.cell, self.fit)
        free = plain.frees(self.fit, values, self.tolerance)
        return free, values, filters_of(self, noise.FIRST, steep(self, values))

    def with_effect(self, free, effect):
        """Free parameters beside those of an effect."""
        return (*free, *frees_of(effect))

    def problem(self, effects, free, filters):
        """The fit of a model with these effects to the records of role fit."""
        return problem_of(self, effects, free, filters)

    def candidates(self, effects, solution, possible, further):
        """What each further effect would change: list of screen.Candidate."""

        def predict(values, effect):
            together = in_order((*effects, effect), possible)
            return base.voltage(self.cell, self.fit, values, together)

        return candidates(predict, solution.prediction, solution.values, further)

    def filters_for(self, residual, filters, earlier):
        """Filters by the noise of a residual in which nothing is missing."""
        limits = {
            name: getattr(self.gates, name) for name in ("most_slow_volt", "most_slow_second")
        }
        spread = noise.estimate_noise(
            residual, self.fit, extra_volt=filters.extra_volt[0], **limits
        )
        return filters_of(self, spread, filters.extra_volt)

    def sharper(self, trial, filters):
        """None: the noise of a cell is taken once a round."""

    def screened(self, lined_up, before, free, possible, filters):
        """Scores, best first, and keys of effects that the records cannot show."""
        return screened(self, lined_up, before, possible, filters)

    def state(self, effects, solution, filters):
        """How a fitted model does on the records that judge."""
        return state_of(self, effects, solution, filters)

    def floor_volt(self, residual, filters, earlier):
        """Noise that no model can explain: white as neighbouring rows show it, and slow [V]."""
        if earlier:
            return earlier[0].floor_volt
        steady = STEADY_C_RATE * self.cell.capacity_ampere_hour
        white = noise.read_volt(residual, self.fit, steady_ampere=steady)
        return float(np.hypot(min(white, filters.noise.white_volt), filters.noise.slow_volt))

    def misled(self, before, trial):
        """Whether resistances or time constants went far from where derivatives were taken."""
        then, now = before.solution.values, trial.state.solution.values
        return max(abs(now[name] - then[name]) for name in base.LOGARITHMS) > FAR_LOG

    def denied(self, trials):
        """Keys of trials that something measured beside the records speaks against.

        The current logged at rest tells an offset from a leak. A gap between the branches of the
        slow test that no resistance explains is hysteresis, which slow diffusion must not stand in
        for.
        """
        told = {t.effect.id: _told(self, t) for t in trials if t.effect.id in LOGGED}
        against = {name for name, word in told.items() if word not in (None, name)}
        slow = [t for t in trials if t.effect.id == SLOW and _in_place_of_hysteresis(self, t)]
        return against | {t.effect.key for t in slow}

    def ties(self, chosen, tied, denied, library):
        """The ties of a choice with their structural partners, without those that are denied."""
        values = chosen.state.solution.values
        tied = with_partners(chosen.effect.id, tied, library, values)
        if chosen.effect.id in LOGGED and _told(self, chosen) is not None:
            denied = denied | LOGGED
        return tuple(name for name in tied if name not in denied)


def not_excited(case, effect):
    """What the records of either role lack for this effect, in words; empty: nothing."""
    capacity = case.cell.capacity_ampere_hour
    return lacking(effect, case.fit, capacity) or lacking(effect, case.validation, capacity)


def _told(case, trial):
    """Which of an offset and a leak the log at rest says it is; None where it cannot tell."""
    name = trial.effect.names[0]
    size, std = trial.state.solution.values[name], stds(trial.state.solution)[name]
    rest = rest_current(case.fit, capacity_ampere_hour=case.cell.capacity_ampere_hour)
    return offset_or_leak(rest, size_ampere=size, std_ampere=std)[0]


def _in_place_of_hysteresis(case, trial):
    values = trial.state.solution.values
    own = sum(np.exp(values[name]) for name in ("log_r0", "log_r1", "log_r2"))
    there = HYSTERESIS & {effect.id for effect in trial.state.effects}
    return not there and shows_hysteresis(case.gap, own + values[f"{SLOW}.resistance_ohm"])


def problem_of(case, effects, free, filters):
    """The fit of a model with these effects to the records of role fit."""
    return Problem(
        lambda values: base.voltage(case.cell, case.fit, values, effects),
        case.fit.voltage_volt,
        filters.fit.apply,
        free,
        plain.coupling(free, case.tolerance),
        lambda values: _apart(case, effects, values),
    )


def _apart(case, effects, values):
    """A start moves the rows of its record, every other knot of the OCV's error those around it."""
    soc = base.fields_of(case.cell, case.fit, values, effects).soc
    left = base.left_knot(soc)
    starts = [f"soc0[{k}]" for k in range(len(case.fit.first))]
    even, odd = ([f"ocv[{k}]" for k in range(first, base.OCV_KNOTS, 2)] for first in (0, 1))
    return [(starts, case.fit.file), (even, (left + 1) // 2), (odd, left // 2)]


def state_of(case, effects, solution, filters):
    """How a fitted model does on the records that judge; only their first rest is looked at."""
    stack = case.validation
    pairs = [(k, case.fit.tests.index(t)) for k, t in enumerate(stack.tests) if t in case.fit.tests]
    rests = rests_of(case.cell, case.fit, solution)
    values = started(case.cell, stack, solution.values, effects, case.tolerance, pairs, rests)
    volt = base.voltage(case.cell, stack, values, effects)
    error = stack.voltage_volt - volt
    about = case.cell, stack, values, effects, case.tolerance
    white = filters.validation.apply(error)
    explained = by_starts(*about, volt, filters.validation, pairs)
    return State(
        effects,
        solution,
        values,
        error,
        float(white @ white) - explained,
        rms(solution.residual[filters.fit_rows]),
        rms(error[filters.validation_rows]),
    )


def steep(case, values):
    """What each row of both stacks may err beyond noise [V]: on a steep OCV, or not compared."""
    found = []
    for stack in (case.fit, case.validation):
        socs = {f"soc0[{k}]": float(soc) for k, soc in enumerate(stack.soc_at_start)}
        soc = base.fields_of(case.cell, stack, values | socs).soc
        lost = np.where(stack.used, 0.0, UNUSED_VOLT)
        found.append(lost + plain.steep_volt(case.cell, soc, case.tolerance))
    return tuple(found)


def filters_of(case, spread, extra):
    """Filters for a noise. extra: of `steep`."""
    return Filters(
        spread,
        extra,
        noise.whitening(spread, case.fit, extra_volt=extra[0]),
        noise.whitening(spread, case.validation, extra_volt=extra[1]),
        extra[0] <= case.gates.steep_volt,
        extra[1] <= case.gates.steep_volt,
    )
