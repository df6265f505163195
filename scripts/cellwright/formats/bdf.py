"""Battery Data Format: csv or Parquet, labels `Quantity / unit` or `quantity_unit`.

Source: Battery Data Alliance, Battery Data Format; labels as in the campaign contract.
"""

import re

import numpy as np

from cellwright import gate
from cellwright.formats.fields import (
    IMPEDANCE,
    SERIES,
    UNITS,
    WORDS,
    Field,
    converted,
    known_fields,
    require,
)
from cellwright.formats.table import clock_second, layout_of, line_of, read_numbers
from cellwright.refusal import Refusal

NAME = "bdf"
SIMULATED = "Simulated Voltage / V"
PARQUET = b"PAR1"
DOUBLE_BYTE = 8
EXAMPLE_ROWS = 100
MEANING = {
    "test time": ("test_time_second", "time"),
    "current": ("current_ampere", "current"),
    "voltage": ("voltage_volt", "voltage"),
    "unix time": ("unix_time_second", "time"),
    "ambient temperature": ("ambient_temperature_celsius", "temperature"),
    "surface temperature": ("surface_temperature_celsius", "temperature"),
    "net capacity": ("net_capacity_ampere_hour", "charge"),
    "charging capacity": ("charge_counter", "charge"),
    "discharging capacity": ("discharge_counter", "charge"),
    "step index": ("step_index", "count"),
    "step count": ("step_count", "count"),
    "cycle count": ("cycle_count", "count"),
    "frequency": ("frequency_hertz", "frequency"),
    "real impedance": ("impedance_real_ohm", "impedance"),
    "imaginary impedance": ("impedance_imaginary_ohm", "impedance"),
}
SPELT = {
    "test_time_second": "Test Time / s",
    "current_ampere": "Current / A",
    "voltage_volt": "Voltage / V",
    "frequency_hertz": "Frequency / Hz",
    "impedance_real_ohm": "Real Impedance / ohm",
    "impedance_imaginary_ohm": "Imaginary Impedance / ohm",
}
# Numbered channels of a group: of its members and of its cells, with the house's units.
OF_GROUP = {
    "branch": {"current": "ampere"},
    "cell": {"voltage": "volt", "temperature": "celsius"},
}
SPOKEN_UNIT = re.compile(rf"^(?P<base>.+)_(?P<word>{'|'.join(sorted(WORDS, key=len)[::-1])})$")


def recognises(head: bytes) -> bool:
    """A Parquet file, or a first line with one of the format's own labels."""
    return head.startswith(PARQUET) or any(
        field.column in SPELT for field in _fields(line_of(head, 1))
    )


def read(data: bytes) -> dict[str, np.ndarray]:
    """Columns of a BDF file; a spectrum where it has a frequency, else a series."""
    return _read(data, _meaning, _checked)


def read_simulated(data: bytes) -> dict[str, np.ndarray]:
    """Test time [s] and simulated voltage [V] of a BDF file: test_time_second, voltage_volt.

    The voltage is that of `Simulated Voltage / V`; `Voltage / V` in a file that has no current, and
    so is a simulator's own.
    """
    return _read(data, _simulated_meaning, _checked_simulated)


def _read(data, meaning, checked) -> dict[str, np.ndarray]:
    """Columns of a CSV or Parquet file: `meaning` knows the labels, `checked` the whole set."""
    if data.startswith(PARQUET):
        return _read_parquet(data, meaning, checked)
    layout = layout_of(data)
    fields = checked(known_fields(layout.labels, meaning))
    labels = [field.label for field in fields]
    clock = next((f.label for f in fields if f.column == "test_time_second"), None)
    if clock and re.search(r"\d:\d", line_of(data, layout.first_line)):  # a time as 0d 00:10:00.5
        found = read_numbers(data, layout, [x for x in labels if x != clock], texts=[clock])
        found[clock] = clock_second(found[clock])
    else:
        found = read_numbers(data, layout, labels)
    return converted(found, fields)


def _simulated_meaning(label: str) -> Field | None:
    base, unit = _base_and_unit(label)
    simulated = Field(label, "simulated_voltage_volt", "voltage", unit)
    return simulated if base == "simulated voltage" else _meaning(label)


