"""Which row of the results belongs to which row of the truth."""

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
