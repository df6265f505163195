"""A raw series becomes a clean one: rows flagged with a reason, then removed or repaired.

Detectors flag and remove nothing; `remove` is the one place that removes rows.
"""

from collections.abc import Mapping
from enum import IntFlag
from typing import NamedTuple

import numpy as np

from cellwright.formats.fields import NET, SERIES
from cellwright.formats.physics import COLDEST, HOTTEST
from cellwright.formats.pieces import (
    any_where,
    largest,
    median_of,
    pieces,
    rows_where,
    step_at,
)
from cellwright.refusal import Refusal
from cellwright.series.doubts import Doubt, counter_digit, doubts
from cellwright.series.doubts import sentences as doubts_in_words
from cellwright.series.edges import OTHER_PACE, begun_at_last_row, step_rows
from cellwright.series.gaps import RAN, RESTED, in_words
from cellwright.series.gaps import verdicts as gap_verdicts
from cellwright.series.repeated import repeated_rows
from cellwright.series.rest_current import RestReading, rest_reading, stretches
from cellwright.series.scale import refuse_other_unit
from cellwright.series.spikes import (
    burst_rows,
    rows_around,
    spike_free,
    spikes_under_load,
    without_bursts,
)
from cellwright.series.steps import silent_before
from cellwright.settings import Clean

CLEAN = Clean()

LEAST_VOLT = 1.0  # V beside which exactly 0 V is no reading
SUMMED_SHARE = 1e-3  # within which a counter is a current as it is written, times an interval,
LEAST_SUMMED, SUMMED_ROWS_SHARE = 10, 0.9  # in so many intervals, and of all that tell
NO_READING = 1e30  # instruments write ±3.4e38 for "no reading"
MOST_GAPS_TOLD = 5  # in notes, which people read
PACE_ROWS = 3  # intervals at each side of one that is a multiple of them: single rows are missing
SINGLE_SHARE = 0.05  # of the rows: what happens more often is how an instrument samples
CONTACT_KELVIN = 5.0  # from row to row
STILL_KELVIN, STILL_ROWS = 2.0, 10
BLANK_SHARE = 0.01  # likewise of rows without a temperature: some log it every few rows


class Flag(IntFlag):
    """Reason why a row is flagged; a row may carry several."""

    NAN = 1  # time, current or voltage is no number
    SENTINEL = 2  # it holds an instrument's mark for "no reading"
    REPEAT = 4  # it repeats the row before, or its time stamp without a step of the current
    OUT_OF_PLACE = 8  # its time stamp alone lies behind that of the rows around it
    CLOCK = 16  # the clock jumped before it and goes on from there
    SPIKE = 32  # its voltage jumps out and back
    GAP = 64  # the record is silent before it
    REST_READING = 128  # a rest begins in which the current channel reads what is no current
    BURST = 256  # its voltage is one of several that jump out of a smooth curve
    LOST = 512  # single rows are missing before it
    NO_VALUE = 1024  # a thermometer shows no number there, or what no cell survives


REMOVED = Flag.NAN | Flag.SENTINEL | Flag.REPEAT | Flag.OUT_OF_PLACE


