"""Raw files of a campaign to what a search is about, in one process instead of a job a step."""

from pathlib import Path
from typing import NamedTuple

import cellwright as cw
from cellwright.api import inputs
from cellwright.records.basis import Lender
from runtime import raw_files, sheets

SCHEMAS = Path(__file__).resolve().parents[2] / "workflow" / "schemas"
FACTS = ("test", "kind", "ambient_temperature_celsius", "cycle", "soc", "role")


class Place(NamedTuple):
    """A campaign's folder and sheets; the rows of tests by cell or group, of branches by group."""

    folder: Path
    cells: dict
    tests: dict
    branches: dict


class Loaded(NamedTuple):
    """One cell: its row of the sheet, its basis, and its tests, (TestFacts, columns) each."""

    cell: dict
    basis: dict
    tests: list


class Steps(NamedTuple):
    """Settings of the stages before a search: two sections of the config, and a key of `ocv`."""

    clean: dict
    segment: dict
    least_hour: float


def place(folder) -> Place:
    """The campaign in a folder, its sheets checked as the workflow checks them."""
    read = sheets.read(folder, SCHEMAS)
    tests, branches = {}, {}
    for row in read.tests:
        tests.setdefault(row["cell"], []).append(row)
    for row in sorted(read.groups, key=lambda row: row["position"]):
        branches.setdefault(row["group"], []).append(inputs.branch_facts(row))
    return Place(Path(folder), {row["cell"]: row for row in read.cells}, tests, branches)


def searched(place: Place) -> list[str]:
    """Cells and groups that a search is for: no reference, and no branch of a group."""
    inside = {row.cell for rows in place.branches.values() for row in rows}
    cells = [c for c, row in place.cells.items() if row["reference"] != "yes" and c not in inside]
    return sorted([*cells, *place.branches])


def lenders(place: Place, steps: Steps) -> dict[str, list[Lender]]:
    """The marked cells of each chemistry, with the OCV and capacities that others borrow."""
    by_chemistry = {}
    for cell, row in place.cells.items():
        if row["reference"] == "yes":
            records = tests_of(place, cell, steps)
            shown = (_curves(records, row, steps), _capacities(records, row, steps))
            lender = cw.lender(row, *shown, marked=True)
            by_chemistry.setdefault(row["chemistry"], []).append(lender)
    return by_chemistry


def loaded(place: Place, cell: str, lenders_of: dict[str, list[Lender]], steps: Steps) -> Loaded:
    """One cell with what its SoC refers to.

    Raises
    ------
    Refusal : a file that cannot be read, or no capacity.
    """
    row, records = place.cells[cell], tests_of(place, cell, steps)
    basis = cw.basis(
        row,
        _curves(records, row, steps),
        _capacities(records, row, steps),
        [lender for lender in lenders_of.get(row["chemistry"], []) if lender.cell != cell],
    )
    return Loaded(row, basis.content, records)


def tests_of(place: Place, cell: str, steps: Steps) -> list[tuple]:
    """The cleaned tests of a cell or group, with their steps apart: (TestFacts, columns) each."""
    return [
        (cw.TestFacts(**{name: row[name] for name in FACTS}), _series(place, row, steps))
        for row in place.tests[cell]
    ]


def _series(place, row, steps):
    files = [str(place.folder / file) for file in row["file"]]
    contents = raw_files.contents(files, row["sha256"])
    stated = {"instrument": row["instrument"], "current_sign": row["current_sign"]}
    return cw.clean(cw.read(contents, **stated), steps.clean).columns


def _curves(records, row, steps):
    return [
        (facts, cw.ocv(series, row, least_hour=steps.least_hour))
        for facts, series in records
        if facts.kind == "ocv" and facts.role == "fit"
    ]


def _capacities(records, row, steps):
    kinds = ("capacity", "ocv")
    fitted = [record for record in records if record[0].kind in kinds and record[0].role == "fit"]
    tried = [(facts, _capacity(facts, series, row, steps)) for facts, series in fitted]
    return [(facts, capacity) for facts, capacity in tried if capacity]


def _capacity(facts, series, row, steps):
    """None, as in the workflow, of a test without a complete charge."""
    try:
        cut = cw.segment(series, row, steps.segment)
        return cw.capacity(series, cut, row, whole_swing=facts.kind == "ocv")
    except cw.Refusal:
        return None
