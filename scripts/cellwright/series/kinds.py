"""What a run is: dynamic load, pulse, constant current, held voltage."""

import numpy as np

from cellwright.series.runs import runs

CHAIN_RUNS = 8  # a dynamic load has at least so many direct changes of load …
CHAIN_LEVELS = 5  # … between so many levels, a tenth of the largest apart
CHAIN_REST_SECOND = 10.0  # a longer rest at its beginning or end does not belong to it
STEADY_SHARE = 0.10  # a steady current stays so near to its median, …
STEADY_C_RATE = 0.02  # … or so near in C, if that is more, …
STEADY_ROWS = 0.85  # … in so many of its rows; the others are its rise and overshoot


def dynamic_chains(record, edges, short_second):
    """Edges without those inside dynamic loads, and the rows of these loads."""
    found = runs(record, edges)
    short = found.span <= short_second
    pair = (short & ~found.rest) & np.roll(short & ~found.rest, -1)
    beside = np.roll(pair, -1) | np.roll(pair, 2)  # two equal runs of a chain look like one
    short |= beside & ~found.rest & (found.span <= 2 * short_second)
    begins = np.flatnonzero(np.diff(short, prepend=False) | found.gap)
    ends = np.append(begins[1:], len(short))
    edges, dynamic = edges.copy(), np.zeros(len(edges), bool)
    for begin, end in zip(begins, ends, strict=True):
        begin, end = _trim(found, begin, end)
        if short[begin] and _many_levels(found.level[begin:end], found.rest[begin:end]):
            edges[found.first[begin] + 1 : found.last[end - 1] + 1] = False
            dynamic[found.first[begin] : found.last[end - 1] + 1] = True
    return edges, dynamic


def _trim(found, begin, end):
    """The chain without the long rests at its two ends."""
    inside = ~(found.rest[begin:end] & (found.span[begin:end] > CHAIN_REST_SECOND))
    kept = np.flatnonzero(inside)
    return (begin + kept[0], begin + kept[-1] + 1) if len(kept) else (begin, begin + 1)


def _many_levels(level, rest):
    """Whether runs (k,) [A] change load directly, often, and between many levels."""
    direct = np.count_nonzero(~rest[1:] & ~rest[:-1])
    if direct < CHAIN_RUNS:
        return False
    levels = np.unique(np.round(level / (0.1 * np.abs(level).max())))
    return len(levels) >= CHAIN_LEVELS


def run_kinds(record, found, dynamic, tolerance, pulse_max_second, rated):
    """Kind of each run (runs,) and the row from which its voltage is held (−1: never)."""
    kind = np.where(found.rest, "rest", "CC").astype("<U7")
    held = np.full(len(kind), -1)
    kind[dynamic[found.first]] = "dynamic"
    for run in np.flatnonzero(kind == "CC"):
        kind[run], held[run] = _load_kind(
            record, found.first[run], found.last[run], tolerance, STEADY_C_RATE * rated
        )
    brief = (found.span <= pulse_max_second) & ~found.rest & ~dynamic[found.first]
    kind[brief & (_beside_rest(found) | _on_load(found))] = "pulse"
    return kind, held


def _load_kind(record, first, last, tolerance, slack):
    """Kind of one load run, and its first row of held voltage."""
    size = np.abs(record.current[first : last + 1])
    level = np.median(size)
    if np.median(size[-3:]) >= 0.9 * level and _steady(size, slack):
        return "CC", -1
    voltage = record.voltage[first : last + 1]
    away = np.flatnonzero(np.abs(voltage - np.median(voltage[-3:])) > tolerance)
    hold = away[-1] + 1 if len(away) else 0
    if hold >= len(size) or size[hold:].max() < 1.1 * size[-1]:
        return ("CC" if _steady(size, slack) else "dynamic"), -1
    before = size[np.argmax(size >= (1 - STEADY_SHARE) * level) : hold]
    if hold <= max(2, 0.02 * len(size)):
        return "CV", first + hold
    return ("CCCV" if _steady(before, slack) else "dynamic"), first + hold if _steady(
        before, slack
    ) else -1


def _steady(size, slack):
    """Whether currents (k,) [A] stay near their median, rise and overshoot aside."""
    level = np.median(size)
    near = np.abs(size - level) <= np.maximum(STEADY_SHARE * level, slack)
    return np.mean(near) >= STEADY_ROWS


def _beside_rest(found):
    """Runs that begin from rest (or with the record or after a gap), or end in one."""
    return found.gap | np.roll(found.rest, 1) | np.roll(found.rest, -1)


def _on_load(found):
    """Short runs on top of a load that runs on at the same level, much longer than they."""
    before, after = np.roll(found.level, 1), np.roll(found.level, -1)
    same = np.abs(before - after) <= STEADY_SHARE * np.abs(before)
    beside = np.minimum(np.roll(found.span, 1), np.roll(found.span, -1))
    return same & (found.span <= 0.5 * beside)


def join_holds(record, found, kind, held, tolerance):
    """A load and the held voltage that it ends in as one, though the current there is uneven."""
    low = np.minimum.reduceat(record.voltage, found.first)
    high = np.maximum.reduceat(record.voltage, found.first)
    still = np.maximum(high, np.roll(record.voltage[found.last], 1)) - np.minimum(
        low, np.roll(record.voltage[found.last], 1)
    )
    least = np.minimum.reduceat(record.current, found.first)
    most = np.maximum.reduceat(record.current, found.first)
    onward = (least * most > 0) & (found.level * np.roll(found.level, 1) > 0) & ~found.rest
    falls = np.abs(found.level) < np.abs(np.roll(found.level, 1))
    again = (still <= 2 * tolerance) & onward & falls & ~found.gap
    again &= np.isin(np.roll(kind, 1), ("CC", "CV", "CCCV")) | np.roll(again, 1)
    again[0] = False
    kind, held = kind.copy(), held.copy()
    for run in np.flatnonzero(again)[::-1]:
        before = held[run - 1] if held[run - 1] >= 0 else found.first[run]
        held[run - 1] = before
        kind[run - 1] = "CCCV" if kind[run - 1] == "CC" else kind[run - 1]
    return join(record, found, kind, held, again)


def alike(found, kind):
    """Runs that go on what the run before does: dynamic loads, and rests."""
    again = (kind == np.roll(kind, 1)) & np.isin(kind, ("dynamic", "rest")) & ~found.gap
    again[0] = False
    return again


def join(record, found, kind, held, again):
    """The runs with those marked joined to the one before."""
    edges = np.zeros(len(record.time), bool)
    edges[found.first[~again]] = True
    return runs(record, edges), kind[~again], held[~again]