def flag(
    columns: Mapping[str, np.ndarray],
    *,
    spike_limit_volt: float = CLEAN.spike_limit_volt,
    gap_second: float = CLEAN.gap_second,
) -> np.ndarray:
    """Flags of each row of a series: all that is wrong with it.

    columns : mapping of arrays
        test_time_second [s], current_ampere [A], voltage_volt [V]; file_index where files are
        joined.
    spike_limit_volt : float [V]
        Least step of the voltage to either neighbour that makes a spike.
    gap_second : float [s]
        Shortest gap, see `steps.silent_before`.

    Returns an array of int, a combination of `Flag` for each row, 0 where nothing is wrong.
    """
    time, current, voltage = (columns[name] for name in SERIES)
    flags = _unreadable(time, current, voltage)
    rows = _kept(flags)
    kept = [_of_rows(column, rows) for column in (time, current, voltage)]
    # A change by a hundredth of the largest current is a step: it explains one of the voltage.
    step = 0.01 * largest(kept[1])
    for kind, detector in (
        (Flag.REPEAT, lambda rows, t, i, v: _twice(t, i, v)),
        (Flag.REPEAT, lambda rows, t, i, v: _repeats(t, i, step)),
        (Flag.OUT_OF_PLACE, lambda rows, t, i, v: _out_of_place(t)),
        (Flag.CLOCK, lambda rows, t, i, v: _clock_jumps(t, rows)),
        (Flag.GAP, lambda rows, t, i, v: silent_before(
            rebased(t, _of_rows(flags, rows)), gap_second
        )),
        (Flag.SPIKE, lambda rows, t, i, v: np.union1d(
            spike_rows(i, v, limit_volt=spike_limit_volt, current_step_ampere=step),
            spikes_under_load(t, i, v, limit_volt=spike_limit_volt),
        )),
        (Flag.BURST, lambda rows, t, i, v: burst_rows(
            i, v, limit_volt=spike_limit_volt, current_step_ampere=step
        )),
        (Flag.LOST, lambda rows, t, i, v: _lost_rows(
            rebased(t, _of_rows(flags, rows)), rows, flags
        )),
    ):  # fmt: skip
        # Each looks among the rows that are kept so far.
        found = rows[detector(rows, *kept)]
        flags[found] |= kind
        if kind & REMOVED and len(found):
            rows = _kept(flags)
            kept = [_of_rows(column, rows) for column in (time, current, voltage)]
    if "file_index" in columns:
        # What the cell did before a file begins is not in the record.
        files = _of_rows(columns["file_index"], rows)
        flags[rows[1:][rows_where(lambda f: np.diff(f) != 0, files, beside=1)]] |= Flag.GAP
    for name in filter(_is_thermometer, columns):
        shown = _of_rows(columns[name], rows)
        blank = rows[rows_where(lambda c, n=name: ~np.isfinite(_blanked(n, c)), shown)]
        flags[blank if len(blank) <= BLANK_SHARE * len(rows) else slice(0)] |= Flag.NO_VALUE
    return flags


def counts(flags: np.ndarray) -> dict[str, int]:
    """Number of rows with each flag, by the flag's name in lower case."""
    return {kind.name.lower(): len(_rows_of(flags, kind)) for kind in Flag}


def _kept(flags: np.ndarray) -> np.ndarray:
    """Rows that no flag so far removes."""
    removed = int(REMOVED)  # an integer keeps the type of the flags, and takes a seventh
    if not any_where(lambda f: f & removed, flags):
        return np.arange(len(flags))
    return rows_where(lambda f: (f & removed) == 0, flags)


