"""Campaigns, real or simulated, as records cut into steps; numbers and curves found in a record."""

import csv
import io
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from cellwright import formats, series
from cellwright.refusal import Refusal
from cellwright.series.cleaning import net_charge
from cellwright.series.steps import Steps, gap_rows, segment


class Number(NamedTuple):
    """One number of one step (−1: the whole record); `condition`: the load at that time."""

    source: str
    real: bool
    cell: str
    test: str
    step: int
    subject: str  # noise, clock, relaxation, pulse, peaks
    condition: str
    quantity: str
    value: float
    unit: str


class Curve(NamedTuple):
    """One line of a figure; `panel` says in which."""

    source: str
    cell: str
    test: str
    panel: str
    x: np.ndarray
    y: np.ndarray


def number_rows(record, step: int, subject: str, condition: str, values: dict) -> list[Number]:
    """Rows for the numbers of one step, {quantity: (value, unit)}; NaN is left out."""
    about = (record.source.name, record.source.real, record.cell, record.test, int(step))
    return [
        Number(*about, subject, condition, quantity, float(value), unit)
        for quantity, (value, unit) in values.items()
        if np.isfinite(value)
    ]


KINDS = {
    *("capacity", "hppc", "pulse_resistance", "ocv", "ica", "relaxation", "drive", "ageing"),
    "fast_charge",
}
WITHIN_KELVIN = 5.0
GAP_SECOND = 300.0


class Source(NamedTuple):
    """A campaign: its name in figures, its folder, and whether its cells are real."""

    name: str
    folder: Path
    real: bool


class Record(NamedTuple):
    """One test: time [s], current [A, + charge], voltage [V], charge [Ah], each (n,), and steps.

    `columns` holds what else was read, under the pipeline's names; `rating_ampere_hour` is that of
    the sheet, NaN where it says none.
    """

    source: Source
    cell: str
    test: str
    kind: str
    chemistry: str
    rating_ampere_hour: float
    second: np.ndarray
    ampere: np.ndarray
    volt: np.ndarray
    ampere_hour: np.ndarray
    steps: Steps
    columns: dict[str, np.ndarray]


class Skipped(NamedTuple):
    """A test that could not be used, and why."""

    source: str
    test: str
    reason: str


def named(text: str, *, real: bool) -> Source:
    """A source from `folder` or `name=folder`."""
    name, _, folder = text.rpartition("=")
    return Source(name or Path(folder).resolve().name, Path(folder), real)


def load(
    source: Source, *, celsius: float = 25.0, most_cells: int = 8
) -> Iterator[Record | Skipped]:
    """Records of a campaign's first cells at one chamber temperature, one at a time.

    Parameters
    ----------
    source : the campaign.
    celsius : chamber temperature [°C]; tests within 5 K of it, and those that state none.
    most_cells : number of cells, in the order of the sheet, of those with such a test.
    """
    sheet = source.folder / "config" / "tests.tsv"
    if not sheet.is_file():
        yield Skipped(source.name, "", f"no campaign there: {sheet} is missing")
        return
    cells = {row["cell"]: row for row in _rows(source.folder / "config" / "cells.tsv")}
    tests = [test for test in _rows(sheet) if test["kind"] in KINDS]
    stated = [test["ambient_temperature_celsius"] or celsius for test in tests]
    near = [abs(float(value) - celsius) <= WITHIN_KELVIN for value in stated]
    tests = [test for test, is_near in zip(tests, near, strict=True) if is_near]
    wanted = list(dict.fromkeys(test["cell"] for test in tests))[:most_cells]
    for test in (test for test in tests if test["cell"] in wanted):
        yield _loaded(source, test, cells[test["cell"]])


def _rows(sheet: Path) -> list[dict]:
    with sheet.open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines, delimiter="\t"))


