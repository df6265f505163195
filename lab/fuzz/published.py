"""The numbers that a record publishes, each with its interval and whether it owns up to a doubt."""

import io
from typing import NamedTuple

import numpy as np

import cellwright as cw
from cellwright.records import inputs
from fuzz.record import TIME

# What counts as wrong beyond a stated interval: share of the value, and least in its unit.
SHARE = {"capacity": 0.005, "efficiency": 0.005, "temperature": 0.0, "resistance": 0.02}
LEAST = {"capacity": 0.0, "efficiency": 0.0, "temperature": 1.0, "resistance": 1e-4}
# The stated temperature beside a measured one is a number too: laws over temperature use it.
SHARE, LEAST = SHARE | {"chamber": 0.0}, LEAST | {"chamber": 1.0}


class Number(NamedTuple):
    """One published number: what it is, of which half cycle or pulse, value, std, its doubt."""

    quantity: str
    where: tuple
    value: float
    std: float
    doubt: str


class Outcome(NamedTuple):
    """All that one record gives: rows by quantity, notes and flags, or the reason for none."""

    rows: dict
    notes: tuple
    refused: str = ""
    crash: str = ""


def file_of(record):
    """The bytes of a record as a file in the Battery Data Format."""
    columns = record.columns
    labels = [record.labels.get(name, name) for name in columns]
    lines = io.StringIO()
    lines.write(",".join(labels) + "\n")
    cells = [_written(name, np.asarray(column)) for name, column in columns.items()]
    lines.writelines(",".join(row) + "\n" for row in zip(*cells, strict=True))
    text = lines.getvalue()
    return (record.text(text) if record.text else text).encode("utf-8", "surrogateescape")


def _written(name, column):
    """Cells of a column, as a file holds them."""
    if column.dtype.kind == "U":
        return column.tolist()
    exact = name in (TIME, "second") or "Unix" in name
    return [("%.10g" if exact else "%.7g") % value for value in column.tolist()]


def outcome_of(record):
    """What a record publishes, through the same steps as the workflow."""
    try:
        return _outcome(file_of(record), record)
    except cw.Refusal as reason:
        return Outcome({}, (), refused=str(reason))
    except Exception as fault:  # what is looked for: anything but our own refusal
        return Outcome({}, (), crash=f"{type(fault).__name__}: {fault}")


def _outcome(data, record):
    series = cw.read(data, name="record.bdf.csv")
    clean = cw.clean(series.columns, cell=record.cell, test=record.test)
    steps = cw.segment(clean.columns, record.cell)
    notes = [*series.notes, *clean.notes, *map(str, np.unique(clean.actions["flag"]))]
    tables, refused = {}, []
    for name, publish in (("capacity", _capacities), ("resistance", _resistances)):
        try:
            found, said = publish(clean.columns, steps, record)
        except cw.Refusal as reason:
            refused.append(str(reason))
            continue
        names = ("test", "cycle", "ambient_temperature_celsius")
        facts = {"cell": record.cell["cell"]} | {n: record.test.get(n) for n in names}
        tables[name] = [facts | row for row in _rows(found)]
        notes += said
    if not tables:
        return Outcome({}, tuple(notes), "; ".join(refused))
    # What is refused beside what is published stands in excluded.csv, with its reason.
    return Outcome(tables, (*notes, *refused))


def _capacities(columns, steps, record):
    found = cw.capacity(columns, steps, record.cell, test=record.test)
    return found.rows, found.notes


def _resistances(columns, steps, record):
    """Pulse resistances; their SoC from the record's own charge, as far as its rating tells it."""
    from cellwright.protocols.resistance import pulse_resistance
    from cellwright.settings import Resistance

    rated = record.cell["rated_capacity_ampere_hour"]
    begun = record.test.get("soc")
    soc = (np.nan if begun is None else begun) + columns["charge_ampere_hour"] / rated
    found = pulse_resistance(
        columns,
        soc,
        inputs.steps(steps),
        rated_capacity_ampere_hour=rated,
        **Resistance()._asdict(),
    )
    return found.rows, found.notes


def _rows(columns):
    columns = columns if isinstance(columns, dict) else columns._asdict()
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def numbers_of(outcome, others=()):
    """The numbers of an outcome, held against those that the cell's other tests publish."""
    numbers = []
    for name, rows in outcome.rows.items():
        beside = [row for other in others for row in other.rows.get(name, ())]
        told = cw.disagreements([*rows, *beside], quantity=name).rows[: len(rows)]
        numbers += [number for row in told for number in OF_ROW[name](row)]
    return numbers


def _of_capacity(row):
    where, doubt = (str(row["direction"]), float(row["c_rate"])), row["doubt"]
    size, std = row["capacity_ampere_hour"], row["capacity_std_ampere_hour"]
    measured, stated = row["temperature_mean_celsius"], row["ambient_temperature_celsius"]
    known = np.isfinite(measured) and stated is not None
    return [
        Number("capacity", where, size, std, doubt),
        Number(
            "efficiency",
            where,
            row["coulombic_efficiency"],
            row.get("coulombic_efficiency_std", np.nan),
            doubt,
        ),
        Number("temperature", where, measured, 0.0, doubt),
        Number("chamber", where, stated if known else np.nan, 0.0, doubt),
    ]


def _of_resistance(row):
    if row["delay_second"] > 0:
        return []
    where = str(row["direction"]), float(row["voltage_before_volt"])
    values = row["resistance_ohm"], row["resistance_std_ohm"], row["doubt"]
    return [Number("resistance", where, *values)]


OF_ROW = {"capacity": _of_capacity, "resistance": _of_resistance}


def wrong_numbers(numbers, clean):
    """The numbers that differ from the clean record's by more than their interval.

    Each is held against the clean number of the same direction with the nearest rate or place.
    """
    wrong = []
    for number in numbers:
        same = [
            n for n in clean
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
