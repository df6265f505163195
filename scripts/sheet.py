"""A tab-separated sheet held against its schema: typed rows, and every fault with its place."""

import csv
import io
import math
import re
from functools import partial
from pathlib import Path
from typing import NamedTuple

from schema import fault, wanted

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
COMMA = re.compile(r"[+-]?\d+,\d+")


class Sheet(NamedTuple):
    """What a sheet says: one dict of typed values and one place ("file, row, line") per row."""

    rows: list[dict]
    places: list[str]
    faults: list[str]


def read(folder, name: str, schema: dict) -> Sheet:
    """Read `config/<name>` of a campaign. A missing sheet or a bad value is a fault, not an error.

    Byte-order marks, any line ends, blank lines, spaces around values, and rows without their
    last blank cells are all read as what they mean.
    """
    path, file = Path(folder) / "config" / name, f"config/{name}"
    if not path.is_file():
        found = "a directory" if path.is_dir() else "no such file"
        return Sheet([], [], [fault(f"{file} in {folder}", found, "a tab-separated sheet")])
    text, faults = _decoded(path.read_bytes(), file)
    lines, broken = _lines(text, file)
    if not lines:
        return Sheet([], [], faults + broken + [fault(file, "", "a row of column names")])
    header, wrong = _header(*lines[0], file, schema)
    faults += broken + wrong
    places = [f"{file}, row {n} (line {line})" for n, (line, _) in enumerate(lines[1:], 1)]
    readers = {name: _reader(spec) for name, spec in schema["properties"].items()}
    rows = []
    for place, (_, cells) in zip(places, lines[1:], strict=True):
        rows.append(_row(cells, header, readers, place, faults))
    return Sheet(_with_defaults(rows, schema), places, faults)


def _decoded(data: bytes, file: str) -> tuple[str, list[str]]:
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):  # what spreadsheets call Unicode text
        return data.decode("utf-16", errors="replace"), []
    try:
        return data.decode("utf-8-sig"), []
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        byte = data[error.start : error.start + 1].decode("latin-1")
        told = fault(f"{file}, line {line}", byte, "UTF-8, not Latin-1; save the sheet as UTF-8")
        return data.decode("latin-1"), [told]


def _lines(text: str, file: str) -> tuple[list, list[str]]:
    """(line number, cells) of each line that is not blank."""
    reader = csv.reader(io.StringIO(text, newline=""), delimiter="\t", strict=True)
    lines, start = [], 1
    try:
        for cells in reader:
            lines.append((start, [cell.strip() for cell in cells]))
            start = reader.line_num + 1
    except csv.Error as error:
        told = [fault(f"{file}, line {start}", str(error), 'each " doubled and closed, or no "')]
    else:
        told = []
    return [(line, cells) for line, cells in lines if any(cells)], told


def _header(line, cells, file, schema) -> tuple[list[str], list[str]]:
    """Column names as they stand, and what is wrong with them."""
    place, known = f"{file}, line {line}", list(schema["properties"])
    if len(cells) == 1 and re.search("[,;]", cells[0]):
        return cells, [fault(place, cells[0], "columns separated by tabs")]
    columns = f"one of the columns {', '.join(known)}"
    unknown = [name for name in cells if name and name not in known]
    twice = sorted({name for name in cells if name and cells.count(name) > 1})
    missing = [name for name in schema["required"] if name not in cells]
    faults = [fault(place, name, columns, known) for name in unknown]
    faults += [fault(place, name, "each column once") for name in twice]
    faults += [f"{place}: found no column {name!r}, wanted one" for name in missing]
    return cells, faults


def _row(cells, header, readers, place, faults) -> dict:
    beyond = [cell for cell in cells[len(header) :] if cell]
    beyond += [cell for name, cell in zip(header, cells, strict=False) if not name and cell]
    faults += [fault(place, cell, "nothing here, no column has this place") for cell in beyond]
    texts = dict.fromkeys(header, "") | dict(zip(header, cells, strict=False))
    row = dict.fromkeys(readers)
    for name in (name for name in row if name in texts):
        row[name], unfit = readers[name](texts[name])
        if unfit:
            faults.append(fault(f"{place}, {name}", texts[name], *unfit))
    return row


def _reader(spec: dict):
    """Text → (value, None) or (None, (what is wanted, known values)) for one column."""
    memory = {}

    def reader(text):
        if text not in memory:
            memory[text] = _read_value(text, spec)
        return memory[text]

    return reader


def _read_value(text: str, spec: dict):
    if not text:
        return None, (f"a value: {wanted(spec)}",) if spec.get("filled") else None
    if spec["type"] == "array":
        parts = [
            _read_value(part.strip(), spec["items"] | {"filled": True})
            for part in text.split(spec["separator"])
        ]
        bad = any(unfit for _, unfit in parts)
        return (None, (wanted(spec),)) if bad else ([value for value, _ in parts], None)
    read = {"number": _number, "integer": partial(_number, kind=int), "string": _text}
    return read[spec["type"]](text, spec)


def _text(text, spec):
    known = spec.get("enum", ())
    if (known and text not in known) or not re.fullmatch(spec.get("pattern", r"[\s\S]*"), text):
        return None, (wanted(spec), known)
    return text, None


def _number(text, spec, kind=float):
    if COMMA.fullmatch(text):
        return None, (f"{wanted(spec)}, with a point: {text.replace(',', '.')}",)
    if not (re.fullmatch(r"\d+", text) if kind is int else NUMBER.fullmatch(text)):
        return None, (wanted(spec),)
    value = kind(text)
    low, high = spec.get("minimum", -math.inf), spec.get("maximum", math.inf)
    inside = low <= value <= high and value > spec.get("exclusiveMinimum", -math.inf)
    return (value, None) if inside and math.isfinite(value) else (None, (wanted(spec),))


def _with_defaults(rows, schema) -> list[dict]:
    for name, spec in schema["properties"].items():
        special = spec.get("default_of_kind", {})
        for row in (row for row in rows if row[name] is None):
            row[name] = special.get(row.get("kind"), spec.get("default"))
    return rows
