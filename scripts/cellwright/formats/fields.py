"""What a file's columns mean: labels and unit strings as the house's columns and units."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cellwright.formats.pieces import all_where, any_where, pieces
from cellwright.formats.pieces import summed as sums_of
from cellwright.gate import refuse_columns
from cellwright.refusal import Refusal

# Factor to the house's unit of the quantity: s, A, V, Ah, degC, ohm, Hz, 1.
UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0, "h": 3600.0, "d": 86400.0},
    "current": {"A": 1.0, "mA": 1e-3, "uA": 1e-6, "µA": 1e-6},
    "voltage": {"V": 1.0, "mV": 1e-3, "uV": 1e-6, "µV": 1e-6},
    "charge": {"Ah": 1.0, "A.h": 1.0, "mAh": 1e-3, "mA.h": 1e-3, "As": 1 / 3600, "C": 1 / 3600},
    "energy": {"Wh": 1.0, "W.h": 1.0, "mWh": 1e-3, "mW.h": 1e-3},
    "temperature": {"degC": 1.0, "°C": 1.0, "C": 1.0, "K": 1.0, "degF": 5 / 9},
    "angle": {"deg": 1.0, "rad": 180.0 / np.pi},
    "impedance": {"ohm": 1.0, "Ohm": 1.0, "Ω": 1.0, "mohm": 1e-3, "mOhm": 1e-3, "mΩ": 1e-3},
    "frequency": {"Hz": 1.0, "mHz": 1e-3, "kHz": 1e3},
    "count": {"1": 1.0, "": 1.0},
}
OFFSET = {"K": -273.15, "degF": -160 / 9}
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


def _without_resets(counter: np.ndarray) -> np.ndarray:
    """The magnitude of a counter, continued over its resets; some instruments count downwards."""
    total, before, last = np.empty(len(counter)), np.abs(counter[:1]), None
    first = before
    for part in pieces(len(counter)):
        magnitude = np.abs(counter[part])
        step = np.diff(magnitude, prepend=before)
        # A counter that falls to less than half began again from zero: it shows what it counted.
        falls = np.flatnonzero(step < 0)
        reset = falls[magnitude[falls] < 0.5 * (magnitude[falls] - step[falls])]
        step[reset] = magnitude[reset]
        before, last = magnitude[-1:], sums_of(step, last)
        total[part] = step + first
    return total


SERIES = ("test_time_second", "current_ampere", "voltage_volt")
IMPEDANCE = ("frequency_hertz", "impedance_real_ohm", "impedance_imaginary_ohm")
MINUS = "minus_impedance_imaginary_ohm"
NET = "net_capacity_ampere_hour"
# ASSUME: Counters that agree with the current for nine tenths of the charge determine its sign.
CLEAR_SIGN = 0.9
BACK_SHARE = 0.05  # of its travel that a net counter goes back, at least
LONGEST_LABEL = 200
REPEATED = re.compile(r"(?<=[)\]\w])\.\d{1,2}$")  # what pandas puts behind a label used before
COUNTERS = ("charge_counter", "discharge_counter")
ENERGIES = ("charge_energy_counter", "discharge_energy_counter")
ENERGY = "net_energy_watt_hour"  # as the instrument counts it: a witness, which no result holds


class Field(NamedTuple):
    """One column of a file that the house knows."""

    label: str  # as the file writes it
    column: str  # the house's name for it
    quantity: str  # a key of units.UNITS
    unit: str  # as the file writes it


def refuse_repeated(labels: Sequence[str], meaning: Callable[[str], Field | None]) -> None:
    """Refuse a file in which two columns that `meaning` knows have one label.

    The second of pandas' labels `Voltage (V)` and `Voltage (V).1` is one of them.
    """
    for label in dict.fromkeys(labels):
        first = REPEATED.sub("", label)
        same = labels.count(label) > 1 or (first != label and first in labels)
        if same and (meaning(label) or meaning(first)):
            places = [k + 1 for k, one in enumerate(labels) if REPEATED.sub("", one) == first]
            raise Refusal(
                f"columns {', '.join(map(str, places))} have one label, {first!r}: two channels "
                "side by side? Keep one channel a file, and one label a column"
            )


def probe_column(number: int) -> str:
    """Column of a thermometer on the cell, of several the one of a number from 1 on."""
    return f"surface_temperature{f'_{number}' if number > 1 else ''}_celsius"


def label_of(text: str) -> str:
    """A label without blanks around it, each between its words once, of 200 letters at most.

    Patterns try each of many blanks as the end of a name: thousands of them took hours.
    """
    return " ".join(text.split())[:LONGEST_LABEL]


def known_fields(labels: Iterable[str], meaning: Callable[[str], Field | None]) -> list[Field]:
    """Fields that `meaning` knows among the labels; a column found twice is refused."""
    labels = list(labels)
    refuse_columns(len(labels))
    refuse_repeated(labels, meaning)
    fields = [field for label in dict.fromkeys(labels) if (field := meaning(label))]
    columns = [field.column for field in fields]
    for field in fields:
        if columns.count(field.column) > 1:
            same = [other.label for other in fields if other.column == field.column]
            raise Refusal(f"columns {same} say the same thing; one is wanted")
    return fields


def require(
    fields: Sequence[Field],
    columns: Sequence[str],
    spelt: Mapping[str, str],
    labels: Sequence[str] = (),
) -> None:
    """Refuse a file that lacks a column; `spelt` says how the instrument labels it.

    labels : all of the file, to name those that are not known.
    """
    found = {field.column for field in fields}
    missing = [spelt[column] for column in columns if column not in found]
    if missing:
        known = [field.label for field in fields]
        have = ", ".join(map(repr, known)) or "none that is known"
        others = ", ".join(repr(label) for label in labels if label and label not in known)
        unknown = f"; not known: {others}" if others else ""
        raise Refusal(f"no column {', '.join(map(repr, missing))}; found: {have}{unknown}")


def converted(values: dict[str, np.ndarray], fields: Sequence[Field]) -> dict[str, np.ndarray]:
    """Columns in the house's names and units, from values by label, which are taken out.

    What became another column is not held beside it.
    Optional columns without a single number are left out, but for thermometers, which are named.
    """
    columns = {}
    for field in fields:
        column = in_house_unit(
            values.pop(field.label), quantity=field.quantity, unit=field.unit, label=field.label
        )
        wanted = field.column in SERIES + IMPEDANCE or field.quantity == "temperature"
        if wanted or any_where(np.isfinite, column):
            columns[field.column] = _counted(column) if field.quantity == "count" else column
    return columns


def _counted(column: np.ndarray) -> np.ndarray:
    whole = all_where(lambda c: np.isfinite(c) & (c == np.rint(c)), column)
    return column.astype(np.int64) if whole else column


def with_net_counter(columns: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], int]:
    """Columns with the counters of charge and of discharge as one net counter, and the sign.

    Those of energy likewise, as net_energy_watt_hour [Wh]. Two counters say which way the charge
    went, whatever sign the current is written with; a current that is never negative takes its
    signs from them.

    Returns
    -------
    columns : those given, from which counters are taken out, with net_capacity_ampere_hour [Ah],
        positive on charge, where both counters are.
    sign : 1 where the current is positive on charge, -1 where it is negative, 0 where no counters
        tell it.
    """
    if columns.keys() >= set(ENERGIES):
        counters = (_without_resets(columns.pop(name)) for name in ENERGIES)
        columns[ENERGY] = _difference(*counters)
    for name in ENERGIES:
        columns.pop(name, None)
    if not columns.keys() >= set(COUNTERS):
        return _with_lone_counter(columns, *(columns.pop(name, None) for name in COUNTERS))
    current = columns["current_ampere"]
    charge, discharge = (_without_resets(columns.pop(name)) for name in COUNTERS)
    if np.nanmin(current, initial=0.0) >= 0:
        moves = [np.diff(counter, prepend=np.nan) for counter in (charge, discharge)]
        if all(np.nansum(move) > 0 for move in moves):
            columns["current_ampere"] = current * _directions(*moves)
    columns[NET] = _difference(charge, discharge)
    return columns, _sign_of(columns)


def _difference(values, others):
    """Values less others, in the place of the values."""
    return np.subtract(values, others, out=values)


def _sign_of(columns):
    """1 or -1: which way the current runs with the net counter; 0 where that is not clear."""
    share = counted_share(columns)
    return int(np.sign(share)) if abs(share) > CLEAR_SIGN else 0


def _with_lone_counter(columns, charge, discharge):
    """Columns with the net counter that one of charge, or of discharge, alone may be; the sign.

    It is one where it goes back row by row; one that stands still in the other direction is none,
    and is left out. PyBaMM's discharge capacity falls while the cell is charged.
    """
    lone, sign = (discharge, -1.0) if charge is None else (charge, 1.0)
    if lone is None or NET in columns:
        return columns, 0
    moved = np.diff(lone)
    falls = np.flatnonzero(moved < 0)
    # What begins anew falls in one row to less than half.
    gradual = falls[np.abs(lone[falls + 1]) > 0.5 * np.abs(lone[falls])]
    if -np.nansum(moved[gradual]) < BACK_SHARE * np.nansum(np.abs(moved)) or not len(gradual):
        return columns, 0
    columns[NET] = sign * lone
    return columns, _sign_of(columns)


def _directions(charged, discharged):
    """1 or -1 of each row, by the counter that moved up to it, or else next after it."""
    moved = np.nan_to_num(np.sign(charged) - np.sign(discharged))
    rows = np.flatnonzero(moved)
    following = np.minimum(np.searchsorted(rows, np.arange(len(moved))), len(rows) - 1)
    return moved[rows[following]]


def counted_share(columns: Mapping[str, np.ndarray]) -> float:
    """1 where charge by clock and current runs with the net counter, -1 against it, 0 unclear.

    Only rows count between which the current is steady and the clock goes on.
    """
    agreed = total = 0.0
    for rows in pieces(len(columns[NET]), beside=1):
        time, current, net = (columns[name][rows] for name in (*SERIES[:2], NET))
        interval = np.diff(time)
        steady = (np.abs(np.diff(current)) <= 0.5 * np.abs(current[1:])) & (interval > 0)
        product = ((current[1:] + current[:-1]) * interval * np.diff(net))[steady]
        agreed += np.nansum(product)
        total += np.nansum(np.abs(product))
    return agreed / total if total > 0 else 0.0
