"""What a file's columns mean: labels and unit strings as the house's columns and units."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal

# Factor to the house's unit of the quantity: s, A, V, Ah, degC, ohm, Hz, 1.
UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0, "h": 3600.0, "d": 86400.0},
    "current": {"A": 1.0, "mA": 1e-3, "uA": 1e-6, "µA": 1e-6},
    "voltage": {"V": 1.0, "mV": 1e-3, "uV": 1e-6, "µV": 1e-6},
    "charge": {"Ah": 1.0, "A.h": 1.0, "mAh": 1e-3, "mA.h": 1e-3, "As": 1 / 3600, "C": 1 / 3600},
    "temperature": {"degC": 1.0, "°C": 1.0, "C": 1.0, "K": 1.0},
    "impedance": {"ohm": 1.0, "Ohm": 1.0, "Ω": 1.0, "mohm": 1e-3, "mOhm": 1e-3, "mΩ": 1e-3},
    "frequency": {"Hz": 1.0, "mHz": 1e-3, "kHz": 1e3},
    "count": {"1": 1.0, "": 1.0},
}
OFFSET = {"K": -273.15}
# Units as words, for labels such as test_time_millisecond.
WORDS = {
    "second": "s", "millisecond": "ms", "minute": "min", "hour": "h", "ampere": "A",
    "milliampere": "mA", "volt": "V", "millivolt": "mV", "ampere_hour": "Ah", "ah": "Ah",
    "celsius": "degC", "kelvin": "K", "ohm": "ohm", "hertz": "Hz", "dimensionless": "1",
}  # fmt: skip


def in_house_unit(values: np.ndarray, *, quantity: str, unit: str, label: str) -> np.ndarray:
    """Convert `values` [unit] of a quantity to the house's unit.

    Raises
    ------
    Refusal
        The unit is not one of those known for the quantity.
    """
    known = UNITS[quantity]
    if unit not in known:
        allowed = ", ".join(name or "none" for name in known)
        raise Refusal(f"column {label!r}: unknown unit {unit!r} of {quantity}; known: {allowed}")
    factor, offset = known[unit], OFFSET.get(unit, 0.0) if quantity == "temperature" else 0.0
    return values if factor == 1.0 and offset == 0.0 else values * factor + offset


def net_capacity(charge_counter: np.ndarray, discharge_counter: np.ndarray) -> np.ndarray:
    """Net charge put in, from two counters that only grow, but may start again from zero.

    Parameters
    ----------
    charge_counter, discharge_counter : arrays [Ah]

    Returns
    -------
    array [Ah], positive on charge whatever the sign of the file's current.
    """
    return _without_resets(charge_counter) - _without_resets(discharge_counter)


def _without_resets(counter: np.ndarray) -> np.ndarray:
    """The magnitude of a counter, continued over its resets; some instruments count downwards."""
    magnitude = np.abs(counter)
    step = np.diff(magnitude, prepend=magnitude[:1])
    # A counter that falls to less than half began again from zero: what it shows was counted since.
    reset = (step < 0) & (magnitude < 0.5 * (magnitude - step))
    return magnitude[:1] + np.cumsum(np.where(reset, magnitude, step))


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
    return with_net_counter(in_house_units(values, fields))


def in_house_units(
    values: Mapping[str, np.ndarray], fields: Sequence[Field]
) -> dict[str, np.ndarray]:
    """As `converted`, with the counters of charge and discharge as they stand."""
    columns = {}
    for field in fields:
        column = in_house_unit(
            values[field.label], quantity=field.quantity, unit=field.unit, label=field.label
        )
        if field.column in SERIES + IMPEDANCE or np.isfinite(column).any():
            columns[field.column] = _counted(column) if field.quantity == "count" else column
    return columns


def _counted(column: np.ndarray) -> np.ndarray:
    whole = np.isfinite(column).all() and (column == np.rint(column)).all()
    return column.astype(np.int64) if whole else column


def with_net_counter(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Columns with the counters of charge and of discharge, where both are, as one net counter."""
    counters = [columns.pop(name, None) for name in COUNTERS]
    if "net_capacity_ampere_hour" not in columns and all(c is not None for c in counters):
        columns["net_capacity_ampere_hour"] = net_capacity(*counters)
    return columns
