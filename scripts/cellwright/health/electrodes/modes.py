"""Degradation modes over a life: lithium lost and active material lost, with their covariance."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from cellwright.health.electrodes.alignment import CORRELATED_SOC, align, realigned
from cellwright.health.electrodes.half_cells import may_hold_silicon
from cellwright.numerics.statistics import NORMAL_95

# ASSUME: What a charge alone tells of a cell with silicon at its end of life (a fifth of the
# capacity lost) and a discharge does not: 5.36 points of lithium, 3.42 of the positive electrode,
# −14.38 of the silicon, which holds 22 % of that cell's negative electrode (docs/health-modes.md).
# Taken as the 95 % interval of either branch, in proportion to the capacity lost.
# M. Asheruddin et al., Phantom LAM and LLI, arXiv 2512.19773 (2025), Molicel P45B.
BRANCH_POINTS = {"lli": 0.0536, "lam_positive": 0.0342, "silicon": 0.1438}
BRANCH_SHARE = 0.22
END_OF_LIFE = 0.2


class Modes(NamedTuple):
    """Losses of each check-up against the first, as shares of what the fresh cell had.

    single, single_std : (k, 3) one by one, in the order of `names.MODES`. joint, joint_std : (k, 3)
    of all check-ups together: no active material comes back. known : (k, 3) bool, whether the data
    tell more than the capacity alone. possible : (k, 3) largest loss that the capacity allows.
    alignments : list of Alignment.
    doubts : (k, 3) standard deviation by where it is from: "data", and what of it or beside it
    hangs on the "window", the "half cells" and the "branch". left_out : (b, k, 3) change of
    `single` without each 5 % of SoC. materials, materials_std : (k, 2) loss of either material of a
    blended negative electrode, (k, 0) of one material. shares, shares_std : (k, blends) [1].
    """

    single: np.ndarray
    single_std: np.ndarray
    joint: np.ndarray
    joint_std: np.ndarray
    known: np.ndarray
    possible: np.ndarray
    alignments: list
    doubts: dict
    left_out: np.ndarray
    materials: np.ndarray
    materials_std: np.ndarray
    shares: np.ndarray
    shares_std: np.ndarray


def degradation_modes(curves, pair, *, others=()):
    """Loss of lithium inventory and of either active material at each check-up of a life.

    1. Each curve is aligned with the half cells. 2. Electrode capacities are charge over change of
    lithiation; cyclable lithium is what both electrodes hold at soc 0; losses are the changes of
    the three since the first check-up. 3. Errors of the half cells that all check-ups share cancel
    in part: the covariance between check-ups follows from how alike their misfits are. An interval
    is no narrower than what leaving out each 5 % of SoC in turn gives. What other half cells that
    fit give instead adds to it, and what the other branch may. 4. The joint estimate weighs all
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
    material, as there. Leaving out: the jackknife, B. Efron, The Jackknife, the Bootstrap and Other
    Resampling Plans (1982), over parts as long as the error is alike.
    """
    alignments = aligned(curves, pair)
    losses, covariance = _losses(alignments, pair, _likeness(alignments))
    doubts = {"data": np.sqrt(np.diag(covariance)).reshape(losses.shape)}
    parts = _left_out(alignments, pair)
    left_out = np.array([_losses_of(part, pair) for part in parts]) - losses
    doubts["window"] = _jackknife(left_out)
    # What a part of the curve decides alone is no better known than without it.
    wider = (np.maximum(doubts["window"] / np.maximum(doubts["data"], 1e-12), 1.0)).ravel()
    apart = _by_other_half_cells(curves, others, losses)
    doubts["half cells"] = np.sqrt(np.mean(apart**2, axis=0)).reshape(losses.shape)
    covariance = covariance * np.outer(wider, wider) + apart.T @ apart / len(apart)
    capacity = np.array([curve.capacity_ampere_hour for curve in curves])
    lost = 1 - capacity / capacity[0]
    doubts["branch"] = _of_the_branch(curves, pair, alignments, lost, losses.shape)
    spread = np.hypot(np.sqrt(np.diag(covariance)).reshape(losses.shape), doubts["branch"])
    fresh = _capacities(alignments[:1], pair)[0, :3]
    possible = 1 - capacity[:, None] / fresh[None, :]
    # An interval as wide as from nothing to all that the capacity allows tells nothing.
    known = 2 * NORMAL_95 * spread[:, :3] < np.maximum(possible, 0.0)
    known[0] = True
    modes = np.tile(np.arange(losses.shape[1]) < 3, len(losses))
    joint, joint_std = _joint(losses[:, :3], covariance[np.ix_(modes, modes)], lost)
    return Modes(
        single=losses[:, :3],
        single_std=spread[:, :3],
        joint=joint,
        joint_std=np.hypot(joint_std, doubts["branch"][:, :3]),
        known=known,
        possible=possible,
        alignments=alignments,
        doubts={source: std[:, :3] for source, std in doubts.items()},
        left_out=left_out[:, :, :3],
        materials=losses[:, 3:],
        materials_std=spread[:, 3:],
        shares=_shares(alignments),
        shares_std=np.maximum(
            np.sqrt([np.diag(one.covariance)[6:] for one in alignments]),
            _jackknife(np.array([_shares(part) for part in parts]) - _shares(alignments)),
        ),
    )


def aligned(curves, pair):
    """Alignment of each SlowCurve, by age; a fit also begins where the one before it ended."""
    found = []
    for curve in curves:
        found.append(align(curve, pair, starts=[one.limits for one in found[-1:]]))
    return found


def quantities(alignment, pair):
    """Cyclable lithium and what the electrodes can hold (m,) [Ah], and derivatives.

    Returns
    -------
    values : (m,) [Ah]: lithium, negative, positive electrode; of a blended negative one also its
        first and its second material. gradient : (m, p) over `limits`.
    """
    x0, x1, y0, y1 = alignment.limits[:4]
    charge = alignment.curve.capacity_ampere_hour
    negative, positive = charge / (x1 - x0), charge / (y0 - y1)
    none = np.zeros(len(alignment.limits))
    of_negative, of_positive, of_lithium = none.copy(), none.copy(), none.copy()
    of_negative[:2] = negative / (x1 - x0) * np.array([1.0, -1.0])
    of_positive[2:4] = positive / (y0 - y1) * np.array([-1.0, 1.0])
    of_lithium[[0, 2]] = negative, positive
    of_lithium += x0 * of_negative + y0 * of_positive
    values = [x0 * negative + y0 * positive, negative, positive]
    gradient = [of_lithium, of_negative, of_positive]
    if pair.negative.parts is not None:
        share, of_share = alignment.limits[6], none.copy()
        of_share[6] = negative
        values += [(1 - share) * negative, share * negative]
        gradient += [(1 - share) * of_negative - of_share, share * of_negative + of_share]
    return np.array(values), np.array(gradient)


def _capacities(alignments, pair):
    """Lithium and materials (k, m) [Ah]; the fresh ones no less than can be divided by."""
    values = np.array([quantities(alignment, pair)[0] for alignment in alignments])
    # Of less than a thousandth of the electrode there is nothing to lose.
    values[0, 3:] = np.maximum(values[0, 3:], 1e-3 * values[0, 1])
    return values


def _losses_of(alignments, pair):
    """Losses (k, m) [1] against the first check-up."""
    values = _capacities(alignments, pair)
    return 1 - values / values[0]


def _shares(alignments):
    """Shares of the blends (k, blends) [1]."""
    return np.array([one.limits[6:] for one in alignments])


def _by_other_half_cells(curves, others, losses):
    """What other half cells give instead: changes of the losses (n, m k), 0 of a blend's parts."""
    # Of a blend's parts others say nothing: their second material is another one.
    apart = np.zeros((max(len(others), 1), *losses.shape))
    for k, other in enumerate(others):
        apart[k, :, :3] = _losses_of(aligned(curves, other), other)[:, :3] - losses[:, :3]
    return apart.reshape(len(apart), -1)


