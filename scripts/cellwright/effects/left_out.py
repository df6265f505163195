"""The found model fitted again without some blocks of the records, to be judged by just these."""

import numpy as np

from cellwright.effects import plain
from cellwright.effects.case import filters_of, problem_of, steep
from cellwright.effects.problem import fit
from cellwright.effects.trial import POLISH_STEPS, frees_of
from cellwright.models.selection import FOLDS
from cellwright.models.split import blocks
from cellwright.series.anchor import REST_C_RATE


def folds(case, state, noise, *, split_rest_second):
    """Values of a found model without each fold of the blocks, a block being a load and its rest.

    Every fourth block is left out together with its like, as in the choice between members of the
    circuit family (`models.selection.left_out`). Effects and noise stay as found.

    Parameters
    ----------
    case : Case. state : case.State, the model with its effects. noise : noise.Noise.
    split_rest_second : shortest rest that ends a block [s].

    Returns
    -------
    folds : list of dict: values, as in the model; blocks, list of [test, from, until] in seconds
        of the test. Empty where the records fitted are one block.
    """
    numbers, spans = _blocks(case, split_rest_second)
    count = min(FOLDS, len(spans))
    if count < 2:
        return []
    values = plain.first_values(case.cell, case.fit)
    own = [one for effect in state.effects for one in frees_of(effect)]
    free = (*plain.frees(case.fit, values, case.tolerance), *own)
    renew = tuple(one.name for one in own)
    found = []
    for fold in range(count):
        kept = case.fit.used & (numbers % count != fold)
        part = case._replace(fit=case.fit._replace(used=kept))
        filters = filters_of(part, noise, steep(part, values))
        problem = problem_of(part, state.effects, free, filters)
        start = state.solution
        solution = fit(
            problem, start.values, columns=start.columns, renew=renew, steps=POLISH_STEPS
        )
        left = [span for number, span in enumerate(spans) if number % count == fold]
        found.append({"values": _plain(solution.values), "blocks": left})
    return found


def _blocks(case, rest_second):
    """Number of the block of each row, and [test, from, until] of each; unused rows: number −1."""
    stack, numbers, spans = case.fit, np.full(len(case.fit.file), -1), []
    rest_ampere = REST_C_RATE * case.cell.capacity_ampere_hour
    for file, test in enumerate(stack.tests):
        rows = np.flatnonzero(stack.file == file)
        second, current = stack.second[rows], stack.current_ampere[rows]
        block = blocks(second, current, rest_second=rest_second, rest_ampere=rest_ampere)
        for one in np.unique(block[stack.used[rows]]):
            inside = rows[block == one]
            numbers[inside] = len(spans)
            spans.append([test, float(stack.second[inside[0]]), float(stack.second[inside[-1]])])
    return numbers, spans


def _plain(values):
    return {name: float(value) for name, value in values.items()}
