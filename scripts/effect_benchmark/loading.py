"""Raw files of a campaign to what a search is about, in one process instead of a job a step."""

from pathlib import Path
from typing import NamedTuple

from cellwright import formats, series
from cellwright.protocols.capacity import capacity
from cellwright.protocols.ocv.slow import slow_ocv
from cellwright.records.basis import Lender, basis
from cellwright.records.facts import BranchFacts, CellFacts, MeasuredTest, TestFacts
from cellwright.refusal import Refusal
from cellwright.series.steps import segment
from runtime import raw_files, sheets

SCHEMAS = Path(__file__).resolve().parents[2] / "workflow" / "schemas"
CUTOFFS = ("rated_capacity_ampere_hour", "lower_cutoff_volt", "upper_cutoff_volt")
COUNTED = ("test_time_second", "current_ampere", "voltage_volt", "charge_ampere_hour")


class Place(NamedTuple):
    """A campaign's folder and sheets; the rows of tests by cell or group, of branches by group."""

    folder: Path
    cells: dict
    tests: dict
    branches: dict


class Loaded(NamedTuple):
    """One cell: its facts, basis (`cellwright.records.basis`), and tests (MeasuredTest)."""

    cell: CellFacts
    basis: dict
    tests: list


class Steps(NamedTuple):
    """Settings of the stages before a search, sections of the config."""

    clean: dict
    segment: dict
    ocv: dict


def place(folder) -> Place:
    """The campaign in a folder, its sheets checked as the workflow checks them."""
    read = sheets.read(folder, SCHEMAS)
    tests, branches = {}, {}
    for row in read.tests:
        tests.setdefault(row["cell"], []).append(row)
    for row in sorted(read.groups, key=lambda row: row["position"]):
        facts = BranchFacts(*(row[name] for name in BranchFacts._fields))
        branches.setdefault(row["group"], []).append(facts)
    return Place(Path(folder), {row["cell"]: row for row in read.cells}, tests, branches)


def searched(place: Place) -> list[str]:
    """Cells and groups that a search is for: no reference, and no branch of a group."""
    inside = {row.cell for rows in place.branches.values() for row in rows}
    cells = [c for c, row in place.cells.items() if row["reference"] != "yes" and c not in inside]
    return sorted([*cells, *place.branches])


def lenders(place: Place, steps: Steps) -> dict[str, list[Lender]]:
    """The marked cells of each chemistry, with the OCV and capacities that others borrow."""
    found = {}
    for cell, row in place.cells.items():
        if row["reference"] == "yes":
            records = tests_of(place, cell, steps)
            one = Lender(cell, True, _curves(records, row, steps), _capacities(records, row, steps))
            found.setdefault(row["chemistry"], []).append(one)
    return found


def loaded(place: Place, cell: str, known: dict[str, list[Lender]], steps: Steps) -> Loaded:
    """One cell with what its SoC refers to.

    Raises
    ------
    Refusal : a file that cannot be read, or no capacity.
    """
    row, records = place.cells[cell], tests_of(place, cell, steps)
    found = basis(
        cell,
        _curves(records, row, steps),
        _capacities(records, row, steps),
        [one for one in known.get(row["chemistry"], []) if one.cell != cell],
        rated_capacity_ampere_hour=row["rated_capacity_ampere_hour"],
    )
    facts = CellFacts(*(row[name] for name in CellFacts._fields))
    return Loaded(facts, found, records)


def tests_of(place: Place, cell: str, steps: Steps) -> list[MeasuredTest]:
    """The cleaned tests of a cell or group."""
    return [
        MeasuredTest(
            TestFacts(*(row[name] for name in TestFacts._fields)), _series(place, row, steps)
        )
        for row in place.tests[cell]
    ]


def _series(place, row, steps):
    files = [str(place.folder / file) for file in row["file"]]
    readings = [
        formats.read(data, name=name, instrument=row["instrument"])
        for name, data in raw_files.contents(files, row["sha256"])
    ]
    raw = series.assemble(readings, stated_sign=row["current_sign"]).columns
    return series.clean(raw, **steps.clean).columns


def _who(facts):
    names = ("test", "ambient_temperature_celsius", "cycle")
    return {name: getattr(facts, name) for name in names}


def _curves(records, row, steps):
    found = []
    for facts, columns in records:
        if facts.kind == "ocv" and facts.role == "fit":
            curve = slow_ocv(
                *(columns[name] for name in COUNTED),
                file_index=columns["file_index"],
                lower_cutoff_volt=row["lower_cutoff_volt"],
                upper_cutoff_volt=row["upper_cutoff_volt"],
                least_hour=steps.ocv["least_hour"],
            )
            found.append(_who(facts) | {name: _plain(v) for name, v in curve._asdict().items()})
    return found


def _capacities(records, row, steps):
    kinds = ("capacity", "ocv")
    mine = [one for one in records if one.facts.kind in kinds and one.facts.role == "fit"]
    return [_who(one.facts) | found for one in mine for found in _capacity_rows(one, row, steps)]


def _capacity_rows(one, row, steps):
    facts, columns = one
    counted = [columns[name] for name in COUNTED]
    rated = row["rated_capacity_ampere_hour"]
    try:
        cut = segment(
            *counted,
            file_index=columns["file_index"],
            rated_capacity_ampere_hour=rated,
            **steps.segment,
        )
        limits = {name: row[name] for name in CUTOFFS}
        rows = capacity(*counted, cut, whole_swing=facts.kind == "ocv", **limits).rows
    except Refusal:
        return []  # as in the workflow: a test without a complete charge gives no capacity
    lists = {name: _plain(values) for name, values in rows._asdict().items()}
    return [dict(zip(lists, values, strict=True)) for values in zip(*lists.values(), strict=True)]


def _plain(value):
    return value.tolist() if hasattr(value, "tolist") else value
