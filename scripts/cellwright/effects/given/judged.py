"""Errors of the model in use, with its effects and without, on blocks left out of their search."""

import numpy as np

from cellwright.effects import base
from cellwright.effects.given.case import at_starts
from cellwright.effects.member import blocks_of_case, shift_of_starts
from cellwright.numerics.statistics import rms


def judged_blocks(case, state, folds, *, split_rest_second):
    """How far the given model errs in each block of the records fitted, with effects and without.

    Every voltage begins at the SoC that counting gives at the start of its record, as in use. A
    start that was fitted to one record is no part of the model; by how much the fitted starts of
    all records usually lie beside the counted ones is.

    Parameters
    ----------
    case : case.Case of a given model, `case.given_case`. state : state.State, the model with
        its effects. folds : list of dict, see `member.folds`.
    split_rest_second : shortest rest that ends a block [s].

    Returns
    -------
    blocks : list of dict: test, from_second, until_second, rows, celsius (least, mean and largest
        of the record [degC]), square_volt2: mean square error [V²] of the `member` as it is,
        `with_effects`, and `left_out`, with effects that were found without the block. Empty where
        nothing could be left out.
    """
    if not folds:
        return []
    numbers, spans = blocks_of_case(case, split_rest_second)
    stack, effects = case.fit, state.effects
    whole, *each = (
        base.voltage(case.cell, stack, _from_counted(case, values, effects), effects)
        for values in (state.solution.values, *(fold["values"] for fold in folds))
    )
    held_out = np.array(each)[numbers % len(folds), np.arange(len(numbers))]
    volts = {"member": given_volt(case, stack), "with_effects": whole, "left_out": held_out}
    squares = {name: (stack.voltage_volt - volt) ** 2 for name, volt in volts.items()}
    return [_block(stack, span, numbers == k, squares) for k, span in enumerate(spans)]


def _from_counted(case, values, effects):
    """Values with every start as counted, moved by the usual distance of the fitted starts."""
    counted = base.stated_starts(case.fit)
    starts = base.starts_of(case.cell, case.fit, values, effects)
    shift = shift_of_starts(case.fit, starts)
    return values | {name: soc + shift for name, soc in counted.items()}


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


def _block(stack, span, inside, squares):
    test, begin, end = span
    celsius = stack.celsius[stack.file == stack.tests.index(test)]
    return {
        "test": test,
        "from_second": begin,
        "until_second": end,
        "rows": int(inside.sum()),
        "celsius": [float(value) for value in (celsius.min(), celsius.mean(), celsius.max())],
        "square_volt2": {name: float(square[inside].mean()) for name, square in squares.items()},
    }