def _left_out(alignments, pair):
    """Alignments of all check-ups without each part of SoC in which half cells err alike (b, k)."""
    edges = np.linspace(0.0, 1.0, round(1 / CORRELATED_SOC) + 1)
    parts = [np.digitize(alignment.curve.soc, edges[1:-1]) for alignment in alignments]
    return [
        [realigned(one, pair, own != part) for one, own in zip(alignments, parts, strict=True)]
        for part in range(len(edges) - 1)
    ]


def _jackknife(left_out):
    """Standard deviation from changes (b, …) as each of b parts is left out."""
    return np.sqrt((len(left_out) - 1) / len(left_out) * np.sum(left_out**2, axis=0))


def _of_the_branch(curves, pair, alignments, lost, shape):
    """Standard deviation (k, m) of what the other branch would tell; none where both are there."""
    doubt = np.zeros(shape)
    if curves[0].branches not in ("charge", "discharge") or not may_hold_silicon(pair.negative):
        return doubt
    blended, count = pair.negative.parts is not None, len(curves)
    share = np.array([one.limits[6] if blended else BRANCH_SHARE for one in alignments])
    lithium, positive, silicon = (np.full(count, points) for points in BRANCH_POINTS.values())
    columns = [lithium, silicon * share, positive, *([0 * silicon, silicon] if blended else [])]
    return np.stack(columns, 1) * (np.abs(lost) / END_OF_LIFE / NORMAL_95)[:, None]


