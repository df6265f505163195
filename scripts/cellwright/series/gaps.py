"""What a cell did while its record was silent: its load went on, or it rested."""

import numpy as np

from cellwright.formats.pieces import sum_of
from cellwright.numerics.statistics import robust_std

RAN, RESTED, UNKNOWN, NO_LOAD = "load went on", "cell rested", "not known", "no load"
OTHER_LOAD = "another load"  # of the same direction on the other side: anything may have flowed
SAME_CURRENT = 0.1  # of the current: as much on both sides of a gap is the same load
SHORTEST_WINDOW = 60.0  # s of rows at each side, by which the voltage's slope is told
LEAST_ROWS = 4
FIRST_REACH = 64  # rows beside a gap that are looked at first
LEAST_SHARE = 0.001  # of all charge: gaps with less are not worth a sentence
FLOOR_VOLT = 0.002  # no verdict hangs on less: contacts, temperature
# ASSUME: If the load went on in a gap, the voltage moves by at least half of what the slopes beside
# the gap say; in a rest by less than a quarter, since polarisation recovers and charge does not.
RAN_SHARE, RESTED_SHARE = 0.5, 0.25  # a voltage that comes back says so by itself


def verdicts(
    time: np.ndarray, current: np.ndarray, voltage: np.ndarray, gaps: np.ndarray
) -> np.ndarray:
    """What happened in each gap between two rows of the same load, by the voltage.

    The slopes of the voltage over the charge at both sides say by how much the load would have
    moved it, the least of them at least. Where it moved so, the load went on and only rows were
    lost; where it came back instead, or hardly moved where all slopes say that it would have, the
    cell rested. At a voltage that is held on both sides a load went on if its current fell: after
    a rest it would have been larger.

    Parameters
    ----------
    time, current, voltage : (n,) arrays [s], [A, positive on charge], [V]
    gaps : rows with a gap before them.

    Returns
    -------
    array of RAN, RESTED, UNKNOWN where the slopes cannot tell (a plateau, few rows), OTHER_LOAD
    where the load is not the same on both sides, but of one direction and at another voltage,
    NO_LOAD else.
    """
    found = [_verdict(time, current, voltage, int(row)) for row in gaps]
    return np.array(found, dtype=f"U{len(RAN)}")


def load_went_on(time, current, voltage, first, stop) -> bool:
    """Whether over rows of no current between two of one load the voltage moved as under it.

    Parameters
    ----------
    time, current, voltage : (n,) arrays [s], [A], [V]. first, stop : first of these rows, and the
        row after the last.
    """
    if first < LEAST_ROWS or stop > len(time) - LEAST_ROWS:
        return False
    before, after = current[first - 1], current[stop]
    moved = (voltage[stop] - voltage[first - 1]) * np.sign(after)
    if abs(after - before) > SAME_CURRENT * abs(after) or not moved > FLOOR_VOLT:
        return False
    window = max(time[stop] - time[first - 1], SHORTEST_WINDOW)
    begin = np.searchsorted(time, time[first - 1] - window)
    end = np.searchsorted(time, time[stop] + window, side="right")
    beside = np.r_[begin:first, stop:end]
    return _verdict(*(c[beside] for c in (time, current, voltage)), first - begin) == RAN


