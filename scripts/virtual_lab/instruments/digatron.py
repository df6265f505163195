"""Digatron: csv with lines on the test, a line of names, one of units, then rows.

English files have commas and a twelve-hour clock, German ones semicolons and dd.mm.yyyy, as their
computer was set; both end lines with carriage return and line feed.
"""

import numpy as np

from virtual_lab.instruments.start import date_texts
from virtual_lab.instruments.text import (
    Written,
    cycles,
    energy_watt_hour,
    labels_of,
    packed,
    rows_of,
    same,
    signed,
    step_begins,
)
from virtual_lab.measurement import Columns

ENGLISH = {"day": "%m/%d/%Y", "clock": "%-I:%M:%S %p"}
GERMAN = {"day": "%d.%m.%Y", "clock": "%H:%M:%S"}
ABOUT = """

Measurement ID{d}1001
Battery Name{d}simulated
Battery Type{d}Li-ion
Circuit{d}Circuit001
Program{d}Cellwright virtual laboratory
Start Time{d}{start}
End Time{d}{end}
Test section{d}{section}
Comment{d}no real cell
OrderNo{d}
Producer{d} none
Type{d} Li-ion
Nominal Voltage{d} 0
Nominal Current{d} 0
Nominal Capacity{d} 0
Cells{d} 1
Maximum Voltage{d} 0
Gassing Voltage{d} 0
Break Voltage{d} 0
Charge Factor{d} 0
Impedance{d} 0
Cold Cranking Current{d} 0
Energy Density{d} 0
Comment{d}simulated, not measured


"""
UNITS = {"Voltage": "V", "Current": "A", "Temperature": "C", "Capacity": "Ah", "WhAccu": "Wh"}


def digatron_csv(columns: Columns, *, discharge_positive: bool = False) -> bytes:
    """A series as an English Digatron writes it, gzipped; `Capacity` is its signed counter."""
    return _series(columns, discharge_positive, ENGLISH, ",")


def digatron_german_csv(columns: Columns, *, discharge_positive: bool = False) -> bytes:
    """The same of a German one."""
    return _series(columns, discharge_positive, GERMAN, ";")


def _series(columns, discharge_positive, form, delimiter) -> bytes:
    time, step, rows = columns["time_second"], columns["step"], columns["step"].size
    net = columns["charged_ampere_hour"] - columns["discharged_ampere_hour"]
    sheet = [
        Written("Time Stamp", date_texts(time, **form)),
        Written("Step", step),
        Written("Status", _status(columns["current_ampere"])),
        Written("Prog Time", clock_texts(time)),
        Written("Step Time", clock_texts(time - time[step_begins(step)])),
        Written("Cycle", cycles(columns)),
        Written("Cycle Level", same(0, rows)),
        Written("Procedure", same("Cellwright", rows)),
        Written("Voltage", columns["voltage_volt"], 5),
        Written("Current", signed(columns["current_ampere"], discharge_positive), 5),
        Written("Temperature", columns["surface_celsius"], 5),
        Written("Capacity", net + 0.0, 5),
        Written("WhAccu", energy_watt_hour(columns) + 0.0, 5),
        Written("", same("", rows)),
    ]
    return packed(whole_file(sheet, UNITS, section="Series", delimiter=delimiter))


def whole_file(
    sheet: list[Written], units: dict[str, str], *, section: str, delimiter: str
) -> bytes:
    """Lines on the test, names, units and rows; the first column holds the dates."""
    dates = sheet[0].values
    about = ABOUT.format(d=delimiter, start=dates[0], end=dates[-1], section=section)
    shown = [f"[{units[column.label]}]" if column.label in units else "" for column in sheet]
    head = about.encode() + labels_of(sheet, delimiter=delimiter)
    head += (delimiter.join(shown) + "\n").encode()
    return (head + rows_of(sheet, delimiter=delimiter)).replace(b"\n", b"\r\n")


def clock_texts(time: np.ndarray):
    """Times [s] as hh:mm:ss.mmm, hours beyond 24."""
    import pyarrow as pa
    import pyarrow.compute as pc

    total = np.rint(np.asarray(time) * 1000).astype(np.int64)
    parts = (total // 3_600_000, total // 60_000 % 60, total // 1000 % 60, total % 1000)
    texts = [
        pc.utf8_lpad(pc.cast(pa.array(part), pa.string()), width=width, padding="0")
        for part, width in zip(parts, (2, 2, 2, 3), strict=True)
    ]
    clock = pc.binary_join_element_wise(*texts[:3], ":")
    return pc.binary_join_element_wise(clock, texts[3], ".")


def _status(current):
    shown = np.nan_to_num(current)
    return np.where(shown > 0, "CHA", np.where(shown < 0, "DCH", "PAU"))
