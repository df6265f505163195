"""Degradation modes over a life: lithium lost and active material lost, with their covariance."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from cellwright.health.electrodes.alignment import CORRELATED_SOC, align

MODES = ("lli", "lam_negative", "lam_positive")
DRAWS, SEED = 200, 16
CHANGE_OF_SLOPE = 0.5  # of a mode per capacity lost, from one check-up to the next
LEAST_LOSS = 0.02  # of the capacity, over which such a slope is taken
QUANTILE = 1.959964  # of the normal distribution, for 95 %


class Modes(NamedTuple):
    """Losses of each check-up against the first, as shares of what the fresh cell had.

    single, single_std : (k, 3) one by one, in the order of `MODES`. joint, joint_std : (k, 3)
    of all check-ups together: no active material comes back. known : (k, 3) bool, whether the data
    tell more than the capacity alone. possible : (k, 3) largest loss that the capacity allows.
    alignments : list of Alignment. likeness : correlation of the misfit between check-ups [1].
    """

    single: np.ndarray
    single_std: np.ndarray
    joint: np.ndarray
    joint_std: np.ndarray
    known: np.ndarray
    possible: np.ndarray
    alignments: list
    likeness: float


def degradation_modes(curves, pair, *, others=()):
    """Loss of lithium inventory and of either active material at each check-up of a life.

    1. Each curve is aligned with the half cells. 2. Electrode capacities are charge over change of
    lithiation; cyclable lithium is what both electrodes hold at soc 0; losses are the changes of
    the three since the first check-up. 3. Errors of the half cells that all check-ups share cancel
    in part: the covariance between check-ups follows from how alike their misfits are. What other
    half cells that fit give instead adds to it. 4. The joint estimate weighs all
    check-ups by that covariance; active material only falls, and a mode's slope over the capacity
    lost changes little from one check-up to the next.

    Parameters
    ----------
    curves : list of SlowCurve, two or more; the first stands for the fresh cell.
    pair : Pair of half cells. others : further pairs that fit.

    Returns
    -------
    modes : Modes.

    Source: definitions of Birkl et al., J. Power Sources 341 (2017) 373; losses of delithiated
    material, as there.
    """
    alignments = aligned(curves, pair)
    likeness = _likeness(alignments)
    losses, covariance = _losses(alignments, likeness)
    for other in others:
        apart = (_losses(aligned(curves, other), likeness)[0] - losses).ravel()
        covariance += np.outer(apart, apart) / len(others)
    spread = np.sqrt(np.diag(covariance)).reshape(losses.shape)
    capacity = np.array([curve.capacity_ampere_hour for curve in curves])
    fresh = quantities(alignments[0])[0]
    possible = 1 - capacity[:, None] / fresh[None, :]
    known = 2 * QUANTILE * spread < np.maximum(possible, 0.0)
    known[0] = True
    joint, joint_std = _joint(losses, covariance, 1 - capacity / capacity[0])
    return Modes(losses, spread, joint, joint_std, known, possible, alignments, likeness)


def aligned(curves, pair):
    """Alignment of each curve; a fit also begins where its neighbour's ended.

    Parameters
    ----------
    curves : list of SlowCurve in the order of age. pair : Pair.

    Returns
    -------
    alignments : list of Alignment.
    """
    forward, start = [], ()
    for curve in curves:
        forward.append(align(curve, pair, starts=start))
        start = (forward[-1].limits,)
    return forward


def quantities(alignment):
    """Cyclable lithium, negative and positive electrode's capacity (3,) [Ah], and derivatives.

    Parameters
    ----------
    alignment : Alignment.

    Returns
    -------
    values : (3,) [Ah]. gradient : (3, 6) over `limits`.
    """
    x0, x1, y0, y1 = alignment.limits[:4]
    charge = alignment.curve.capacity_ampere_hour
    negative, positive = charge / (x1 - x0), charge / (y0 - y1)
    of_negative = negative / (x1 - x0) * np.array([1.0, -1.0, 0.0, 0.0, 0.0, 0.0])
    of_positive = positive / (y0 - y1) * np.array([0.0, 0.0, -1.0, 1.0, 0.0, 0.0])
    of_lithium = x0 * of_negative + y0 * of_positive
    of_lithium[0] += negative
    of_lithium[2] += positive
    values = np.array([x0 * negative + y0 * positive, negative, positive])
    return values, np.array([of_lithium, of_negative, of_positive])


def _likeness(alignments):
    """Mean correlation of the misfits of neighbouring check-ups over SoC, 0 to 0.98."""
    grid = np.linspace(0.02, 0.98, 97)
    misfits = [np.interp(grid, a.curve.soc, a.residual_volt / a.error_volt) for a in alignments]
    pairs = pairwise(misfits)
    each = [np.mean(a * b) / np.sqrt(np.mean(a**2) * np.mean(b**2)) for a, b in pairs]
    return float(np.clip(np.mean(each), 0.0, 0.98)) if each else 0.0


def _losses(alignments, likeness):
    """Losses (k, 3) [1] against the first check-up, and their covariance (3 k, 3 k)."""
    values, gradients = zip(*(quantities(alignment) for alignment in alignments), strict=True)
    values, count = np.array(values), len(alignments)
    between = np.zeros((count, 3, count, 3))
    for i, first in enumerate(alignments):
        for j, second in enumerate(alignments):
            limits = first.covariance if i == j else likeness * _shared(first, second)
            between[i, :, j, :] = gradients[i] @ limits @ gradients[j].T
    between = between.reshape(3 * count, 3 * count)
    fresh = values[0]
    change = -np.kron(np.eye(count), np.diag(1 / fresh))
    change[:, :3] += np.vstack([np.diag(row / fresh**2) for row in values])
    return 1 - values / fresh, change @ between @ change.T


def _shared(first, second):
    """Covariance (6, 6) of the limits of two check-ups whose half cells err alike."""
    distance = np.abs(first.curve.soc[:, None] - second.curve.soc[None, :])
    errors = np.exp(-distance / CORRELATED_SOC)
    errors *= first.error_volt[:, None] * second.error_volt[None, :]
    return first.spread @ errors @ second.spread.T


def _joint(losses, covariance, capacity_loss):
    """Losses (k, 3) of all check-ups together, and their standard deviations from draws."""
    count = len(losses)
    if count < 2:
        return losses, np.zeros_like(losses)
    inner = covariance[3:, 3:]
    widths = np.sqrt(np.maximum(np.diag(inner), 1e-12))
    correlation = inner / np.outer(widths, widths) + 1e-9 * np.eye(len(inner))
    factor = np.linalg.cholesky(correlation)
    # Unknowns are the steps from one check-up to the next: of material they are not negative.
    steps_to_losses = np.kron(np.tril(np.ones((count - 1, count - 1))), np.eye(3))
    design = np.linalg.solve(factor, steps_to_losses / widths[:, None])
    smooth = _change_of_slope(capacity_loss)
    rows = np.vstack([design, smooth])
    low = np.tile([-np.inf, 0.0, 0.0], count - 1)
    noise = np.random.default_rng(SEED).standard_normal((DRAWS, len(inner)))
    measured = np.linalg.solve(factor, losses[1:].ravel() / widths)
    solved = [
        lsq_linear(rows, np.append(goal, np.zeros(len(smooth))), bounds=(low, np.inf)).x
        for goal in [measured, *(measured + noise)]
    ]
    joint = np.array(solved) @ steps_to_losses.T
    std = np.sqrt(np.mean((joint[1:] - joint[0]) ** 2, axis=0))
    zero = np.zeros((1, 3))
    return np.vstack([zero, joint[0].reshape(-1, 3)]), np.vstack([zero, std.reshape(-1, 3)])


def _change_of_slope(capacity_loss):
    """Rows that hold the slope of each mode over the capacity lost near that of the step before."""
    lost = np.maximum(np.abs(np.diff(capacity_loss)), LEAST_LOSS)
    slopes = np.diag(1 / lost)
    return np.kron(np.diff(slopes, axis=0) / CHANGE_OF_SLOPE, np.eye(3))
