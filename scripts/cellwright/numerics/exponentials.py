"""Separable least squares of exponentials: start on a grid, then Levenberg-Marquardt in ln tau.

The search is our own, not lmfit's: it needs the products of the columns only, and stops at a share
of the parameters' own standard deviations. lmfit asks for the residual of every row at each step.
"""

from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal


class Normal(NamedTuple):
    """Gram matrix of the columns (fixed, lags, slopes of the lags by ln tau), and the residual.

    gram : (c, c). moment : (c,) columns times residual. power : residual times itself
    [V²]. near : residual times the one before it [V²].
    """

    gram: np.ndarray
    moment: np.ndarray
    power: float
    near: float


GRID = {1: 24, 2: 14, 3: 8}  # time constants per pair
MOST_LAGS = 24  # of the grids of all kinds of bounds together


def best_of_grid(normal_at, fixed, tau_bounds, linear_bounds):
    """Best combination of time constants of a coarse grid [s], and its linear parameters.

    Parameters
    ----------
    normal_at : function (k,) time constants → Normal of the fixed columns and one per constant,
        with the residual taken at zero.
    fixed : number of columns that no time constant enters.
    tau_bounds, linear_bounds : as in `coarse_start`.
    """
    tau_bounds = np.asarray(tau_bounds).tolist()
    kinds = list(dict.fromkeys(map(tuple, tau_bounds)))
    size = max(2, min(GRID.get(len(tau_bounds), 6), MOST_LAGS // len(kinds)))
    # Logarithmic grids strictly within the bounds of each kind.
    shares = np.arange(1, size + 1) / (size + 1)
    tau = np.concatenate([low * (high / low) ** shares for low, high in kinds])
    combinations = _places(tuple(kinds.index(tuple(bounds)) for bounds in tau_bounds), size)
    if len(kinds) > 1 or kinds[0][0] == kinds[0][1]:
        ascending = np.sort(tau[combinations], axis=1)
        combinations = combinations[(ascending[:, 1:] > ascending[:, :-1]).all(axis=1)]
    if not len(combinations):
        raise Refusal("bounds hold two time constants at one value: their pairs are one")
    normal = normal_at(tau)
    linear, power = _solved(normal, fixed, combinations)
    inside = ((linear >= linear_bounds[0]) & (linear <= linear_bounds[1])).all(axis=1)
    best = int(np.argmin(np.where(inside, power, power + 1e6 * normal.power)))
    return tau[combinations[best]], linear[best]


@cache
def _places(kinds, size):
    """All combinations of grid indices (k, m), one grid for each kind of bounds."""
    combinations = np.array(
        list(product(*(range(kind * size, (kind + 1) * size) for kind in kinds)))
    )
    alike = np.equal(kinds[1:], kinds[:-1])
    return combinations[((combinations[:, 1:] > combinations[:, :-1]) | ~alike).all(axis=1)]


def _solved(normal, fixed, combinations):
    """Least squares of every combination: parameters (k, l) and squared residuals (k,) [V²]."""
    columns = np.empty((len(combinations), fixed + combinations.shape[1]), int)
    columns[:, :fixed], columns[:, fixed:] = np.arange(fixed), fixed + combinations
    scale = np.sqrt(normal.gram.diagonal())
    scale = np.where(scale > 0, scale, 1.0)
    ridged = normal.gram / (scale[:, None] * scale)
    ridged.flat[:: len(scale) + 1] += RANK
    gram = ridged[columns[:, :, None], columns[:, None, :]]
    moment = (normal.moment / scale)[columns]
    scaled = np.linalg.solve(gram, moment[:, :, None])[:, :, 0]
    return scaled / scale[columns], normal.power - (scaled * moment).sum(axis=1)


RANK = 1e-12  # smallest pivot of a Gram matrix of unit columns that is not rounding
# Stop when the next step is this share of the standard deviation of what it moves. That step is
# still made, without another look at the data, and leaves an error of about its square.
STOP_SHARE = 0.02
MOST_PASSES = 200  # passes over the data; a search that takes them all has not arrived
LARGEST_LOG_STEP = 2.0  # of one step, in ln tau


class Projected(NamedTuple):
    """Best linear parameters at given time constants, and the products there.

    log_tau : (m,) of [s]. linear : (l,). gram, moment : (l + m, l + m), (l + m,) products of the
    sensitivities (by each linear parameter, by each ln tau) with each other and the residual.
    power : sum of squared residuals [V²]. near : of residuals times the one before [V²].
    """

    log_tau: np.ndarray
    linear: np.ndarray
    gram: np.ndarray
    moment: np.ndarray
    power: float
    near: float


def projected(normal, log_tau, linear, lower, upper):
    """The linear parameters that fit best, within their bounds, and all products at them.

    The residual is linear in them, so that no second pass over the data is needed.

    Parameters
    ----------
    normal : `Normal` with the derivatives of the last m linear columns by ln tau behind.
    log_tau : (m,). linear : (l,) at which the residual of `normal` was taken.
    lower, upper : (l,) bounds of the linear parameters.

    Returns
    -------
    at : Projected.

    Raises
    ------
    Refusal : a column is zero, or no linear parameters lie within their bounds.
    """
    size, pairs = len(linear), len(log_tau)
    scale = np.sqrt(normal.gram.diagonal()[:size])
    if not (scale > 0).all():
        raise Refusal(f"{int((scale <= 0).sum())} parameter(s) are not excited at all")
    unit = normal.gram[:size, :size] / (scale[:, None] * scale)
    moment = normal.moment[:size] / scale
    move = _bounded(unit, moment, (lower - linear) * scale, (upper - linear) * scale) / scale
    best = _within(linear + move, lower, upper)
    power = normal.power - 2 * move @ normal.moment[:size] + move @ normal.gram[:size, :size] @ move
    moment = normal.moment - normal.gram[:, :size] @ move
    chain = np.ones(size + pairs)
    chain[size:] = best[size - pairs :]
    gram = normal.gram * (chain[:, None] * chain)
    return Projected(log_tau, best, gram, moment * chain, max(power, 0.0), normal.near)


def levenberg(normal_at, log_tau, linear, bounds, *, samples):
    """Least squares over time constants and linear parameters, by a damped search from a start.

    Parameters
    ----------
    normal_at : function (log_tau, linear) → Normal.
    log_tau, linear : (m,), (l,) where to start; the first residual is taken at the linear ones.
    bounds : (lower, upper) of log_tau, (lower, upper) of the linear parameters.
    samples : number of data, for the scatter that the stop refers to.

    Returns
    -------
    at, passes : Projected, and how often the data were passed over.

    Source: variable projection by G. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413, with
    the step of A. Ruhe, P. Wedin, SIAM Review 22 (1980) 318; damping: D. Marquardt, J. SIAM 11
    (1963) 431.
    """
    (tau_lower, tau_upper), linear_bounds = bounds
    at = projected(normal_at(log_tau, linear), log_tau, linear, *linear_bounds)
    damping, passes = 1e-3, 1
    while passes < MOST_PASSES and damping <= 1e9:
        move, gain = _step(at, damping, tau_lower, tau_upper, linear_bounds)
        next_log_tau = _within(at.log_tau + move[len(linear) :], tau_lower, tau_upper)
        next_linear = _within(at.linear + move[: len(linear)], *linear_bounds)
        if gain < 0.0:
            # A bound has turned the step uphill: a shorter one keeps more of its direction.
            damping *= 10
            continue
        if gain <= STOP_SHARE**2 * at.power / max(samples - len(at.gram), 1):
            # The first pass took its residuals at linear parameters that were only guessed.
            near = at.near if passes > 1 else normal_at(next_log_tau, next_linear).near
            power = max(at.power - gain, 0.0)
            return at._replace(
                log_tau=next_log_tau, linear=next_linear, power=power, near=near
            ), passes
        trial = projected(
            normal_at(next_log_tau, next_linear), next_log_tau, next_linear, *linear_bounds
        )
        passes += 1
        better = trial.power < at.power
        at = trial if better else at
        damping = max(damping / 30, 1e-9) if better else damping * 10
    return at, passes


def _step(at, damping, lower, upper, linear_bounds):
    """Damped step of all parameters, and the fall of the squared residual it predicts [V²]."""
    size, diagonal = len(at.linear), at.gram.diagonal()
    pull = at.moment[size:]
    held = ((at.log_tau <= lower) & (pull < 0)) | ((at.log_tau >= upper) & (pull > 0))
    inside = (at.linear > linear_bounds[0]) & (at.linear < linear_bounds[1])
    free = np.concatenate([inside, ~held & (lower < upper)]) & (diagonal > 0)
    move = np.zeros(len(diagonal))
    if free[size:].any():
        root = np.where(free, np.sqrt(diagonal), np.inf)
        unit = at.gram / (root[:, None] * root)
        # The linear part is projected, not damped: the trace of ridge only guards its rank. What
        # is not free has a row of zeros, and stays where it is.
        unit.flat[:: len(move) + 1] += np.where(np.arange(len(move)) < size, RANK, damping) + ~free
        move = np.linalg.solve(unit, at.moment / root) / root
    reach = _within(move[size:], -LARGEST_LOG_STEP, LARGEST_LOG_STEP)
    allowed = _within(reach, lower - at.log_tau, upper - at.log_tau)
    if (allowed != move[size:]).any():
        move[:size] = _following(at, free[:size], allowed)
    move[size:] = allowed
    return move, float(move @ at.moment)


def _following(at, free, log_tau_move):
    """Step of the linear parameters that belongs to a step of ln tau shortened by bounds."""
    size = len(at.linear)
    root = np.where(free, np.sqrt(at.gram.diagonal()[:size]), np.inf)
    unit = at.gram[:size, :size] / (root[:, None] * root)
    unit.flat[:: size + 1] += RANK + ~free
    return (
        np.linalg.solve(unit, (at.moment[:size] - at.gram[:size, size:] @ log_tau_move) / root)
        / root
    )


def _within(values, lower, upper):
    """Values limited to bounds; as np.clip, in a third of its time."""
    return np.minimum(np.maximum(values, lower), upper)


def _bounded(unit, moment, lower, upper):
    """Bounded least squares: the free solution if it lies within, else the best on the bounds."""
    ridged = unit.copy()
    ridged.flat[:: len(unit) + 1] += RANK
    free = np.linalg.solve(ridged, moment)
    if (free >= lower).all() and (free <= upper).all():
        return free
    best, least = None, np.inf
    ends = zip(np.isfinite(lower), np.isfinite(upper), strict=True)
    for face in product(*([0] + [1] * bool(low) + [2] * bool(high) for low, high in ends)):
        candidate = _on_face(ridged, moment, np.array(face), lower, upper)
        cost = candidate @ unit @ candidate - 2 * candidate @ moment
        inside = (candidate >= lower - 1e-12) & (candidate <= upper + 1e-12)
        if inside.all() and cost < least:
            best, least = candidate, cost
    if best is None:
        raise Refusal("no linear parameters lie within their bounds: the load tells them not apart")
    return best


def _on_face(unit, moment, face, lower, upper):
    """Solution with the parameters marked 1 held at their lower and 2 at their upper bound."""
    solution = np.where(face == 1, lower, np.where(face == 2, upper, 0.0))
    free = face == 0
    right = moment[free] - unit[np.ix_(free, ~free)] @ solution[~free]
    solution[free] = np.linalg.solve(unit[np.ix_(free, free)], right)
    return solution


# Relative standard deviation above which a parameter is not determined: its 95 % interval, 1.96
# times that wide, reaches down to zero.
UNDETERMINED = 0.51
