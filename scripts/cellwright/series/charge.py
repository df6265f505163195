"""Net charge of a cell since the first row of its record."""

import numpy as np


def net_charge(
    test_time_second: np.ndarray,
    current_ampere: np.ndarray,
    *,
    gap_rows: np.ndarray | None = None,
    counter_ampere_hour: np.ndarray | None = None,
) -> np.ndarray:
    """Net charge put into the cell since the first row.

    1. Trapezoids of the true time stamps.
    2. Where the current steps within an interval the trapezoid guesses when. The instrument's
       counter knows: it serves where that guess is worse than twenty of its digits, and where what
       it counted lies between what either current would have moved.
    3. Across a gap: the counter; without one, a current that is the same on both sides, else none.

    Parameters
    ----------
    test_time_second, current_ampere : arrays [s], [A]
    gap_rows : array of int
        Rows with a gap in the record before them.
    counter_ampere_hour : array [Ah]
        The instrument's own signed counter; may have rows without a number (NaN).

    Returns
    -------
    array [Ah], 0 in the first row
    """
    interval = np.diff(test_time_second) / 3600
    before, after = current_ampere[:-1] * interval, current_ampere[1:] * interval
    moved = 0.5 * (before + after)
    counted = np.full(moved.size, np.nan)
    if counter_ampere_hour is not None:
        counted = np.diff(counter_ampere_hour)
    better = _knows_better(before, after, counted)
    moved[better] = counted[better]
    if gap_rows is not None and gap_rows.size:
        moved[gap_rows - 1] = _across_gaps(before, after, counted, gap_rows - 1)
    return np.concatenate([[0.0], np.cumsum(moved)])


def _knows_better(before: np.ndarray, after: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """Intervals in which the counter is surer than the trapezoid, and can be right."""
    if not np.any(counted[np.isfinite(counted)]):
        return np.zeros(counted.size, dtype=bool)
    digit = _digit(counted[np.isfinite(counted)])
    unsure = 0.5 * np.abs(after - before) > 20 * digit
    slack = digit + 0.02 * np.maximum(np.abs(before), np.abs(after))
    low, high = np.minimum(before, after) - slack, np.maximum(before, after) + slack
    return unsure & (counted >= low) & (counted <= high)


def _digit(steps: np.ndarray) -> float:
    """The last digit that a counter shows, from 1 to 1e-9, by its steps."""
    digits = 10.0 ** -np.arange(10)
    shown = (d for d in digits if np.all(np.abs(steps / d - np.rint(steps / d)) < 1e-3))
    return next(shown, digits[-1])


def _across_gaps(
    before: np.ndarray, after: np.ndarray, counted: np.ndarray, gaps: np.ndarray
) -> np.ndarray:
    """Charge [Ah] over each gap (a number of an interval)."""
    # ASSUME: In a gap of a record without a counter, a current that is the same on both sides
    # flowed all the time, and otherwise none did.
    same = np.abs(after[gaps] - before[gaps]) <= 0.1 * np.abs(after[gaps])
    guess = np.where(same, 0.5 * (before + after)[gaps], 0.0)
    return np.where(np.isfinite(counted[gaps]), counted[gaps], guess)
