"""Battery Data Format: csv and Parquet, with the labels of the campaign contract."""

import io

from virtual_lab.instruments.start import UNIX_START_SECOND
from virtual_lab.instruments.text import Written, labels_of, packed, rows_of
from virtual_lab.measurement import Columns

# Label and decimals of each column, in the file's order.
LABELS = {
    "time_second": ("Test Time / s", 3),
    "current_ampere": ("Current / A", 3),
    "voltage_volt": ("Voltage / V", 4),
    "step": ("Step Count / 1", None),
    "cycle": ("Cycle Count / 1", None),
    "ambient_celsius": ("Ambient Temperature / degC", 1),
    "surface_celsius": ("Surface Temperature T1 / degC", 1),
}


def bdf_csv(columns: Columns, *, discharge_positive: bool = False) -> bytes:
    """Battery Data Format as csv, gzipped."""
    shown = _turned(columns) if discharge_positive else columns
    # Adding zero turns -0.0, which would be written as "-0.000", into 0.0.
    sheet = _sheet(shown | {"current_ampere": shown["current_ampere"] + 0.0})
    return packed(labels_of(sheet) + rows_of(sheet))


def bdf_parquet(columns: Columns, *, discharge_positive: bool = False) -> bytes:
    """Battery Data Format as Parquet, with absolute time."""
    import pyarrow as pa
    from pyarrow import parquet

    sheet = _sheet(_turned(columns) if discharge_positive else columns)
    named = {column.label: column.values for column in sheet}
    named["Unix Time / s"] = UNIX_START_SECOND + columns["time_second"]
    buffer = io.BytesIO()
    parquet.write_table(pa.table(named), buffer, compression="zstd")
    return buffer.getvalue()


def _turned(columns) -> Columns:
    """All currents positive on discharge."""
    currents = [name for name in columns if name.endswith("current_ampere")]
    return columns | {name: 0.0 - columns[name] for name in currents}


def _sheet(columns) -> list[Written]:
    """What the record has; currents of branches come last."""
    branches = [name for name in columns if name.startswith("branch_")]
    labels = LABELS | {name: (f"Branch {name.split('_')[1]} Current / A", 3) for name in branches}
    return [
        Written(label, columns[name], decimals)
        for name, (label, decimals) in labels.items()
        if name in columns
    ]
