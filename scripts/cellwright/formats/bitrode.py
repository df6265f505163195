"""Bitrode: csv `Exclude,Time(s),…,Current(A),Voltage(V),…,Mode,Data`, with or without that line.

`Capacity(Ah)` is signed and starts again at zero with most steps, but not with all: a rest may keep
what the load before it has moved.
"""

import re

import numpy as np

from cellwright.formats.content import Content
from cellwright.formats.fields import SERIES, Field, converted, known_fields, require
from cellwright.formats.table import Layout, layout_of, line_of, read_table

NAME = "bitrode"
COLUMNS = (
    "Exclude,Time(s),Cycle,Loop,Loop,Loop,Step,StepTime(s),Current(A),Voltage(V),Power(W),"
    "Capacity(Ah),Energy(Wh),Mode,Data"
)
HEADER = tuple(re.split(",", COLUMNS))
STEP_COUNTER = "step_capacity_ampere_hour"
MEANING = {
    "Time": ("test_time_second", "time"),
    "Current": ("current_ampere", "current"),
    "Voltage": ("voltage_volt", "voltage"),
    "Cycle": ("cycle_count", "count"),
    "Step": ("step_index", "count"),
    "Capacity": (STEP_COUNTER, "charge"),
}
COUNTER_DIGIT = 0.01  # [Ah] coarsest digit that its exports show
SPELT = dict(zip(SERIES, ("Time(s)", "Current(A)", "Voltage(V)"), strict=True))
LABEL = re.compile(r"^(?P<base>\w+)(?:\((?P<unit>[^()]*)\))?$")
BARE_ROW = re.compile(r"^(No|Yes),(-?[\d.]+,){12}[A-Z]{3,5},")


def recognises(head: bytes) -> bool:
    """The instrument's header, or a first row shaped as only Bitrode's are."""
    first = line_of(head, 1)
    return first.startswith("Exclude,Time") or bool(BARE_ROW.match(first))


def read(data: bytes | Content) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Columns of a Bitrode csv, and notes."""
    layout = _layout(data)
    fields = known_fields(layout.labels, _meaning)
    require(fields, SERIES, SPELT)
    found, notes = read_table(data, layout, [field.label for field in fields])
    columns = converted(found, fields)
    counter, step = columns.pop(STEP_COUNTER, None), columns.get("step_index")
    if counter is None or step is None:
        return columns, notes
    return columns | {"net_capacity_ampere_hour": _net(counter, step, columns)}, notes


# ASSUME: Where both a counter that goes on and one that began anew fit the currents at a change of
# steps, it began anew.
def _net(counter, step, columns):
    """Net charge [Ah] from a counter that starts again with most steps.

    Where the step changes the counter began anew, unless what it shows is then more than the larger
    current of the two rows can have moved between them.
    """
    time, current = columns["test_time_second"], np.abs(columns["current_ampere"])
    possible = np.maximum(current[1:], current[:-1]) * np.diff(time) / 3600
    moved = np.diff(counter)
    anew = (np.diff(step) != 0) & (np.abs(counter[1:]) <= 1.05 * possible + COUNTER_DIGIT)
    return np.concatenate([[0.0], np.cumsum(np.where(anew, counter[1:], moved))])


def _layout(data) -> Layout:
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
