"""Samples of the voltage that jump out of a record and back: while the current changes, or several.

A sample's bend is by how much it differs from the mean of its two neighbours. In a cell the bends
of voltage and current go together by its ohmic resistance, whatever the load does; a spike leaves
the mark −½, 1, −½ in what is left of the voltage's.
"""

import numpy as np

from cellwright.formats.pieces import any_where, largest, rows_where, step_at

UNUSUAL = 15.0  # times the median of what is left nearby: ten standard deviations
NEARBY = 31  # rows
PIECE_ROWS = 1 << 16  # whose neighbours are looked at together
MARK_SHARE = 0.35  # by which the neighbours may differ from minus a half of the spike
SAME_PACE = 0.5  # of an interval: rows of another pace have other bends
LEAST_BENDS = 20  # bends of the current that tell a resistance
LARGE_BEND = 0.05  # of the largest current
# Where less than four fifths of the bends are within half of the usual ratio the channels lag, or
# kinetics bend the answer: no single row can be judged.
FOLLOWING, FOLLOWING_SHARE = 0.5, 0.8
UNDER_LOAD = 5.0  # times the least spike at rest: a cold cell's answer bends by 40 mV
LOAD_SHARE = 0.5
LONGEST_BURST = 10  # rows, a third of those nearby: what lasts longer may be the cell's
QUIET_ROWS = 3  # at each side of a row, in which the current must be steady
BACK_SHARE = 0.25  # of a burst's largest bend: the curve goes on where it was left
MADE_SHARE = 1.2  # of what the current's steps nearby make of the voltage: kinetics leave less


def bend(values: np.ndarray) -> np.ndarray:
    """By how much values (n,) differ from the mean of their two neighbours (n - 2,)."""
    return values[1:-1] - 0.5 * (values[:-2] + values[2:])


def bend_at(values, rows):
    """Bend of the values at rows of any shape; 0 at both ends."""
    inner = np.clip(rows, 1, len(values) - 2)
    bent = values[inner] - 0.5 * (values[inner - 1] + values[inner + 1])
    return np.where(inner == rows, bent, 0.0)


