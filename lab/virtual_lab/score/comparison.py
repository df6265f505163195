"""Results compared with the truth: which rows belong together, and the error of each pair."""

from typing import NamedTuple

import numpy as np
import pandas as pd


class Pairs(NamedTuple):
    """Row numbers: `found[i]` belongs to `true[i]`; `extra` and `missing` have no partner."""

    found: np.ndarray
    true: np.ndarray
    extra: np.ndarray
    missing: np.ndarray


def pair(found: pd.DataFrame, true: pd.DataFrame, *, keys, near=None, tolerance=0.0) -> Pairs:
    """Pair rows with equal keys; each row at most once.

    Parameters
    ----------
    found, true : tables with the columns `keys` and, where given, `near`.
    keys : columns that must be equal; blank equals blank.
    near : column of numbers: of several rows with equal keys those are paired that are each
        other's nearest, and no further apart than `tolerance`. None: the k-th goes with the k-th.
    """
    keys_found, keys_true = _key_numbers(found, true, keys)
    if near is None:
        place_found, place_true = (
            pd.Series(group).groupby(group).cumcount().to_numpy(float)
            for group in (keys_found, keys_true)
        )
    else:
        place_found, place_true = (table[near].to_numpy(float) for table in (found, true))
    partner = _nearest(keys_true, place_true, keys_found, place_found, tolerance)
    back = _nearest(keys_found, place_found, keys_true, place_true, tolerance)
    mutual = np.flatnonzero(partner >= 0)
    mutual = mutual[back[partner[mutual]] == mutual]
    return Pairs(
        found=partner[mutual],
        true=mutual,
        extra=np.setdiff1d(np.arange(len(found)), partner[mutual]),
        missing=np.setdiff1d(np.arange(len(true)), mutual),
    )


def snapped(found: pd.DataFrame, true: pd.DataFrame, *, keys, near, tolerance) -> pd.Series:
    """Values of the column `near` of the results, each replaced by the truth's nearest.

    Parameters
    ----------
    found, true : tables with the columns `keys` and `near`.
    keys : columns that must be equal.
    near, tolerance : the column, and how far its logarithm may differ; beyond, the value stays.
    """
    key_numbers = _key_numbers(found, true, keys)
    places = [np.log(table[near].where(table[near] > 0).to_numpy(float)) for table in (found, true)]
    partner = _nearest(key_numbers[0], places[0], key_numbers[1], places[1], tolerance)
    values = np.append(true[near].to_numpy(float), np.nan)[partner]
    return found[near].where(partner < 0, values)


def _key_numbers(found, true, keys):
    """A number for each combination of keys, the same in both tables."""
    keys = list(keys)
    both = pd.concat([found[keys], true[keys]], ignore_index=True)
    if not len(both):
        return np.zeros(0, int), np.zeros(0, int)
    numbers = both.groupby(keys, dropna=False, sort=False).ngroup().to_numpy()
    return numbers[: len(found)], numbers[len(found) :]


def _nearest(key, place, other_key, other_place, tolerance):
    """For each row the nearest row of the other table with the same key; −1 where none is near.

    The rows of all keys lie on one line, those of different keys further apart than the tolerance.
    """
    numbered = np.flatnonzero(np.isfinite(other_place))
    if not len(numbered) or not len(key):
        return np.full(len(key), -1)
    values = np.concatenate([place[np.isfinite(place)], other_place[numbered]])
    low, span = values.min(), np.ptp(values) + 2 * tolerance + 1
    here = key * span + (place - low)
    there = other_key[numbered] * span + (other_place[numbered] - low)
    order = np.argsort(there, kind="stable")
    behind = np.clip(np.searchsorted(there[order], here), 0, len(order) - 1)
    before = np.clip(behind - 1, 0, len(order) - 1)
    gap = np.abs(there[order][np.stack([before, behind])] - here)
    best = np.where(gap[0] <= gap[1], before, behind)
    near = np.min(gap, axis=0) <= tolerance + 1e-9 * span * (key.max() + 1)
    return np.where(near & np.isfinite(place), numbered[order[best]], -1)


NORMAL_95 = 1.959964
COLUMNS = [
    *("table", "quantity", "unit", "cell", "test", "at", "status"),
    *("found", "true", "error", "std", "inside_95", "reason"),
]


def nothing() -> pd.DataFrame:
    """An empty table of comparisons."""
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
        Optional: std (of found), reason, and word: the status of a row that cannot be compared,
        where it is neither missing nor extra; paired: whether a row has a partner at all, so that a
        blank `true` means "no truth".
    """
    # ASSUME: A stated deviation is that of a normal distribution, of a mean of repeats too: what an
    # ammeter errs by is common to them all.
    rows = rows.reset_index(drop=True)
    numbers = {name: pd.to_numeric(rows[name], errors="coerce") for name in ("found", "true")}
    std = pd.to_numeric(rows["std"], errors="coerce") if "std" in rows else np.nan
    is_found, is_true = numbers["found"].notna(), numbers["true"].notna()
    either = [is_found & is_true, ~is_found & is_true, is_found]
    comparisons = pd.DataFrame(
        {
            "table": table,
            "quantity": quantity,
            "unit": unit,
            **{name: rows[name] for name in ("cell", "test", "at")},
            "status": np.select(either, ["compared", "missing", "extra"], default=""),
            **numbers,
            "error": numbers["found"] - numbers["true"],
            "std": std,
            "reason": rows.get("reason"),
        }
    )
    if "paired" in rows:
        untold = (comparisons["status"] == "extra") & rows["paired"].astype(bool)
        comparisons["status"] = comparisons["status"].mask(untold, "no truth")
    if "word" in rows:
        lonely = comparisons["status"].isin(["missing", "extra"]) & rows["word"].notna()
        comparisons["status"] = comparisons["status"].mask(lonely, rows["word"])
    comparisons["std"] = comparisons["std"].astype(float).where(lambda value: value > 0)
    inside = (np.abs(comparisons["error"]) <= NORMAL_95 * comparisons["std"]).astype(object)
    comparisons["inside_95"] = inside.where(
        comparisons["std"].notna() & comparisons["error"].notna(), None
    )
    return comparisons[comparisons["status"] != ""][COLUMNS]


def side_by_side(found, true, *, keys, columns, near=None, tolerance=0.0) -> pd.DataFrame:
    """Rows of two tables beside each other, partners in one row.

    Parameters
    ----------
    found, true : tables with the columns `keys` and `near`.
    columns : names that are wanted of `found`; they come as `<name>_found`.
    keys, near, tolerance : as of `pair`.

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


def _zipped(first, second):
    return pd.concat([one.reset_index(drop=True) for one in (first, second)], axis=1)