def _checked_simulated(fields: list[Field]) -> list[Field]:
    """The two fields of a simulation."""
    by_column = {field.column: field for field in fields}
    voltage = by_column.get("simulated_voltage_volt")
    if voltage is None and "current_ampere" not in by_column:
        voltage = by_column.get("voltage_volt")
    kept = [by_column[name] for name in ("test_time_second",) if name in by_column]
    kept += [voltage._replace(column="voltage_volt")] if voltage else []
    spelt = SPELT | {"voltage_volt": SIMULATED}
    require(kept, ("test_time_second", "voltage_volt"), spelt)
    return kept


def refuse_large(data: bytes, largest_megabyte: float | None = None) -> None:
    """Refuse a Parquet file whose known columns take more memory than they may.

    Its pages may be repetitions of one value: neither the file nor they are long.
    """
    about = _opened(data)
    gate.refuse_columns(len(about.schema_arrow.names))
    known = [name for name in about.schema_arrow.names if _simulated_meaning(name)]
    groups = [about.metadata.row_group(k) for k in range(about.metadata.num_row_groups)]
    held = max(
        about.metadata.num_rows * DOUBLE_BYTE * len(known),
        sum(group.total_byte_size for group in groups),
    )
    gate.refuse_unpacked(held, len(data), largest_megabyte)


def _opened(data):
    import pyarrow as pa
    from pyarrow import parquet

    try:
        return parquet.ParquetFile(pa.BufferReader(data))
    except (pa.ArrowInvalid, OSError) as fault:
        raise Refusal(f"the Parquet file is cut off or damaged: {fault}") from None


def _read_parquet(data: bytes, meaning, checked) -> dict[str, np.ndarray]:
    import pyarrow as pa

    file = _opened(data)
    fields = checked(known_fields(file.schema_arrow.names, meaning))
    for field in fields:  # before they are read: texts may be of any length
        kind = file.schema_arrow.field(field.label).type
        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
            raise Refusal(f"column {field.label!r} holds {kind}{_example(file, field.label)}")
    try:
        found = file.read([field.label for field in fields])
    except (pa.ArrowInvalid, OSError) as fault:
        raise Refusal(f"the Parquet file is cut off or damaged: {fault}") from None
    return converted({name: _numbers(found[name]) for name in found.column_names}, fields)


def _example(file, label):
    """A value of a column that holds no numbers, in words, from its first rows."""
    first = next(file.iter_batches(EXAMPLE_ROWS, columns=[label]), None)
    values = [] if first is None else first.column(0).to_pylist()
    example = next((f", such as {str(value)[:40]!r}" for value in values if value is not None), "")
    return f"{example}; numbers are wanted"


def _numbers(column) -> np.ndarray:
    """One Parquet column [its unit] as float64, missing values NaN."""
    import pyarrow as pa

    return column.cast(pa.float64()).to_numpy().astype(float)


def _checked(fields: list[Field]) -> list[Field]:
    spectrum = any(field.column == "frequency_hertz" for field in fields)
    require(fields, IMPEDANCE if spectrum else SERIES, SPELT)
    return fields


def _fields(header: str) -> list[Field]:
    """Fields of a header whose delimiter is not known yet."""
    labels = re.split(r"[,;\t]", header)
    return [field for label in labels if (field := _meaning(label.strip().strip('"')))]


def _meaning(label: str) -> Field | None:
    base, unit = _base_and_unit(label)
    numbered = re.fullmatch(r"(branch|cell) (\d+) (current|voltage|temperature)", base)
    if numbered and numbered[3] in OF_GROUP[numbered[1]]:
        owner, number, quantity = numbered.groups()
        column = f"{owner}_{int(number)}_{quantity}_{OF_GROUP[owner][quantity]}"
        return Field(label, column, quantity, unit)
    probe = re.fullmatch(r"surface temperature t(\d+)", base)
    if probe:
        number = "" if probe[1] == "1" else f"_{probe[1]}"
        return Field(label, f"surface_temperature{number}_celsius", "temperature", unit)
    return Field(label, *MEANING[base], unit) if base in MEANING else None


def _base_and_unit(label: str) -> tuple[str, str]:
    base, slash, unit = label.rpartition(" / ")
    if slash:
        return base.strip().lower(), unit.strip()
    spoken = SPOKEN_UNIT.match(label)
    if spoken and WORDS[spoken["word"]] in {u for units in UNITS.values() for u in units}:
        return spoken["base"].replace("_", " "), WORDS[spoken["word"]]
    return "", ""
