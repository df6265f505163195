"""How coarsely the current of a record was read, and what charge that leaves open."""

import numpy as np

from cellwright.numerics.noise import least_digit_ampere, read_levels
from cellwright.records.agreement import FINEST_SHARE
from cellwright.records.conditions import off_round

SET_LEVELS = 4  # that one test sets its current to; more are those of a reading
MOST_REPAIRED = 3  # rows of a record at least that cleaning may have filled in
STILL_ROWS = 10  # at one level: noise as large as a digit seldom stays so long
WRITTEN_DIGITS = np.array([1.0, 2.0, 2.5, 5.0])
WRITTEN_SHARE = 1e-5  # of the largest current: no tester holds one so well that it never shows
ONE_LEVEL_SHARE = 5e-7  # of the largest: levels that differ by less are one, written as float32


# ASSUME: A current that stands still at a few levels with all their digits was set to them.
def coarsest_digit_ampere(current_ampere, rated_ampere_hour):
    """Largest least digit [A] that a record's readings leave room for; 0 where they tell none.

    A current that scatters shows its digit, as does one that falls while the voltage is held: its
    levels are whole multiples of it. One that stands still at few levels shows none where these
    have six digits or more, as a tester's set currents do: nothing in the record tells. But of
    levels that are written with few decimals, and are no round ones, the last one is the digit.

    current_ampere : (n,) [A]. rated_ampere_hour : for the rates that are round [Ah].
    """
    read = np.append(current_ampere, [0.0, 0.0])
    levels, largest = read_levels(read)[0], float(np.nanmax(np.abs(read)))
    if not largest:
        return 0.0
    if digit := least_digit_ampere(current_ampere):
        return 0.0 if _read_finer(read, levels, digit) else digit
    loads = np.unique(np.abs(levels[levels != 0.0]))
    same = ONE_LEVEL_SHARE * largest
    if len(loads) > SET_LEVELS:
        gaps = np.diff(levels)
        digit = float(gaps[gaps > same].min(initial=np.inf))
        return digit if _are_multiples(loads, digit) else 0.0
    decimals = 10.0 ** -np.arange(-np.floor(np.log10(largest)), 9)
    # 1.2999 is no 1.3: what a number is off a written one, it shows by a further decimal.
    last = next((one for one in decimals if _are_multiples(loads, one, same / one)), 0.0)
    if last < WRITTEN_SHARE * largest:
        return 0.0
    sizes = [off_round(size / rated_ampere_hour, size) for size in loads]
    return 0.0 if max(sizes) <= FINEST_SHARE else float(last)


def _read_finer(current, levels, digit):
    """Whether a current is read at levels between the multiples of a digit of its repeated ones.

    In a hold each level is read but once, a few by chance twice: those between are then more. Few
    of them are repairs of cleaning.
    """
    found, rows = np.unique(current[np.isfinite(current)], return_counts=True)
    once = found[~np.isin(found, levels)]
    between = np.abs(once / digit - np.rint(once / digit)) > 1e-3
    by_chance = rows[np.isin(found, levels) & (rows < STILL_ROWS)].sum()
    return np.count_nonzero(between) > max(by_chance, MOST_REPAIRED)


def _are_multiples(levels, digit, off=1e-3):
    """Whether levels are whole multiples of a digit, within a share `off` of it, 1e-3 at most."""
    return np.allclose(levels / digit, np.rint(levels / digit), 0.0, min(off, 1e-3))


def unsure_of_digit(half, test_time_second, current_ampere, digit_ampere):
    """Standard deviation [Ah] of what a half cycle moves by the least digit of its current.

    While the reading stays at one level its error is one, anywhere within a digit (a uniform
    distribution); that of another level is another. A number that is written with few decimals may
    have been cut instead of rounded: it lacks up to a whole digit, half of one at each level that
    it stays at. What flips between two from row to row an instrument has rounded.

    half : HalfCycle. test_time_second, current_ampere : (n,) [s], [A]. digit_ampere : [A].
    """
    rows = slice(half.first_row, half.last_row + 1)
    time, current = test_time_second[rows], current_ampere[rows]
    first = np.flatnonzero(np.diff(current, prepend=np.inf))
    hours = np.diff(np.append(time[first], time[-1])) / 3600.0
    loaded = current[first] != 0.0
    by_chance = np.linalg.norm(hours[loaded]) / np.sqrt(12.0)
    still = np.diff(np.append(first, len(current))) >= STILL_ROWS
    cut = may_be_cut(digit_ampere) * hours[loaded & still].sum() / 2.0
    return float(digit_ampere * np.hypot(by_chance, cut))


# ASSUME: A converter's step is no round number, and its readings are calibrated to their middle.
def may_be_cut(digit_ampere):
    """Whether a digit [A] is one of numbers as they are written, which may have been cut."""
    if not 0 < digit_ampere < np.inf:
        return False
    leading = digit_ampere / 10.0 ** np.floor(np.log10(digit_ampere) + 1e-6)
    return bool(np.any(np.abs(leading / WRITTEN_DIGITS - 1) <= 1e-3))