def _likeness(alignments):
    """Mean correlation of the misfits of neighbouring check-ups over SoC, 0 to 0.98."""
    grid = np.linspace(0.02, 0.98, 97)
    misfits = [np.interp(grid, a.curve.soc, a.residual_volt / a.error_volt) for a in alignments]
    pairs = pairwise(misfits)
    each = [np.mean(a * b) / np.sqrt(np.mean(a**2) * np.mean(b**2)) for a, b in pairs]
    # Errors wholly alike would leave none in a difference, which nobody can promise.
    return float(np.clip(np.mean(each), 0.0, 0.98)) if each else 0.0


def _losses(alignments, pair, likeness):
    """Losses (k, m) [1] against the first check-up, and their covariance (m k, m k)."""
    values, gradients = _capacities(alignments, pair), [quantities(a, pair)[1] for a in alignments]
    count, size = values.shape
    between = np.zeros((count, size, count, size))
    for i, first in enumerate(alignments):
        for j, second in enumerate(alignments):
            limits = first.covariance if i == j else likeness * _shared(first, second)
            between[i, :, j, :] = gradients[i] @ limits @ gradients[j].T
    between = between.reshape(size * count, size * count)
    fresh = values[0]
    change = -np.kron(np.eye(count), np.diag(1 / fresh))
    change[:, :size] += np.vstack([np.diag(row / fresh**2) for row in values])
    return 1 - values / fresh, change @ between @ change.T


def _shared(first, second):
    """Covariance (p, p) of the limits of two check-ups whose half cells err alike."""
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
    # A little more on the diagonal: two check-ups of one curve must not be singular.
    correlation = inner / np.outer(widths, widths) + 1e-9 * np.eye(len(inner))
    factor = np.linalg.cholesky(correlation)
    # Unknowns are the steps from one check-up to the next: of material they are not negative.
    steps_to_losses = np.kron(np.tril(np.ones((count - 1, count - 1))), np.eye(3))
    design = np.linalg.solve(factor, steps_to_losses / widths[:, None])
    # ASSUME: The slope of a mode over the capacity lost changes by some 0.5 from one check-up to
    # the next; over less than 2 % of the capacity it is not known better than over 2 %.
    lost = np.maximum(np.abs(np.diff(capacity_loss)), 0.02)
    smooth = np.kron(np.diff(np.diag(1 / lost), axis=0) / 0.5, np.eye(3))
    rows = np.vstack([design, smooth])
    low = np.tile([-np.inf, 0.0, 0.0], count - 1)
    noise = np.random.default_rng(16).standard_normal((200, len(inner)))
    measured = np.linalg.solve(factor, losses[1:].ravel() / widths)
    solved = [
        lsq_linear(rows, np.append(goal, np.zeros(len(smooth))), bounds=(low, np.inf)).x
        for goal in [measured, *(measured + noise)]
    ]
    joint = np.array(solved) @ steps_to_losses.T
    std = np.sqrt(np.mean((joint[1:] - joint[0]) ** 2, axis=0))
    zero = np.zeros((1, 3))
    return np.vstack([zero, joint[0].reshape(-1, 3)]), np.vstack([zero, std.reshape(-1, 3)])
