"""The same peaks of dQ/dV across the cells of one type."""

from itertools import combinations, product

import numpy as np

# ASSUME: From one check-up to the next, and from cell to cell, a peak moves by about 20 mV about
# what all peaks of the charge move together (60 mV), and its height changes by a factor of two.
OWN_VOLT, COMMON_VOLT, LOG_HEIGHT = 0.02, 0.06, 0.7
ALONE_COST = 4.0  # of a peak without a partner, squared standard deviations


def named_alike(charges):
    """Charges whose peaks are numbered alike: `1` is one peak in every cell of the type.

    The charge with the most peaks, the freshest of those, gives the numbers. Each cell's charges
    follow by age; a charge is matched with the last known place and height of each peak in its
    cell, in order of voltage, after a shift common to all peaks of the charge is taken out
    (resistance moves them together). A peak without a partner is left out.

    Parameters
    ----------
    charges : list of PeakCharge of one type, rate and temperature; their identities do not count.

    Returns
    -------
    list of PeakCharge, in the same order.
    """
    fullest = max(charges, key=lambda charge: (len(charge.peaks), -charge.cycle))
    template = {str(number): _place(peak) for number, peak in enumerate(fullest.peaks.values(), 1)}
    named = {}
    for cell in dict.fromkeys(charge.cell for charge in charges):
        by_age = sorted((c.cycle, place) for place, c in enumerate(charges) if c.cell == cell)
        places = [place for _, place in by_age]
        named |= zip(places, _named([charges[place] for place in places], template), strict=True)
    return [named[place] for place in range(len(charges))]


def _named(charges, known):
    """Charges of one cell by age; `known`: place of each peak before the first of them."""
    named = []
    for charge in charges:
        peaks = list(charge.peaks.values())
        pairs, shift = matched(list(known.values()), [_place(peak) for peak in peaks])
        names = list(known)
        found = {names[i]: peaks[j] for i, j in pairs}
        known = {
            name: _place(found[name]) if name in found else (volt + shift, height)
            for name, (volt, height) in known.items()
        }
        named.append(charge._replace(peaks=found))
    return named


def _place(peak):
    return peak.voltage_volt, float(np.log(peak.height_ampere_hour_per_volt))


def matched(known, found):
    """Pairs of peaks that are the same, in order of voltage, and the shift common to them [V].

    Parameters
    ----------
    known, found : lists of (voltage [V], logarithm of the height).

    Returns
    -------
    pairs : list of (place in known, place in found). shift_volt : 0 without pairs.
    """
    best = (ALONE_COST * (len(known) + len(found)), [], 0.0)
    known_at, found_at = (np.array(places, float).reshape(-1, 2) for places in (known, found))
    for first, second in _choices(len(known), len(found)):
        moved = found_at[second] - known_at[first]
        shift = moved[:, 0].sum() / (len(first) + (OWN_VOLT / COMMON_VOLT) ** 2)
        cost = ALONE_COST * (len(known) + len(found) - 2 * len(first))
        cost += (shift / COMMON_VOLT) ** 2
        cost += (((moved - [shift, 0]) / [OWN_VOLT, LOG_HEIGHT]) ** 2).sum()
        best = min(best, (cost, list(zip(first, second, strict=True)), shift))
    return best[1], float(best[2])


def _choices(known, found):
    """Every choice of as many of one list as of the other, both in order, as lists of places."""
    for count in range(1, min(known, found) + 1):
        pairs = product(combinations(range(known), count), combinations(range(found), count))
        yield from ([list(part) for part in pair] for pair in pairs)
