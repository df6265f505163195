"""Rows of errors: what was found beside what is true, one row a comparison."""

import numpy as np
import pandas as pd

from virtual_lab.score.matching import pair

NORMAL_95 = 1.959964
COLUMNS = [
    *("table", "quantity", "unit", "cell", "test", "at", "status"),
    *("found", "true", "error", "std", "inside_95", "reason"),
]


def nothing() -> pd.DataFrame:
    """No comparison at all."""
    return pd.DataFrame({name: pd.Series(dtype=object) for name in COLUMNS})


def gathered(parts) -> pd.DataFrame:
    """One table of comparisons from several."""
    parts = [part for part in parts if len(part)]
    return pd.concat(parts, ignore_index=True) if parts else nothing()


def errors(table, quantity, unit, rows) -> pd.DataFrame:
    """Comparisons of one quantity.

    Parameters
    ----------
    table, quantity, unit : what is compared.
    rows : table with columns cell, test, at (where in the test, text), found, true; a blank `found`
        is missing, a blank `true` is extra, where both are blank there is nothing to compare.
        Optional: std (of found), reach (half width of the 95 % interval over std), reason, and
        word: the status of a row that cannot be compared, where it is neither missing nor extra;
        paired: whether a row has a partner at all, so that a blank `true` means "no truth".
    """
    # ASSUME: A stated deviation without a number of repeats is that of a normal distribution.
    rows = rows.reset_index(drop=True)
    numbers = {name: pd.to_numeric(rows[name], errors="coerce") for name in ("found", "true")}
    std = pd.to_numeric(rows["std"], errors="coerce") if "std" in rows else np.nan
    reach = rows["reach"].fillna(NORMAL_95) if "reach" in rows else NORMAL_95
    made = pd.DataFrame(
        {
            "table": table,
            "quantity": quantity,
            "unit": unit,
            **{name: rows[name] for name in ("cell", "test", "at")},
            "status": _status(**numbers),
            **numbers,
            "error": numbers["found"] - numbers["true"],
            "std": std,
            "reason": rows.get("reason"),
        }
    )
    if "paired" in rows:
        untold = (made["status"] == "extra") & rows["paired"].astype(bool)
        made["status"] = made["status"].mask(untold, "no truth")
    if "word" in rows:
        lonely = made["status"].isin(["missing", "extra"]) & rows["word"].notna()
        made["status"] = made["status"].mask(lonely, rows["word"])
    made["std"] = made["std"].astype(float).where(lambda value: value > 0)
    inside = (np.abs(made["error"]) <= reach * made["std"]).astype(object)
    made["inside_95"] = inside.where(made["std"].notna() & made["error"].notna(), None)
    return made[made["status"] != ""][COLUMNS]


def _status(found, true):
    known = [found.notna() & true.notna(), found.isna() & true.notna(), found.notna()]
    return np.select(known, ["compared", "missing", "extra"], default="")


def side_by_side(found, true, *, keys, columns, near=None, tolerance=0.0) -> pd.DataFrame:
    """Rows of two tables beside each other, partners in one row.

    Parameters
    ----------
    found, true : tables with the columns `keys` and `near`.
    columns : names that are wanted of `found`; they come as `<name>_found`.
    keys, near, tolerance : as of `matching.pair`.

    Column `paired` says which rows have a partner.
    """
    pairs = pair(found, true, keys=keys, near=near, tolerance=tolerance)
    wanted = [name for name in columns if name in found]
    beside = found[wanted].add_suffix("_found")
    names = [*keys, *([near] if near and near not in keys else [])]
    both = _zipped(true.iloc[pairs.true], beside.iloc[pairs.found]).assign(paired=True)
    missing = true.iloc[pairs.missing].assign(paired=False)
    extra = _zipped(found[names].iloc[pairs.extra], beside.iloc[pairs.extra]).assign(paired=False)
    parts = [part for part in (both, missing, extra) if len(part)]
    together = pd.concat(parts, ignore_index=True) if parts else both
    return together.reindex(columns=[*true.columns, *beside.columns, "paired"])


def _zipped(left, right):
    return pd.concat([left.reset_index(drop=True), right.reset_index(drop=True)], axis=1)
