"""Two ordered lists of peaks aligned: a common shift, own motions, and what has no partner."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.ordered import ordered_pairs

ALONE_COST = 8.0  # of a peak without a partner, in units of -2 log likelihood
SHIFTS_VOLT = np.arange(-0.15, 0.1501, 0.0025)


class Aligned(NamedTuple):
    """Pairs (number in the first list, in the second), the common shift [V], margins.

    margins : by number in the second list, by how much the best alignment without that pair is
    worse [-2 log likelihood]. known : how many of the first list were seen in the charge before.
    upset : why no pair can be trusted, "" where they can.
    """

    pairs: tuple
    shift: float
    margins: dict
    known: int = 0
    upset: str = ""


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
    # Heights and areas change by factors, not by amounts.
    ratio = np.log(second[None, :, 1:] / first[:, None, 1:]) / log_factor
    other = ratio[..., 0] ** 2 + 0.5 * ratio[..., 1] ** 2
    tolerances = motion_volt, shift_std_volt, ALONE_COST
    cost, pairs, shift = paired(apart, other, *tolerances)
    margins = {}
    for pair in pairs:
        without = other.copy()
        without[pair] = np.inf
        margins[pair[1]] = paired(apart, without, *tolerances)[0] - cost
    return Aligned(tuple(pairs), shift, margins)


def paired(apart, other, motion_volt, shift_std_volt, alone_cost):
    """Pairs of two ordered lists and the shift common to them, of least cost.

    Parameters
    ----------
    apart : (n, m) voltage of each of the second list over each of the first [V].
    other : (n, m) further cost of each pair, in units of -2 log likelihood.
    motion_volt, shift_std_volt : standard deviations of an own motion, of the common shift [V].
    alone_cost : of each member without a partner.

    Returns
    -------
    cost : the least. pairs : list of (place in the first, in the second). shift_volt : mean motion
    of the pairs, drawn to zero by its own tolerance; 0 without pairs.
    """
    shifts = SHIFTS_VOLT[np.abs(SHIFTS_VOLT) <= 3 * shift_std_volt + 1e-9]
    options = (motion_volt, shift_std_volt, alone_cost)
    cost, pairs = min(
        (_paired_at(shift, apart, other, *options) for shift in shifts), key=lambda found: found[0]
    )
    # One pair alone cannot tell common from own motion: drawn to zero by its prior.
    weight = (motion_volt / shift_std_volt) ** 2
    return cost, pairs, float(np.sum([apart[pair] for pair in pairs]) / (len(pairs) + weight))


def _paired_at(shift, apart, other, motion, shift_std, alone_cost):
    """Least cost of an ordered pairing at one common shift, and its pairs."""
    cost, pairs = ordered_pairs(((apart - shift) / motion) ** 2 + other, alone_cost)
    return cost + (shift / shift_std) ** 2, pairs