def _loaded(source: Source, test: dict, cell: dict) -> Record | Skipped:
    try:
        readings = []
        for file in test["file"].split(";"):
            content = (source.folder / file).read_bytes()
            content = channel_csv(content) if file.endswith(".xlsx") else content
            instrument = test.get("instrument") or None
            readings.append(formats.read(content, name=file, instrument=instrument))
        sign = test.get("current_sign") or None
        columns = series.assemble(readings, stated_sign=sign).columns
        return _record(source, test, cell, columns)
    except (Refusal, OSError) as reason:
        return Skipped(source.name, f"{test['cell']}/{test['test']}", str(reason))


def _record(source, test, cell, columns) -> Record:
    whole = np.isfinite(columns["test_time_second"] + columns["current_ampere"])
    whole &= np.isfinite(columns["voltage_volt"])
    columns = {name: column[whole] for name, column in columns.items()}
    second, ampere = columns["test_time_second"], columns["current_ampere"]
    files = columns["file_index"]
    counter = columns.get("net_capacity_ampere_hour")
    gaps = np.flatnonzero(gap_rows(second, files, gap_second=GAP_SECOND))
    charge = net_charge(second, ampere, gap_rows=gaps, counter_ampere_hour=counter)
    rating = float(cell.get("rated_capacity_ampere_hour") or "nan")
    steps = segment(
        *(second, ampere, columns["voltage_volt"], charge),
        rated_capacity_ampere_hour=rating if np.isfinite(rating) else None,
        file_index=files,
    )
    about = (source, test["cell"], test["test"], test["kind"], cell.get("chemistry") or "")
    return Record(*about, rating, second, ampere, columns["voltage_volt"], charge, steps, columns)


MAIN = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
RELATION = "{http://schemas.openxmlformats.org/officeDocument/2006/relationships}id"


def channel_csv(content: bytes) -> bytes:
    """Text of the sheet `Channel…` of an Arbin workbook (.xlsx), for the reader of Arbin's CSV.

    Numbers as they stand in the file. Office Open XML (ECMA-376, part 1, 18.3): rows of cells,
    texts in a table of their own.
    """
    book = zipfile.ZipFile(io.BytesIO(content))
    with book.open(_channel_path(book)) as sheet:
        lines = list(_lines(sheet, _texts(book)))
    return ("\n".join(lines) + "\n").encode()


def _channel_path(book: zipfile.ZipFile) -> str:
    sheets = ElementTree.fromstring(book.read("xl/workbook.xml")).iter(f"{MAIN}sheet")
    wanted = next(s.get(RELATION) for s in sheets if s.get("name", "").startswith("Channel"))
    links = ElementTree.fromstring(book.read("xl/_rels/workbook.xml.rels"))
    target = next(link.get("Target") for link in links if link.get("Id") == wanted)
    return target.lstrip("/") if target.startswith("/") else f"xl/{target}"


def _texts(book: zipfile.ZipFile) -> list[str]:
    if "xl/sharedStrings.xml" not in book.namelist():
        return []
    table = ElementTree.fromstring(book.read("xl/sharedStrings.xml"))
    return ["".join(part.text or "" for part in text.iter(f"{MAIN}t")) for text in table]


def _lines(sheet, texts):
    """One line a row; cells that the file leaves out are blank."""
    for _, row in ElementTree.iterparse(sheet):
        if row.tag != f"{MAIN}row":
            continue
        cells = {_column(cell.get("r")): _value(cell, texts) for cell in row}
        if cells:
            yield ",".join(cells.get(number, "") for number in range(1, max(cells) + 1))
        row.clear()


def _column(reference: str) -> int:
    """Number of a column from a cell's address: A1 → 1, AB7 → 28."""
    number = 0
    for letter in re.match("[A-Z]+", reference)[0]:
        number = 26 * number + ord(letter) - ord("A") + 1
    return number


def _value(cell, texts) -> str:
    value = cell.findtext(f"{MAIN}v") or ""
    return texts[int(value)] if cell.get("t") == "s" and value else value
