"""The one place that removes: a flagged series → a clean one, and a list of what was done."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..refusal import Refusal
from .charge import net_charge
from .flags import NO_READING, REMOVED, SERIES, Flag, flag, rebased
from .spikes import spike_free

ACTION = {
    Flag.NAN: "row removed",
    Flag.SENTINEL: "row removed",
    Flag.REPEAT: "row removed",
    Flag.OUT_OF_PLACE: "row removed",
    Flag.CLOCK: "time re-based, row kept",
    Flag.SPIKE: "voltage replaced by the mean of its four neighbours",
    Flag.GAP: "kept",
}


class Cleaned(NamedTuple):
    """A clean series and what was done to it."""

    columns: dict[str, np.ndarray]
    actions: dict[str, np.ndarray]  # row (of the raw series), test_time_second, flag, value, action


def clean(columns: Mapping[str, np.ndarray], **settings: float) -> Cleaned:
    """Flag a series and remove what is flagged; settings as for `flag`."""
    return remove(columns, flag(columns, **settings))


def remove(columns: Mapping[str, np.ndarray], flags: np.ndarray) -> Cleaned:
    """Remove and repair what is flagged, and add charge_ampere_hour.

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
    clean["charge_ampere_hour"] = net_charge(
        clean["test_time_second"],
        clean["current_ampere"],
        gap_rows=np.flatnonzero(marks & Flag.GAP),
        counter_ampere_hour=clean.get("net_capacity_ampere_hour"),
    )
    return Cleaned(clean, _actions(columns, flags))


def _blanked(column: np.ndarray) -> np.ndarray:
    """Marks for "no reading" in the other channels become NaN: their row stays."""
    if not np.issubdtype(column.dtype, np.floating) or not (np.abs(column) > NO_READING).any():
        return column
    return np.where(np.abs(column) > NO_READING, np.nan, column)


def _actions(columns: Mapping[str, np.ndarray], flags: np.ndarray) -> dict[str, np.ndarray]:
    """One line for each flag of each row."""
    lines = [(row, kind) for kind in Flag for row in np.flatnonzero(flags & kind)]
    lines.sort(key=lambda line: line[0])
    rows = np.array([row for row, _ in lines], dtype=int)
    time, current, voltage = (columns[name] for name in SERIES)
    timed = Flag.OUT_OF_PLACE | Flag.CLOCK | Flag.GAP | Flag.REPEAT
    at_fault = np.where(np.abs(current) > NO_READING, current, voltage)
    value = [time[row] if kind & timed else at_fault[row] for row, kind in lines]
    return {
        "row": rows,
        "test_time_second": time[rows],
        "flag": np.array([kind.name.lower() for _, kind in lines], dtype=str),
        "value": np.array(value, dtype=float),
        "action": np.array([ACTION[kind] for _, kind in lines], dtype=str),
    }
