"""The numbers that a record publishes, each with its interval and whether it owns up to a doubt."""

import io
from typing import NamedTuple

import numpy as np

import cellwright as cw
from fuzz.kinds import TIME

# What counts as wrong beyond a stated interval: share of the value, and least in its unit.
SHARE = {"capacity": 0.005, "efficiency": 0.005, "temperature": 0.0, "resistance": 0.02}
LEAST = {"capacity": 0.0, "efficiency": 0.0, "temperature": 1.0, "resistance": 1e-4}


class Number(NamedTuple):
    """One published number: what it is, of which half cycle or pulse, value, std, its doubt."""

    quantity: str
    where: tuple
    value: float
    std: float
    doubt: str


class Outcome(NamedTuple):
    """All that one record gives: numbers, notes and flags beside them, or the reason for none."""

    numbers: list
    notes: tuple
    refused: str = ""
    crash: str = ""


def file_of(record):
    """The bytes of a record as a file in the Battery Data Format."""
    columns = record.columns
    labels = [record.labels.get(name, name) for name in columns]
    lines = io.StringIO()
    lines.write(",".join(labels) + "\n")
    table = np.column_stack([np.asarray(c, float) for c in columns.values()])
    formats = ["%.10g" if name == TIME or "Unix" in name else "%.7g" for name in columns]
    np.savetxt(lines, table, fmt=formats, delimiter=",")
    text = lines.getvalue()
    return (record.text(text) if record.text else text).encode("utf-8", "surrogateescape")


def outcome_of(record):
    """What a record publishes, through the same steps as the workflow."""
    try:
        return _outcome(file_of(record), record)
    except cw.Refusal as reason:
        return Outcome([], (), refused=str(reason))
    except Exception as fault:  # what is looked for: anything but our own refusal
        return Outcome([], (), crash=f"{type(fault).__name__}: {fault}")


def _outcome(data, record):
    series = cw.read(data, name="record.bdf.csv")
    clean = cw.clean(series.columns, cell=record.cell)
    steps = cw.segment(clean.columns, record.cell)
    notes = [*series.notes, *clean.notes, *map(str, np.unique(clean.actions["flag"]))]
    numbers, refused = [], []
    for publish in (_capacities, _resistances):
        try:
            found, said = publish(clean.columns, steps, record)
        except cw.Refusal as reason:
            refused.append(str(reason))
            continue
        numbers += found
        notes += said
    return Outcome(numbers, tuple(notes), "" if numbers else "; ".join(refused))


def _capacities(columns, steps, record):
    found = cw.capacity(columns, steps, record.cell, test=record.test)
    numbers = []
    for row in _rows(found.rows):
        where = (str(row["direction"]), float(row["c_rate"]))
        doubt = row.get("doubt", "")
        numbers += [
            Number("capacity", where, row["capacity_ampere_hour"], row["capacity_std_ampere_hour"], doubt),
            Number("efficiency", where, row["coulombic_efficiency"], row.get("coulombic_efficiency_std", np.nan), doubt),
            Number("temperature", where, row["temperature_mean_celsius"], 0.0, doubt),
        ]  # fmt: skip
    return numbers, found.notes


def _resistances(columns, steps, record):
    from cellwright.protocols.resistance import pulse_resistance
    from cellwright.settings import Resistance

    names = ("test_time_second", "current_ampere", "voltage_volt")
    found = pulse_resistance(
        *(columns[name] for name in names),
        np.full(len(columns[names[0]]), np.nan),
        cw.api.inputs.steps(steps),
        rated_capacity_ampere_hour=record.cell["rated_capacity_ampere_hour"],
        doubt=columns.get("doubt"),
        **Resistance()._asdict(),
    )
    rows = _rows(found.rows)
    first = min((row["delay_second"] for row in rows), default=0)
    kept = [row for row in rows if row["delay_second"] == first]
    return [
        Number("resistance", (str(row["direction"]), float(row["voltage_before_volt"])), row["resistance_ohm"], row["resistance_std_ohm"], row.get("doubt", ""))
        for row in kept
    ], found.left_out  # fmt: skip


def _rows(columns):
    columns = columns if isinstance(columns, dict) else columns._asdict()
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def wrong_numbers(outcome, clean):
    """The numbers of an outcome that differ from the clean record's by more than their interval.

    Each is held against the clean number of the same direction with the nearest rate or place.
    """
    wrong = []
    for number in outcome.numbers:
        same = [
            n for n in clean.numbers
            if n.quantity == number.quantity and n.where[0] == number.where[0]
        ]  # fmt: skip
        if not same or not np.isfinite(number.value):
            continue
        true = min(same, key=lambda n: abs(n.where[1] - number.where[1]))
        if not np.isfinite(true.value):
            continue
        std = np.hypot(np.nan_to_num(number.std), np.nan_to_num(true.std))
        floor = max(SHARE[number.quantity] * abs(true.value), LEAST[number.quantity])
        if abs(number.value - true.value) > max(2 * std, floor):
            wrong.append((number, true))
    return wrong
