"""Solving for courses over SoC: least squares with stated priors, and what was not fitted.

Without priors a knot that no datum touches would take any value, and a fit of a drive's blocks
would say nothing of the SoC between them. The priors are weak and physical: resistances change
smoothly with SoC, faster near empty; an OCV table is right to some tens of millivolts; capacity
is known to two per cent. They matter only where the data are silent.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.numerics.linear import solve
from cellwright.numerics.statistics import correlation_factor
from cellwright.refusal import Refusal

SCALES = 2  # numbers of the SoC's scale: what is missing at full, and the stretch


class Noise(NamedTuple):
    """How far the model is trusted: variances of a row add.

    floor_volt : at rest [V]. relative : of the overpotential [1]. soc : of the counted SoC [1],
    which counts where the OCV is steep.
    """

    floor_volt: float = 0.003
    relative: float = 0.03
    soc: float = 0.003


class Prior(NamedTuple):
    """What is believed before the data; standard deviations.

    shift_volt : of the OCV table. shift_walk_volt : of its change over the whole of SoC.
    walk : relative change of a resistance over the whole of SoC [1].
    missing, stretch : of what a full charge leaves out, and of the capacity [1].
    empty : SoC near empty within which things change as much as over all the rest [1].
    """

    shift_volt: float = 0.02
    shift_walk_volt: float = 0.05
    walk: float = 1.0
    missing: float = 0.02
    stretch: float = 0.04
    empty: float = 0.1


class System(NamedTuple):
    """A weighted linear problem: k shifts, a change of the SoC's scale (2), then k columns a name.

    prior : (p, p) precision. held : (p,) what the priors count and the columns do not: the scale
    about which the problem holds, so that the prior is of the scale and not of its last change.
    most : (p,) upper bounds, None without any.
    """

    matrix: np.ndarray
    target: np.ndarray
    weight: np.ndarray
    prior: np.ndarray
    held: np.ndarray
    names: tuple
    knots: np.ndarray
    most: np.ndarray | None = None


class Solution(NamedTuple):
    """What solves a system.

    values, stds : dict name → (k,), with "shift". scale : (2,) change of the SoC's scale [1].
    vector, covariance : (p,), (p, p) of all parameters, NaN where a bound holds.
    residual_volt : (n,) measured minus modelled. factor : weight of a row's square: one over the
    residuals' variance and correlation. cost : factor·Σ residual² + priors' penalty.
    """

    values: dict
    stds: dict
    scale: np.ndarray
    vector: np.ndarray
    covariance: np.ndarray
    residual_volt: np.ndarray
    factor: float
    cost: float


def system_of(columns, knots, *, noise=None, prior=None):
    """The weighted problem of a set of columns, with the priors' precision.

    Parameters
    ----------
    columns : design.Columns.
    knots : (k,) SoC [1].
    noise, prior : Noise, Prior; None: the defaults.

    Returns
    -------
    system : System.

    Raises
    ------
    Refusal : fewer rows than parameters at one SoC, or a load that excites nothing.
    """
    noise, prior = noise or Noise(), prior or Prior()
    names = tuple(name for name, _ in columns.resistances)
    if len(columns.target_volt) < 3 * (len(names) + 2):
        raise Refusal(f"{len(columns.target_volt)} rows cannot carry {len(names) + 2} parameters")
    scales = (
        noise.floor_volt,
        noise.relative * columns.target_volt,
        noise.soc * columns.slope_volt,
    )
    weight = 1.0 / np.sqrt(sum(np.square(scale) for scale in scales))
    blocks = [columns.shift, columns.scale, *(c for _, c in columns.resistances)]
    matrix = np.hstack(blocks) * weight[:, None]
    target = columns.target_volt * weight
    sizes = _typical(columns, matrix, target, len(knots))
    precision = _precision(knots, sizes, prior)
    held = np.zeros(len(precision))
    held[len(knots) : len(knots) + SCALES] = columns.held_scale
    most = _most(columns.most_volt, names, len(precision))
    return System(matrix, target, weight, precision, held, names, knots, most)


def _most(most_volt, names, size):
    """Upper bounds of all parameters: only the hysteresis, "m", has one, and it comes last."""
    if most_volt is None or "m" not in names:
        return None
    return np.append(np.full(size - len(most_volt), np.inf), most_volt)


def _typical(columns, matrix, target, knots):
    """Size of each resistance if it did not depend on SoC: what "smooth" is measured by."""
    count = len(columns.resistances)
    ends = SCALES + knots + knots * np.arange(count + 1)
    groups = [matrix[:, :knots].sum(axis=1)]
    groups += [matrix[:, a:b].sum(axis=1) for a, b in pairwise(ends)]
    reduced = np.column_stack(groups)
    norm = np.linalg.norm(reduced, axis=0)
    names = [name for name, _ in columns.resistances]
    silent = [name for name, size in zip(names, norm[1:], strict=True) if not size > 0]
    if silent:
        raise Refusal(f"nothing in the data excites {', '.join(silent)}: the current never flows")
    gram = reduced.T @ reduced
    gram += np.diag(1e-6 * np.diag(gram))  # two columns may say the same
    found = solve(gram, reduced.T @ target, 1)[1:]
    ohmic = np.array([name != "m" for name in names])
    if not found[ohmic].any():
        raise Refusal("no resistance above zero: the voltage moves against the current's sign")
    least = np.where(ohmic, 0.05 * found[ohmic].max(), 0.005)
    return np.maximum(found, least)


def _precision(knots, sizes, prior):
    """Inverse covariance of all parameters before the data."""
    count = len(knots)
    near_empty = np.diff(np.log(np.maximum(knots, 0.0) + 0.02))  # counting may end below zero
    path = np.diff(knots) + prior.empty * near_empty
    change = np.diff(np.eye(count), axis=0)
    smooth = change.T @ (change / path[:, None])
    size = count + SCALES + count * len(sizes)
    found = np.zeros((size, size))
    found[:count, :count] = smooth / prior.shift_walk_volt**2
    found[:count, :count] += np.eye(count) / prior.shift_volt**2
    found[count, count] = 1.0 / prior.missing**2
    found[count + 1, count + 1] = 1.0 / prior.stretch**2
    for number, typical in enumerate(sizes):
        at = slice(count + SCALES + number * count, count + SCALES + (number + 1) * count)
        found[at, at] = smooth / (prior.walk * typical) ** 2
        found[at, at] += np.eye(count) / ((10.0 * typical) ** 2 * count)
    return found


def solved(system, *, factor=None, rounds=2):
    """Solve a system; the data's weight follows from the residuals and their correlation.

    Parameters
    ----------
    system : System.
    factor : weight of the data; None: found here. Costs compare only at one factor.
    rounds : how often it is taken anew where it is found.

    Returns
    -------
    solution : Solution.
    """
    gram, moment = system.matrix.T @ system.matrix, system.matrix.T @ system.target
    signed, found, pull = len(system.knots) + SCALES, factor or 1.0 / 30.0, pull_of(system)
    for _ in range(rounds if factor is None else 1):
        normal = found * gram + system.prior
        vector = solve(normal, found * moment - pull, signed, system.most)
        residual = system.target - system.matrix @ vector
        if factor is None:
            spread = max(np.mean(residual**2), 1e-12) * max(correlation_factor(residual), 1.0)
            found = 1.0 / spread
    covariance = _covariance(found * gram + system.prior, vector, signed, system.most)
    whole = vector + system.held
    cost = found * (residual @ residual) + whole @ system.prior @ whole
    values, stds = named(system, vector), named(system, np.sqrt(np.diag(covariance)))
    volt = residual / system.weight
    return Solution(values, stds, values["scale"], vector, covariance, volt, found, float(cost))


def pull_of(system):
    """By what the priors draw a solution of a system back from what is held already, (p,)."""
    return system.prior @ system.held


def named(system, vector):
    """Parts of a parameter vector by name.

    Parameters
    ----------
    system : System.
    vector : (p,).
    """
    count = len(system.knots)
    ends = np.cumsum([count, SCALES] + [count] * len(system.names))[:-1]
    return dict(zip(("shift", "scale", *system.names), np.split(vector, ends), strict=True))


def _covariance(precision, vector, signed, most):
    """Of the free parameters; NaN for those at their bound, zero or the largest allowed."""
    free = np.append(np.ones(signed, bool), vector[signed:] > 0)
    free &= vector < (np.inf if most is None else most)
    found = np.full(precision.shape, np.nan)
    found[np.ix_(free, free)] = np.linalg.inv(precision[np.ix_(free, free)])
    return found


def held_out(system, solution, fold):
    """Residuals [V] of rows predicted from the other folds, (n,).

    Parameters
    ----------
    system, solution : System, Solution of all rows.
    fold : (n,) number of the fold of each row, 0, 1, …; −1: never left out.
    """
    gram, moment = system.matrix.T @ system.matrix, system.matrix.T @ system.target
    signed, pull = len(system.knots) + SCALES, pull_of(system)
    found, factor = solution.residual_volt.copy(), solution.factor
    for number in range(fold.max() + 1):
        out = fold == number
        matrix, target = system.matrix[out], system.target[out]
        rest = factor * (gram - matrix.T @ matrix) + system.prior
        vector = solve(rest, factor * (moment - matrix.T @ target) - pull, signed, system.most)
        found[out] = (target - matrix @ vector) / system.weight[out]
    return found
