"""Wildcard constraints of many names: each name and nothing else, in a pattern that stays short."""

import re
from functools import cache

NOTHING = "(?!)"


def either(names) -> str:
    """Pattern of one of these names; without names, of nothing at all.

    Names share their common beginnings in the pattern, and letters with the same endings one class,
    since Snakemake tries a constraint on almost every file: with all names in a row the time of one
    trial would grow with the number of cells.
    """
    return _pattern(frozenset(names)) if names else NOTHING


@cache
def _pattern(names):
    """Pattern of these names; an empty name makes the others optional."""
    endings, letters = {}, {}
    for name in filter(None, names):
        endings.setdefault(name[0], set()).add(name[1:])
    for letter, rest in sorted(endings.items()):
        letters.setdefault(_pattern(frozenset(rest)), []).append(re.escape(letter))
    parts = [
        f"{of[0]}{rest}" if len(of) == 1 else f"[{''.join(of)}]{rest}"
        for rest, of in letters.items()
    ]
    if not parts:
        return ""
    grouped = parts[0] if len(parts) == 1 and "" not in names else f"(?:{'|'.join(parts)})"
    return f"{grouped}?" if "" in names else grouped


def only_these(rows) -> str:
    """Pattern of a cell's name in a path that ends in one of its tests in `rows` of tests.tsv."""
    names, alike = {}, {}
    for row in rows:
        names.setdefault(row["cell"], []).append(row["test"])
    for name, tests in names.items():
        alike.setdefault(either(tests), []).append(name)
    return "|".join(f"(?:{either(alike[of])})(?=/(?:{of})\\.)" for of in alike) or NOTHING
