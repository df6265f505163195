"""The same measurement in two tests of a cell: found by its numbers, it counts once as evidence."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.noise import least_digit, least_digit_ampere
from cellwright.records import inputs
from cellwright.result import Result
from cellwright.series.rest_current import as_logged

WINDOW_ROWS = 16
LEAST_UNFORESEEN = 20  # rows: each that the two before it do not foretell halves the odds of chance
FORESEEN_DIGITS = 2  # of the reading, by which a row that a straight line foretells may miss it
SAME_SECOND = 1e-3  # two exports of one clock differ by their rounding
GRAIN = 1e6  # steps of current [1/A] and voltage [1/V] within which decoded numbers are one


class Repeats(NamedTuple):
    """One entry a stretch that a test shares with another one, arrays of shape (stretches,).

    test : in which it does not count. first_row, last_row : of its clean series, inclusive.
    first_second, last_second : their test time [s]. of : the test in which it counts.
    of_first_second : test time there [s].
    """

    test: np.ndarray
    first_row: np.ndarray
    last_row: np.ndarray
    first_second: np.ndarray
    last_second: np.ndarray
    of: np.ndarray
    of_first_second: np.ndarray


class _Keys(NamedTuple):
    """Of a test: times (n,), one key a row (n,), hash of the window from each row on, and whether
    it can be compared (n − window + 1,), and the count of unforeseen rows up to each (n + 1,)."""

    time: np.ndarray
    row: np.ndarray
    window: np.ndarray
    rich: np.ndarray
    unforeseen: np.ndarray


def repeats(tests, roles=("fit", "validation", "split")):
    """Stretches of tests of one cell that are, number for number, in another of them too.

    1. Windows of 16 rows of current and voltage, as logged, are compared by a hash, whatever their
    time; they may stand still in less than half of their rows, as rests of every test do. 2. A
    window in two tests grows to the longest stretch that is the same in both and runs at the same
    pace. 3. It is one measurement where so many of its rows are not foretold by the two before (by
    a straight line, to two of the reading's digits; or the reading moves at a time that jitters)
    that chance does not do it: 20, and one more for each doubling of the pairs of rows that are
    compared. 4. It counts in the test that may be fitted, of those in the one with fewer rows,
    which would have less left without it.

    Parameters
    ----------
    tests : list of MeasuredTest of one cell.
    roles : Only what tests of these roles repeat; the answer for "fit" hangs on no other test.

    Returns
    -------
    result : Result: rows, Repeats, of no entries where there are none; a note on each stretch.
    Source: docs/cleaning.md.
    """
    tests = inputs.tests(tests)

    def priority(k):
        # What may be fitted keeps its rows.
        role = ("fit", "split", "validation").index(tests[k].facts.role)
        return role, len(tests[k].series["test_time_second"]), k

    order = sorted(range(len(tests)), key=priority)
    keys = [_keys(tests[k].series) for k in order]
    found = []
    for place, start, shift in _shared_windows(keys):
        if tests[order[place[1]]].facts.role not in roles:
            continue
        one, other = keys[place[0]], keys[place[1]]
        for first, last in _stretches(one, other, start, shift):
            names = [tests[order[p]].facts.test for p in place]
            times = one.time[first - shift], *other.time[[first, last]]
            found.append((names[1], first, last, *times[1:], names[0], times[0]))
    types = ("<U1", int, int, float, float, "<U1", float)
    none = (np.array([], dtype) for dtype in types)
    rows = Repeats(*(map(np.array, zip(*found, strict=True)) if found else none))
    return Result({"rows": rows}, notes=_sentences(rows))


def of_tests(table):
    """Repeats from the result of `repeats`, or its columns; None where none were looked for."""
    table = getattr(table, "rows", table)
    return None if table is None else inputs.table_of(Repeats, table)


def _keys(series):
    """Keys of a test; the current as logged, for what cleaning takes off it differs by test."""
    logged = as_logged(series)
    current, voltage = (logged[name] for name in ("current_ampere", "voltage_volt"))
    whole = [np.rint(np.asarray(column, float) * GRAIN) for column in (current, voltage)]
    whole = [np.nan_to_num(column).astype(np.int64) for column in whole]
    bent = np.zeros(len(voltage), bool)
    for column, digit_of in zip(whole, (least_digit_ampere, least_digit), strict=True):
        digit = max(digit_of(column), 1.0)
        bent[2:] |= np.abs(np.diff(column, 2)) > FORESEEN_DIGITS * digit
    time = np.asarray(series["test_time_second"], float)
    moved = np.append(0, np.diff(whole[0]) | np.diff(whole[1])) != 0
    bent[2:] |= moved[2:] & _jitters(time)
    row = (whole[0].view(np.uint64) * np.uint64(0x9E3779B97F4A7C15)) ^ (
        whole[1].view(np.uint64) * np.uint64(0xC2B2AE3D27D4EB4F)
    )
    size = max(len(row) - WINDOW_ROWS + 1, 0)
    window = np.zeros(size, np.uint64)
    for k in range(WINDOW_ROWS):
        window = window * np.uint64(0x100000001B3) + row[k : k + size]
    unforeseen = np.append(0, np.cumsum(bent))
    rich = unforeseen[WINDOW_ROWS:][:size] - unforeseen[:size]
    return _Keys(time, row, window, rich >= WINDOW_ROWS // 2, unforeseen)


def _jitters(time):
    """Rows (n − 2,) whose interval is about that before, and not it: no program sets such times."""
    interval = np.diff(time)
    change, least = np.abs(np.diff(interval)), np.minimum(interval[1:], interval[:-1])
    return (change > 2 * SAME_SECOND) & (change < least / 2)


def _shared_windows(keys):
    """(places of two tests, first rows in the second, shift to those of the first) of windows in
    both; each pair of tests and shift once."""
    if not sum(key.rich.sum() for key in keys):
        return []
    owner = np.repeat(np.arange(len(keys)), [key.rich.sum() for key in keys])
    row = np.concatenate([np.flatnonzero(key.rich) for key in keys])
    value = np.concatenate([key.window[key.rich] for key in keys])
    by_value = np.lexsort((row, owner, value))
    owner, row, value = owner[by_value], row[by_value], value[by_value]
    first = np.flatnonzero(np.append(True, value[1:] != value[:-1]))
    source = np.repeat(first, np.diff(np.append(first, len(value))))
    again = np.flatnonzero(owner != owner[source])
    shared = {}
    for k in again:
        key = (owner[source[k]], owner[k]), int(row[k] - row[source[k]])
        shared.setdefault(key, []).append(int(row[k]))
    return [(place, sorted(rows), shift) for (place, shift), rows in sorted(shared.items())]


def _stretches(one, other, rows, shift):
    """First and last rows, in the other test, of what is the same in both around shared windows."""
    found, after = [], -1
    least = LEAST_UNFORESEEN + np.log2(len(one.row) * len(other.row))
    for row in rows:
        if row <= after:
            continue
        low, high = max(0, shift), min(len(other.row), len(one.row) + shift)
        same = other.row[low:high] == one.row[low - shift : high - shift]
        pace = np.diff(other.time[low:high]) - np.diff(one.time[low - shift : high - shift])
        same[1:] &= (np.abs(pace) <= SAME_SECOND) | ~same[:-1]
        ends = np.flatnonzero(~same)
        at = np.searchsorted(ends, row - low)
        first = low + (ends[at - 1] + 1 if at else 0)
        last = low + (ends[at] - 1 if at < len(ends) else len(same) - 1)
        after = max(last, row)
        if other.unforeseen[last + 1] - other.unforeseen[first] >= least:
            found.append((first, last))
    return found


def rows_repeated(found, test, size):
    """Mask (n,) of rows of a test that count in another one.

    Parameters
    ----------
    found : Repeats. test : its name. size : how many rows its clean series has.
    """
    mask = np.zeros(size, bool)
    for name, first, last in zip(found.test, found.first_row, found.last_row, strict=True):
        if name == test:
            mask[int(first) : int(last) + 1] = True
    return mask


def steps_elsewhere(found, test, steps):
    """Of each step of a test the name of the test in which it counts, empty where it is here.

    One measurement in two tests would count twice in every fit and every error.

    Parameters
    ----------
    found : result of `repeats` or its columns; None: none were looked for. test : TestFacts.
    steps : series.steps.Steps; one of which most rows are repeated is.

    Returns
    -------
    elsewhere : (steps,) str, None where none were looked for.
    """
    found = of_tests(found)
    if found is None:
        return None
    elsewhere = np.full(len(steps.kind), "", object)
    for name, first, last, of in zip(
        found.test, found.first_row, found.last_row, found.of, strict=True
    ):
        shared = np.minimum(steps.last_row, last) - np.maximum(steps.first_row, first) + 1
        most = 2 * shared > steps.last_row - steps.first_row + 1
        if name == test.test:
            elsewhere[most] = of
    return elsewhere


def _sentences(found):
    """A sentence on each stretch, naming both tests."""
    return tuple(
        f"{test} from {first:.6g} to {last:.6g} s is the same measurement as {of} from "
        f"{start:.6g} s on: it counts once, in {of}"
        for test, first, last, of, start in zip(
            found.test,
            found.first_second,
            found.last_second,
            found.of,
            found.of_first_second,
            strict=True,
        )
    )


def counted_once(tests):
    """Tests that are evidence together, with what one repeats of another marked, and sentences.

    Parameters
    ----------
    tests : list of MeasuredTest of one cell.

    Returns
    -------
    marked : list of MeasuredTest; where something is repeated with a column `repeated`, (n,) bool:
        these rows drive a model and are not compared with it, see `record.laid_out`.
    words : tuple of str.
    """
    found = repeats(tests)
    return [with_repeated(test, found.rows) for test in tests], found.notes


def with_repeated(test, found):
    """A MeasuredTest with a column `repeated` where rows of it count in another test."""
    mask = rows_repeated(found, test.facts.test, len(test.series["test_time_second"]))
    return test._replace(series={**test.series, "repeated": mask}) if mask.any() else test
