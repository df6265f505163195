"""Separable least squares: Levenberg–Marquardt in ln tau, all linear parameters projected out."""

from itertools import product
from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal

RANK = 1e-12  # smallest pivot of a Gram matrix of unit columns that still says something
# Stop when the next step is this share of the standard deviation of what it moves. That step is
# still made, without another look at the data, and leaves an error of about its square.
NEAR = 0.02
MOST = 200  # passes over the data; a search that takes them all has not arrived
FARTHEST = 2.0  # of one step, in ln tau


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
    normal : `normal.Normal` with the derivatives of the last m linear columns by ln tau behind.
    log_tau : (m,). linear : (l,) at which the residual of `normal` was taken.
    lower, upper : (l,) bounds of the linear parameters.

    Returns
    -------
    at : Projected.

    Raises
    ------
    Refusal : the columns do not tell the linear parameters apart, whatever the bounds.
    """
    size, pairs = len(linear), len(log_tau)
    scale = np.sqrt(normal.gram.diagonal()[:size])
    if not (scale > 0).all():
        raise Refusal(f"{int((scale <= 0).sum())} parameter(s) are not excited at all")
    unit = normal.gram[:size, :size] / (scale[:, None] * scale)
    moment = normal.moment[:size] / scale
    move = _bounded(unit, moment, (lower - linear) * scale, (upper - linear) * scale) / scale
    found = _within(linear + move, lower, upper)
    power = normal.power - 2 * move @ normal.moment[:size] + move @ normal.gram[:size, :size] @ move
    moment = normal.moment - normal.gram[:, :size] @ move
    chain = np.concatenate([np.ones(size), found[size - pairs :]])
    gram = normal.gram * (chain[:, None] * chain)
    return Projected(log_tau, found, gram, moment * chain, max(power, 0.0), normal.near)


def levenberg(normal_at, log_tau, linear, bounds, *, samples):
    """Minimise over the time constants, from given ones.

    Parameters
    ----------
    normal_at : function (log_tau, linear) → Normal.
    log_tau, linear : (m,), (l,) where to start; the linear ones only tell where the residual is
        taken first.
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
    while passes < MOST:
        move, gain = _step(at, damping, tau_lower, tau_upper, linear_bounds)
        there = at.log_tau + move[len(linear) :]
        guess = _within(at.linear + move[: len(linear)], *linear_bounds)
        if gain <= NEAR**2 * at.power / max(samples - len(at.gram), 1):
            # The first pass took its residuals at linear parameters that were only guessed.
            near = at.near if passes > 1 else normal_at(there, guess).near
            power = max(at.power - gain, 0.0)
            return at._replace(log_tau=there, linear=guess, power=power, near=near), passes
        trial = projected(normal_at(there, guess), there, guess, *linear_bounds)
        passes += 1
        better = trial.power < at.power
        at = trial if better else at
        damping = max(damping / 30, 1e-9) if better else damping * 10
        if damping > 1e9:
            break
    return at, passes


def _step(at, damping, lower, upper, linear_bounds):
    """Damped step of all parameters, and by how much it should lower the power [V²]."""
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
    reach = _within(move[size:], -FARTHEST, FARTHEST)
    move[size:] = _within(at.log_tau + reach, lower, upper) - at.log_tau
    return move, float(move @ at.moment)


def _within(values, lower, upper):
    """As np.clip, in a third of its time."""
    return np.minimum(np.maximum(values, lower), upper)


def _bounded(unit, moment, lower, upper):
    """Least squares in scaled moves within bounds: free if that is inside, else every face."""
    ridge = RANK * np.eye(len(unit))
    free = np.linalg.solve(unit + ridge, moment)
    if (free >= lower).all() and (free <= upper).all():
        return free
    best, least = None, np.inf
    ends = zip(np.isfinite(lower), np.isfinite(upper), strict=True)
    for face in product(*([0] + [1] * bool(low) + [2] * bool(high) for low, high in ends)):
        found = _on_face(unit + ridge, moment, np.array(face), lower, upper)
        cost = found @ unit @ found - 2 * found @ moment
        inside = (found >= lower - 1e-12) & (found <= upper + 1e-12)
        if inside.all() and cost < least:
            best, least = found, cost
    if best is None:
        raise Refusal("no linear parameters lie within their bounds: the load tells them not apart")
    return best


def _on_face(unit, moment, face, lower, upper):
    """Solution with parameters marked 1 at their lower, 2 at their upper bound."""
    found = np.where(face == 1, lower, np.where(face == 2, upper, 0.0))
    free = face == 0
    right = moment[free] - unit[np.ix_(free, ~free)] @ found[~free]
    found[free] = np.linalg.solve(unit[np.ix_(free, free)], right)
    return found
