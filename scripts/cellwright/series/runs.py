"""Runs: stretches of a record between two steps of its current, found from the data alone.

A run is the raw material of a step (`segments`). An edge is a step of current that the voltage
answers; where the current falls while the voltage stands still, the tester holds the voltage and
there is no edge.
"""

from typing import NamedTuple

import numpy as np

EDGE_C_RATE = (0.01, 0.03)  # a step of current within six sigma of its noise is none; bounds
EDGE_SHARE = 0.05  # nor is one below this share of the current itself
SPECK_C_RATE = 0.05  # one or two samples off by less than this between equal levels are noise
SPECK_SHARE = 0.2
TRANSIENT_SECOND = 1.0  # rise and fall of the tester's output
EXCURSION_SECOND = 10.0
HOLD_FLOOR_VOLT = 0.003
HOLD_CEILING_VOLT = 0.010


class Sampled(NamedTuple):
    """The columns that segmentation reads, each of shape (n,)."""

    time: np.ndarray
    current: np.ndarray
    voltage: np.ndarray
    gap: np.ndarray
    rest: np.ndarray


class Runs(NamedTuple):
    """One entry a run: rows (inclusive), mean current [A], length [s], and what it borders on."""

    first: np.ndarray
    last: np.ndarray
    level: np.ndarray
    span: np.ndarray
    rest: np.ndarray
    gap: np.ndarray


def gap_rows(time, file_index, *, gap_second):
    """Rows before which the record has a hole: much longer than the sampling beside it.

    A slow sampling rate is no hole: the interval must exceed five times both its neighbours.
    """
    interval = np.diff(time, prepend=time[0])
    beside = np.maximum(np.roll(interval, 1), np.roll(interval, -1))
    beside[[0, -1]] = interval[[-2, -2]] if len(interval) > 2 else 0.0
    return (interval > np.maximum(gap_second, 5 * beside)) | (np.diff(file_index, prepend=0) > 0)


def rest_rows(time, current, *, threshold, rated):
    """Rows at rest; to leave rest the current must exceed twice the threshold (no flicker).

    An excursion between two rests that stays small and short is the sensor's, not a load's.
    """
    size = np.abs(current)
    decided = (size <= threshold) | (size > 2 * threshold)
    decided[0] = True
    latest = np.maximum.accumulate(np.where(decided, np.arange(len(size)), 0))
    rest = size[latest] <= threshold
    turns = np.flatnonzero(np.diff(rest))  # last rows of stretches, rest and load in turn
    leaves, returns = turns[rest[turns]], turns[~rest[turns]]
    returns = returns[returns > leaves[0]] if len(leaves) else returns[:0]
    for begin, end in zip(leaves + 1, returns, strict=False):
        if time[end] - time[begin] <= EXCURSION_SECOND:
            rest[begin : end + 1] = size[begin : end + 1].max() <= SPECK_C_RATE * rated
    return rest


def hold_tolerance(voltage, rest):
    """How far a held voltage may stray [V]: four sigma of the record's noise at rest, bounded."""
    pairs = np.abs(np.diff(voltage))[rest[1:] & rest[:-1]]
    noise = 1.4826 * np.median(pairs) if len(pairs) else 0.0
    return float(np.clip(4 * noise, HOLD_FLOOR_VOLT, HOLD_CEILING_VOLT))


def held_rows(record, tolerance):
    """Rows before which the current fell while the voltage did not give: a held voltage.

    Looked at over one sample more on either side, for testers whose two channels are not
    sampled together.
    """
    current, voltage, rows = record.current, record.voltage, np.arange(len(record.current))
    falls = np.abs(current) <= np.abs(np.roll(current, 1))
    same_sign = np.sign(current) == np.sign(np.roll(current, 1))
    move = voltage[np.minimum(rows + 1, len(rows) - 1)] - voltage[np.maximum(rows - 2, 0)]
    near = voltage - np.roll(voltage, 1)
    gives = np.minimum(np.sign(current) * move, np.sign(current) * near) < -tolerance
    return falls & same_sign & ~gives


def edge_rows(record, rated, tolerance):
    """Rows that begin a run (shape (n,), bool); the first row always does."""
    size = np.abs(record.current)
    change = np.diff(record.current, prepend=record.current[0])
    noise = 1.05 * np.median(np.abs(change[~record.rest])) if not record.rest.all() else 0.0
    least = np.clip(6 * noise, EDGE_C_RATE[0] * rated, EDGE_C_RATE[1] * rated)
    bar = np.maximum(least, EDGE_SHARE * np.maximum(size, np.roll(size, 1)))
    stepped = np.abs(change) > bar
    turned = np.diff(record.rest, prepend=record.rest[0])
    edges = (stepped & ~held_rows(record, tolerance) & ~(record.rest & ~turned)) | turned
    edges |= record.gap
    edges[0] = True
    return edges


