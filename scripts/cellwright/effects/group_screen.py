"""Candidates in a group: every effect in every branch, screened within the bounds of all else."""

from typing import NamedTuple

import numpy as np

from cellwright.effects.group_case import predicted, rows_of
from cellwright.effects.group_fit import priors, within
from cellwright.effects.group_model import Placed
from cellwright.effects.problem import Free

# The part of a branch's declared tolerance whose place an effect takes.
TAKES = {
    "branch_wire_resistance": ("wire",),
    "branch_initial_soc": ("soc",),
    "branch_capacity": ("capacity",),
    "branch_cell_resistance": ("log_r0", "log_slow"),
    "branch_temperature": ("celsius",),
    "branch_current_offset": ("offset",),
    "branch_current_gain": ("gain",),
}


class GroupScore(NamedTuple):
    """A candidate at the minimum of the quadratic within all bounds.

    column : (m,) change of the prediction per unit, whitened. fall : of the cost. values : dict of
    all free parameters there. information : of its size, nuisances projected out, bounds aside.
    """

    placed: Placed
    column: np.ndarray
    fall: float
    values: dict
    information: float


def free_of(placed):
    """The free parameter of an effect in a branch."""
    p = placed.effect.parameters[0]
    return Free(placed.name, p.step, p.neutral, np.inf, p.lower, p.upper)


def with_effect(free, placed):
    """Free parameters with those of an effect, which takes the place of its branch's tolerance."""
    names = {f"{placed.branch}.{name}" for name in TAKES[placed.effect.id]}
    held = [f._replace(lower=0.0, upper=0.0) if f.name in names else f for f in free]
    return (*held, free_of(placed))


def group_columns(case, placed, solution, library):
    """Change of the prediction per unit of every effect in every branch: list of (Placed, (m,))."""
    wanted = [e for e in library.values() if case.sensors or e.stage != "current"]
    places = [Placed(effect, branch) for effect in wanted for branch in range(len(case.cells))]
    found = []
    for one in places:
        step = one.effect.parameters[0].step
        values = solution.values | {one.name: step}
        moved = predicted(case, case.fit, case.fit_soc, values, (*placed, one))
        column = (moved - solution.prediction) / step
        if one not in placed and np.any(column):
            found.append((one, column))
    return found


def all_in(case, solution, tried, filters):
    """Residual with every effect let in, by ridge regression, bounds aside."""
    residual = rows_of(case, case.fit) - solution.prediction
    many = np.stack([column for _, column in tried], axis=1)
    both = np.concatenate([solution.chart.columns, many], axis=1)
    white = filters.apply(both)
    precision = white.T @ white
    nuisances = len(solution.chart.precision)
    size = np.diag(1e-6 * np.diag(precision) + 1e-12)
    size[:nuisances, :nuisances] += solution.chart.precision - precision[:nuisances, :nuisances]
    return residual - both @ np.linalg.solve(precision + size, white.T @ filters.apply(residual))


def group_scores(problem, solution, tried):
    """Every candidate by the quadratic about the healthy optimum, all bounds held."""
    prior, pull = priors(problem)
    chart, names = solution.chart, [f.name for f in problem.free]
    at = np.array([solution.values[name] for name in names])
    residual = problem.whiten(problem.measured - solution.prediction)
    bent = chart.precision - prior
    moment = chart.white.T @ residual + pull + bent @ at
    rest = within(chart.precision, moment, *_limits(problem.free), at)
    without = 0.5 * rest @ chart.precision @ rest - moment @ rest
    found = []
    for placed, column in tried:
        own = problem.whiten(column)
        mixed = chart.white.T @ own
        precision = np.block([[chart.precision, mixed[:, None]], [mixed[None], own @ own]])
        everything = np.append(moment, own @ residual + mixed @ at)
        limits = _limits(with_effect(problem.free, placed))
        x = within(precision, everything, *limits, np.append(rest, 0.0))
        fall = 2 * (without - (0.5 * x @ precision @ x - everything @ x))
        values = dict(zip((*names, placed.name), x.tolist(), strict=True))
        left = own @ own - mixed @ np.linalg.solve(chart.precision, mixed)
        found.append(GroupScore(placed, own, float(fall), values, float(left)))
    return sorted(found, key=lambda s: -s.fall)


def _limits(free):
    return np.array([f.lower for f in free]), np.array([f.upper for f in free])
