"""Results, truth and sheets of a campaign as tables read from disk."""

import json
from pathlib import Path
from typing import NamedTuple

import pandas as pd

NAMES = ("cell", "test", "group", "file", "reason", "fault", "flag", "model", "filter", "scenario")
NAMED = dict.fromkeys((*NAMES, "direction", "quantity", "law", "parameter", "method", "unit"), str)


class Campaign(NamedTuple):
    """Where a campaign's results, truth and sheets are."""

    results: Path
    truth: Path
    config: Path


def campaign(folder) -> Campaign:
    """The campaign in a folder."""
    folder = Path(folder)
    return Campaign(folder / "results", folder / "truth", folder / "config")


def read_table(path) -> pd.DataFrame | None:
    """A CSV table, blank as not known, names as text.

    None where there is no file; no rows and no columns where the file is empty.
    """
    if not Path(path).is_file():
        return None
    separator = "\t" if Path(path).suffix == ".tsv" else ","
    options = {"dtype": NAMED, "keep_default_na": False, "na_values": [""]}
    try:
        return pd.read_csv(path, sep=separator, low_memory=False, **options)
    except pd.errors.EmptyDataError:
        return pd.DataFrame()


def found(place: Campaign, table: str) -> pd.DataFrame | None:
    """A table of the pipeline's results."""
    return read_table(place.results / "tables" / f"{table}.csv")


def true(place: Campaign, table: str) -> pd.DataFrame | None:
    """A table of the truth."""
    return read_table(place.truth / f"{table}.csv")


def artefact(place: Campaign, stage: str, name: str, test: str) -> pd.DataFrame | None:
    """Columns of `results/stages/<stage>/<cell or group>/<test>.parquet`; None if empty."""
    path = place.results / "stages" / stage / name / f"{test}.parquet"
    columns = pd.read_parquet(path) if path.is_file() else None
    return columns if columns is not None and len(columns) else None


def read_json(path):
    """A JSON document; None where there is no file."""
    return json.loads(Path(path).read_text(encoding="utf-8")) if Path(path).is_file() else None


def with_columns(table: pd.DataFrame | None, columns) -> pd.DataFrame:
    """The table with at least these columns, blank where it has none; empty for None."""
    table = pd.DataFrame() if table is None else table
    missing = [name for name in columns if name not in table]
    return table.assign(**{name: float("nan") for name in missing}).reset_index(drop=True)
