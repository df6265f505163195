"""Linear least squares of an identification: priors and solution of the columns over SoC.

For given time constants, charge constant of the hysteresis and scale of the kinetics, the voltage
is V = U(z') + Σ over knots of (shift, R0, R_j, M) × column (`columns`), where z' is the counted SoC
stretched by a factor. Each quantity is a course over the same SoC knots, straight between them.
"""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.linear import solve
from cellwright.numerics.statistics import correlation_factor
from cellwright.records.counting import SOC_STD
from cellwright.refusal import Refusal

FIRST_FACTOR = 1.0 / 30.0  # weight of the data before the residuals have told it
SCALES = 2  # numbers of the SoC's scale: what is missing at full, and the stretch

# Standard deviations of a row's error, whose variances add: at rest [V], a share of the
# overpotential, and of the counted SoC (`SOC_STD`), which counts where the OCV is steep.
FLOOR_VOLT, RELATIVE = 0.003, 0.03

# Standard deviations of the parameters before the data. Without priors a knot without data could
# take any value, and a fit of a drive's blocks would say nothing of the SoC between them. The
# priors are weak and physical: resistances change smoothly with SoC, faster near empty; an OCV
# table is right to some tens of millivolts, and its SoC to a few per cent, whatever the capacity
# was counted to: cells rest there. They count only where the data say little.
SHIFT_VOLT = 0.02  # of the OCV table
SHIFT_WALK_VOLT = 0.05  # of the change of that shift over the whole of SoC
SCALE_STD = (0.02, 0.04)  # of what a full charge leaves out, and of the stretch [1]
WALK = 1.0  # of a resistance over the whole of SoC, relative to its size
EMPTY = 0.1  # SoC near empty within which things change as much as over all the rest


class System(NamedTuple):
    """A weighted linear problem: k shifts, a change of the SoC's scale (2), then k columns a name.

    prior : (p, p) precision. held : (p,) what the priors count and the columns do not: the scale
    about which the problem holds, so that the prior is of the scale and not of its last change.
    most : (p,) upper bounds, None without any. gram, moment : (p, p), (p,) products of the matrix
    with itself and with the target.
    """

    matrix: np.ndarray
    target: np.ndarray
    weight: np.ndarray
    prior: np.ndarray
    held: np.ndarray
    names: tuple
    knots: np.ndarray
    most: np.ndarray | None
    gram: np.ndarray
    moment: np.ndarray


class Solution(NamedTuple):
    """Solution of a weighted linear problem.

    values : dict name → (k,), with "shift". scale : (2,) change of the SoC's scale [1].
    vector : (p,) of all parameters.
    residual_volt : (n,) measured minus modelled. factor : weight of a row's square: one over the
    residuals' variance and correlation. solved_with : the one that the vector is for.
    cost : factor·Σ residual² + priors' penalty.
    above_zero : dict of weighting, "first" or "found" → dict name → (k,)
    bool, which values are above zero.
    """

    values: dict
    scale: np.ndarray
    vector: np.ndarray
    residual_volt: np.ndarray
    factor: float
    solved_with: float
    cost: float
    above_zero: dict


def system_of(columns, knots):
    """The weighted problem of a set of columns, with the priors' precision.

    Parameters
    ----------
    columns : Columns.
    knots : (k,) SoC [1].

    Returns
    -------
    system : System.

    Raises
    ------
    Refusal : fewer rows than parameters at one SoC, or a load that excites nothing.
    """
    names = tuple(name for name, _ in columns.resistances)
    if len(columns.target_volt) < 3 * (len(names) + 2):
        raise Refusal(f"{len(columns.target_volt)} rows cannot carry {len(names) + 2} parameters")
    parts = (FLOOR_VOLT, RELATIVE * columns.target_volt, SOC_STD * columns.slope_volt)
    weight = 1.0 / np.sqrt(sum(np.square(part) for part in parts))
    matrix, target = _weighted(columns, weight, len(knots)), columns.target_volt * weight
    gram, moment = matrix.T @ matrix, matrix.T @ target
    sizes = _typical_sizes(names, gram, moment, len(knots))
    if columns.most_volt is not None and "m" in names:  # the last, and no larger than allowed
        sizes[-1] = min(sizes[-1], np.median(columns.most_volt))
    precision = _precision(knots, sizes)
    held = np.zeros(len(precision))
    held[len(knots) : len(knots) + SCALES] = columns.held_scale
    most = _upper_bounds(columns.most_volt, names, len(precision))
    return System(matrix, target, weight, precision, held, names, knots, most, gram, moment)


