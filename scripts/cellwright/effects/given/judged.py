"""Error of a given model before a search frees any of its parameters."""

from cellwright.effects import base
from cellwright.effects.given.case import at_starts
from cellwright.effects.state import SIDES
from cellwright.numerics.statistics import rms


def as_given(case, filters):
    """Error of a given model with none of its parameters freed: dict fit, validation [V].

    Over the rows that an rms error of the search counts, from the SoC as stated or counted; of
    records for proof as of those fitted.

    Parameters
    ----------
    case : case.Case of a given model. filters : case.Filters.
    """
    return {
        side: rms((stack.voltage_volt - given_volt(case, stack))[filters.rows_on(side)])
        for side, stack in ((side, case.stack(side)) for side in SIDES)
    }


def given_volt(case, stack):
    """Voltage of the given model over a stack (n,) [V].

    Parameters
    ----------
    case : case.Case of a given model. stack : one of its two.
    """
    return base.voltage(case.cell, stack, at_starts(case.start, stack))
