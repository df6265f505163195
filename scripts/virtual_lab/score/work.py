"""Score a campaign: every table of the contract, then the files that say how good it is."""

from typing import NamedTuple

import pandas as pd

from virtual_lab.score import (
    circuits,
    comparison,
    curves,
    expected,
    files,
    groups,
    spoiled,
    tables,
    verdicts,
)
from virtual_lab.score.summary import summarise


class Score(NamedTuple):
    """errors: one row a comparison; summary: one row a quantity; verdicts: one row a cell."""

    errors: pd.DataFrame
    summary: pd.DataFrame
    verdicts: pd.DataFrame


def score(place: files.Campaign) -> Score:
    """Everything that can be said of a campaign's results."""
    parts = [tables.compare(place, name) for name in tables.SPECS]
    parts += [curves.ocv(place), circuits.compare(place), curves.soc(place), groups.compare(place)]
    parts += [verdicts.parameters(place), spoiled.refused(place), spoiled.flagged(place)]
    compared = expected.mark(place, comparison.gathered(parts))
    judged = verdicts.compare(place)
    return Score(compared, summarise(place, compared, judged), judged)


def write(place: files.Campaign, *, title: str) -> Score:
    """Score a campaign into `results/score/`: tables, and the page for people."""
    from virtual_lab.score import page

    scored = score(place)
    folder = place.results / "score"
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("errors", "summary", "verdicts"):
        path = folder / ("score.csv" if name == "summary" else f"{name}.csv")
        table = getattr(scored, name)
        path.write_text(table.to_csv(index=False, float_format="%.9g"), encoding="utf-8")
    (folder / "score.html").write_text(page.render(scored, title=title), encoding="utf-8")
    return scored