def runs(record, edges):
    """The runs between the edges. A run lasts from the last sample before it to its own last."""
    first = np.flatnonzero(edges)
    last = np.append(first[1:], len(edges)) - 1
    level = np.add.reduceat(record.current, first) / (last - first + 1)
    gap = record.gap[first] | (first == 0)
    begin = record.time[np.where(gap, first, first - 1)]
    return Runs(first, last, level, record.time[last] - begin, record.rest[first], gap)


def drop_noise(record, edges, rated):
    """Edges without those that stray samples made, and the record with its rests mended."""
    for _ in range(3):
        record, edges = _drop_specks(record, edges, rated)
        stretches = runs(record, edges)
        before = np.roll(stretches.level, 1)
        bar = np.maximum(EDGE_C_RATE[0] * rated, EDGE_SHARE * np.abs(before))
        equal = (np.abs(stretches.level - before) < bar) & (
            stretches.rest == np.roll(stretches.rest, 1)
        )
        edges[stretches.first[equal & ~stretches.gap]] = False
    return record, edges


def _drop_specks(record, edges, rated):
    """Join one or two stray samples with the equal levels beside them, or with a rest."""
    stretches = runs(record, edges)
    before, after = np.roll(stretches.level, 1), np.roll(stretches.level, -1)
    bar = np.maximum(SPECK_C_RATE * rated, SPECK_SHARE * np.abs(before))
    few = (stretches.last - stretches.first < 2) & (np.arange(len(bar)) < len(bar) - 1)
    joined = ~stretches.gap & ~np.roll(stretches.gap, -1)
    speck = (
        few & joined & (np.abs(stretches.level - before) < bar) & (np.abs(before - after) < bar / 2)
    )
    faint = few & ~stretches.rest & (np.abs(stretches.level) < SPECK_C_RATE * rated) & ~speck
    faint &= np.maximum(np.abs(before), np.abs(after)) > 5 * np.abs(stretches.level)
    onset = faint & np.where(stretches.first == 0, ~np.roll(stretches.rest, -1), False)
    trail = faint & np.roll(stretches.rest & ~stretches.gap, -1)
    lead = faint & np.roll(stretches.rest, 1) & ~stretches.gap & ~trail
    edges, rest = edges.copy(), record.rest.copy()
    edges[stretches.first[speck | lead]] = edges[stretches.first[np.roll(speck | trail, 1)]] = False
    mended = np.where(speck, np.roll(stretches.rest, 1), True)
    chosen = speck | onset | trail | lead
    rest[_rows(stretches, chosen)] = np.repeat(mended[chosen], _count(stretches)[chosen])
    return record._replace(rest=rest), edges


def join_transients(record, edges):
    """Join the samples of a rising or falling output with the run that they lead to or end."""
    for _ in range(8):
        stretches = runs(record, edges)
        onward, backward = _transients(stretches)
        edges = edges.copy()
        edges[stretches.first[np.roll(onward, 1)]] = edges[stretches.first[backward]] = False
        if not (onward.any() or backward.any()):
            return edges
    return edges


def _transients(stretches):
    """Which runs are the rise of the next run, and which the fall of the one before."""
    before, after = np.roll(stretches.level, 1), np.roll(stretches.level, -1)
    longer = np.roll(stretches.span, -1), np.roll(stretches.span, 1)
    between = (stretches.level - before) * (after - stretches.level) >= 0
    rise = between | (np.roll(stretches.rest, 1) & (stretches.level * after > 0))
    brief = ~stretches.rest & ~stretches.gap & (stretches.span <= TRANSIENT_SECOND)
    few = ~stretches.rest & ~stretches.gap & (stretches.last - stretches.first < 2)
    onward = rise & ~np.roll(stretches.rest | stretches.gap, -1)
    onward &= (brief & (longer[0] >= 5 * stretches.span)) | (
        few & (longer[0] >= 20 * stretches.span)
    )
    backward = between & np.roll(stretches.rest, -1) & ~np.roll(stretches.rest, 1) & ~onward
    backward &= (brief & (longer[1] >= 5 * stretches.span)) | (
        few & (longer[1] >= 20 * stretches.span)
    )
    onward[[0, -1]] = backward[[0, -1]] = False
    return onward, backward


def _count(stretches):
    return stretches.last - stretches.first + 1


def _rows(stretches, chosen):
    """Rows of the chosen runs, in order."""
    count = _count(stretches)
    return np.flatnonzero(np.repeat(chosen, count))
