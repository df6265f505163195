"""The one place that removes rows: a flagged series becomes a clean one, with a list of reasons."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal
from cellwright.series.flags import NO_READING, REMOVED, SERIES, Flag, flag, rebased, spike_free
from cellwright.series.rest_current import RestReading, rest_reading


def net_charge(
    test_time_second: np.ndarray,
    current_ampere: np.ndarray,
    *,
    gap_rows: np.ndarray | None = None,
    counter_ampere_hour: np.ndarray | None = None,
) -> np.ndarray:
    """Net charge put into the cell since the first row.

    1. Trapezoids of the true time stamps.
    2. Where the current steps within an interval the trapezoid guesses when. The instrument's
       counter knows: it serves where that guess is worse than twenty of its digits, and where what
       it counted lies between what either current would have moved.
    3. Across a gap: the counter; without one, a current that is the same on both sides, else none.

    Parameters
    ----------
    test_time_second, current_ampere : arrays [s], [A]
    gap_rows : array of int
        Rows with a gap in the record before them.
    counter_ampere_hour : array [Ah]
        The instrument's own signed counter; may have rows without a number (NaN).

    Returns
    -------
    array [Ah], 0 in the first row
    """
    interval = np.diff(test_time_second) / 3600
    before, after = current_ampere[:-1] * interval, current_ampere[1:] * interval
    moved = 0.5 * (before + after)
    counted = np.full(moved.size, np.nan)
    if counter_ampere_hour is not None:
        counted = np.diff(counter_ampere_hour)
    better = _counter_is_surer(before, after, counted)
    moved[better] = counted[better]
    if gap_rows is not None and gap_rows.size:
        moved[gap_rows - 1] = _across_gaps(before, after, counted, gap_rows - 1)
    return np.concatenate([[0.0], np.cumsum(moved)])


def _counter_is_surer(before: np.ndarray, after: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """Intervals in which the counter is surer than the trapezoid, and can be right."""
    if not np.any(counted[np.isfinite(counted)]):
        return np.zeros(counted.size, dtype=bool)
    digit = _digit(counted[np.isfinite(counted)])
    unsure = 0.5 * np.abs(after - before) > 20 * digit
    slack = digit + 0.02 * np.maximum(np.abs(before), np.abs(after))
    low, high = np.minimum(before, after) - slack, np.maximum(before, after) + slack
    return unsure & (counted >= low) & (counted <= high)


def _digit(steps: np.ndarray) -> float:
    """The last digit that a counter shows, from 1 to 1e-9, by its steps."""
    digits = 10.0 ** -np.arange(10)
    shown = (d for d in digits if np.all(np.abs(steps / d - np.rint(steps / d)) < 1e-3))
    return next(shown, digits[-1])


def _across_gaps(
    before: np.ndarray, after: np.ndarray, counted: np.ndarray, gaps: np.ndarray
) -> np.ndarray:
    """Charge [Ah] over each gap (a number of an interval)."""
    # ASSUME: In a gap of a record without a counter, a current that is the same on both sides
    # flowed all the time, and otherwise none did.
    same = np.abs(after[gaps] - before[gaps]) <= 0.1 * np.abs(after[gaps])
    guess = np.where(same, 0.5 * (before + after)[gaps], 0.0)
    return np.where(np.isfinite(counted[gaps]), counted[gaps], guess)


ACTION = {
    Flag.NAN: "row removed",
    Flag.SENTINEL: "row removed",
    Flag.REPEAT: "row removed",
    Flag.OUT_OF_PLACE: "row removed",
    Flag.CLOCK: "time re-based, row kept",
    Flag.SPIKE: "voltage replaced by the mean of its four neighbours",
    Flag.GAP: "kept",
    Flag.REST_READING: "current taken as zero to the end of the rest, the reading kept beside it",
}


class Cleaned(NamedTuple):
    """A clean series and what was done to it."""

    columns: dict[str, np.ndarray]
    actions: dict[str, np.ndarray]  # row (of the raw series), test_time_second, flag, value, action
    notes: tuple[str, ...] = ()


def clean(columns: Mapping[str, np.ndarray], **settings: float) -> Cleaned:
    """Flag a series and remove what is flagged; settings as for `flag`."""
    return remove(columns, flag(columns, **settings))


def remove(columns: Mapping[str, np.ndarray], flags: np.ndarray) -> Cleaned:
    """Remove and repair what is flagged, and add charge_ampere_hour.

    Where the current channel reads in rests what is no current, that is not counted: the current
    is zero there, and `logged_current_ampere` holds the reading of the whole record.

    Parameters
    ----------
    columns : mapping of arrays, as given to `flag`
    flags : array of int, from `flag`

    Returns
    -------
    Cleaned

    Raises
    ------
    Refusal
        Fewer than two rows are left.
    """
    kept = np.flatnonzero((flags & REMOVED) == 0)
    if kept.size < 2:
        raise Refusal(f"{kept.size} of {flags.size} rows are left after cleaning")
    clean = {name: _blanked(column[kept]) for name, column in columns.items()}
    marks = flags[kept]
    clean["test_time_second"] = rebased(clean["test_time_second"], marks)
    spikes = np.flatnonzero(marks & Flag.SPIKE)
    clean["voltage_volt"] = spike_free(clean["voltage_volt"], spikes)
    gaps = np.flatnonzero(marks & Flag.GAP)
    clean["charge_ampere_hour"] = _charge(clean, gaps)
    rests = rest_reading(clean)
    if rests.verdict == "sensor":
        clean |= _at_open_circuit(clean, rests)
        clean["charge_ampere_hour"] = _charge(clean, gaps)
    return Cleaned(clean, _actions(columns, flags, kept, rests), (rests.note,) * bool(rests.note))


def _charge(columns: Mapping[str, np.ndarray], gaps: np.ndarray) -> np.ndarray:
    return net_charge(
        columns["test_time_second"],
        columns["current_ampere"],
        gap_rows=gaps,
        counter_ampere_hour=columns.get("net_capacity_ampere_hour"),
    )


def _at_open_circuit(columns: Mapping[str, np.ndarray], rests: RestReading) -> dict:
    """The current with zero in the rests, and as it was read."""
    current = columns["current_ampere"].copy()
    for first, stop in zip(rests.first, rests.stop, strict=True):
        current[first:stop] = 0.0
    return {"current_ampere": current, "logged_current_ampere": columns["current_ampere"]}


def _blanked(column: np.ndarray) -> np.ndarray:
    """A column with NaN for its marks of "no reading"; the row stays."""
    if not np.issubdtype(column.dtype, np.floating) or not (np.abs(column) > NO_READING).any():
        return column
    return np.where(np.abs(column) > NO_READING, np.nan, column)


def _actions(
    columns: Mapping[str, np.ndarray], flags: np.ndarray, kept: np.ndarray, rests: RestReading
) -> dict[str, np.ndarray]:
    """One line for each flag of each row, and one for each rest whose reading is not counted."""
    time, current, voltage = (columns[name] for name in SERIES)
    timed = Flag.OUT_OF_PLACE | Flag.CLOCK | Flag.GAP | Flag.REPEAT
    at_fault = np.where(np.abs(current) > NO_READING, current, voltage)
    found = [(kind, (time if kind & timed else at_fault)) for kind in Flag]
    lines = [(row, kind, by[row]) for kind, by in found for row in np.flatnonzero(flags & kind)]
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
