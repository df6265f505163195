"""What stands beside a record's current and voltage: its dates, its two thermometers, its pauses.

Each function says at which rows, or whether, they contradict each other; none changes a number.
"""

from itertools import pairwise

import numpy as np

from cellwright.formats.physics import SAME_CLOCK, date_slopes
from cellwright.series.rest_current import near_zero_ampere, stretches

PACED_PARTS, PACED_ROWS = 20, 20  # of a record, and at least of each, whose pace is compared
PACED_SHARE = 0.02  # within which nine of ten intervals of a part are one; a drift is more
DRIFTED_SHARE = 0.3  # testers that log by voltage change their pace by more
LEAST_DATED_SECOND = 2000.0  # tenths of which dates of whole seconds tell to a per cent
WARM_KELVIN = 2.0  # by which a load has to warm a thermometer before two are compared
FOLLOWS_SHARE = 0.25  # of what its chamber moves by in a load, which any cell follows
WARMING_SECOND = 600.0  # of a load: within it a cell follows its chamber, or warms it
BLOCK_SECOND = 300.0  # over which air that swings is averaged
PAUSE_ROWS = 3  # of a pause that is looked at: in a longer one a rest tells more
LOAD_ROWS = 4  # before a pause, by which it is known how the load moves the voltage
SAME_LOAD_SHARE = 0.02
# Wherever a record is looked at from row to row (`doubts` too):
FLOOR_VOLT = 0.010  # contacts, digits and temperature move the voltage by less
SUDDEN = 5.0  # times the largest step of the rows around: no curve bends so


def against_dates(time: np.ndarray, unix: np.ndarray) -> bool:
    """Whether a clock (n,) [s] runs faster or slower than the dates (n,) [s] beside it, by 1 %.

    In the median over tenths of the record: not where either was set anew or stood for a while.
    """
    known = np.isfinite(unix)
    time, unix = time[known], unix[known]
    if len(time) < 2 or np.any(np.diff(unix) < 0) or np.ptp(unix) < LEAST_DATED_SECOND:
        return False
    slopes = date_slopes(time, unix)
    return bool(np.isfinite(slopes).any() and abs(np.nanmedian(slopes) - 1) > SAME_CLOCK)


# ASSUME: A tester's timer keeps an interval or sets another, and never lets it grow steadily.
def pace_drifts(time: np.ndarray) -> bool:
    """Whether a clock (n,) [s] runs ever faster or slower, as its rows show.

    They lie at one interval in each part of the record, and from part to part it grows, or shrinks,
    by the same.
    """
    if len(time) < PACED_PARTS * PACED_ROWS:
        return False
    bounds = np.linspace(0, len(time) - 1, PACED_PARTS + 1).astype(int)
    pace = np.empty(PACED_PARTS)
    for part, (first, last) in enumerate(pairwise(bounds)):
        interval = np.diff(time[first : last + 1])
        pace[part] = np.median(interval)
        if np.mean(np.abs(interval - pace[part]) <= PACED_SHARE * pace[part]) < 0.9:
            return False
    grown = pace[-1] / pace[0] - 1.0
    if not PACED_SHARE <= abs(grown) <= DRIFTED_SHARE:
        return False
    middle = (bounds[1:] + bounds[:-1]) / 2
    line = np.polynomial.Polynomial.fit(middle, pace, 1)(middle)
    return bool(np.max(np.abs(pace - line)) <= 0.1 * abs(pace[-1] - pace[0]))


def exchanged(time, current, ambient_celsius, surface_celsius) -> bool:
    """Whether in a load the chamber's thermometer moves and the cell's own does not.

    What warms the chamber is the cell; and one whose chamber is warmed by something else follows.
    Compared is the longest load, in means over five minutes.

    time, current : (n,) [s], [A]. ambient_celsius, surface_celsius : (n,) [degC], NaN where not
    known.
    """
    first, stop = stretches(np.abs(current) > near_zero_ampere(current))
    if not len(first):
        return False
    longest = int(np.argmax(time[stop - 1] - time[first]))
    rows = slice(int(first[longest]), int(stop[longest]))
    known = np.isfinite(ambient_celsius[rows]) & np.isfinite(surface_celsius[rows])
    time = time[rows][known]
    if len(time) < 2 or time[-1] - time[0] < WARMING_SECOND:
        return False
    block = ((time - time[0]) // BLOCK_SECOND).astype(int)
    _, block, size = np.unique(block, return_inverse=True, return_counts=True)
    moved = [
        float(np.ptp(np.bincount(block, celsius[rows][known]) / size))
        for celsius in (ambient_celsius, surface_celsius)
    ]
    return moved[0] > WARM_KELVIN and moved[1] < FOLLOWS_SHARE * moved[0]


def moved_over_pauses(time: np.ndarray, current: np.ndarray, voltage: np.ndarray) -> np.ndarray:
    """First rows of a load that went on over a pause of few rows, as its voltage shows.

    In a pause the cell relaxes: where the same load comes back the voltage is no further on than
    the load has moved it from one row to the next before. Rows are missing there.

    time, current, voltage : (n,) [s], [A], [V].
    """
    first, stop = stretches(np.abs(current) <= near_zero_ampere(current))
    short = (stop - first <= PAUSE_ROWS) & (first > LOAD_ROWS) & (stop < len(time))
    first, stop = first[short], stop[short]
    before, after = current[first - 1], current[stop]
    same = np.abs(after - before) <= SAME_LOAD_SHARE * np.abs(before)
    first, stop = first[same], stop[same]
    if not len(first):
        return stop
    sign = np.sign(current[stop])
    moved = sign * (voltage[stop] - voltage[first - 1])
    # Both intervals at its edges may be the load's, of whatever length the rows of a load have.
    rows = first[:, None] - 1 - np.arange(LOAD_ROWS)
    steps = np.abs(voltage[rows] - voltage[rows - 1])
    usual = SUDDEN * np.max(steps, axis=1)
    return stop[moved > np.maximum(FLOOR_VOLT, usual)]
