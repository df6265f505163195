"""Hidden campaigns read for the searches: raw files to tests and basis, in one process."""

from pathlib import Path
from typing import NamedTuple

import cellwright as cw
from cellwright.api import inputs
from cellwright.records.basis import Lender
from runtime import raw_files, sheets

SCHEMAS = Path(__file__).resolve().parents[2] / "workflow" / "schemas"
FACTS = ("test", "kind", "ambient_temperature_celsius", "cycle", "soc", "role")


class Campaign(NamedTuple):
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
    """Settings of the stages before a search: sections clean, segment, and ocv.least_hour [h]."""

    clean: dict
    segment: dict
    least_hour: float


def read(folder) -> Campaign:
    """The campaign in a folder, its sheets checked as the workflow checks them."""
    sheet_rows = sheets.read(folder, SCHEMAS)
    tests, branches = {}, {}
    for row in sheet_rows.tests:
        tests.setdefault(row["cell"], []).append(row)
    for row in sorted(sheet_rows.groups, key=lambda row: row["position"]):
        branches.setdefault(row["group"], []).append(inputs.branch_facts(row))
    return Campaign(Path(folder), {row["cell"]: row for row in sheet_rows.cells}, tests, branches)


def searched(campaign: Campaign) -> list[str]:
    """Cells and groups to be searched: neither references nor branches of a group."""
    inside = {row.cell for rows in campaign.branches.values() for row in rows}
    cells = [
        c for c, row in campaign.cells.items() if row["reference"] != "yes" and c not in inside
    ]
    return sorted([*cells, *campaign.branches])


def lenders(campaign: Campaign, steps: Steps) -> dict[str, list[Lender]]:
    """Reference cells of each chemistry, with the OCV and capacities that others borrow."""
    by_chemistry = {}
    for cell, row in campaign.cells.items():
        if row["reference"] == "yes":
            records = tests_of(campaign, cell, steps)
            shown = (_curves(records, row, steps), _capacities(records, row, steps))
            lender = cw.lender(row, *shown, marked=True)
            by_chemistry.setdefault(row["chemistry"], []).append(lender)
    return by_chemistry


def loaded(
    campaign: Campaign, cell: str, lenders_of: dict[str, list[Lender]], steps: Steps
) -> Loaded:
    """Facts, basis and tests of one cell.

    Raises
    ------
    Refusal : a file that cannot be read, or no capacity.
    """
    row, records = campaign.cells[cell], tests_of(campaign, cell, steps)
    capacities = _capacities(records, row, steps)
    basis = cw.basis(
        row,
        _curves(records, row, steps),
        capacities,
        [lender for lender in lenders_of.get(row["chemistry"], []) if lender.cell != cell],
        rests=_rests(records, row, capacities, steps),
    )
    return Loaded(row, basis.content, records)


def tests_of(campaign: Campaign, cell: str, steps: Steps) -> list[tuple]:
    """The cleaned tests of a cell or group: (TestFacts, columns) each."""
    return [
        (cw.TestFacts(**{name: row[name] for name in FACTS}), _series(campaign, row, steps))
        for row in campaign.tests[cell]
    ]


def _series(campaign, row, steps):
    files = [str(campaign.folder / file) for file in row["file"]]
    contents = raw_files.contents(files, row["sha256"])
    stated = {"instrument": row["instrument"], "current_sign": row["current_sign"]}
    return cw.clean(cw.read(contents, **stated), steps.clean).columns


def _curves(records, row, steps):
    return [
        (facts, cw.ocv(series, row, least_hour=steps.least_hour))
        for facts, series in records
        if facts.kind == "ocv" and facts.role == "fit"
    ]


def _rests(records, row, capacities, steps):
    """OCV curves from the rests of pulse tests, as in the workflow, of a cell without a slow test.

    A pulse test without such rests gives none.
    """
    pulsed = [one for one in records if one[0].kind == "hppc" and one[0].role == "fit"]
    if any(facts.kind == "ocv" for facts, _ in records):
        return []
    curves = [
        (facts, _rest_curve(facts, series, row, capacities, steps)) for facts, series in pulsed
    ]
    return [(facts, curve) for facts, curve in curves if curve]


def _rest_curve(facts, series, row, capacities, steps):
    try:
        cut = cw.segment(series, row, steps.segment)
        return cw.ocv_from_rests(series, cut, row, facts, capacities)
    except cw.Refusal:
        return None


def _capacities(records, row, steps):
    kinds = ("capacity", "ocv")
    fitted = [record for record in records if record[0].kind in kinds and record[0].role == "fit"]
    tried = [(facts, _capacity(facts, series, row, steps)) for facts, series in fitted]
    return [(facts, capacity) for facts, capacity in tried if capacity]


def _capacity(facts, series, row, steps):
    """Capacities of a test; None, as in the workflow, without a complete half cycle."""
    try:
        cut = cw.segment(series, row, steps.segment)
        return cw.capacity(series, cut, row, whole_swing=facts.kind == "ocv")
    except cw.Refusal:
        return None
