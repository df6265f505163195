"""Tests of artefacts as typed values: facts of the sheet, and the clean series with them."""

from cellwright.records.facts import MeasuredTest, TestFacts
from runtime import artefact


def of_artefact(about) -> TestFacts:
    """Facts of the test that an artefact is of, as the sheet gave them to its job."""
    return TestFacts(about["wildcards"]["test"], **about["params"]["test"])


def tests(paths) -> list[MeasuredTest]:
    """Clean series with the facts of each test, of the artefacts that have content."""
    loaded = artefact.load_all(paths)
    return [MeasuredTest(of_artefact(about), series) for series, about in loaded]