def _verdict(time, current, voltage, row):
    before, after = current[row - 1], current[row]
    if not abs(after) > 0 or abs(after - before) > SAME_CURRENT * abs(after):
        if _held_on(current, voltage, row):
            return RAN
        # More current at the same voltage: of a hold, after a rest.
        other = before * after > 0 and abs(voltage[row] - voltage[row - 1]) > FLOOR_VOLT
        return OTHER_LOAD if other else NO_LOAD
    length = time[row] - time[row - 1]
    slopes, noises = [], []
    for side in (-1, 1):
        slope, noise = _slope(time, current, voltage, row, side, max(length, SHORTEST_WINDOW))
        # A curve is flatter or steeper nearby: within the gap it may be as either.
        near, _ = _slope(time, current, voltage, row, side, max(length, SHORTEST_WINDOW) / 4)
        slopes += [slope, slope if np.isnan(near) else near]
        noises.append(noise)
    charge = after * length / 3600
    # Towards where the load drives it, positive.
    expected = np.array(slopes) * charge * np.sign(charge)
    moved = (voltage[row] - voltage[row - 1]) * np.sign(charge)
    floor = FLOOR_VOLT + 4 * max(noises)
    if not np.all(expected > 0) or expected.max() < 2 * floor:
        return UNKNOWN
    if moved > max(RAN_SHARE * expected.min(), floor):
        return RAN
    certain = expected.min() >= 2 * floor and moved < RESTED_SHARE * expected.min()
    return RESTED if certain or moved < -floor else UNKNOWN


def _held_on(current, voltage, row):
    """Whether a voltage is held on both sides of a gap, and the current fell over it."""
    rows = slice(row - LEAST_ROWS, row + LEAST_ROWS)
    size = np.abs(current[rows])
    if row < LEAST_ROWS or len(size) < 2 * LEAST_ROWS or np.ptp(np.sign(current[rows])) > 0:
        return False
    return bool(np.ptp(voltage[rows]) <= FLOOR_VOLT and np.all(np.diff(size) < 0))


def _as_far_as(good, edge, side, length):
    """Rows from an edge outwards, before it (side −1) or after it (1), as far as they are good."""
    reach = FIRST_REACH
    while True:
        rows = edge + side * np.arange(reach)
        rows = rows[(rows >= 0) & (rows < length)]
        fit = good(rows)
        if len(rows) < reach or not fit.all():
            return rows[: len(rows) if fit.all() else int(np.argmin(fit))]
        reach *= 4  # of millions of rows each gap would else look at all


def _slope(time, current, voltage, row, side, window):
    """Slope of the voltage over the charge [V/Ah] before or after a gap, and its scatter [V]."""
    edge = row - 1 if side < 0 else row

    def good(rows):
        near = (np.abs(time[rows] - time[edge]) <= window) & np.isfinite(voltage[rows])
        return near & (np.abs(current[rows] - current[edge]) <= SAME_CURRENT * abs(current[edge]))

    rows = _as_far_as(good, edge, side, len(time))
    if len(rows) < LEAST_ROWS:
        return np.nan, 0.0
    charge = current[edge] * (time[rows] - time[edge]) / 3600
    if not np.ptp(charge) > 0:
        return np.nan, 0.0
    slope, level = np.polyfit(charge, voltage[rows], 1)
    # The scatter from row to row, not the bend of the curve, is what an edge may be off by.
    return slope, robust_std(np.diff(voltage[rows] - slope * charge - level)) / np.sqrt(2)


def in_words(time: np.ndarray, current: np.ndarray, gaps: np.ndarray, found: np.ndarray) -> list:
    """A sentence on each gap under load; the charge that is or is not counted in it [Ah]."""
    said = {
        RAN: "the voltage went on as under load: the charge is counted",
        RESTED: "the voltage came back: the cell rested, no charge is counted",
        UNKNOWN: "the voltage does not tell whether the load went on: the charge is counted as if",
        OTHER_LOAD: "it begins and ends under unlike loads: without a counter no charge is counted",
    }
    out = []
    if not len(gaps):
        return out
    moved = sum_of(lambda t, i: np.abs(i[1:]) * np.diff(t), time, current, beside=1) / 3600
    for row, what in zip(gaps, found, strict=True):
        length = time[row] - time[row - 1]
        charge = abs(current[row]) * length / 3600
        if what == NO_LOAD or charge < LEAST_SHARE * moved:
            continue
        where = f"{length:.4g} s without rows under load from {time[row - 1]:.6g} s on"
        out.append(f"{where} ({charge:.3g} Ah): {said[what]}")
    return out
