"""Columns that the sheet names itself, for labels that nobody else can know.

`Zeit=time h; T_Zelle=surface degC` says of a file's labels what they hold, and in which unit.
"""

import re

from cellwright.formats.fields import NET, UNITS, label_of
from cellwright.formats.text_table import SAME_UNIT, STEP_CHARGE, Format
from cellwright.refusal import Refusal

# Word of the sheet → column of the house and its quantity.
QUANTITIES = {
    "time": ("test_time_second", "time"),
    "current": ("current_ampere", "current"),
    "voltage": ("voltage_volt", "voltage"),
    "surface": ("surface_temperature_celsius", "temperature"),
    "ambient": ("ambient_temperature_celsius", "temperature"),
    "charged": ("charge_counter", "charge"),
    "discharged": ("discharge_counter", "charge"),
    "capacity": (STEP_CHARGE, "charge"),
    "net_capacity": (NET, "charge"),
    "step": ("step_index", "count"),
    "cycle": ("cycle_count", "count"),
    "frequency": ("frequency_hertz", "frequency"),
    "real": ("impedance_real_ohm", "impedance"),
    "imaginary": ("impedance_imaginary_ohm", "impedance"),
}
EXAMPLE = "such as `Zeit=time h; T_Zelle=surface degC`"


def with_columns(form: Format, columns) -> Format:
    """A format that knows the labels of the sheet's `columns`, before its own.

    columns : sequence of texts `label=quantity unit`; the unit is left out of counts alone.

    Raises
    ------
    Refusal
        A text that is none, a quantity or unit that is not known.
    """
    return form._replace(columns=dict(map(_stated, columns)) | dict(form.columns))


def labels_stated(columns) -> list[str]:
    """Labels that the sheet's `columns` names."""
    return [label_of(text.rpartition("=")[0]) for text in columns]


def _stated(text):
    """Pattern of a label, which has a unit, and its column, quantity and unit."""
    label, equals, meaning = text.rpartition("=")
    quantity, _, unit = meaning.strip().partition(" ")
    if not (label.strip() and equals and quantity in QUANTITIES):
        raise Refusal(
            f"columns in tests.tsv: found {text.strip()!r}, wanted label=quantity unit, {EXAMPLE}; "
            f"quantities: {', '.join(QUANTITIES)}"
        )
    column, kind = QUANTITIES[quantity]
    unit = SAME_UNIT.get(unit.strip().lower(), unit.strip()) or "1" * (kind == "count")
    if unit not in UNITS[kind]:
        known = ", ".join(filter(None, UNITS[kind]))
        raise Refusal(
            f"columns in tests.tsv: found {text.strip()!r}, unit {unit!r} of {quantity}; known: "
            f"{known}"
        )
    # The group says that the unit is stated.
    return f"(?P<unit>){re.escape(label_of(label))}", (column, kind, unit)
