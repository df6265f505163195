"""Whether one model predicts better than another: the difference of its scores, block by block.

A score is a number for each block of data that was left out, the larger the better: a logarithmic
predictive density, or minus the logarithm of a mean square error. Blocks, not rows, are the unit,
for errors of a model last for hours. What differs from block to block says how sure a difference
is.

Source: leave-one-out predictive densities and the standard error of their differences: A. Vehtari,
A. Gelman, J. Gabry, Stat. Comput. 27 (2017) 1413. Blocks, where neighbours err alike: D. Roberts et
al., Ecography 40 (2017) 913; the standard error of a sum of alike differences: W. Newey, K. West,
Econometrica 55 (1987) 703. Ranks: F. Wilcoxon, Biometrics Bull. 1 (1945) 80.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

LAG = 2  # blocks beside each other whose differences are alike


class Difference(NamedTuple):
    """How much better one model predicts than another.

    total : sum over the blocks. z : mean over its standard error. rank_z : the same of the ranks of
    the blocks' differences, which no single block decides.
    """

    total: float
    z: float
    rank_z: float


def compare(better, worse, *, record=None, share=None):
    """Difference of the scores of two models over blocks.

    Parameters
    ----------
    better, worse : (b,) scores of the same blocks.
    record : (b,) of each block; those of one record stand side by side, and neighbours err alike.
        None: each block errs by itself.
    share : (b,) how far each counts in the mean; None: all alike.

    Returns
    -------
    difference : Difference; z is 0 where fewer than three blocks tell no scatter between them, and
        infinite where all differ by the same.
    """
    each = np.asarray(better, float) - np.asarray(worse, float)
    count, total = len(each), float(np.sum(each))
    if count < 3:
        return Difference(total, 0.0, 0.0)
    share = np.ones(count) if share is None else np.asarray(share, float)
    share = share / share.sum()
    mean = share @ each
    off = each - mean
    variance = share @ off**2
    if variance == 0.0:
        return Difference(total, float(np.copysign(np.inf, mean)) if mean else 0.0, _rank_z(each))
    for lag in range(1, LAG + 1) if record is not None else ():
        alike = (share[lag:] * off[lag:] * off[:-lag])[record[lag:] == record[:-lag]]
        variance += 2.0 * (1.0 - lag / (LAG + 1.0)) * np.sum(alike)
    if variance <= 0.0:
        return Difference(total, 0.0, 0.0)
    # The mean was taken from the same blocks: n − 1 of them are free.
    error = np.sqrt(variance * count / (count - 1) * np.sum(share**2))
    return Difference(total, float(mean / error), _rank_z(each))


def _rank_z(each):
    """Normal deviate of Wilcoxon's signed ranks, by their exact distribution if there were none.

    Of few blocks the normal approximation falls short: all of ten cannot pass three by it.
    """
    moved = each[each != 0.0]
    rank = np.empty(len(moved), int)
    rank[np.argsort(np.abs(moved), kind="stable")] = np.arange(1, len(moved) + 1)
    positive, whole = int(rank[moved > 0].sum()), int(rank.sum())
    if 2 * positive == whole:
        return 0.0
    sign = 1.0 if 2 * positive > whole else -1.0
    return sign * float(_deviates(len(moved))[min(positive, whole - positive)])


@cache
def _deviates(count):
    """Normal deviate of each sum of ranks, the smaller of both signs, of so many differences."""
    from scipy.special import ndtri  # here: other steps of the method need none of it

    ways = np.ones(1)
    for rank in range(1, count + 1):
        ways = np.append(ways, np.zeros(rank)) + np.append(np.zeros(rank), ways)
    return -ndtri(np.minimum(np.cumsum(ways / 2.0**count), 0.5))
