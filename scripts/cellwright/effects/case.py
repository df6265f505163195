"""What a search is about, and the fits it is made of."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base, plain
from cellwright.effects.judge import by_starts, rests_of, rms, started
from cellwright.numerics import noise
from cellwright.numerics.least_squares import Problem
from cellwright.protocols.ocv.gap import SlowGap

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


class Case(NamedTuple):
    """A cell, the records fitted and those that judge (records.Stack), tolerances and gates.

    gap : what the slow test's branches leave between them, slow_gap.SlowGap.
    """

    cell: base.Cell
    fit: object
    validation: object
    tolerance: plain.Tolerance = plain.Tolerance()
    gates: Gates = Gates()
    gap: SlowGap = SlowGap()


class Filters(NamedTuple):
    """Whitening of both stacks by one noise, and which of their rows an rms error counts.

    Rows on a steep end of the OCV, where a little charge is many millivolts, do not.
    """

    fit: noise.Whitening
    validation: noise.Whitening
    fit_rows: np.ndarray
    validation_rows: np.ndarray


class State(NamedTuple):
    """A model fitted: its effects, and how it does on both kinds of records.

    values : of the validation records, with their own starts. validation : residual (m,) [V].
    validation_chi_square : of it, whitened by the same noise, without what the uncertainty of the
    starts explains. rmse_volt, validation_rmse_volt [V].
    """

    effects: tuple
    solution: object
    values: dict
    validation: np.ndarray
    validation_chi_square: float
    rmse_volt: float
    validation_rmse_volt: float

    @property
    def worst_volt(self):
        """The larger of both rms errors [V]."""
        return max(self.rmse_volt, self.validation_rmse_volt)


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
    left, about = stack.voltage_volt - volt, (case.cell, stack, values, effects, case.tolerance)
    white = filters.validation.apply(left)
    explained = by_starts(*about, volt, filters.validation, pairs)
    return State(
        effects,
        solution,
        values,
        left,
        float(white @ white) - explained,
        rms(solution.residual[filters.fit_rows]),
        rms(left[filters.validation_rows]),
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
        noise.whitening(spread, case.fit, extra_volt=extra[0]),
        noise.whitening(spread, case.validation, extra_volt=extra[1]),
        extra[0] <= case.gates.steep_volt,
        extra[1] <= case.gates.steep_volt,
    )
