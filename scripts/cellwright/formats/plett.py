"""Dynamic records of G. L. Plett's ESC toolbox: csv `time, step, current, voltage, chgAh, disAh`.

The format has no unit strings: it is second, ampere, volt and ampere-hour by its definition
(Plett, Battery Management Systems I, Artech House 2015, chapter 2), current positive on discharge.
"""

import numpy as np

from cellwright.formats.content import Content
from cellwright.formats.fields import SERIES, Field, converted, require
from cellwright.formats.table import layout_of, line_of, read_table

NAME = "plett"
FIELDS = (
    Field("time", "test_time_second", "time", "s"),
    Field("step", "step_index", "count", "1"),
    Field("current", "current_ampere", "current", "A"),
    Field("voltage", "voltage_volt", "voltage", "V"),
    Field("chgAh", "charge_counter", "charge", "Ah"),
    Field("disAh", "discharge_counter", "charge", "Ah"),
)


def recognises(head: bytes) -> bool:
    """The first line has the toolbox's two counters beside its time."""
    return {"time", "chgAh", "disAh"} <= {label.strip() for label in line_of(head, 1).split(",")}


def read(data: bytes | Content) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Columns of a dynamic record, and notes."""
    layout = layout_of(data)
    fields = [field for field in FIELDS if field.label in layout.labels]
    require(fields, SERIES, {field.column: field.label for field in FIELDS})
    found, notes = read_table(data, layout, [field.label for field in fields])
    return converted(found, fields), notes
