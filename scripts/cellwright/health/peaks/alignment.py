"""Two ordered lists of peaks aligned: a common shift, own motions, and what has no partner."""

from typing import NamedTuple

import numpy as np

ALONE_COST = 8.0  # of a peak without a partner, in units of -2 log likelihood
SHIFTS_VOLT = np.arange(-0.15, 0.1501, 0.0025)


class Aligned(NamedTuple):
    """Pairs (number in the first list, in the second), the common shift [V], margins.

    margins : by number in the second list, by how much the best alignment without that pair is
    worse [-2 log likelihood]. known : how many of the first list were seen in the charge before.
    """

    pairs: tuple
    shift: float
    margins: dict
    known: int = 0


def align(known, peaks, motion_volt, log_factor, shift_std_volt):
    """Peaks of a charge aligned with those known before it.

    Among all common shifts and all pairings that keep the order, the one of least cost: squared
    own motion over `motion_volt`, squared logarithms of the ratios of height and of area over
    `log_factor` (area at half weight: a valley that fills moves the area of both its peaks),
    squared common shift over its standard deviation, and a fixed cost for each that stays alone.

    Parameters
    ----------
    known, peaks : lists of (voltage [V], height [Ah/V], area [Ah]), from low voltage.
    motion_volt : [V]. log_factor : [1]. shift_std_volt : [V].

    Returns
    -------
    aligned : Aligned.
    """
    if not known or not peaks:
        return Aligned((), 0.0, {})
    first, second = (np.array(rows, float) for rows in (known, peaks))
    apart = second[None, :, 0] - first[:, None, 0]
    ratio = np.log(second[None, :, 1:] / first[:, None, 1:]) / log_factor
    other = ratio[..., 0] ** 2 + 0.5 * ratio[..., 1] ** 2
    shifts = SHIFTS_VOLT[np.abs(SHIFTS_VOLT) <= 3 * shift_std_volt + 1e-9]
    found = [_paired(apart, other, shift, motion_volt, shift_std_volt) for shift in shifts]
    best = min(range(len(shifts)), key=lambda k: found[k][0])
    pairs, cost = found[best][1], found[best][0]
    # The shift itself is the mean motion of the pairs, drawn to zero by its own tolerance.
    moved = [apart[pair] for pair in pairs]
    weight = (motion_volt / shift_std_volt) ** 2
    shift = float(np.sum(moved) / (len(moved) + weight))
    margins = {}
    for pair in pairs:
        without = other.copy()
        without[pair] = np.inf
        rest = min(_paired(apart, without, s, motion_volt, shift_std_volt)[0] for s in shifts)
        margins[pair[1]] = rest - cost
    return Aligned(tuple(pairs), shift, margins)


def _paired(apart, other, shift, motion, shift_std):
    """Least cost of an ordered pairing at one common shift, and its pairs."""
    cost = ((apart - shift) / motion) ** 2 + other
    rows, columns = cost.shape
    best = np.zeros((rows + 1, columns + 1))
    best[:, 0] = ALONE_COST * np.arange(rows + 1)
    best[0] = ALONE_COST * np.arange(columns + 1)
    for i in range(rows):
        for j in range(columns):
            alone = ALONE_COST + min(best[i, j + 1], best[i + 1, j])
            best[i + 1, j + 1] = min(alone, best[i, j] + cost[i, j])
    return best[-1, -1] + (shift / shift_std) ** 2, _traced(best, cost)


def _traced(best, cost):
    """Pairs of the cheapest way through a table of least costs, from the end."""
    pairs, (i, j) = [], cost.shape
    while i and j:
        if best[i, j] == best[i - 1, j - 1] + cost[i - 1, j - 1]:
            pairs.append((i - 1, j - 1))
            i, j = i - 1, j - 1
        elif best[i, j] == ALONE_COST + best[i - 1, j]:
            i -= 1
        else:
            j -= 1
    return pairs[::-1]
