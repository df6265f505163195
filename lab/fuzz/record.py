"""A record as columns and facts, which the kinds of wrong records change."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

TIME, CURRENT, VOLTAGE = "Test Time / s", "Current / A", "Voltage / V"
CHARGED, DISCHARGED = "Charging Capacity / Ah", "Discharging Capacity / Ah"
UNIX, SURFACE = "Unix Time / s", "Surface Temperature T1 / degC"
AMBIENT = "Ambient Temperature / degC"
CUTOFFS = ("lower_cutoff_volt", "upper_cutoff_volt")


class Record(NamedTuple):
    """A file to be: columns (n,) by label, facts of the cell and of the test, labels as written.

    columns : numbers, or texts, which are written as they are. labels : column → label written
    instead of its own. text : changes the written text. beside : columns of another cell's record.
    """

    columns: dict
    cell: dict
    test: dict
    labels: dict
    text: Callable | None = None
    beside: dict | None = None

    def having(self, **columns):
        """This record with other columns, by their short names."""
        named = {SHORT[name]: values for name, values in columns.items()}
        return self._replace(columns=self.columns | named)

    def of_rows(self, rows):
        """This record with these rows only, or in this order."""
        return self._replace(columns={n: c[rows] for n, c in self.columns.items()})


SHORT = {"time": TIME, "current": CURRENT, "voltage": VOLTAGE, "surface": SURFACE}


def row_count(record):
    """Rows of a record."""
    return len(record.columns[TIME])


def spot(record, rng, low=0.15, high=0.85):
    """A row under load, by its share of the record's rows."""
    current = np.abs(record.columns[CURRENT])
    loaded = np.flatnonzero(current > 0.05 * current.max())
    loaded = loaded[(loaded > low * row_count(record)) & (loaded < high * row_count(record))]
    return int(rng.choice(loaded)) if len(loaded) else row_count(record) // 2


def block(record, rng, share):
    """A stretch of rows that begins under load and spans a share of the record."""
    row = spot(record, rng, 0.1, 0.8)
    return slice(row, min(row + max(int(share * row_count(record)), 3), row_count(record) - 2))


def discharges(record):
    """Stretches of rows of more than 20 under a discharge, (first, stop) each."""
    current = record.columns[CURRENT]
    edges = np.flatnonzero(np.diff(np.r_[0, current < -0.05 * np.abs(current).max(), 0]))
    return [(a, b) for a, b in edges.reshape(-1, 2) if b - a > 20]


def counters(record):
    """Columns of both counters [Ah] of a record, its own or by its current and clock."""
    if CHARGED in record.columns:
        return {name: record.columns[name] for name in (CHARGED, DISCHARGED)}
    time, current = record.columns[TIME], record.columns[CURRENT]
    step = np.r_[0.0, 0.5 * (current[1:] + current[:-1]) * np.diff(time) / 3600]
    return {CHARGED: np.cumsum(np.maximum(step, 0)), DISCHARGED: np.cumsum(np.maximum(-step, 0))}
