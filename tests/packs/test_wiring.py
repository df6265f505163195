"""Wirings: rows of groups.tsv to a tree of groups, its words, and every fault of such rows."""

import pytest

from cellwright.packs.wiring import (
    cells_of,
    depth,
    described,
    is_star,
    models_of,
    rows_below,
    shape,
    wiring_faults,
    wiring_of,
)
from cellwright.refusal import Refusal


def row(group, position, cell, connection="parallel", **more):
    return {"group": group, "position": position, "cell": cell, "connection": connection, **more}


def group(name, members, connection="parallel", **more):
    """Rows of a group, values of `more` one a member."""
    return [
        row(name, k + 1, cell, connection, **{key: values[k] for key, values in more.items()})
        for k, cell in enumerate(members)
    ]


PACK = [
    *group("pack", ["m1", "m2", "m3"], "series", wire_resistance_ohm=[1e-3, None, 2e-3]),
    *group("m1", "AB", link_resistance_ohm=[0.0, 1e-4], sense=["no", "yes"]),
    *group("m2", "CD"),
    *group("m3", "EF"),
]


def test_rows_of_a_sheet_in_any_order_make_a_tree():
    wiring = wiring_of("pack", PACK[::-1])
    assert (wiring.connection, wiring.contact_ohm) == ("series", (1e-3, 0.0, 2e-3))
    first = wiring.members[0]
    assert first.link_ohm == (0.0, 1e-4)
    assert first.sense == 1
    assert cells_of(wiring) == tuple("ABCDEF")
    assert depth(wiring) == 2
    assert wiring_of("m2", PACK) == wiring.members[1]


def test_strings_in_parallel_nest_to_any_depth():
    rows = [*group("top", ["s1", "s2"]), *group("s1", ["A", "p"], "series")]
    rows += [*group("s2", "BC", "series"), *group("p", "DE")]
    wiring = wiring_of("top", rows)
    assert depth(wiring) == 3
    assert cells_of(wiring) == tuple("ADEBC")
    assert described(wiring) == "(A + (D || E)) || (B + C)"
    assert shape(wiring) == (
        "parallel of 2 (1 x series of 2 (1 x cell, 1 x parallel of 2 cells), 1 x series of 2 cells)"
    )


def test_only_cells_on_leads_of_their_own_are_a_star():
    stars = {name: is_star(wiring_of(name, PACK)) for name in ("pack", "m1", "m2")}
    assert stars == {"pack": False, "m1": False, "m2": True}


def test_rows_below_a_group_are_its_own_and_those_of_the_groups_in_it():
    other = group("other", "AC")
    assert rows_below("pack", other + PACK) == PACK
    assert rows_below("m3", other + PACK) == PACK[-2:]


def test_models_stand_in_the_order_of_the_leaves_and_a_missing_one_is_named():
    wiring = wiring_of("m1", PACK)
    models = [{"cell": name} for name in "BXA"]
    assert models_of(wiring, models) == [models[2], models[0]]
    with pytest.raises(Refusal, match="m1 is not simulated: found no model of A, wanted one"):
        models_of(wiring, models[:2])


def faults(rows, cells="ABCDEFGH"):
    return [(f.row, f.column, f.found, f.wanted) for f in wiring_faults(rows, set(cells))]


def test_sound_wirings_have_no_fault():
    assert faults(PACK + group("twin", "AB") + group("triple", "GHA")) == []


BAD = {
    "unknown member": (group("g", "AZ"), 1, "cell", "a cell of cells.tsv or a group"),
    "a member alone": (group("g", "A"), 0, "group", "two or more members of g"),
    "a gap": ([row("g", 1, "A"), row("g", 3, "B")], 1, "position", "without a gap: 1 to 2"),
    "a position twice": ([row("g", 1, "A"), row("g", 1, "B")], 1, "position", "each once in g"),
    "a cell twice": (group("g", "ABA"), 2, "cell", "each once in g"),
    "a cell twice below": (
        [*group("g", ["A", "h"]), *group("h", "AB", "series")],
        2,
        "cell",
        "each once in g",
    ),
    "a group twice": (
        [*group("g", ["h", "h"], "series"), *group("h", "AB")],
        1,
        "cell",
        "each once in g",
    ),
    "both connections": (
        [row("g", 1, "A"), row("g", 2, "B", "series")],
        1,
        "connection",
        "the same on all rows of g, parallel",
    ),
    "both terminals": (
        group("g", "AB", terminals=["opposite_ends", "same_end"]),
        1,
        "terminals",
        "the same on all rows of g, opposite_ends",
    ),
    "a link before the first": (
        group("g", "AB", link_resistance_ohm=[1e-3, 1e-3]),
        0,
        "link_resistance_ohm",
        "blank or 0 at the first position",
    ),
    "a link in series": (
        group("g", "AB", "series", link_resistance_ohm=[None, 1e-3]),
        1,
        "link_resistance_ohm",
        "blank in series",
    ),
    "terminals in series": (
        group("g", "AB", "series", terminals=["opposite_ends"] * 2),
        0,
        "terminals",
        "blank in series",
    ),
    "sense in series": (group("g", "AB", "series", sense=[None, "yes"]), 1, "sense", "blank in"),
    "two sense points": (group("g", "ABC", sense=["yes", "no", "yes"]), 2, "sense", "one sense"),
    "itself": (group("g", ["A", "g"]), 1, "cell", "no group that lies in itself: g in g"),
    "a circle": (
        [*group("g", ["A", "h"]), *group("h", ["B", "k"]), *group("k", ["g", "C"])],
        1,
        "cell",
        "no group that lies in itself: g in k in h in g",
    ),
    "SoC of a group": (
        [*group("g", ["A", "h"], "series", initial_soc=[1.0, 0.9]), *group("h", "BC")],
        1,
        "initial_soc",
        "blank: h is a group",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_each_fault_is_found_once_at_its_row(name):
    rows, index, column, wanted = BAD[name]
    found = faults(rows)
    assert found[0][:3] == (index, column, rows[index].get(column))
    assert wanted in found[0][3]
    assert len(found) == (2 if name == "terminals in series" else 1)


def test_all_faults_are_told_at_once_in_the_order_of_the_rows():
    rows = [*group("g", "AZ", "series", sense=["yes", None]), *group("h", "C")]
    assert [fault[1] for fault in faults(rows)] == ["sense", "cell", "group"]
    with pytest.raises(Refusal, match=r"g position 1, sense: found 'yes'.*; h position 1, group"):
        wiring_of("g", rows)


def test_a_row_that_was_not_read_makes_no_further_faults():
    unread = {"group": "g", "position": None, "cell": "B", "connection": "parallel"}
    assert faults([row("g", 1, "A"), unread]) == []


def test_a_group_without_rows_is_refused_with_those_there_are():
    with pytest.raises(Refusal, match="no row of group x; there are pack, m1, m2, m3"):
        wiring_of("x", PACK)


def test_ten_thousand_cells_are_checked_in_a_moment():
    rows = [r for s in range(100) for r in group(f"s{s}", [f"c{s}_{k}" for k in range(100)])]
    rows += group("pack", [f"s{s}" for s in range(100)], "series")
    cells = {f"c{s}_{k}" for s in range(100) for k in range(100)}
    assert wiring_faults(rows, cells) == []
    assert len(cells_of(wiring_of("pack", rows))) == 10_000