def _weighted(columns, weight, knots):
    """Matrix (n, p) of all columns times the weight of each row, column by column in memory."""
    blocks = [columns.shift, columns.scale, *(c for _, c in columns.resistances)]
    transposed = np.empty((SCALES + knots * (len(blocks) - 1), len(weight)))
    ends = np.cumsum([block.shape[1] for block in blocks])
    for block, end in zip(blocks, ends, strict=True):
        np.multiply(block.T, weight, out=transposed[end - block.shape[1] : end])
    return transposed.T


def _upper_bounds(most_volt, names, size):
    """Upper bounds of all parameters: only the hysteresis, "m", has one, and it comes last."""
    if most_volt is None or "m" not in names:
        return None
    return np.append(np.full(size - len(most_volt), np.inf), most_volt)


def _typical_sizes(names, gram, moment, knots):
    """Size of each resistance if constant over SoC [ohm], the scale of the smoothness prior."""
    # A constant course adds its columns: sums over blocks of the products, without the SoC's scale.
    starts = np.append([0, knots], knots + SCALES + knots * np.arange(len(names)))
    rows = np.delete(np.arange(len(starts)), 1)
    reduced = np.add.reduceat(np.add.reduceat(gram, starts), starts, axis=1)[np.ix_(rows, rows)]
    target = np.add.reduceat(moment, starts)[rows]
    norm = np.diag(reduced)
    silent = [name for name, size in zip(names, norm[1:], strict=True) if not size > 0]
    if silent:
        raise Refusal(f"nothing in the data excites {', '.join(silent)}: the current never flows")
    reduced = reduced + np.diag(1e-6 * norm)  # two columns may say the same
    sizes = solve(reduced, target, 1)[1:]
    ohmic = np.array([name != "m" for name in names])
    if not sizes[ohmic].any():
        raise Refusal("no resistance above zero: the voltage moves against the current's sign")
    least = np.where(ohmic, 0.05 * sizes[ohmic].max(), 0.005)
    return np.maximum(sizes, least)


def _precision(knots, sizes):
    """Inverse covariance of all parameters before the data."""
    count, smooth = len(knots), _smoothness(knots)
    size = count + SCALES + count * len(sizes)
    precision = np.zeros((size, size))
    precision[:count, :count] = shift_precision(knots)
    scale = slice(count, count + SCALES)
    precision[scale, scale] = np.diag(np.square(SCALE_STD) ** -1.0)
    for number, typical in enumerate(sizes):
        block = slice(count + SCALES + number * count, count + SCALES + (number + 1) * count)
        precision[block, block] = smooth / (WALK * typical) ** 2
        # Ten times its typical size: only so that a course without any data has a middle.
        precision[block, block] += np.eye(count) / ((10.0 * typical) ** 2 * count)
    return precision


def _smoothness(knots):
    """Precision (k, k) of a course whose change over the whole of SoC is of size one."""
    near_empty = np.diff(np.log(np.maximum(knots, 0.0) + 0.02))  # counting may end below zero
    path = np.diff(knots) + EMPTY * near_empty
    change = np.diff(np.eye(len(knots)), axis=0)
    return change.T @ (change / path[:, None])


def shift_precision(knots):
    """Inverse covariance of the shift of the OCV table at knots before the data (k, k) [1/V²].

    Parameters
    ----------
    knots : (k,) SoC [1].
    """
    return _smoothness(knots) / SHIFT_WALK_VOLT**2 + np.eye(len(knots)) / SHIFT_VOLT**2


def solved(system, *, factor=None, expected=None, scale_free=True):
    """Solution of a system, weighted by the residuals and their correlation.

    Parameters
    ----------
    system : System.
    factor : weight of the data; None: found here, in two rounds. Costs compare only at one factor.
    expected : dict of weighting → dict name → (k,) bool, which values are expected above zero,
        "first" at the weight that a search begins with, "found" at the one that it ends with;
        changes the time alone.
    scale_free : False: the SoC's scale stays where it is held.

    Returns
    -------
    solution : Solution.
    """
    expected, above_zero, weight = expected or {}, {}, factor or FIRST_FACTOR
    weightings = ["first", "found"] if factor is None else ["found"]
    for weighting in weightings:
        vector = minimum(
            system, weight, expected=expected.get(weighting, {}), scale_free=scale_free
        )
        above_zero[weighting] = named(system, vector > 0)
        effective = _effective(system, vector, scale_free)
        residual, solved_with = system.target - system.matrix @ effective, weight
        if factor is None:
            weight = weight_of(residual)
    total = vector + system.held
    cost = weight * (residual @ residual) + total @ system.prior @ total
    values, volt = named(system, vector), residual / system.weight
    return Solution(
        values, values["scale"], vector, volt, weight, solved_with, float(cost), above_zero
    )


