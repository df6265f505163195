"""Results compared with the truth: which rows belong together, and the error of each pair."""

from typing import NamedTuple

import numpy as np
import pandas as pd


class Pairs(NamedTuple):
    """Row numbers: `found[i]` belongs to `true[i]`; the rest has no partner."""

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
    group_found, group_true = _groups(found, true, keys)
    if near is None:
        place_found, place_true = _order(group_found), _order(group_true)
    else:
        place_found, place_true = (table[near].to_numpy(float) for table in (found, true))
    partner = _nearest(group_true, place_true, group_found, place_found, tolerance)
    back = _nearest(group_found, place_found, group_true, place_true, tolerance)
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
    groups = _groups(found, true, keys)
    places = [np.log(table[near].where(table[near] > 0).to_numpy(float)) for table in (found, true)]
    partner = _nearest(groups[0], places[0], groups[1], places[1], tolerance)
    values = np.append(true[near].to_numpy(float), np.nan)[partner]
    return found[near].where(partner < 0, values)


def _groups(found, true, keys):
    """A number for each combination of keys, the same in both tables."""
    keys = list(keys)
    both = pd.concat([found[keys], true[keys]], ignore_index=True)
    if not len(both):
        return np.zeros(0, int), np.zeros(0, int)
    numbers = both.groupby(keys, dropna=False, sort=False).ngroup().to_numpy()
    return numbers[: len(found)], numbers[len(found) :]


def _order(group):
    return pd.Series(group).groupby(group).cumcount().to_numpy(float)


def _nearest(group, place, other_group, other_place, tolerance):
    """For each row the nearest row of the other table in the same group; −1 where none is near.

    Groups are laid one behind the other on one line, further apart than the tolerance reaches.
    """
    known = np.flatnonzero(np.isfinite(other_place))
    if not len(known) or not len(group):
        return np.full(len(group), -1)
    values = np.concatenate([place[np.isfinite(place)], other_place[known]])
    low, span = values.min(), np.ptp(values) + 2 * tolerance + 1
    here = group * span + (place - low)
    there = other_group[known] * span + (other_place[known] - low)
    order = np.argsort(there, kind="stable")
    behind = np.clip(np.searchsorted(there[order], here), 0, len(order) - 1)
    before = np.clip(behind - 1, 0, len(order) - 1)
    gap = np.abs(there[order][np.stack([before, behind])] - here)
    best = np.where(gap[0] <= gap[1], before, behind)
    near = np.min(gap, axis=0) <= tolerance + 1e-9 * span * (group.max() + 1)
    return np.where(near & np.isfinite(place), known[order[best]], -1)


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
