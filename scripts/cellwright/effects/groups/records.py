"""Records of a parallel group, one after the other: total current, voltage, branch currents."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.statistics import rms
from cellwright.refusal import Refusal

MOST_BRANCHES = 64
ADDS_UP = 0.25  # of the total's size, by which the branch currents may miss it


class GroupStack(NamedTuple):
    """Rows of several records of one group, one record after the other.

    tests : names. first : (f,) index of first rows. file : (n,) number of the record of each row.
    second : (n,) time within the record [s]. step_second : (n,) since the row before, 0 in first
    rows [s]. fresh : (n,) 1.0 in first rows, else 0.0. hold : of the total between rows.
    branch_current_ampere : (n, branches) or None [A]. branches : how many.
    """

    tests: tuple
    first: np.ndarray
    file: np.ndarray
    second: np.ndarray
    step_second: np.ndarray
    fresh: np.ndarray
    current_ampere: np.ndarray
    voltage_volt: np.ndarray
    celsius: np.ndarray
    branch_current_ampere: np.ndarray | None
    branches: int
    hold: str


def group_stacked(records, *, branches, hold="zero_order"):
    """Lay the records of a group one after the other.

    Parameters
    ----------
    records : sequence of GroupRecord. branches : how many cells are in parallel.
    hold : "zero_order": between two rows the total of the earlier one flows; "first_order": it
        moves on a straight line.

    Returns
    -------
    stack : GroupStack. Where one record lacks branch currents, those of the others are not used.

    Raises
    ------
    Refusal : no record; fewer than two branches; a value that is not finite; a clock that runs
        back; another number of branch currents than branches; branch currents that do not add up
        to the total (a turned sign, another unit).
    """
    if not records:
        raise Refusal("no record to look for a missing effect of a group in")
    if not 2 <= branches <= MOST_BRANCHES:
        raise Refusal(f"a group of {branches} branches; 2 to {MOST_BRANCHES} were wanted")
    for record in records:
        _check(record, branches)
    sizes = [len(r.test_time_second) for r in records]
    fresh = np.zeros(sum(sizes))
    first = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    fresh[first] = 1.0
    second = _joined(records, "test_time_second")
    return GroupStack(
        tuple(r.test for r in records),
        first,
        np.repeat(np.arange(len(records)), sizes),
        second,
        np.diff(second, prepend=second[0]) * (1.0 - fresh),
        fresh,
        *(_joined(records, n) for n in ("current_ampere", "voltage_volt", "celsius")),
        _branch_currents(records),
        branches,
        hold,
    )


def _joined(records, name):
    return np.ascontiguousarray(np.concatenate([getattr(r, name) for r in records]), float)


def _branch_currents(records):
    logged = all(r.branch_current_ampere is not None for r in records)
    return _joined(records, "branch_current_ampere") if logged else None


def _check(record, branches):
    names = ["test_time_second", "current_ampere", "voltage_volt", "celsius"]
    if record.branch_current_ampere is not None:
        names.append("branch_current_ampere")
    for name in names:
        values = np.asarray(getattr(record, name), float)
        wrong = np.argwhere(~np.isfinite(values))
        if len(wrong):
            found = values[tuple(wrong[0])]
            raise Refusal(f"{record.test}: row {wrong[0][0]} of {name} is {found}, not a number")
    back = np.flatnonzero(np.diff(record.test_time_second) < 0)
    if len(back):
        raise Refusal(f"{record.test}: the clock runs back after row {back[0]}")
    if record.branch_current_ampere is not None:
        _check_sum(record, branches)


def _check_sum(record, branches):
    own = np.asarray(record.branch_current_ampere)
    if own.shape != (len(record.test_time_second), branches):
        raise Refusal(f"{record.test}: branch currents {own.shape} of {branches} branches")
    total = record.current_ampere
    miss, size = (rms(x) for x in (own.sum(axis=1) - total, total))
    if miss > ADDS_UP * size:
        raise Refusal(
            f"{record.test}: the branch currents miss the total by {miss:.3g} A (root mean square) "
            f"of {size:.3g} A: is a sign turned, a branch missing, or a unit another?"
        )
