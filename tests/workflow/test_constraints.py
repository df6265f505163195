"""Wildcard constraints of many names: each name and nothing else, in a pattern that stays short."""

import re
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as some

RULES = Path(__file__).resolve().parents[2] / "workflow" / "rules"


def functions_of_rules():
    """The two functions that make constraints, from the file of rules that they stand in."""
    text = (RULES / "common.smk").read_text(encoding="utf-8")
    source = text[text.index("def either(") : text.index("def only_these(")]
    space = {}
    exec("import re\nfrom functools import cache\n" + source, space)
    return space["either"]


EITHER = functions_of_rules()
NAMES = some.text(alphabet="ab12-_", min_size=1, max_size=5)


@given(some.sets(NAMES, min_size=1, max_size=30), some.lists(NAMES, max_size=20))
def test_a_constraint_allows_its_names_and_no_others(names, others):
    pattern = re.compile(f"results/({EITHER(names)})/")
    for name in [*names, *others]:
        assert bool(pattern.fullmatch(f"results/{name}/")) == (name in names)


def test_without_names_nothing_is_allowed():
    assert re.search(EITHER([]), "C1") is None


def test_the_pattern_of_numbered_cells_does_not_grow_with_their_number():
    thousands = EITHER([f"S{number:05d}" for number in range(1, 10_000)])
    assert len(thousands) < 200
    assert re.fullmatch(thousands, "S04711")
    assert not re.fullmatch(thousands, "S00000")
