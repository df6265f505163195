"""Numbers of the demo campaign against what is true in it, and of its own run."""

from pathlib import Path

import pandas as pd

from real_cells import gather
from virtual_lab.score import files, summary

PERCENT = 1e2


def numbers(repository) -> pd.DataFrame:
    """Every number of the finished demo campaign: as for real cells, and its errors against truth.

    Parameters
    ----------
    repository : folder with `results/`, `config/` and `tests/truth/`.
    """
    place = files.Campaign(
        *(Path(repository, part) for part in ("results", "tests/truth", "config"))
    )
    scored = pd.DataFrame(
        list(errors(summary.score(place).summary)),
        columns=["cell", "quantity", "where", "value", "unit"],
    )
    measured = gather.numbers(repository, name="demo")
    # The records of jobs in the repository are those of other targets too.
    measured = measured[measured["quantity"] != "time of all jobs"]
    return pd.concat([measured, gather.finished(scored, "demo")], ignore_index=True)


def errors(summary: pd.DataFrame):
    """One row a scored quantity: root mean square error, share, rows that are missing."""
    for row in summary[summary["state"] == "scored"].to_dict("records"):
        place = ", ".join(name for name in (row["table"], row["quantity"]) if name)
        if pd.notna(row["rms_error"]):
            unit = "" if row["unit"] == "1" else row["unit"]
            yield "all", "error against the truth", place, row["rms_error"], unit
        if pd.notna(row["share"]):
            yield "all", "share that is right", place, PERCENT * row["share"], "%"
        if pd.notna(row["n_missing"]):
            quantity = "rows that the truth has and the results have not"
            yield "all", quantity, place, row["n_missing"], "count"
