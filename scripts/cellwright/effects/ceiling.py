"""What could still be learned of a residual: any function of SoC, temperature and past current.

A name says what is missing; where none fits, it still matters whether the records fitted hold what
is missing on other records. A smooth function without any physics, fitted to the residual, is the
most that an effect of the cell's state could explain there.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base
from cellwright.effects.proof import blocks_of, excess_volt
from cellwright.effects.search import up_to
from cellwright.numerics.linear import hats
from cellwright.numerics.statistics import rms
from cellwright.records.conditions import REFERENCE_CELSIUS

KNOTS = np.linspace(0.0, 1.0, 9)  # of the SoC
KNOTS_OF_CURRENT = np.linspace(-1.0, 1.0, 7)  # of the largest of the records fitted
LAGS_SECOND = (1.0, 10.0, 100.0, 1000.0)
KELVIN = 20.0  # unit of the temperature's distance from 25 °C
LEAST_KELVIN = 2.0  # range of the records fitted from which a course over temperature is asked
# Standard deviations of the function's coefficients, for drives of usual size [V].
SIZES_VOLT = (0.0, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
FOLDS = 5
HALF = 0.5  # of the excess, from which what is missing counts as learned
SHORT = 2 / 3  # of what the function explains: a name below it has another course


class Ceiling(NamedTuple):
    """What the best function without physics leaves.

    fit_volt, validation_volt : rms error with it, of the records fitted (each block by a function
    fitted without it) and of those that judge [V]. learnable : it takes more than half of the
    squared excess over the floor off the latter; None: there is no excess.
    """

    fit_volt: float
    validation_volt: float
    learnable: bool | None


def ceiling(case, state, filters, floor):
    """Ceiling of a fitted state.

    1. Columns: hat functions of the SoC times hat functions of the current, its direction and the
       current after lags of 1, 10, 100 and 1000 s, times one and, where it varies, the temperature.
    2. Ridge regression of the residual of the records fitted, whitened as for the fit. Its penalty
       leaves least of blocks (a record's band of the SoC) that are left out of the regression; no
       function at all is one of the choices.
    3. The function is added to the model on the records that judge, which chose nothing.

    Parameters
    ----------
    case : case.Case. state : candidates.State. filters : case.Filters, with the fit's whitening.
    floor : proof.Floor.

    Returns
    -------
    ceiling : Ceiling.

    Source: T. Hastie, R. Tibshirani, J. Friedman, The Elements of Statistical Learning, 2nd ed.
    (2009), 3.4.1 and 7.10.
    """
    fitted, judging = _sides(case, state)
    rows = filters.fit_rows
    usual = np.sqrt(np.mean(np.square(fitted.drives[rows]), axis=0))
    columns = _columns(fitted, usual)
    white = filters.fit.apply(np.column_stack([columns, state.solution.residual]))
    fold = blocks_of(case.fit, fitted.soc, rows) % FOLDS
    fold = np.where(rows, fold, -1)
    size_volt, left_out = _chosen(white, fold, columns, state.solution.residual)
    coefficients = _ridge(_gram(white[rows]), size_volt)
    error = state.validation - _columns(judging, usual) @ coefficients
    before, after = state.validation_rmse_volt, rms(error[filters.validation_rows])
    excess = excess_volt(before, floor.validation_volt)
    learnable = before**2 - after**2 > HALF * excess**2
    nothing = excess <= case.gates.material_volt
    return Ceiling(rms(left_out[rows]), after, None if nothing else bool(learnable))


def reached(case, rounds, floor):
    """Rounds of a search up to the first name that falls short of what could be learned.

    A name that takes less than two thirds as much of the squared error off the records fitted as
    the best function without physics (`ceiling`, each block by a function fitted without it), and
    less than it off the records that judge, has the wrong course over SoC, current or temperature:
    it stands for something else. What is chosen after it, and together explains more, speaks for
    it.

    Parameters
    ----------
    case : case.Case. rounds : list of search.Round. floor : proof.Floor.

    Returns
    -------
    rounds : list of search.Round; the last one chose nothing where a name was refused.
    refused : search.Round that chose the name that is refused, or None.
    """
    last = rounds[-1].before
    kept = {effect.key for effect in last.effects}
    for step in rounds:
        if step.chosen is None or step.chosen.effect.key not in kept:
            continue
        if _short(step.before, last, ceiling(case, step.before, step.filters, floor)):
            return up_to(rounds, step), step
    return rounds, None


def _short(before, after, most):
    """Whether a model falls short of a Ceiling: by a third where fitted, and where it is judged."""
    fitted = before.rmse_volt**2 - after.rmse_volt**2
    judged = before.validation_rmse_volt**2 - after.validation_rmse_volt**2
    return fitted < SHORT * (before.rmse_volt**2 - most.fit_volt**2) and judged < (
        before.validation_rmse_volt**2 - most.validation_volt**2
    )


class _Side(NamedTuple):
    """SoC (n,) [1] and drives (n, k) of a stack: the function is linear in the latter."""

    soc: np.ndarray
    drives: np.ndarray


def _sides(case, state):
    """Both stacks; temperatures of the records that judge within those of the records fitted."""
    within = float(case.fit.celsius.min()), float(case.fit.celsius.max())
    values = (case.fit, state.solution.values), (case.validation, state.values)
    return [_side(case, stack, own, state.effects, within) for stack, own in values]


def _side(case, stack, values, effects, within):
    soc = base.fields_of(case.cell, stack, values, effects).soc
    current = stack.current_ampere
    lags = [base.relaxed(stack, current, second) for second in LAGS_SECOND]
    at_once = hats(current, KNOTS_OF_CURRENT * np.abs(case.fit.current_ampere).max())
    drives = np.column_stack([at_once, np.sign(current), *lags])
    if within[1] - within[0] < LEAST_KELVIN:
        return _Side(soc, drives)
    warmer = (np.clip(stack.celsius, *within) - REFERENCE_CELSIUS) / KELVIN
    return _Side(soc, np.concatenate([drives, drives * warmer[:, None]], axis=1))


def _columns(side, usual):
    """Columns (n, k) of the function: hats of the SoC times drives in their usual size."""
    shares = hats(side.soc, KNOTS)
    drives = side.drives / np.maximum(usual, 1e-12)
    return (shares[:, :, None] * drives[:, None, :]).reshape(len(shares), -1)


def _chosen(white, fold, columns, residual):
    """Size of the coefficients [V] that leaves least of what is left out, and that error (n,) [V].

    white : (n, k + 1) whitened columns and residual. fold : (n,) -1 where a row does not count.
    """
    parts = [_gram(white[fold == k]) for k in range(FOLDS)]
    whole = sum(parts)
    solved = np.stack([_ridges(whole - part) for part in parts])
    costs = [_cost(part, own) for part, own in zip(parts, solved, strict=True)]
    best = int(np.argmin(np.sum(costs, axis=0)))
    predicted = np.einsum("nk,nk->n", columns, solved[np.maximum(fold, 0), best])
    return SIZES_VOLT[best], residual - predicted


def _gram(white):
    return white.T @ white


def _ridges(gram):
    """Coefficients (s, k) for each size."""
    values, vectors = np.linalg.eigh(gram[:-1, :-1])
    moment = vectors.T @ gram[:-1, -1]
    sizes = np.square(SIZES_VOLT)[:, None]
    return (moment * sizes / (1.0 + np.maximum(values, 0.0) * sizes)) @ vectors.T


def _ridge(gram, size_volt):
    return _ridges(gram)[SIZES_VOLT.index(size_volt)]


def _cost(gram, coefficients):
    """Change of the chi-square of a part by the function, for each size (s,)."""
    quadratic = np.einsum("sk,kj,sj->s", coefficients, gram[:-1, :-1], coefficients)
    return quadratic - 2.0 * coefficients @ gram[:-1, -1]
