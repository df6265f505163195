"""Wildcard constraints of many names: each name and nothing else, in a pattern that stays short."""

import re
from functools import cache

NOTHING = "(?!)"


def either(names) -> str:
    """Pattern of one of these names; without names, of nothing at all.

    Of C1, C2 and D1 it is `(?:C[12]|D1)`: names share their beginnings, and letters that are
    followed by the same endings one class. Snakemake tries a constraint on almost every file; with
    all names in a row the time of one trial would grow with the number of cells.
    """
    return _pattern(frozenset(names)) if names else NOTHING


@cache  # numbered names have the same endings after many beginnings
def _pattern(names):
    """Pattern of these names; an empty one among them makes the others optional."""
    endings_after = {}
    for name in filter(None, names):
        endings_after.setdefault(name[0], set()).add(name[1:])
    letters_before = {}
    for letter, endings in sorted(endings_after.items()):
        letters_before.setdefault(_pattern(frozenset(endings)), []).append(re.escape(letter))
    parts = [
        (letters[0] if len(letters) == 1 else f"[{''.join(letters)}]") + ending
        for ending, letters in letters_before.items()
    ]
    if not parts:
        return ""
    if len(parts) == 1 and "" not in names:
        return parts[0]
    return f"(?:{'|'.join(parts)})" + ("?" if "" in names else "")


def only_these(rows) -> str:
    """Pattern of a cell's name in a path that ends in one of its tests in `rows` of tests.tsv."""
    tests_of, cells_with = {}, {}
    for row in rows:
        tests_of.setdefault(row["cell"], []).append(row["test"])
    for cell, tests in tests_of.items():
        cells_with.setdefault(either(tests), []).append(cell)
    parts = [rf"(?:{either(cells)})(?=/(?:{tests})\.)" for tests, cells in cells_with.items()]
    return "|".join(parts) or NOTHING