def rows_around(rows, width, length):
    """Rows (k, width) around each of (k,), an odd number; beyond a record's ends the end's own."""
    return np.clip(rows[:, None] + np.arange(width) - width // 2, 0, length - 1)


def usual_nearby(values_at, rows, length):
    """Median of the values nearby each row (k,) of a record of a length; values_at : of rows."""
    parts = np.array_split(rows, len(rows) // PIECE_ROWS + 1)
    return np.concatenate(
        [np.median(values_at(rows_around(part, NEARBY, length)), axis=1) for part in parts]
    )


def of_one_pace(time, rows):
    """Those of the rows, none at an end, whose neighbours lie at one pace."""
    before, after = time[rows] - time[rows - 1], time[rows + 1] - time[rows]
    return rows[np.abs(after - before) <= SAME_PACE * np.minimum(after, before)]


def resistance_of_bends(time, current, voltage):
    """Resistance [ohm] by which the voltage's bends follow the current's, where rows have one pace.

    NaN where too few changes of the current tell it.
    """
    least = LARGE_BEND * largest(current)
    large = rows_where(lambda i: np.abs(bend(i)) > least, current, beside=2) + 1
    large = of_one_pace(time, large)
    if len(large) < LEAST_BENDS:
        return np.nan
    ratio = bend_at(voltage, large) / bend_at(current, large)
    resistance = float(np.median(ratio))
    follows = np.mean(np.abs(ratio - resistance) <= FOLLOWING * resistance)
    return resistance if resistance > 0 and follows >= FOLLOWING_SHARE else np.nan


def spikes_under_load(time, current, voltage, *, limit_volt) -> np.ndarray:
    """Rows of spikes of the voltage in a record whose current changes from row to row.

    Parameters
    ----------
    time, current, voltage : (n,) arrays [s], [A], [V]. limit_volt : least spike [V].

    Returns
    -------
    rows; none where too few changes of the current tell how the voltage follows them.
    """
    if len(time) < NEARBY:
        return np.empty(0, int)
    resistance = resistance_of_bends(time, current, voltage)
    if not np.isfinite(resistance):
        return np.empty(0, int)

    def left(rows):
        return bend_at(voltage, rows) - resistance * bend_at(current, rows)

    def size(rows):
        return np.abs(left(rows))

    least = UNDER_LOAD * limit_volt
    rows = 1 + rows_where(
        lambda i, v: np.abs(bend(v) - resistance * bend(i)) > least,
        *(current, voltage),
        beside=2,
    )
    rows = of_one_pace(time, rows[(rows > 2) & (rows < len(time) - 3)])
    marks = np.stack([left(rows + side) + 0.5 * left(rows) for side in (-1, 1)])
    rows = rows[np.all(np.abs(marks) < MARK_SHARE * size(rows), axis=0)]
    before = rows_around(rows, 5, len(current)) - 1
    change = np.abs(step_at(current, np.maximum(before, 0)))
    step = np.max(np.where(before < 0, 0.0, change), axis=1)
    usual = usual_nearby(size, rows, len(time))
    limit = np.maximum(UNUSUAL * usual, MADE_SHARE * resistance * step)
    # Where the whole load comes or goes an empty or cold cell answers by any multiple.
    gentle = step < LOAD_SHARE * largest(current)
    return rows[(size(rows) > limit) & gentle]


def spike_free(time, current, voltage, rows) -> np.ndarray:
    """The voltage [V] with each spike replaced by the mean of its four neighbours.

    Where the current changes from row to row, its own change there is added by the resistance.
    """
    if not len(rows):
        return voltage
    resistance = np.nan_to_num(resistance_of_bends(time, current, voltage))
    around = rows[:, None] + np.array([-2, -1, 1, 2])
    repaired = voltage.copy()
    moved = current[rows] - current[around].mean(axis=1)
    repaired[rows] = voltage[around].mean(axis=1) + resistance * moved
    return repaired


def burst_rows(current, voltage, *, limit_volt, current_step_ampere) -> np.ndarray:
    """Rows of bursts: two samples of the voltage and more that jump about within a smooth curve.

    Their bends exceed the limit and fifteen usual ones nearby, the current is steady, and the curve
    goes on after them where it was before.

    Parameters
    ----------
    current, voltage : (n,) [A], [V]. limit_volt : least bend [V]. current_step_ampere : a change of
        the current by as much is a step [A].
    """
    if not any_where(lambda v: np.abs(bend(v)) > limit_volt, voltage, beside=2):
        return np.empty(0, int)

    def bent(rows):
        return np.abs(bend_at(voltage, rows))

    # Beside a burst the bend is half of its first sample.
    large = 1 + rows_where(lambda v: np.abs(bend(v)) > limit_volt / 2, voltage, beside=2)
    large = large[bent(large) > UNUSUAL * usual_nearby(bent, large, len(voltage))]
    found = [np.empty(0, int)]
    for rows in np.split(large, np.flatnonzero(np.diff(large) > QUIET_ROWS) + 1):
        # The first and the last bend stand beside the burst.
        first, last = (rows[0], rows[-1]) if len(rows) else (0, 0)
        if not 2 <= last - first - 1 <= LONGEST_BURST or bent(rows).max() <= limit_volt:
            continue
        beside = np.r_[first - QUIET_ROWS : first + 1, last : last + QUIET_ROWS + 1]
        if beside[0] < 0 or beside[-1] >= len(voltage):
            continue
        quiet = np.ptp(current[beside[0] : beside[-1] + 1]) < current_step_ampere
        if quiet and np.ptp(voltage[beside]) <= BACK_SHARE * bent(rows).max():
            found.append(np.arange(first + 1, last))
    return np.concatenate(found)


def without_bursts(voltage, corrupt) -> np.ndarray:
    """The voltage [V] with its corrupt rows (k,) on the line between those beside them."""
    if not len(corrupt):
        return voltage
    good = np.delete(np.arange(len(voltage)), corrupt)
    repaired = voltage.copy()
    repaired[corrupt] = np.interp(corrupt, good, voltage[good])
    return repaired