def weight_of(residual):
    """Weight of the square of a row: one over the residuals' variance and correlation.

    A model's errors are alike from row to row: each counts as fewer than one independent datum.

    Parameters
    ----------
    residual : (n,) of weighted rows [1].
    """
    return 1.0 / (max(np.mean(residual**2), 1e-12) * max(correlation_factor(residual), 1.0))


def minimum(system, factor, *, expected, scale_free=True):
    """Parameters (p,) of the lowest cost at a weight of the data, from the products alone.

    Parameters
    ----------
    system : System. factor : weight of the data.
    expected : dict name → (k,) bool, which values are expected above zero.
    scale_free : False: the SoC's scale stays where it is held.
    """
    gram, moment, count = system.gram, system.moment, len(system.knots)
    if not scale_free:
        scale = slice(count, count + SCALES)
        gram, moment = gram.copy(), moment.copy()
        gram[scale] = gram[:, scale] = moment[scale] = 0.0
    normal, right = factor * gram + system.prior, factor * moment - pull_of(system)
    free = _free(system, expected)
    return solve(normal, right, count + SCALES, system.most, free=free)


def cost_at(system, vector, factor):
    """Cost of parameters at a weight of the data, from the products alone (see `Solution`).

    Parameters
    ----------
    system : System. vector : (p,). factor : weight of the data.
    """
    total, square = vector + system.held, system.target @ system.target
    square += vector @ (system.gram @ vector - 2.0 * system.moment)
    return float(factor * square + total @ system.prior @ total)


def _effective(system, vector, scale_free):
    """The parameters that the columns are multiplied with: a scale that is held does not change."""
    count, effective = len(system.knots), vector.copy()
    effective[count : count + SCALES] *= scale_free
    return effective


def _free(system, expected):
    """Which parameters are expected off their bound (p,)."""
    signed, every = np.ones(len(system.knots) + SCALES, bool), np.ones(len(system.knots), bool)
    return np.concatenate([signed, *(expected.get(name, every) for name in system.names)])


def pull_of(system):
    """Gradient of the priors at the held scale (p,)."""
    return system.prior @ system.held


def named(system, vector):
    """Parts of a parameter vector, name → (k,).

    Parameters
    ----------
    system : System.
    vector : (p,).
    """
    count = len(system.knots)
    ends = np.cumsum([count, SCALES] + [count] * len(system.names))[:-1]
    return dict(zip(("shift", "scale", *system.names), np.split(vector, ends), strict=True))


def covariance_of(system, solution):
    """Covariance of all parameters (p, p); NaN for those at a bound, zero or the largest allowed.

    Parameters
    ----------
    system : System. solution : Solution, of a free SoC scale.
    """
    signed, vector = len(system.knots) + SCALES, solution.vector
    precision = solution.factor * system.gram + system.prior
    free = np.append(np.ones(signed, bool), vector[signed:] > 0)
    free &= vector < (np.inf if system.most is None else system.most)
    covariance = np.full(precision.shape, np.nan)
    covariance[np.ix_(free, free)] = np.linalg.inv(precision[np.ix_(free, free)])
    return covariance


def held_out(system, solution, fold):
    """Residuals [V] of rows predicted from the other folds, (n,).

    Parameters
    ----------
    system, solution : System, Solution of all rows.
    fold : (n,) number of the fold of each row, 0, 1, …; −1: never left out.
    """
    signed, pull = len(system.knots) + SCALES, pull_of(system)
    free = _free(system, solution.above_zero["found"])
    residual_volt, factor = solution.residual_volt.copy(), solution.factor
    for number in range(fold.max() + 1):
        fold_rows = fold == number
        matrix, target = system.matrix[fold_rows], system.target[fold_rows]
        rest = factor * (system.gram - matrix.T @ matrix) + system.prior
        moment = factor * (system.moment - matrix.T @ target) - pull
        vector = solve(rest, moment, signed, system.most, free=free)
        residual_volt[fold_rows] = (target - matrix @ vector) / system.weight[fold_rows]
    return residual_volt
