"""All numbers of finished campaigns as one table: what, where, how much, which side is better."""

from pathlib import Path

import numpy as np
import pandas as pd

from real_cells import cells, models, run, search
from real_cells.quantities import MODEL, QUANTITIES, SEARCH

KEYS = ["campaign", "cell", "quantity", "where"]
COLUMNS = [*KEYS, "value", "unit", "better", "tolerance_absolute", "tolerance_relative"]
COLUMNS += ["published", "published_source"]
MOST_CELLS = 8  # of a campaign with more, models and verdicts are told over all cells together
TELLERS = (
    *(cells.capacities, cells.open_circuit_voltages, cells.resistances, cells.spectra),
    *(models.resistances_in_groups, models.validations, models.filters),
    *(models.capacities_of_filters, models.packs),
    *(search.verdicts, search.answers),
    *(run.left_out, run.broken_laws, run.flags, run.seconds),
)


def numbers(campaign, *, name: str | None = None) -> pd.DataFrame:
    """Every measured number of one finished campaign, values as text with six digits.

    Parameters
    ----------
    campaign : folder with `results/` and `config/`.
    name : of the campaign (default: the folder's).
    """
    told = [row for teller in TELLERS for row in teller(campaign)]
    rows = pd.DataFrame(told, columns=["cell", "quantity", "where", "value"])
    rows = finished(together(rows), name or Path(campaign).name)
    if "right verdicts" in set(rows["quantity"]):  # then right is what counts, not the words
        rows.loc[rows["quantity"].isin(["verdict", "named effects"]), "better"] = "shown"
    return rows


def campaigns(folder) -> list[Path]:
    """The finished campaigns in a folder: those whose results were held against physics."""
    return [path.parents[2] for path in sorted(Path(folder).glob("*/results/tables/checks.csv"))]


def finished(rows: pd.DataFrame, name: str) -> pd.DataFrame:
    """Rows (cell, quantity, where, value) with what is to be known of each; unknown ones left out.

    A column `unit` goes before the unit of the quantity.
    """
    rows = rows[rows["value"].map(lambda value: isinstance(value, str) or np.isfinite(value))]
    rows = rows.assign(campaign=name, value=rows["value"].map(text))
    return _described(rows.assign(published="", published_source=""))


def _described(rows):
    """The rows with unit, side and tolerance of their quantity; a unit of their own stays."""
    about = [QUANTITIES[quantity] for quantity in rows["quantity"]]
    return rows.assign(
        unit=rows["unit"] if "unit" in rows else [one.unit for one in about],
        better=[one.better for one in about],
        tolerance_absolute=[text(one.absolute) for one in about],
        tolerance_relative=[text(one.relative) for one in about],
    )[COLUMNS]


def with_published(rows: pd.DataFrame, published: pd.DataFrame) -> pd.DataFrame:
    """The same numbers, each beside the published one of its campaign, cell, quantity and place.

    A published number of these campaigns that the results do not have stands with a blank value.
    """
    known = published[published["campaign"].isin(rows["campaign"])]
    known = known.rename(columns={"value": "published", "source": "published_source"})
    both = rows.drop(columns=["published", "published_source"]).merge(known, on=KEYS, how="left")
    keys = pd.MultiIndex.from_frame(rows[KEYS])
    blank = _described(known[~pd.MultiIndex.from_frame(known[KEYS]).isin(keys)].assign(value=""))
    return pd.concat([both, blank], ignore_index=True).fillna("")[COLUMNS]


def text(value) -> str:
    """A number with six digits, a word as it is."""
    return value if isinstance(value, str) else f"{float(value):.6g}"


def together(rows: pd.DataFrame) -> pd.DataFrame:
    """The same rows; of many cells, models and verdicts as median and worst over the cells."""
    if rows["cell"].nunique() <= MOST_CELLS:
        return rows
    about = rows["quantity"].map(QUANTITIES)
    many = pd.Series([one.topic in (MODEL, SEARCH) for one in about], rows.index)
    many &= rows["cell"] != "all"
    told = list(_over_cells(rows[many]))
    return pd.concat([rows[~many], pd.DataFrame(told, columns=rows.columns)], ignore_index=True)


def _over_cells(rows):
    """Median and worst of each number over the cells; how many cells have which word."""
    for (quantity, place), group in rows.groupby(["quantity", "where"], sort=False):
        about = QUANTITIES[quantity]
        if about.unit == "word":
            counts = group["value"].value_counts().sort_index()
            words = "; ".join(f"{word}: {count}" for word, count in counts.items())
            yield "all", quantity, place, words
            continue
        values = group["value"].astype(float)
        cells_told = f"{len(values)} cells"
        yield f"median of {cells_told}", quantity, place, values.median()
        worst = values.min() if about.better == "higher" else values.max()
        yield f"worst of {cells_told}", quantity, place, worst
