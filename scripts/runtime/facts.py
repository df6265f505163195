"""What the sheets say of a job's cell, test or group as typed values, tests with their series."""

from cellwright.records.facts import BranchFacts, CellFacts, MeasuredTest, TestFacts
from runtime import artefact


def of_job(snakemake) -> tuple[TestFacts, CellFacts]:
    """What the sheets say of the test and of the cell of a job."""
    params = snakemake.params
    return TestFacts(snakemake.wildcards.test, **params.test), CellFacts(**params.cell)


def of_artefact(about) -> TestFacts:
    """Facts of the test that an artefact is of, as its job was given them."""
    return TestFacts(about["wildcards"]["test"], **about["params"]["test"])


def branches(rows) -> list[BranchFacts]:
    """Branches of a group from its rows of groups.tsv."""
    return [BranchFacts(*(row[name] for name in BranchFacts._fields)) for row in rows]


def test(snakemake) -> MeasuredTest:
    """The test of a job, whose clean series is its input of that name."""
    test_facts = TestFacts(snakemake.wildcards.test, **snakemake.params.test)
    return MeasuredTest(test_facts, artefact.load(snakemake.input.series))


def tests(paths) -> list[MeasuredTest]:
    """Clean series with what the sheet says of each test."""
    loaded = artefact.load_all(paths)
    return [MeasuredTest(of_artefact(about), series) for series, about in loaded]
