"""What the sheets say of a job's cell and test as typed values, and tests with their series."""

from cellwright.records.facts import CellFacts, MeasuredTest, TestFacts
from runtime import artefact


def of_job(snakemake) -> tuple[TestFacts, CellFacts]:
    """Facts of the test and of the cell of a job."""
    params = snakemake.params
    return TestFacts(snakemake.wildcards.test, **params.test), CellFacts(**params.cell)


def of_artefact(about) -> TestFacts:
    """Facts of the test that an artefact is of, as the sheet gave them to its job."""
    # As its job was told, not as the sheet says now: an artefact that is not made anew stays true.
    return TestFacts(about["wildcards"]["test"], **about["params"]["test"])


def tests_with_steps(steps_paths, series_paths) -> list[tuple[TestFacts, dict, dict]]:
    """Each test with its clean series and its steps, where both could be made."""
    pairs = zip(steps_paths, series_paths, strict=True)
    return [
        (of_artefact(about), series, steps)
        for steps, series, about in artefact.load_together(pairs)
    ]


def tests(paths) -> list[MeasuredTest]:
    """Clean series with the facts of each test, of the artefacts that have content."""
    loaded = artefact.load_all(paths)
    return [MeasuredTest(of_artefact(about), series) for series, about in loaded]


def with_columns(paths) -> list[tuple[TestFacts, dict]]:
    """Facts of each test and the columns of its artefact, of those that have content."""
    return [(of_artefact(about), columns) for columns, about in artefact.load_all(paths)]


def rows_of_tests(paths) -> list[dict]:
    """Rows of all artefacts with content, each with cell or group, test and what the sheet says."""
    return [
        dict(about["wildcards"]) | about["params"].get("test", {}) | row
        for columns, about in artefact.load_all(paths)
        for row in artefact.rows(columns)
    ]


def fresh_cell(cells, paths):
    """Facts and tests of the cell that lends its fresh state; None where none does."""
    # Of several cells marked fresh the first of the sheet, so that a run is the same every time.
    return (CellFacts(**cells[0]), tests(paths)) if cells else None
