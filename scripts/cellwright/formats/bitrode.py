"""Bitrode: csv `Exclude,Time(s),…,Current(A),Voltage(V),…,Mode,Data`, with or without that line.

`Capacity(Ah)` counts within a step and starts again at each: it is no net counter and is left out.
"""

import re

import numpy as np

from cellwright.formats.fields import SERIES, Field, converted, known_fields, require
from cellwright.formats.table import Layout, layout_of, line_of, read_numbers

NAME = "bitrode"
COLUMNS = (
    "Exclude,Time(s),Cycle,Loop,Loop,Loop,Step,StepTime(s),Current(A),Voltage(V),Power(W),"
    "Capacity(Ah),Energy(Wh),Mode,Data"
)
HEADER = tuple(re.split(",", COLUMNS))
MEANING = {
    "Time": ("test_time_second", "time"),
    "Current": ("current_ampere", "current"),
    "Voltage": ("voltage_volt", "voltage"),
    "Cycle": ("cycle_count", "count"),
    "Step": ("step_index", "count"),
}
SPELT = dict(zip(SERIES, ("Time(s)", "Current(A)", "Voltage(V)"), strict=True))
LABEL = re.compile(r"^(?P<base>\w+)(?:\((?P<unit>[^()]*)\))?$")
BARE_ROW = re.compile(r"^(No|Yes),(-?[\d.]+,){12}[A-Z]{3,5},")


def recognises(head: bytes) -> bool:
    """The instrument's header, or a first row shaped as only Bitrode's are."""
    first = line_of(head, 1)
    return first.startswith("Exclude,Time") or bool(BARE_ROW.match(first))


def read(data: bytes) -> dict[str, np.ndarray]:
    """Columns of a Bitrode csv."""
    layout = _layout(data)
    fields = known_fields(layout.labels, _meaning)
    require(fields, SERIES, SPELT)
    return converted(read_numbers(data, layout, [field.label for field in fields]), fields)


def _layout(data: bytes) -> Layout:
    if line_of(data, 1).startswith("Exclude"):
        return layout_of(data)
    # ASSUME: A Bitrode file without a header line has the columns and units of one with it.
    extra = line_of(data, 1).count(",") + 1 - len(HEADER)
    return Layout((*HEADER, *[""] * extra), ",", 1)


def _meaning(label: str) -> Field | None:
    parts = LABEL.match(label)
    if not parts or parts["base"] not in MEANING:
        return None
    return Field(label, *MEANING[parts["base"]], parts["unit"] or "")
