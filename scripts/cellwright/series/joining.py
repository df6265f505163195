"""The readings of one test as one series: files joined, clock and charge counter continued."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cellwright.formats import SIGN_RULE, Reading
from cellwright.refusal import Refusal
from cellwright.series.sign import charge_positive

COUNTER = "net_capacity_ampere_hour"
DATE_RESOLUTION = 2.0  # [s] what a date stamp of whole seconds may be wrong by, at either end


class Joined(NamedTuple):
    """One series, and how its files were put together."""

    columns: dict[str, np.ndarray]  # file_index says which file a row came from
    notes: tuple[str, ...]


def join(series: Sequence[Mapping[str, np.ndarray]]) -> Joined:
    """Join the files of one test, given in time order.

    1. Where both files carry absolute time, the pause between them is the real one.
    2. Else, where the second clock goes on from the first, it is kept.
    3. Else the second file begins one sampling interval after the first ends, and a note says so.

    Parameters
    ----------
    series : sequence of mappings of arrays
        test_time_second [s], current_ampere [A], voltage_volt [V] and more; a column that one file
        lacks is NaN there.

    Returns
    -------
    Joined

    Raises
    ------
    Refusal
        By their date stamps, a file begins before the one in front of it ends.
    """
    names = list(dict.fromkeys(name for columns in series for name in columns))
    first, *others = [_with_steady_counter(columns) for columns in series]
    parts, notes = [first], []
    for number, following in enumerate(others, start=2):
        part, note = _continued(parts[-1], following, number)
        parts.append(part)
        notes.append(note)
    joined = {
        name: np.concatenate(
            [
                (part[name] if name in part else np.full(part["test_time_second"].size, np.nan))
                for part in parts
            ]
        )
        for name in names
    }
    sizes = [part["test_time_second"].size for part in parts]
    return Joined({**joined, "file_index": np.repeat(np.arange(len(parts)), sizes)}, tuple(notes))


def _continued(before: Mapping, after: Mapping, number: int) -> tuple[dict, str]:
    """The next file on the clock and counter of the one before."""
    shift, note = _clock_shift(before, after, number)
    part = dict(after)
    part["test_time_second"] = after["test_time_second"] + shift
    if COUNTER in before and COUNTER in after:
        part[COUNTER] = after[COUNTER] + _counter_shift(before[COUNTER], after[COUNTER])
    return part, note


def _clock_shift(before: Mapping, after: Mapping, number: int) -> tuple[float, str]:
    """Seconds to add to the clock of a file, and where they come from."""
    end, start = before["test_time_second"][-1], after["test_time_second"][0]
    interval = _sampling(after["test_time_second"])
    if "unix_time_second" in before and "unix_time_second" in after:
        pause = after["unix_time_second"][0] - before["unix_time_second"][-1]
        if pause < -DATE_RESOLUTION:
            raise Refusal(
                f"file {number} begins {-pause:g} s before file {number - 1} ends, by their dates; "
                "files must be given in time order"
            )
        return end + max(
            pause, interval
        ) - start, f"file {number} follows after {pause:g} s (dates)"
    # A clock that had started anew would show about one sampling interval in its first row.
    if start > end and start > 2 * interval:
        return 0.0, f"file {number} follows after {start - end:g} s (its clock goes on)"
    # ASSUME: A file without dates whose clock starts anew follows the one before at once.
    return end + interval - start, f"file {number} put behind file {number - 1}: pause not known"


def _sampling(time: np.ndarray) -> float:
    """Typical interval [s] between the first rows."""
    steps = np.diff(time[:20])
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0


def _with_steady_counter(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The same with a counter that goes on where the instrument set it to zero within the file.

    A reset jumps by far more than the current could have moved, and lands near zero.
    """
    if COUNTER not in columns:
        return dict(columns)
    counter, current = columns[COUNTER], np.abs(columns["current_ampere"])
    possible = np.maximum(current[1:], current[:-1]) * np.abs(np.diff(columns["test_time_second"]))
    possible = 2 * possible / 3600 + 1e-3 * np.nanmax(np.abs(counter))
    moved = np.diff(counter)
    reset = (np.abs(moved) > 5 * possible) & (np.abs(counter[1:]) < possible)
    moved = np.where(reset, counter[1:], moved)
    return {**columns, COUNTER: counter[0] + np.concatenate([[0.0], np.cumsum(moved)])}


def _counter_shift(before: np.ndarray, after: np.ndarray) -> float:
    """What to add to a counter [Ah]: nothing where it goes on, the old level where it restarted."""
    goes_on = abs(after[0] - before[-1]) <= abs(after[0])
    return 0.0 if goes_on else float(before[-1])


class Assembled(NamedTuple):
    """One series and what a person should know of how it came about."""

    columns: dict[str, np.ndarray]
    notes: tuple[str, ...]


def assemble(readings: Sequence[Reading], *, stated_sign: str | None = None) -> Assembled:
    """Join the readings of one test and turn the current positive on charge.

    Parameters
    ----------
    readings : sequence of Reading, in time order
    stated_sign : {None, "charge_positive", "discharge_positive"}
        What the sheet says of the files; blank or None: found from the data.

    Returns
    -------
    Assembled
        Columns: test_time_second [s], current_ampere [A, + charge], voltage_volt [V], file_index
        and what else the files hold.

    Raises
    ------
    Refusal
        A reading is no series, the files are out of order, or the sign cannot be known.
    """
    for number, reading in enumerate(readings, start=1):
        if reading.kind != "series":
            raise Refusal(f"file {number} holds {reading.kind}, a series is wanted")
    joined = join([reading.columns for reading in readings])
    rules = {SIGN_RULE.get(reading.instrument) for reading in readings}
    default = rules.pop() if len(rules) == 1 else None
    signed = charge_positive(joined.columns, stated=stated_sign or None, default=default)
    return Assembled(signed.columns, (*joined.notes, *([signed.note] if signed.note else [])))
