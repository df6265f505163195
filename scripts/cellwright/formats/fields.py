"""What a file's columns mean: labels → the house's columns and units."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..refusal import Refusal
from .counters import net_capacity
from .units import in_house_unit

SERIES = ("test_time_second", "current_ampere", "voltage_volt")
IMPEDANCE = ("frequency_hertz", "impedance_real_ohm", "impedance_imaginary_ohm")
COUNTERS = ("charge_counter", "discharge_counter")


class Field(NamedTuple):
    """One column of a file that the house knows."""

    label: str  # as the file writes it
    column: str  # the house's name for it
    quantity: str  # a key of units.UNITS
    unit: str  # as the file writes it


def known_fields(labels: Iterable[str], meaning: Callable[[str], Field | None]) -> list[Field]:
    """Fields that `meaning` knows among the labels; a column found twice is refused."""
    fields = [field for label in dict.fromkeys(labels) if (field := meaning(label))]
    columns = [field.column for field in fields]
    for field in fields:
        if columns.count(field.column) > 1:
            same = [other.label for other in fields if other.column == field.column]
            raise Refusal(f"columns {same} say the same thing; one is wanted")
    return fields


def require(fields: Sequence[Field], columns: Sequence[str], spelt: Mapping[str, str]) -> None:
    """Refuse a file that lacks a column; `spelt` says how the instrument labels it."""
    found = {field.column for field in fields}
    missing = [spelt[column] for column in columns if column not in found]
    if missing:
        have = ", ".join(repr(field.label) for field in fields) or "none that is known"
        raise Refusal(f"no column {', '.join(map(repr, missing))}; found: {have}")


def converted(values: Mapping[str, np.ndarray], fields: Sequence[Field]) -> dict[str, np.ndarray]:
    """Columns in the house's names and units, from values by label.

    Optional columns without a single number are left out. Counters of charge and of discharge
    become one net counter.
    """
    columns = {}
    for field in fields:
        column = in_house_unit(
            values[field.label], quantity=field.quantity, unit=field.unit, label=field.label
        )
        if field.column in SERIES + IMPEDANCE or np.isfinite(column).any():
            columns[field.column] = _counted(column) if field.quantity == "count" else column
    return _with_net_counter(columns)


def _counted(column: np.ndarray) -> np.ndarray:
    whole = np.isfinite(column).all() and (column == np.rint(column)).all()
    return column.astype(np.int64) if whole else column


def _with_net_counter(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    counters = [columns.pop(name, None) for name in COUNTERS]
    if "net_capacity_ampere_hour" not in columns and all(c is not None for c in counters):
        columns["net_capacity_ampere_hour"] = net_capacity(*counters)
    return columns
