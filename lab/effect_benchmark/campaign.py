"""Hidden campaigns read for the searches: raw files to tests and basis, in one process."""

from contextlib import suppress
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
    """Settings of the stages before a search: sections clean, segment, and of ocv two keys.

    least_hour : ocv.least_hour [h]. rest_second : ocv.rest_second [s]; None: no curve from rests.
    """

    clean: dict
    segment: dict
    least_hour: float
    rest_second: float | None = None


class Shown(NamedTuple):
    """What a cell's tests show for its basis: (TestFacts, result) each."""

    curves: list
    capacities: list
    rests: list


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
    basis = cw.basis(
        row,
        _curves(records, row, steps),
        _capacities(records, row, steps),
        [lender for lender in lenders_of.get(row["chemistry"], []) if lender.cell != cell],
    )
    return Loaded(row, basis.content, records)


def tests_of(campaign: Campaign, cell: str, steps: Steps) -> list[tuple]:
    """The cleaned tests of a cell or group: (TestFacts, columns) each.

    Raises
    ------
    Refusal : a file that cannot be read.
    """
    return [_test(campaign, row, steps) for row in campaign.tests[cell]]


def readable_tests(campaign: Campaign, cell: str, steps: Steps) -> list[tuple]:
    """The same without spectra and, as in the workflow, without tests that cannot be read."""
    tried = []
    for row in campaign.tests.get(cell, []):
        with suppress(cw.Refusal):
            tried += [_test(campaign, row, steps)] if row["kind"] != "eis" else []
    return tried


def _test(campaign, row, steps):
    facts = cw.TestFacts(**{name: row[name] for name in FACTS})
    return facts, _series(campaign, row, steps)


def shown(records: list[tuple], cell: dict, steps: Steps) -> Shown:
    """Curves of slow tests and capacities of a cell; without a slow test, curves of rests.

    Parameters
    ----------
    records : of `tests_of`. cell : its facts. steps : settings.
    """
    curves, capacities = _curves(records, cell, steps), _capacities(records, cell, steps)
    slow = any(facts.kind == "ocv" for facts, _ in records)
    if slow or steps.rest_second is None:
        return Shown(curves, capacities, [])
    pulses = [record for record in records if record[0].kind == "hppc" and record[0].role == "fit"]
    tried = [(facts, _rests(facts, series, cell, capacities, steps)) for facts, series in pulses]
    return Shown(curves, capacities, [(facts, curve) for facts, curve in tried if curve])


def _rests(facts, series, cell, capacities, steps):
    """OCV from the rests of a pulse test; None, as in the workflow, where they are too few."""
    try:
        cut = cw.segment(series, cell, steps.segment)
        return cw.ocv_from_rests(
            series, cut, cell, facts, capacities, rest_second=steps.rest_second
        )
    except cw.Refusal:
        return None


def _series(campaign, row, steps):
    files = [str(campaign.folder / file) for file in row["file"]]
    contents = raw_files.contents(files, row["sha256"])
    stated = {"instrument": row["instrument"], "current_sign": row["current_sign"]}
    return cw.clean(cw.read(contents, **stated), steps.clean).columns


def _curves(records, row, steps):
    """Curves of slow tests; none, as in the workflow, of one that is not slow or not complete."""
    curves = []
    for facts, series in records:
        with suppress(cw.Refusal):
            slow = facts.kind == "ocv" and facts.role == "fit"
            curves += [(facts, cw.ocv(series, row, least_hour=steps.least_hour))] if slow else []
    return curves


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
