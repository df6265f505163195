"""Tables of numbers: all that finished campaigns say, each with unit, better side and tolerance."""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from real_cells import record
from real_cells.measured import MEASUREMENTS, PERCENT
from real_cells.quantities import COLUMNS, KEYS, MODEL, QUANTITIES, SEARCH
from virtual_lab.score import files, summary

ROOT = Path(__file__).resolve().parents[2]
LAST_RUN = ROOT / "real" / "numbers.csv"
MOST_CELLS = 8  # of a campaign with more, models and verdicts are put together over all cells


def of_campaign(campaign, *, name: str | None = None) -> pd.DataFrame:
    """Every measured number of one finished campaign, values as text with six digits.

    Parameters
    ----------
    campaign : folder with `results/` and `config/`.
    name : of the campaign (default: the folder's).
    """
    measured = [row for measure in MEASUREMENTS for row in measure(campaign)]
    rows = pd.DataFrame(measured, columns=["cell", "quantity", "where", "value"])
    rows = described(over_cells(rows), name or Path(campaign).name)
    if "right verdicts" in set(rows["quantity"]):  # then right is what counts, not the words
        rows.loc[rows["quantity"].isin(["verdict", "named effects"]), "better"] = "shown"
    return rows


def finished_campaigns(folder) -> list[Path]:
    """The finished campaigns in a folder: those whose results were held against physics."""
    return [path.parents[2] for path in sorted(Path(folder).glob("*/results/tables/checks.csv"))]


def described(rows: pd.DataFrame, name: str) -> pd.DataFrame:
    """Rows (cell, quantity, where, value) with what is to be known of each; unknown ones left out.

    A column `unit` goes before the unit of the quantity. `name` is the campaign's.
    """
    rows = rows[rows["value"].map(lambda value: isinstance(value, str) or np.isfinite(value))]
    rows = rows.assign(campaign=name, value=rows["value"].map(_six_digits))
    return _with_tolerances(rows.assign(published="", published_source=""))


def _with_tolerances(rows):
    """The rows with unit, side and tolerance of their quantity; a unit of their own stays."""
    about = [QUANTITIES[quantity] for quantity in rows["quantity"]]
    return rows.assign(
        unit=rows["unit"] if "unit" in rows else [one.unit for one in about],
        better=[one.better for one in about],
        tolerance_absolute=[_six_digits(one.absolute) for one in about],
        tolerance_relative=[_six_digits(one.relative) for one in about],
    )[COLUMNS]


def _six_digits(value) -> str:
    """A number with six digits, a word as it is."""
    return value if isinstance(value, str) else f"{float(value):.6g}"


def with_published(rows: pd.DataFrame, published: pd.DataFrame) -> pd.DataFrame:
    """The same numbers, each beside the published one of its campaign, cell, quantity and place.

    A published number of these campaigns that the results do not have stands with a blank value.
    """
    known = published[published["campaign"].isin(rows["campaign"])]
    known = known.rename(columns={"value": "published", "source": "published_source"})
    both = rows.drop(columns=["published", "published_source"]).merge(known, on=KEYS, how="left")
    measured = pd.MultiIndex.from_frame(rows[KEYS])
    alone = known[~pd.MultiIndex.from_frame(known[KEYS]).isin(measured)]
    blank = _with_tolerances(alone.assign(value=""))
    return pd.concat([both, blank], ignore_index=True).fillna("")[COLUMNS]


def over_cells(rows: pd.DataFrame) -> pd.DataFrame:
    """The same rows; of many cells, models and verdicts as median and worst over the cells."""
    if rows["cell"].nunique() <= MOST_CELLS:
        return rows
    about = rows["quantity"].map(QUANTITIES)
    many = pd.Series([one.topic in (MODEL, SEARCH) for one in about], rows.index)
    many &= rows["cell"] != "all"
    together = pd.DataFrame(list(_median_and_worst(rows[many])), columns=rows.columns)
    return pd.concat([rows[~many], together], ignore_index=True)


def _median_and_worst(rows):
    """Median and worst of each number over the cells; how many cells have which word."""
    for (quantity, where), same in rows.groupby(["quantity", "where"], sort=False):
        about = QUANTITIES[quantity]
        if about.unit == "word":
            counts = same["value"].value_counts().sort_index()
            words = "; ".join(f"{word}: {count}" for word, count in counts.items())
            yield "all", quantity, where, words
            continue
        values = same["value"].astype(float)
        cells = f"{len(values)} cells"
        worst = values.min() if about.better == "higher" else values.max()
        yield f"median of {cells}", quantity, where, values.median()
        yield f"worst of {cells}", quantity, where, worst


def of_demo(repository) -> pd.DataFrame:
    """Every number of the finished demo campaign: as for real cells, and its errors against truth.

    Parameters
    ----------
    repository : folder with `results/`, `config/` and `tests/truth/`.
    """
    folders = (Path(repository, part) for part in ("results", "tests/truth", "config"))
    scored = pd.DataFrame(
        list(errors_against_truth(summary.score(files.Campaign(*folders)).summary)),
        columns=["cell", "quantity", "where", "value", "unit"],
    )
    measured = of_campaign(repository, name="demo")
    # The records of jobs in the repository are those of other targets too.
    measured = measured[measured["quantity"] != "time of all jobs"]
    return pd.concat([measured, described(scored, "demo")], ignore_index=True)


def errors_against_truth(scores: pd.DataFrame):
    """One row a scored quantity: root mean square error, share, rows that are missing."""
    for row in scores[scores["state"] == "scored"].to_dict("records"):
        where = ", ".join(name for name in (row["table"], row["quantity"]) if name)
        if pd.notna(row["rms_error"]):
            unit = "" if row["unit"] == "1" else row["unit"]
            yield "all", "error against the truth", where, row["rms_error"], unit
        if pd.notna(row["share"]):
            yield "all", "share that is right", where, PERCENT * row["share"], "%"
        if pd.notna(row["n_missing"]):
            quantity = "rows that the truth has and the results have not"
            yield "all", quantity, where, row["n_missing"], "count"


def command_line(about: str) -> argparse.ArgumentParser:
    """The options of a tool that say where its numbers come from; `about` is its description."""
    parser = argparse.ArgumentParser(description=about)
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--from", dest="folder", help="gather from a folder of finished campaigns")
    source.add_argument(
        "--demo", action="store_true", help="the finished demo campaign, against its truth"
    )
    return parser


def of_command_line(given) -> pd.DataFrame:
    """Numbers that the options ask for: of the last `real` run, a folder, or the demo campaign.

    Raises
    ------
    FileNotFoundError
        Where there are none.
    """
    if given.demo:
        return of_demo(ROOT)
    if given.folder:
        tables = [of_campaign(campaign) for campaign in finished_campaigns(given.folder)]
        if not tables:
            raise FileNotFoundError(
                f"{given.folder}: found no finished campaign (results/tables/checks.csv)"
            )
        rows = pd.concat(tables, ignore_index=True)
        return with_published(rows, record.read(record.PUBLISHED))
    if not LAST_RUN.is_file():
        raise FileNotFoundError(
            "real/numbers.csv: found none; run `snakemake --cores 2 real` first"
        )
    return record.read(LAST_RUN)
