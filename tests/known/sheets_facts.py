"""Facts of cells and tests, as the sheets of a campaign would say them."""

from cellwright.records.facts import BranchFacts, CellFacts, MeasuredTest, TestFacts


def cell_facts(lower=3.0, upper=4.3, *, name="A", rated=None):
    return CellFacts(name, rated, lower, upper)


def facts_of(test="test", kind="drive", *, celsius=25.0, soc=None, role="fit", cycle=None):
    return TestFacts(test, kind, celsius, cycle, soc, role)


def measured_test(series, test="test", kind="drive", **facts):
    return MeasuredTest(facts_of(test, kind, **facts), series)


def branch_facts(cells, soc, wire=None):
    """Branches of a group from the names of its cells, their SoC at the start and their wires."""
    wires = wire or [None] * len(soc)
    rows = zip(cells, wires, soc, strict=True)
    return [BranchFacts(k, *row) for k, row in enumerate(rows, 1)]
