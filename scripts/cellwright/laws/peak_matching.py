"""Peaks of dQ/dV matched across temperatures: kept, merged, split, lost or not to be resolved."""

from itertools import product
from typing import NamedTuple

import numpy as np

QUANTILE = 1.959964  # of the normal distribution, for 95 %
MOST_JOINED = 3
# What a step of the alignment costs, in units of a squared standard deviation: a further peak in
# a group, a peak without a partner; an area that disagrees costs no more than four deviations.
JOIN_COST, ALONE_COST, AREA_COST_MAX = 6.0, 12.0, 16.0
SHIFT_TOLERANCE_VOLT = 0.04
SHIFT_SCALE_VOLT = 0.1  # what a common shift may be without much cost
SHIFTS_VOLT = np.arange(-0.06, 0.261, 0.01)


class Match(NamedTuple):
    """One or several peaks of the reference and what became of them.

    reference_peaks, peaks : numbers from 1, joined by "+"; "" where there is none.
    fate : kept; changed (one peak stays, its area does not); merged; split; lost; cut (lost,
    but it may lie behind the end of the curve); new; unresolved (peaks stand where others stood,
    but their areas do not add up, or not all peaks of the other curve stand clear of their
    valleys, so that ripples may be among them).
    voltages are means weighted by area [V]; areas are sums [Ah], of the outer valleys only, with
    the standard deviation of their difference.
    """

    reference_peaks: str
    peaks: str
    fate: str
    reference_voltage_volt: float
    voltage_volt: float
    shift_volt: float
    reference_area_ampere_hour: float
    area_ampere_hour: float
    area_difference_ampere_hour: float
    area_difference_std_ampere_hour: float


# ASSUME: Between temperatures the peaks keep their order, and move by about as much.
def match_peaks(reference, other, *, end_volt=np.inf):
    """What became of the peaks of one curve in another, at another temperature.

    Both lists are aligned in order, by dynamic programming: one peak to one, up to three to one
    (merged) or one to three (split), or none. A step costs the squared difference of the areas
    over its variance, and that of the position once a shift common to all peaks is taken out
    (polarisation moves them all); the alignment and shift of least cost win. Groups are called
    merged or split only where the areas' sums agree within the 95 % interval.

    Parameters
    ----------
    reference, other : lists of `peak_scale.Peak`, from low voltage.
    end_volt : where the other curve ends [V].

    Returns
    -------
    list of Match, in order of voltage.

    Source: thesis 3.3 (figure 3.20: of four peaks at 20 °C the upper two become one at −20 °C).
    """
    found = [(*_aligned(reference, other, shift), shift) for shift in SHIFTS_VOLT]
    _, blocks, shift = min(found, key=lambda one: one[0])
    reach = end_volt - shift - SHIFT_TOLERANCE_VOLT
    found = [_match(reference, other, reach, *block) for block in blocks]
    if all(peak.clear for peak in other):
        return found
    return [one if one.fate == "kept" else one._replace(fate="unresolved") for one in found]


def _aligned(reference, other, shift):
    """Least cost at one common shift, and its blocks as (first, stop) in either list."""
    best = {(0, 0): (0.0, [])}
    places = product(range(len(reference) + 1), range(len(other) + 1))
    for i, j in list(places)[1:]:
        options = [
            (best[i - k, j - m][0] + cost, (i - k, i, j - m, j))
            for k, m, cost in _steps(reference[:i], other[:j], shift)
        ]
        cost, block = min(options)
        best[i, j] = (cost, [*best[block[0], block[2]][1], block])
    return best[len(reference), len(other)]


def _steps(reference, other, shift):
    """Every step that may end here: how many peaks it takes of either list, and its cost."""
    if reference:
        yield 1, 0, ALONE_COST
    if other:
        yield 0, 1, ALONE_COST
    joined = [(1, 1), *[(k, 1) for k in range(2, MOST_JOINED + 1)]]
    joined += [(1, k) for k in range(2, MOST_JOINED + 1)]
    for k, m in joined:
        if k <= len(reference) and m <= len(other):
            yield k, m, _cost(reference[-k:], other[-m:], shift)


def _cost(reference, other, shift):
    difference, std = _difference(reference, other)
    moved = (_centre(other) - _centre(reference) - shift) / SHIFT_TOLERANCE_VOLT
    area = min((difference / std) ** 2, AREA_COST_MAX)
    common = (shift / SHIFT_SCALE_VOLT) ** 2
    return area + moved**2 + common + JOIN_COST * (len(reference) + len(other) - 2)


def _area(peaks):
    return sum(peak.area_ampere_hour for peak in peaks)


def _centre(peaks):
    return sum(peak.voltage_volt * peak.area_ampere_hour for peak in peaks) / _area(peaks)


def _difference(reference, other):
    """Of the summed areas, and its standard deviation; inner valleys cancel."""
    edges = [
        value
        for peaks in (reference, other)
        for value in (peaks[0].left_std_ampere_hour, peaks[-1].right_std_ampere_hour)
    ]
    return _area(other) - _area(reference), max(float(np.linalg.norm(edges)), 1e-12)


def _match(reference, other, reach, first, stop, low, high):
    mine, theirs = reference[first:stop], other[low:high]
    names = ["+".join(str(k + 1) for k in range(*span)) for span in ((first, stop), (low, high))]
    place = [_centre(peaks) if peaks else np.nan for peaks in (mine, theirs)]
    area = [_area(peaks) if peaks else np.nan for peaks in (mine, theirs)]
    difference, std = _difference(mine, theirs) if mine and theirs else (np.nan, np.nan)
    fate = _fate(len(mine), len(theirs), abs(difference) <= QUANTILE * std)
    return Match(
        *names,
        "cut" if fate == "lost" and place[0] > reach else fate,
        *place,
        place[1] - place[0],
        *area,
        difference,
        std,
    )


def _fate(mine, theirs, agree):
    if not mine or not theirs:
        return "lost" if mine else "new"
    if mine == theirs:
        return "kept" if agree else "changed"
    if not agree:
        return "unresolved"
    return "merged" if mine > theirs else "split"
