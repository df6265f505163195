"""Digatron: csv with about thirty lines on the test, a line of names, one of units, then rows.

A file is a series, or an impedance spectrum where it has `Zreal1` and `Zimg1`. Those are in
milliohm though the line of units only says [EIS]; each row's own amplitudes prove it:
Betrag = VRelativ × mvIdeal / AAmplitude. `Zimg1` is the imaginary part itself.
"""

import re
from functools import partial

import numpy as np

from cellwright.formats.content import Content, head_of, with_lines_changed
from cellwright.formats.dates import Clocks, Dates, date_readings
from cellwright.formats.fields import IMPEDANCE, SERIES, Field, converted, known_fields, require
from cellwright.formats.table import (
    Layout,
    decoded,
    layout_of,
    line_of,
    offset_of,
    read_table,
)
from cellwright.refusal import Refusal

NAME = "digatron"
MEANING = {
    "Current": ("current_ampere", "current"),
    "Voltage": ("voltage_volt", "voltage"),
    "Capacity": ("net_capacity_ampere_hour", "charge"),
    "AhAccu": ("net_capacity_ampere_hour", "charge"),
    "Temperature": ("surface_temperature_celsius", "temperature"),
    "Step": ("step_index", "count"),
    "Cycle": ("cycle_count", "count"),
}
SPECTRUM = (
    Field("ActFreq", "frequency_hertz", "frequency", "Hz"),
    Field("Zreal1", "impedance_real_ohm", "impedance", "mohm"),
    Field("Zimg1", "impedance_imaginary_ohm", "impedance", "mohm"),
)
PROOF = ("VRelativ", "mvIdeal", "AAmplitude")
CLOCK, DATE = "Prog Time", "Time Stamp"
DATES = ("%m/%d/%Y %I:%M:%S %p", "%m/%d/%Y %H:%M:%S", "%d.%m.%Y %H:%M:%S")
SPELT = {field.column: field.label for field in SPECTRUM}
SPELT |= dict(zip(SERIES, (CLOCK, "Current", "Voltage"), strict=True))


def recognises(head: bytes) -> bool:
    """A `Measurement ID` among the first lines."""
    return any(line_of(head, number).startswith("Measurement ID") for number in range(1, 6))


def read(data: bytes | Content) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Columns of a Digatron csv, a spectrum where it holds one, else a series; and notes."""
    layout, units = _layout(data)
    begin = offset_of(data, layout.first_line)
    data = with_lines_changed(data, begin, _without_messages)
    return (_spectrum if "Zreal1" in layout.labels else _series)(data, layout, units)


def _layout(data) -> tuple[Layout, dict[str, str]]:
    lines = decoded(head_of(data)[: 1 << 16]).split("\n")
    header = next((k for k, line in enumerate(lines, 1) if CLOCK in line), None)
    if header is None:
        raise Refusal(f"no line of names with {CLOCK!r}: the file ends within its header")
    layout = layout_of(data, header_line=header, units_lines=1)
    units = (unit.strip().strip("[]") for unit in line_of(data, header + 1).split(layout.delimiter))
    return layout, dict(zip(reversed(layout.labels), reversed([*units]), strict=False))


def _without_messages(data: bytes) -> bytes:
    """Rows with the status MSG hold text where numbers belong: blanked, so lines keep theirs."""
    return (
        re.sub(rb"(?m)^[^;,\n]*[;,][^;,\n]*[;,]MSG[;,].*$", b"", data) if b"MSG" in data else data
    )


def _series(data, layout: Layout, units: dict[str, str]) -> tuple:
    fields = known_fields(
        layout.labels,
        lambda label: Field(label, *MEANING[label], units[label]) if label in MEANING else None,
    )
    fields = [Field(CLOCK, "test_time_second", "time", "s"), *fields]
    require(fields, SERIES, SPELT)
    labels = [field.label for field in fields[1:]]
    texts = {CLOCK: Clocks, DATE: partial(Dates, DATES)}
    found, notes = read_table(data, layout, labels, texts=texts)
    seconds = next(iter(date_readings(found.pop(DATE)).values()), None)
    dated = {} if seconds is None else {"unix_time_second": seconds}
    return converted(found, fields) | dated, notes


def _spectrum(data, layout: Layout, units: dict[str, str]) -> tuple:
    fields = [field for field in SPECTRUM if field.label in layout.labels]
    require(fields, IMPEDANCE, SPELT)
    probe = [label for label in layout.labels if re.fullmatch(r"Temp\d+", label)][:1]
    fields += [Field(label, "surface_temperature_celsius", "temperature", "C") for label in probe]
    wanted = [field.label for field in fields] + [p for p in PROOF if p in layout.labels]
    found, notes = read_table(data, layout, wanted)
    measured = found["ActFreq"] > 0  # other rows of the file are rests and messages
    found = {label: values[measured] for label, values in found.items()}
    _refuse_other_unit(found)
    return converted(found, fields), notes


def _refuse_other_unit(found: dict[str, np.ndarray]) -> None:
    """|Z| in milliohm must be the applied voltage [mV] over the current that flowed [A]."""
    if not set(PROOF) <= found.keys():
        return
    relative, applied, flowed = (found[label] for label in PROOF)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.nanmedian(
            np.hypot(found["Zreal1"], found["Zimg1"]) * flowed / relative / applied
        )
    if not 0.5 < ratio < 2:
        raise Refusal(f"Zreal1, Zimg1 are {ratio:.3g} times voltage / current: not in milliohm?")
