"""Inputs of a search besides the tests of its cell: models of a group's cells, healthy cells."""

from cellwright.effects.finding import Reference
from cellwright.effects.groups.finding import KnownCell
from cellwright.records.facts import CellFacts
from cellwright.refusal import Refusal
from runtime import artefact, facts, raw_files, tables

MEASUREMENTS = ("eis", "resistance", "relaxation", "capacity", "ocv_entropic")


def known_cells(branches, lenders, paths) -> list[KnownCell]:
    """The model of the cell in each branch of a group.

    Parameters
    ----------
    branches : rows of groups.tsv. lenders : cell whose model stands for a cell without one.
    paths : of the models.
    """
    models = {about["wildcards"]["cell"]: model for model, about in artefact.load_all(paths)}
    # A cell without pulses of its own is known by its type, which the verdict says.
    sources = [lenders.get(row["cell"], row["cell"]) for row in branches]
    return [KnownCell(models.get(source), source) for source in sources]


def references(rows, basis_paths, series_paths) -> list[Reference]:
    """Healthy cells of the type: facts, basis and tests of each."""
    owner = {path: artefact.read_about(path)["wildcards"]["cell"] for path in series_paths}
    paths_of = {cell: [p for p in series_paths if owner[p] == cell] for cell in owner.values()}
    bases = {basis["cell"]: basis for basis, _ in artefact.load_all(basis_paths)}
    return [
        Reference(cell, bases[cell.cell], facts.tests(paths_of[cell.cell]))
        for cell in (CellFacts(**row) for row in rows)
        if cell.cell in bases
    ]


def measurements(inputs, facts_of_tests) -> dict:
    """Rows of each kind of measurement of a cell by itself, with what the sheet says of its test.

    Parameters
    ----------
    inputs : of a job, with the artefacts of `MEASUREMENTS` by name.
    facts_of_tests : as of `tables.rows_of`.
    """
    return {stage: tables.rows_of(getattr(inputs, stage), facts_of_tests) for stage in MEASUREMENTS}


def simulated(files, tests, content=None) -> tuple[dict, list[str]]:
    """Simulated voltages by test, and notes on those that could not be read.

    Parameters
    ----------
    files : dict test → path relative to the campaign. tests : list of MeasuredTest that there are.
    content : as of `raw_files.contents`.

    Raises
    ------
    Refusal
        None of them could be read.
    """
    import cellwright as cw

    curves, notes = {}, []
    # A simulation of a test that could not be read has nothing to be compared with.
    for test in (name for name in files if name in {one.facts.test for one in tests}):
        try:
            (named,) = raw_files.contents([files[test]], None, content=content)
            curves[test] = cw.read_simulated(named)
        except Refusal as refusal:
            notes.append(f"not used: {test}: {refusal}")
    if not curves:
        raise Refusal("; ".join(["no simulated voltage of a test of the cell", *notes]))
    return curves, notes
