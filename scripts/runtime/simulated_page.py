"""Of simulated cells: each verdict beside what was simulated, which only the report reads."""

import csv
from pathlib import Path

from cellwright.effects.story.words import name_of_effect
from runtime.page_tables import Cell, link, plain_table

TITLE = "What was simulated, beside each verdict"
READ = (
    "These cells are simulated, so the truth is known. No fit and no choice reads it: only this "
    "report opens data/simulated.csv. Named, not simulated: a wrong name. Simulated, not named: "
    "too small to act on, not excited by the tests of the cell, or missed."
)
COLUMNS = ["cell", "verdict", "named, and simulated", "named, not simulated"]
COLUMNS += ["simulated, not named", "what was simulated"]
VERDICTS = {
    "named": "named",
    "ambiguous": "named, at least once as A or B",
    "none": "nothing is missing",
    "unknown": "something without a name",
    "": "not searched",
}


def known(paths) -> dict:
    """What the laboratory says of each cell: (words, ids of effects); {} of a real campaign."""
    found = {}
    for path in paths:
        with Path(path).open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                found[row["cell"]] = row["simulated"], row["effects"].split(";")
    return found


def table(simulated, summary, effects):
    """A row a simulated cell; None without any.

    `simulated` is as of `known`, `summary` and `effects` are rows of the tables summary and
    missing_effect, as text.
    """
    verdicts = {row["cell"]: row["verdict"] for row in summary}
    rows = [
        [link(cell), VERDICTS[verdicts.get(cell, "")], *_sides(cell, true, effects), words]
        for cell, (words, true) in simulated.items()
    ]
    return plain_table("simulated", TITLE, READ, COLUMNS, rows) if rows else None


def _sides(cell, true, effects):
    """Names that are right, those that are wrong, effects that have no name, each in words."""
    named = [row for row in effects if row["cell"] == cell and row["effect"]]
    ties = [[row["effect"], *filter(None, row["alternatives"].split(";"))] for row in named]
    right = [tie for tie in ties if set(tie) & set(true)]
    wrong = [tie for tie in ties if tie not in right]
    unnamed = [[one] for one in filter(None, true) if not any(one in tie for tie in ties)]
    texts = [
        "; ".join(" or ".join(map(name_of_effect, tie)) for tie in side)
        for side in (right, wrong, unnamed)
    ]
    return texts[0], Cell(texts[1], mark="wrong"), texts[2]
