"""The files of a finished campaign: its tables, artefacts and sheets, blank as not known."""

import json
from pathlib import Path

import pandas as pd

NAMES = ("cell", "test", "group", "model", "filter", "scenario", "direction", "stage", "reason")


def table(campaign, name: str) -> pd.DataFrame:
    """A table of the results, `results/tables/<name>.csv`.

    Raises
    ------
    FileNotFoundError
        Where the campaign has none: it has not been run to its end.
    """
    path = Path(campaign) / "results" / "tables" / f"{name}.csv"
    if not path.is_file():
        raise FileNotFoundError(f"{path}: there is no such table; run the campaign to its end")
    texts = dict.fromkeys(NAMES, str)
    return pd.read_csv(path, dtype=texts, keep_default_na=False, na_values=[""])


def documents(campaign, pattern: str) -> dict[str, dict]:
    """JSON artefacts below `results/` that have content, by the cell or group they are about."""
    found = {}
    for path in sorted((Path(campaign) / "results").glob(pattern)):
        document = json.loads(path.read_text(encoding="utf-8"))
        if document["provenance"]["reason"] is None:
            found[path.parent.name if path.stem == "verdict" else path.stem] = document
    return found


def curves(campaign, stage: str) -> dict[tuple, pd.DataFrame]:
    """Parquet artefacts of a stage that have rows, by (cell, test)."""
    paths = sorted((Path(campaign) / "results" / stage).glob("*/*.parquet"))
    read = {(path.parent.name, path.stem): pd.read_parquet(path) for path in paths}
    return {key: rows for key, rows in read.items() if len(rows)}


def tests(campaign) -> pd.DataFrame:
    """The sheet of tests, with cell, test, cycle and temperature."""
    path = Path(campaign) / "config" / "tests.tsv"
    texts = {"cell": str, "test": str}
    sheet = pd.read_csv(path, sep="\t", dtype=texts, keep_default_na=False, na_values=[""])
    return sheet if "cycle" in sheet else sheet.assign(cycle=float("nan"))
