"""Campaigns, real or simulated, as records cut into steps."""

import csv
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cellwright import formats, series
from cellwright.refusal import Refusal
from cellwright.series.cleaning import net_charge
from cellwright.series.runs import gap_rows
from cellwright.series.steps import Steps, segment
from virtual_lab.reality import workbook

KINDS = {
    *("capacity", "hppc", "pulse_resistance", "ocv", "ica", "relaxation", "drive", "ageing"),
    "fast_charge",
}
WITHIN_KELVIN = 5.0
GAP_SECOND = 300.0


class Source(NamedTuple):
    """A campaign's name on figures, its folder, and whether real cells stand behind it."""

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
    """What was not looked at, and why."""

    source: str
    test: str
    reason: str


def named(text: str, *, real: bool) -> Source:
    """A campaign from `folder` or `name=folder`."""
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
    tests = [t for t in _rows(sheet) if t["kind"] in KINDS and _is_near(t, celsius)]
    wanted = list(dict.fromkeys(test["cell"] for test in tests))[:most_cells]
    for test in (test for test in tests if test["cell"] in wanted):
        yield _loaded(source, test, cells[test["cell"]])


def _rows(sheet: Path) -> list[dict]:
    with sheet.open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines, delimiter="\t"))


def _is_near(test: dict, celsius: float) -> bool:
    stated = test["ambient_temperature_celsius"]
    return not stated or abs(float(stated) - celsius) <= WITHIN_KELVIN


def _loaded(source: Source, test: dict, cell: dict) -> Record | Skipped:
    try:
        readings = [
            formats.read(content, name=name, instrument=test.get("instrument") or None)
            for name, content in _contents(source.folder, test["file"].split(";"))
        ]
        sign = test.get("current_sign") or None
        columns = series.assemble(readings, stated_sign=sign).columns
        return _record(source, test, cell, columns)
    except (Refusal, OSError) as reason:
        return Skipped(source.name, f"{test['cell']}/{test['test']}", str(reason))


def _contents(folder: Path, files: Iterable[str]) -> Iterator[tuple[str, bytes]]:
    for file in files:
        content = (folder / file).read_bytes()
        yield file, workbook.channel_csv(content) if file.endswith(".xlsx") else content


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
