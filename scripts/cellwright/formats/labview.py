"""LabVIEW measurement file: tab-separated text with one or two headers, `X_Value` in seconds.

Channels are often unnamed (`Untitled 1`) and then told by the header's `Description`, such as
"columns are: time, current, voltage, power". Units are rarely written; the column of power, where
there is one, proves that current and voltage are what the description says.
"""

import re

import numpy as np

from cellwright.formats.dates import unix_time_second
from cellwright.formats.fields import SERIES, Field, converted, known_fields, label_of, require
from cellwright.formats.table import Layout, line_of, read_table
from cellwright.refusal import Refusal

NAME = "labview"
MARK, END = "LabVIEW Measurement", "***End_of_Header***"
# ASSUME: A LabVIEW channel without a unit is in second, ampere, volt, watt or degree Celsius.
MEANING = {
    "time": ("test_time_second", "time", "s"),
    "x_value": ("test_time_second", "time", "s"),
    "current": ("current_ampere", "current", "A"),
    "voltage": ("voltage_volt", "voltage", "V"),
    "battery temp": ("surface_temperature_celsius", "temperature", "degC"),
    "cell temp": ("surface_temperature_celsius", "temperature", "degC"),
    "chamber temp": ("ambient_temperature_celsius", "temperature", "degC"),
    "ambient temp": ("ambient_temperature_celsius", "temperature", "degC"),
}
SPELT = dict(zip(SERIES, ("time", "current", "voltage"), strict=True))
LABEL = re.compile(r"^(?P<base>[^()]+?)(?:erature)?\s*(?:\((?P<unit>[^()]*)\))?$")
DATES = ("%Y/%m/%d %H:%M:%S",)
HEADER_LINES = 100  # a file's two headers have about twenty lines


def recognises(head: bytes) -> bool:
    """Whether the first line is that of a LabVIEW measurement file."""
    return line_of(head, 1).startswith(MARK)


def read(data: bytes) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Columns of a LabVIEW measurement file of one segment, and notes.

    Raises
    ------
    Refusal
        Several segments, a time column per channel or none, unnamed channels without a
        description, another number of columns than the description has, a power that is not
        current times voltage.
    """
    header, first_line = _header(data)
    layout = _layout(data, header, first_line)
    data = data.replace(b",", b".") if header.get("Decimal_Separator") == "," else data
    fields = known_fields(layout.labels, _meaning)
    require(fields, SERIES, SPELT)
    power = [label for label in layout.labels if _meaning_of(label)[0] == "power"]
    labels = [field.label for field in fields]
    found, notes = read_table(data, layout, labels + power[:1])
    columns = converted(found, fields)
    _refuse_other_power(columns, *(found[label] for label in power[:1]))
    return columns | _unix_time(columns["test_time_second"], header), notes


def _header(data: bytes) -> tuple[dict[str, str], int]:
    """Key → value of the headers (the segment's own last), and the first line that is no header."""
    lines = [line_of(data, number) for number in range(1, HEADER_LINES)]
    ends = [number for number, line in enumerate(lines, 1) if line.startswith(END)]
    if not lines[0].startswith(MARK) or not ends:
        raise Refusal(f"no line {END!r} after {MARK!r}: the file ends within its header")
    header = dict(line.split("\t", 1) for line in lines[: ends[-1]] if "\t" in line)
    header = {key: value.strip() for key, value in header.items()}
    _refuse_other_layout(data, header)
    return header, ends[-1] + 1


def _refuse_other_layout(data: bytes, header: dict[str, str]) -> None:
    if (ends := data.count(END.encode())) > 2:
        raise Refusal(f"{ends - 1} segments; a file with one is wanted")
    if header.get("X_Columns", "One") != "One":
        raise Refusal(f"X_Columns is {header['X_Columns']!r}; one column of time is wanted")
    if header.get("Separator", "Tab") != "Tab":
        raise Refusal(f"separator {header['Separator']!r}; 'Tab' is wanted")


def _layout(data: bytes, header: dict[str, str], line: int) -> Layout:
    """Labels of the row of names, or of the description where that has none of the channels."""
    names = line_of(data, line).split("\t")
    has_names = names[0] == "X_Value"
    first_line = line + has_names
    while first_line < line + HEADER_LINES and not line_of(data, first_line).strip():
        first_line += 1
    labels = (
        names
        if has_names and not any(name.startswith("Untitled") for name in names)
        else _described(header)
    )
    width = line_of(data, first_line).count("\t") + 1
    labels = [label for label in labels if label != "Comment" or len(labels) == width]
    if len(labels) != width and line_of(data, first_line).strip():
        raise Refusal(f"line {first_line}: {width} columns, where the header names {len(labels)}")
    return Layout(tuple(labels), "\t", first_line)


def _described(header: dict[str, str]) -> list[str]:
    text = header.get("Description", "")
    if ":" not in text:
        raise Refusal(f"channels without names, and the description {text!r} does not list them")
    return [re.sub(r"^and\s+", "", part.strip()) for part in text.split(":", 1)[1].split(",")]


def _meaning(label: str) -> Field | None:
    base, unit = _meaning_of(label)
    if base not in MEANING:
        return None
    column, quantity, bare_unit = MEANING[base]
    return Field(label, column, quantity, unit or bare_unit)


def _meaning_of(label: str) -> tuple[str, str | None]:
    parts = LABEL.match(label_of(label))
    return (parts["base"].lower(), parts["unit"]) if parts else ("", None)


def _refuse_other_power(columns: dict[str, np.ndarray], *power: np.ndarray) -> None:
    """Power [W] must be current times voltage, where a current flows.

    Rows in which it repeats the current tell nothing: measured files hold such steps.
    """
    current, voltage = columns["current_ampere"], columns["voltage_volt"]
    for measured in power:
        flows = (np.abs(current) < 1e30) & (np.abs(current * voltage) > 0.1) & (measured != current)
        ratio = np.median(measured[flows] / (current * voltage)[flows]) if flows.any() else 1.0
        if not 0.9 < ratio < 1.1:
            raise Refusal(f"power is {ratio:.3g} times current × voltage: other units or columns?")


def _unix_time(time: np.ndarray, header: dict[str, str]) -> dict[str, np.ndarray]:
    """Absolute time from the segment's date; nothing where the clock was not set."""
    import pyarrow as pa

    text = f"{header.get('Date', '')[:10]} {header.get('Time', '')[:15]}"
    start = unix_time_second(pa.array([text]), DATES)
    # A clock that was not set says 1903/12/31, the origin of LabVIEW's time.
    return {} if start is None or start[0] < 0 else {"unix_time_second": start[0] + time}
