"""Arbin: a workbook (.xlsx), or the csv of one of its channel sheets.

Labels are `Test_Time(s)`, `Test Time (s)` or, of its data base, bare. Charge and discharge counters
are per file or per cycle; time is the whole test's. A channel whose rows fill a sheet goes on in
another one.
"""

import re
from itertools import pairwise

import numpy as np

from cellwright.formats.content import Content, head_of, whole_of
from cellwright.formats.dates import Dates, date_readings
from cellwright.formats.fields import (
    SERIES,
    Field,
    converted,
    known_fields,
    label_of,
    require,
)
from cellwright.formats.table import (
    CHANNEL,
    DELIMITERS,
    Words,
    is_number,
    layout_of,
    line_of,
    read_table,
    refuse_channels,
    unquoted,
)
from cellwright.formats.workbook import dates, is_workbook, numbers, sheets_of
from cellwright.refusal import Refusal

NAME = "arbin"
# Third: the unit of Arbin's data base, whose exports carry bare labels.
MEANING = {
    "test time": ("test_time_second", "time", "s"),
    "current": ("current_ampere", "current", "A"),
    "voltage": ("voltage_volt", "voltage", "V"),
    "charge capacity": ("charge_counter", "charge", "Ah"),
    "discharge capacity": ("discharge_counter", "charge", "Ah"),
    "charge energy": ("charge_energy_counter", "energy", "Wh"),
    "discharge energy": ("discharge_energy_counter", "energy", "Wh"),
    "step index": ("step_index", "count", "1"),
    "cycle index": ("cycle_count", "count", "1"),
    "temperature": ("surface_temperature_celsius", "temperature", "degC"),
    "cell temperature": ("surface_temperature_celsius", "temperature", "degC"),
    "aux temperature 1": ("surface_temperature_celsius", "temperature", "degC"),
    "environment temperature": ("ambient_temperature_celsius", "temperature", "degC"),
}
SPELT = dict(zip(SERIES, ("Test_Time(s)", "Current(A)", "Voltage(V)"), strict=True))
OWN = {"test time", "data point", "step index", "cycle index", "date time", "charge capacity"}
DATES = ("%m/%d/%Y %H:%M:%S", "%Y-%m-%d %H:%M:%S", "%m/%d/%Y %I:%M:%S %p", "%m/%d/%Y %H:%M")
CHANNEL_SHEET = "Channel"  # begins the names of the sheets that hold readings
LABEL = re.compile(r"^(?P<base>[^()]+?)\s*(?:\((?P<unit>[^()]*)\))?$")


def recognises(head: bytes) -> bool:
    """At least three of the labels that only Arbin writes in the first line."""
    labels = re.split(f"[{DELIMITERS}]", line_of(head, 1))
    bases = {_base_and_unit(unquoted(label))[0] for label in labels}
    return len(bases & OWN) >= 3 and not bases.isdisjoint({"test time", "current", "voltage"})


def read(data: bytes | Content) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Columns of an Arbin workbook or csv, and notes."""
    if is_workbook(head_of(data)):
        return _of_workbook(whole_of(data)), ()
    return _of_text(data)


def _of_workbook(data):
    """Columns of all channel sheets, one behind the other in the order of their clocks."""
    sheets = sheets_of(data, lambda name: name.startswith(CHANNEL_SHEET))
    parts = sorted((_of_sheet(sheet) for sheet in sheets), key=lambda p: p["test_time_second"][0])
    for before, after in pairwise(parts):
        end, start = before["test_time_second"][-1], after["test_time_second"][0]
        if start < end:
            named = ", ".join(repr(sheet.name) for sheet in sheets)
            raise Refusal(
                f"sheets {named} run at the same time ({start:g} s is before {end:g} s), so they "
                "are several channels; one channel a file is wanted"
            )
    shared = [name for name in parts[0] if all(name in part for part in parts)]
    return {name: np.concatenate([part[name] for part in parts]) for name in shared}


def _of_sheet(sheet):
    """Columns of one channel sheet in the house's names and units, its counters as they stand."""
    fields = known_fields(sheet.labels, meaning)
    require(fields, SERIES, SPELT)
    columns = converted(numbers(sheet, [field.label for field in fields]), fields)
    label = next((name for name in sheet.labels if _is_date(name)), None)
    seconds = dates(sheet, label) if label else None
    return columns if seconds is None else columns | {"unix_time_second": seconds}


def _of_text(data):
    layout = layout_of(data)
    fields = known_fields(layout.labels, meaning)
    require(fields, SERIES, SPELT)
    date = [label for label in layout.labels if _is_date(label)][:1]
    channels = [x for x in layout.labels if re.fullmatch(CHANNEL, x, re.I)]
    texts = dict.fromkeys(channels, Words) | dict.fromkeys(date, _Stamps)
    found, notes = read_table(data, layout, [field.label for field in fields], texts=texts)
    refuse_channels(found, channels)
    seconds = found.pop(date[0]) if date else None
    dated = {} if seconds is None else {"unix_time_second": seconds}
    return converted(found, fields) | dated, notes


def _is_date(label):
    return _base_and_unit(label)[0] in ("date time", "datetime")


class _Stamps:
    """Absolute time from the date column, block by block: date texts, or seconds since 1970."""

    def __init__(self):
        self.dates, self.numbers = None, []

    def add(self, block):
        """Read a block of the column (pyarrow strings)."""
        import pyarrow as pa
        import pyarrow.compute as pc

        if self.dates is None:
            self.dates = Dates(() if is_number(block[0].as_py().strip()) else DATES)
            self.numbers = None if self.dates.seconds else []
        self.dates.add(block)
        if self.numbers is not None:
            try:
                self.numbers.append(pc.cast(block, pa.float64()).to_numpy(zero_copy_only=False))
            except pa.ArrowInvalid:
                self.numbers = None

    def all(self):
        """Seconds since 1970 (n,), or None where they cannot be read."""
        if self.dates is None:  # of no row
            return None
        if self.numbers:
            return np.concatenate(self.numbers)
        return next(iter(date_readings(self.dates.all()).values()), None)


def meaning(label: str) -> Field | None:
    """What a label of Arbin means; None where it is not known."""
    base, unit = _base_and_unit(label)
    if base not in MEANING:
        return None
    column, quantity, bare_unit = MEANING[base]
    return Field(label, column, quantity, bare_unit if unit is None else unit.strip())


def _base_and_unit(label: str) -> tuple[str, str | None]:
    parts = LABEL.match(label_of(label.strip().lstrip("\ufeff")))
    if not parts:
        return "", None
    return parts["base"].replace("_", " ").strip().lower(), parts["unit"]
