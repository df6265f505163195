"""Error of a given model before a search frees any of its parameters."""

from cellwright.effects import base
from cellwright.effects.given.case import at_starts
from cellwright.numerics.statistics import rms


def as_given(case, filters):
    """Error of a given model with none of its parameters freed: dict fit, validation [V].

    Over the rows that an rms error of the search counts, from the SoC as stated or counted; of
    records for proof as of those fitted.

    Parameters
    ----------
    case : case.Case of a given model. filters : case.Filters.
    """
    rows = {"fit": filters.fit_rows, "validation": filters.validation_rows}
    return {
        role: rms((stack.voltage_volt - given_volt(case, stack))[rows[role]])
        for role, stack in (("fit", case.fit), ("validation", case.validation))
    }


def given_volt(case, stack):
    """Voltage of the given model over a stack (n,) [V].

    Parameters
    ----------
    case : case.Case of a given model. stack : one of its two.
    """
    return base.voltage(case.cell, stack, at_starts(case.start, stack))