def _of_rows(column: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Values of ascending rows; the column itself, not a copy, where these are all."""
    return column if len(rows) == len(column) else column[rows]


def _unreadable(*columns: np.ndarray) -> np.ndarray:
    """Flags (n,) of rows in which time, current or voltage is no reading."""
    flags = np.zeros(columns[0].size, dtype=np.int16)
    for column in columns:
        flags[rows_where(lambda c: ~np.isfinite(c), column)] |= Flag.NAN
        marks = rows_where(lambda c: np.isfinite(c) & (np.abs(c) > NO_READING), column)
        flags[marks] |= Flag.SENTINEL
    flags[unmeasured(columns[2])] |= Flag.SENTINEL
    return flags


def unmeasured(voltage: np.ndarray) -> np.ndarray:
    """Rows (n,) of exactly 0 V, one or many, where the instrument measured no voltage.

    The nearest other readings, of which there is one at least, are above 1 V: no cell jumps there.
    """
    dead = np.zeros(len(voltage), bool)
    rows = rows_where(lambda v: v == 0, voltage)
    others = np.flatnonzero(np.isfinite(voltage) & (voltage != 0)) if len(rows) else rows
    if not len(others):
        return dead
    place = np.searchsorted(others, rows)
    sides = others[np.maximum(place - 1, 0)], others[np.minimum(place, len(others) - 1)]
    dead[rows] = np.all([np.abs(voltage[side]) > LEAST_VOLT for side in sides], axis=0)
    return dead


def _falls(time):
    return np.diff(time) < 0


def _twice(time: np.ndarray, current: np.ndarray, voltage: np.ndarray) -> np.ndarray:
    """Rows of a block that stands in the record before: ten readings and more, to the last digit.

    Their clock goes back with them; two measurements are never equal in all.
    """
    if not any_where(_falls, time, beside=1):
        return np.zeros(0, int)
    return np.flatnonzero(repeated_rows(dict(zip(SERIES, (time, current, voltage), strict=True))))


def _repeats(time: np.ndarray, current: np.ndarray, step: float) -> np.ndarray:
    """Rows that repeat the time of the row before, but for edges, where the current steps."""
    return 1 + rows_where(
        lambda t, i: (np.diff(t) == 0) & ~(np.abs(np.diff(i)) > step), time, current, beside=1
    )


def _out_of_place(time: np.ndarray) -> list[int]:
    """Single rows out of order in time: behind the row before, or too far ahead of the next."""
    found = []
    for row in rows_where(_falls, time, beside=1) + 1:
        resumes = row + 1 >= time.size or time[row + 1] > time[row - 1]
        overshot = row > 1 and time[row - 2] < time[row] < time[row - 1]
        if resumes or overshot:
            found.append(row if resumes else row - 1)
    return found


def _clock_jumps(time: np.ndarray, rows: np.ndarray) -> list[int]:
    """Rows before which the clock was set back, or forward again by what it had lost.

    Rows without a reading are gone from between, but their time passed: each counts as a step.
    """
    found = []
    if not any_where(_falls, time, beside=1):
        return found
    interval = np.diff(time)
    typical, lost = float(np.median(interval[interval > 0])), 0.0
    beyond = interval - typical * np.diff(rows)
    for row in np.flatnonzero((interval < 0) | (beyond > 4 * typical)) + 1:
        ahead = beyond[row - 1]
        if ahead < 0 or ahead <= 1.1 * lost:
            found.append(row)
            lost = max(lost - ahead, 0.0)
    return found


def _lost_rows(time: np.ndarray, rows: np.ndarray, flags: np.ndarray) -> np.ndarray:
    """Rows before which single ones are missing: the interval is a multiple of all those around.

    Neither a gap nor rows that were removed here are such.
    """

    def longer(time):
        interval = np.diff(time)
        return interval[1:] > 1.4 * interval[:-1]

    long = rows_where(longer, time, beside=2) + 1
    around = np.delete(rows_around(long, 2 * PACE_ROWS + 1, len(time) - 1), PACE_ROWS, axis=1)
    slow, fast = (extreme(step_at(time, around), axis=1) for extreme in (np.max, np.min))
    even = (slow <= (1 + OTHER_PACE) * fast) & (fast > 0)
    long, times = long[even], step_at(time, long[even]) / slow[even]
    found = long[(times > 1.5) & (np.abs(times - np.rint(times)) <= OTHER_PACE)]
    found = found[(rows[found + 1] - rows[found] == 1) & ((flags[rows[found + 1]] & Flag.GAP) == 0)]
    return found + 1 if len(found) <= SINGLE_SHARE * len(time) else np.empty(0, int)


def without_zeros(columns: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
    """Columns whose thermometers show nothing where they jump to exactly 0 °C and back.

    An input that loses contact reads so; a cell's temperature goes through zero by small steps.
    """
    changed = {}
    for name in filter(_is_thermometer, columns):
        zero = columns[name] == 0
        if zero.all() or not zero.any():
            continue
        # A change of the temperature by so much from one row to the next is a contact's; less is
        # one beside a stretch that stands at zero.
        first, stop = stretches(zero)
        least = np.where(stop - first < STILL_ROWS, CONTACT_KELVIN, STILL_KELVIN)
        change = np.abs(np.diff(columns[name]))
        before, after = np.r_[np.inf, change][first], np.r_[change, np.inf][stop - 1]
        lost = (before > least) & (after > least)
        if lost.any():
            ends = zip(first[lost], stop[lost], strict=True)
            blank = np.concatenate([np.arange(*rows) for rows in ends])
            changed[name] = columns[name].astype(float)
            changed[name][blank] = np.nan
    return {**columns, **changed} if changed else columns


def _is_thermometer(name: str) -> bool:
    return name.endswith("_celsius")


def rebased(time: np.ndarray, flags: np.ndarray) -> np.ndarray:
    """Time [s] in which a row after a jump of the clock follows after the interval before it."""
    jumps = _rows_of(flags, Flag.CLOCK)
    if not jumps.size:
        return time
    interval = np.diff(time, prepend=time[0])
    good = np.flatnonzero((flags & Flag.CLOCK) == 0)[1:]
    before = good[np.maximum(np.searchsorted(good, jumps) - 1, 0)]
    interval[jumps] = interval[before]
    return time[0] + np.cumsum(interval)


def spike_rows(
    current_ampere: np.ndarray,
    voltage_volt: np.ndarray,
    *,
    limit_volt: float = CLEAN.spike_limit_volt,
    current_step_ampere: float,
) -> np.ndarray:
    """Rows of the voltage that are spikes.

    1. The steps to both neighbours exceed the limit and have opposite signs.
    2. The limit is `limit_volt`, or eight times the typical step nearby if that is more.
    3. The current of the five samples around moves by less than `current_step_ampere`: a step of
       the voltage that the current explains is never a spike, even where its channel lags by two.
    4. Nor does the current jump out and back with it by three of its own small steps: on a
       coarse grid a short pulse leaves little of its current and much of its voltage.
    5. The four neighbours agree with each other better than with the spike: it jumped out of a
       smooth curve, and back.

    current_ampere, voltage_volt : arrays [A], [V], same length
    limit_volt : float [V]
    current_step_ampere : float [A]

    Returns an array of row numbers.

    Source
    ------
    Thesis ch. 5.2 and table 5.1. Erratum: its test compares signed differences; the two steps of
    a spike have opposite signs, so magnitudes and signs are compared here.
    """
    if voltage_volt.size < 5:
        return np.empty(0, dtype=int)

    def least(into, out):
        return np.minimum(np.abs(into), np.abs(out))

    def jumps(voltage):
        into, out = np.diff(voltage)[1:-2], np.diff(voltage)[2:-1]
        return (into * out < 0) & (least(into, out) > limit_volt)

    suspect = rows_where(jumps, voltage_volt, beside=4) + 2
    limit = 8.0 * _typical_step(voltage_volt, suspect)
    size = least(step_at(voltage_volt, suspect - 1), step_at(voltage_volt, suspect))
    suspect, size = suspect[size > limit], size[size > limit]
    around = suspect[:, None] + np.arange(-2, 3)
    quiet = np.ptp(current_ampere[around], axis=1) < current_step_ampere
    quiet &= ~_answered(current_ampere, voltage_volt, suspect, 0.1 * current_step_ampere)
    neighbours = voltage_volt[around[:, [0, 1, 3, 4]]]
    smooth = np.ptp(neighbours, axis=1) < 0.5 * size
    return suspect[quiet & smooth]


def _answered(
    current: np.ndarray, voltage: np.ndarray, rows: np.ndarray, least_ampere: float
) -> np.ndarray:
    """Whether the current of each row jumps out and back as its voltage does."""
    neighbours = rows[:, None] + np.array([-1, 1])
    out_current = current[rows] - current[neighbours].mean(axis=1)
    out_voltage = voltage[rows] - voltage[neighbours].mean(axis=1)
    quiet = _typical_step(current, rows, quantile=0.25)
    limit = np.maximum(3 * quiet, least_ampere)
    return (out_current * out_voltage > 0) & (np.abs(out_current) > limit)


def _typical_step(values: np.ndarray, rows: np.ndarray, *, quantile: float = 0.5) -> np.ndarray:
    """Quantile of the magnitude of the values' steps within ten samples of each row."""
    near = np.clip(rows[:, None] + np.arange(-10, 10), 0, values.size - 2)
    return np.quantile(np.abs(step_at(values, near)), quantile, axis=1)


def net_charge(
    test_time_second: np.ndarray,
    current_ampere: np.ndarray,
    *,
    gap_rows: np.ndarray | None = None,
    counter_ampere_hour: np.ndarray | None = None,
    silent: np.ndarray | None = None,
) -> np.ndarray:
    """Net charge put into the cell since the first row.

    1. Trapezoids of the true time stamps.
    2. Where the current steps within an interval the trapezoid guesses when. The pace of the rows
       may tell that it stepped at the first of the two (`edges.begun_at_last_row`).
    3. The instrument's counter knows: it serves where the guess is worse than twenty of its digits
       (five in an interval ten times as long as usual, where no neighbour evens it out), and where
       what it counted lies between what either current would have moved.
    4. Across a gap: the counter; without one, a current that is the same on both sides, unless
       the voltage shows that the cell rested, or that falls at a held voltage; else none.

    test_time_second, current_ampere : arrays [s], [A]
    gap_rows : array of int
        Rows with a gap in the record before them.
    counter_ampere_hour : array [Ah]
        The instrument's own signed counter; may have rows without a number (NaN).
    silent : one for each gap
        What the cell did in it, see `gaps.verdicts`.

    Returns an array [Ah], 0 in the first row.
    """
    time, current, counter = test_time_second, current_ampere, counter_ampere_hour
    charge = np.zeros(len(time))
    moved = charge[1:]
    for part in pieces(len(time), beside=1):
        before, after = _by_either_current(time[part], current[part])
        moved[part.start : part.stop - 1] = 0.5 * (before + after)
    rows = step_rows(time, current)
    begun = rows[begun_at_last_row(time, current, rows)]
    moved[begun - 1] = current[begun] * (step_at(time, begun - 1) / 3600)
    better = _counter_is_better(time, current, counter)
    moved[better] = step_at(counter, better) if len(better) else 0.0
    if gap_rows is not None and gap_rows.size:
        moved[gap_rows - 1] = _across_gaps(time, current, counter, gap_rows, silent)
    np.cumsum(moved, out=moved)
    return charge


def _by_either_current(time, current):
    """Charge [Ah] that the current before, and the one after, would move in each interval."""
    interval = np.diff(time) / 3600
    return current[:-1] * interval, current[1:] * interval


def _counter_is_better(time, current, counter) -> np.ndarray:
    """Intervals (k,) in which the counter is more accurate than the trapezoid, and plausible."""
    known = counter is not None and any_where(_counts, counter, beside=1)
    if not known:
        return np.empty(0, int)
    digit = counter_digit(np.diff, counter, beside=1)
    long = 10 * median_of(lambda t: np.diff(t) / 3600, time, beside=1)

    def better(time, current, counter):
        digits = np.where(np.diff(time) / 3600 > long, 5, 20)
        before, after = _by_either_current(time, current)
        return _is_better(before, after, np.diff(counter), digits, digit)

    found = rows_where(better, time, current, counter, beside=1)
    return np.setdiff1d(found, _summed_rows(time, current, counter, digit), assume_unique=True)


# ASSUME: Where a current falls smoothly, no tester counts that of one row times the interval.
def _summed_rows(time, current, counter, digit) -> np.ndarray:
    """Intervals (k,) of a hold, where a counter is made of the rows themselves; else none.

    Of the current at one end of each interval: it knows no more than they do there, and less than
    the mean of both ends.
    """

    def falls(time, current, counter):
        change = np.diff(current)
        near = change[1:-1]
        smooth = np.ones(len(near), bool)
        for beside in (change[:-2], change[2:]):
            smooth &= (beside * near > 0) & (np.abs(near - beside) < 0.5 * np.abs(near))
        before, after = (end[1:-1] for end in _by_either_current(time, current))
        apart, size = np.abs(after - before), np.maximum(np.abs(before), np.abs(after))
        tells = (apart > 4 * digit + 10 * SUMMED_SHARE * size) & (apart < 0.5 * size)
        return smooth & tells

    rows = rows_where(falls, time, current, counter, beside=3) + 1
    if len(rows) < LEAST_SUMMED:
        return rows[:0]
    hours, counted = step_at(time, rows) / 3600, step_at(counter, rows)
    for end in (current[rows] * hours, current[rows + 1] * hours):
        near = np.abs(counted - end) <= 2 * digit + SUMMED_SHARE * np.abs(end)
        if np.mean(near) >= SUMMED_ROWS_SHARE:
            return rows
    return rows[:0]


def _counts(counter):
    """Whether a counter moves between rows, both of which hold a number."""
    step = np.diff(counter)
    return np.isfinite(step) & (step != 0)


def _is_better(before, after, counted, digits, digit):
    unsure = 0.5 * np.abs(after - before) > digits * digit
    slack = digit + 0.02 * np.maximum(np.abs(before), np.abs(after))
    low, high = np.minimum(before, after) - slack, np.maximum(before, after) + slack
    return unsure & (counted >= low) & (counted <= high)


def _across_gaps(time, current, counter, rows, silent) -> np.ndarray:
    """Charge over the gap before each of the rows [Ah]; silent : as of `net_charge`."""
    hour = step_at(time, rows - 1) / 3600
    before, after = current[rows - 1] * hour, current[rows] * hour
    counted = np.full(len(rows), np.nan) if counter is None else step_at(counter, rows - 1)
    # ASSUME: In a gap of a record without a counter, a current that is the same on both sides
    # flowed all the time, and otherwise none did.
    same = np.abs(after - before) <= 0.1 * np.abs(after)
    ran = 0.5 * (before + after)
    across = np.where(same, ran, 0.0)
    if silent is not None:
        across = np.where(silent == RAN, ran, across)
        across = np.where(silent == RESTED, 0.0, across)
    return np.where(np.isfinite(counted), counted, across)


ACTION = {
    Flag.NAN: "row removed",
    Flag.SENTINEL: "row removed",
    Flag.REPEAT: "row removed",
    Flag.OUT_OF_PLACE: "row removed",
    Flag.CLOCK: "time re-based, row kept",
    Flag.SPIKE: "voltage replaced by the mean of its four neighbours",
    Flag.GAP: "kept",
    Flag.BURST: "voltage replaced by the line between the rows beside the burst",
    Flag.LOST: "kept",
    Flag.NO_VALUE: "temperature left blank, row kept",
    Flag.REST_READING: "current taken as zero to the end of the rest, the reading kept beside it",
}


class Cleaned(NamedTuple):
    """A clean series and what was done to it."""

    columns: dict[str, np.ndarray]
    actions: dict[str, np.ndarray]  # row (of the raw series), test_time_second, flag, value, action
    notes: tuple[str, ...] = ()


def clean(
    columns: Mapping[str, np.ndarray],
    *,
    rated_capacity_ampere_hour: float | None = None,
    cutoffs_volt: tuple = (None, None),
    ambient_temperature_celsius: float | None = None,
    **settings: float,
) -> Cleaned:
    """Flag a series and remove what is flagged; settings as for `flag`, the rest for `remove`.

    Raises Refusal as `remove`, and as `scale.refuse_other_unit`.
    """
    columns = without_zeros(columns)
    known = {
        "rated_capacity_ampere_hour": rated_capacity_ampere_hour,
        "cutoffs_volt": cutoffs_volt,
        "ambient_temperature_celsius": ambient_temperature_celsius,
    }
    cleaned = remove(columns, flag(columns, **settings), **known)
    if not np.any(cleaned.columns.get("doubt", 0) & Doubt.CLOCK):
        refuse_other_unit(cleaned.columns, rated_capacity_ampere_hour, cutoffs_volt)
    return cleaned


def remove(
    columns: Mapping[str, np.ndarray],
    flags: np.ndarray,
    *,
    rated_capacity_ampere_hour: float | None = None,
    cutoffs_volt: tuple = (None, None),
    ambient_temperature_celsius: float | None = None,
) -> Cleaned:
    """Remove and repair what is flagged, and add charge_ampere_hour and, where any, doubt.

    Where the current channel reads in rests what is no current, that is not counted: the current
    is zero there, and `logged_current_ampere` holds the reading of the whole record.

    columns : mapping of arrays, as given to `flag`
    flags : array of int, from `flag`

    Returns Cleaned, whose columns are the given arrays where nothing was removed or repaired.
    Raises Refusal: fewer than two rows are left.
    """
    kept = _kept(flags)
    if kept.size < 2:
        raise Refusal(f"{kept.size} of {flags.size} rows are left after cleaning")
    clean = {name: _blanked(name, _of_rows(column, kept)) for name, column in columns.items()}
    marks = _of_rows(flags, kept)
    clean["test_time_second"] = rebased(clean["test_time_second"], marks)
    spikes = _rows_of(marks, Flag.SPIKE)
    clean["voltage_volt"] = spike_free(*(clean[name] for name in SERIES), spikes)
    clean["voltage_volt"] = without_bursts(clean["voltage_volt"], _rows_of(marks, Flag.BURST))
    gaps = _rows_of(marks, Flag.GAP)
    silent = gap_verdicts(*(clean[name] for name in SERIES), gaps)
    clean["charge_ampere_hour"] = _charge(clean, gaps, silent)
    rests = rest_reading(clean)
    if rests.verdict == "sensor":
        logged = clean["current_ampere"]
        clean |= {"current_ampere": logged.copy(), "logged_current_ampere": logged}
        for first, stop in zip(rests.first, rests.stop, strict=True):
            clean["current_ampere"][first:stop] = 0.0
        clean["charge_ampere_hour"] = _charge(clean, gaps, silent)
    notes = [rests.note] * bool(rests.note)
    if not np.isfinite(clean.get(NET, np.nan)).all():  # else the counter knows
        told = in_words(clean["test_time_second"], clean["current_ampere"], gaps, silent)
        notes += told[:MOST_GAPS_TOLD]
        more = len(told) - MOST_GAPS_TOLD
        notes += [f"and {more} more such gaps"] * (more > 0)
    doubt = doubts(
        clean,
        jumps=_rows_of(marks, Flag.CLOCK),
        gaps=gaps,
        silent=silent,
        rated_capacity_ampere_hour=rated_capacity_ampere_hour,
        cutoffs_volt=cutoffs_volt,
        ambient_temperature_celsius=ambient_temperature_celsius,
    )
    if doubt.any():
        clean["doubt"] = doubt
        notes += doubts_in_words(clean["test_time_second"], doubt)
    return Cleaned(clean, _actions(columns, flags, kept, rests), tuple(notes))


def _rows_of(flags, kind):
    """Rows that carry a flag."""
    number = int(kind)
    return rows_where(lambda f: f & number, flags)


def _charge(columns: Mapping[str, np.ndarray], gaps: np.ndarray, silent) -> np.ndarray:
    """Net charge of a clean series [Ah], by `net_charge`."""
    return net_charge(
        columns["test_time_second"],
        columns["current_ampere"],
        gap_rows=gaps,
        counter_ampere_hour=columns.get(NET),
        silent=silent,
    )


def _blanked(name: str, column: np.ndarray) -> np.ndarray:
    """A column with NaN where it holds no reading; no row is removed.

    Such as an instrument's mark, or the end of a thermometer's range (3276.7, 1372, -999 °C).
    """
    if not np.issubdtype(column.dtype, np.floating):
        return column
    lowest, highest = (COLDEST, HOTTEST) if _is_thermometer(name) else (-NO_READING, NO_READING)
    beyond = rows_where(lambda c: (c > highest) | (c < lowest), column)
    if not len(beyond):
        return column
    blanked = column.copy()
    blanked[beyond] = np.nan
    return blanked


def _no_temperature(columns: Mapping[str, np.ndarray], rows: np.ndarray) -> np.ndarray:
    """What is shown in rows (k,) instead of a temperature, NaN where nothing is."""
    shown = np.full(len(rows), np.nan)
    for name in filter(_is_thermometer, columns):
        values = columns[name][rows]
        beyond = ~np.isfinite(_blanked(name, values))
        shown[beyond] = values[beyond]
    return shown


def _actions(
    columns: Mapping[str, np.ndarray], flags: np.ndarray, kept: np.ndarray, rests: RestReading
) -> dict[str, np.ndarray]:
    """One line for each flag of each row, and one for each rest whose reading is not counted."""
    time, current, voltage = (columns[name] for name in SERIES)
    timed = Flag.OUT_OF_PLACE | Flag.CLOCK | Flag.GAP | Flag.REPEAT
    lines = []
    for kind in Flag:
        rows = _rows_of(flags, kind)
        values = np.where(np.abs(current[rows]) > NO_READING, current[rows], voltage[rows])
        values = time[rows] if kind & timed else values
        values = _no_temperature(columns, rows) if kind == Flag.NO_VALUE else values
        lines += [(row, kind, value) for row, value in zip(rows, values, strict=True)]
    if rests.verdict == "sensor":
        begins = zip(kept[rests.first], rests.mean_ampere, strict=True)
        lines += [(row, Flag.REST_READING, mean) for row, mean in begins]
    lines.sort(key=lambda line: line[0])
    rows = np.array([row for row, _, _ in lines], dtype=int)
    return {
        "row": rows,
        "test_time_second": time[rows],
        "flag": np.array([kind.name.lower() for _, kind, _ in lines], dtype=str),
        "value": np.array([value for _, _, value in lines], dtype=float),
        "action": np.array([ACTION[kind] for _, kind, _ in lines], dtype=str),
    }
