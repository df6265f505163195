"""Wildcard constraints of many names: each name and nothing else, in a pattern that stays short."""

import re

from hypothesis import given
from hypothesis import strategies as some

from runtime.wildcard_patterns import either, only_these

NAMES = some.text(alphabet="ab12-_", min_size=1, max_size=5)


@given(some.sets(NAMES, min_size=1, max_size=30), some.lists(NAMES, max_size=20))
def test_a_constraint_allows_its_names_and_no_others(names, others):
    pattern = re.compile(f"results/({either(names)})/")
    for name in [*names, *others]:
        assert bool(pattern.fullmatch(f"results/{name}/")) == (name in names)


def test_without_names_nothing_is_allowed():
    assert re.search(either([]), "C1") is None


def test_the_pattern_of_numbered_cells_does_not_grow_with_their_number():
    thousands = either([f"S{number:05d}" for number in range(1, 10_000)])
    assert len(thousands) < 200
    assert re.fullmatch(thousands, "S04711")
    assert not re.fullmatch(thousands, "S00000")


def test_a_cell_is_allowed_in_paths_of_its_own_tests_only():
    rows = [{"cell": cell, "test": test} for cell, test in (("A", "t1"), ("B", "t1"), ("C", "t2"))]
    pattern = re.compile(rf"results/({only_these(rows)})/(\w+)\.parquet")
    paths = [f"results/{cell}/{test}.parquet" for cell in "ABC" for test in ("t1", "t2")]
    allowed = [match.group(1, 2) for path in paths if (match := pattern.fullmatch(path))]
    assert allowed == [("A", "t1"), ("B", "t1"), ("C", "t2")]
    assert re.search(only_these([]), "A") is None
