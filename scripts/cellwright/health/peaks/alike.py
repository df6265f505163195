"""The same peaks of dQ/dV across the cells of one type."""

import numpy as np

from cellwright.health.peaks.alignment import paired

# ASSUME: From one check-up to the next, and from cell to cell, a peak moves by about 20 mV about
# what all peaks of the charge move together (60 mV), and its height changes by a factor of two.
OWN_VOLT, COMMON_VOLT, LOG_HEIGHT = 0.02, 0.06, 0.7
ALONE_COST = 4.0  # of a peak without a partner, squared standard deviations


def named_alike(charges, tracked=()):
    """Charges whose peaks have names alike: one name is one peak in every cell of the type.

    The cell with the most peaks gives the names. In a tracked cell the earliest place and height
    of each of its peaks is matched with those of that cell. The charges of any other cell follow
    by age; each is matched with the last known places in its cell. Matching keeps the order of
    voltage and takes out a shift common to all peaks (resistance moves them together). A peak
    without a partner is left out.

    Parameters
    ----------
    charges : list of PeakCharge of one type, rate and temperature.
    tracked : cells in which an identity already is one peak through the life; of all others the
        identities do not count.

    Returns
    -------
    list of PeakCharge, in the same order.
    """
    by_cell = {}
    for _, place in sorted((charge.cycle, place) for place, charge in enumerate(charges)):
        by_cell.setdefault(charges[place].cell, []).append(place)
    profiles = {
        cell: _profile([charges[place] for place in places], cell in tracked)
        for cell, places in by_cell.items()
    }
    # The most peaks: what the template lacks gets no name in any cell.
    template = profiles[max(profiles, key=lambda cell: (len(profiles[cell]), cell in tracked))]
    named = {}
    for cell, places in by_cell.items():
        of_cell = [charges[place] for place in places]
        if cell in tracked:
            found = _renamed(of_cell, profiles[cell], template)
        else:
            found = _named(of_cell, template)
        named |= zip(places, found, strict=True)
    return [named[place] for place in range(len(charges))]


def _profile(charges, tracked):
    """Earliest place of each peak of a cell, from low voltage; untracked: of its fullest charge."""
    if not tracked:
        fullest = max(charges, key=lambda charge: len(charge.peaks))
        return {str(k): _place(peak) for k, peak in enumerate(fullest.peaks.values(), 1)}
    first = {}
    for charge in charges:
        for name, peak in charge.peaks.items():
            first.setdefault(name, _place(peak))
    return dict(sorted(first.items(), key=lambda item: item[1]))


def _renamed(charges, profile, template):
    """Charges of a tracked cell with the template's names."""
    pairs, _ = matched(list(template.values()), list(profile.values()))
    names = {list(profile)[j]: list(template)[i] for i, j in pairs}
    return [
        charge._replace(peaks={names[n]: p for n, p in charge.peaks.items() if n in names})
        for charge in charges
    ]


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
    if not known or not found:
        return [], 0.0
    known_at, found_at = (np.array(places, float) for places in (known, found))
    apart, taller = np.moveaxis(found_at[None, :] - known_at[:, None], 2, 0)
    tolerances = OWN_VOLT, COMMON_VOLT, ALONE_COST
    return paired(apart, (taller / LOG_HEIGHT) ** 2, *tolerances)[1:]
