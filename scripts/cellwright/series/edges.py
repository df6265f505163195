"""When the current stepped between two rows: what the rows' own pace tells, and what it does not.

A tester begins to count its sampling interval anew with each step, and stores a row where a step
ends. The first row of a step then lies one interval of that step after its beginning.
"""

import numpy as np

from cellwright.formats.pieces import largest, rows_where, step_at

STEP_SHARE = 0.05  # of a record's largest current: a change that is a step
STEADY_SHARE = 0.1  # of the step, by which the current may move beside it: else it is no edge
# Two intervals of one sampling differ by the clock's digits; what differs by more is another pace,
# and what lies between the two is neither.
SAME_PACE, OTHER_PACE = 0.01, 0.05
PACE_ROWS = 3  # intervals before an edge, whose median is the pace there: rows may be missing
HABIT_EDGES, HABIT_SHARE = 3, 0.9  # so many edges, and of all that can tell, show a tester's habit
CHANCE_SHARE = 0.5  # of all that can tell, below which those that do are equal by chance
GUESSED = 0.05  # of an interval: nearer to its middle a counted charge says nothing of the edge


def step_rows(time, current):
    """Rows after each step of the current between two rows of different time (k,).

    Parameters
    ----------
    time, current : (n,) [s], [A].
    """
    least = STEP_SHARE * largest(current)

    def stepped(time, current):
        return (np.abs(np.diff(current)) > least) & (np.diff(time) > 0)

    return rows_where(stepped, time, current, beside=1) + 1


# ASSUME: If the sampling interval across a current step is as long as those after the step and not
# as those before, the new current flowed for all of it; likewise at every step of such a record.
def begun_at_last_row(time, current, rows):
    """Whether the current stepped at the row before each of these rows, as the pace tells (k,).

    1. The interval to the row is as long as the one after it, while rows before it followed at
    another pace, or the last of them came early, as a step's end does. 2. Of a record in which nine
    tenths of the edges that can tell do so, and three at least, it holds at those of one pace too.

    Parameters
    ----------
    time, current : (n,) [s], [A]. rows : (k,) from `step_rows`.
    """
    begun = np.zeros(len(rows), bool)
    inside = rows < len(time) - 1
    row = rows[inside]
    across, after = step_at(time, row - 1), step_at(time, row)
    bar, earlier = STEADY_SHARE * np.abs(step_at(current, row - 1)), np.maximum(row - 2, 0)
    steady = np.abs(step_at(current, row)) <= bar
    steady &= (row < 2) | (np.abs(step_at(current, earlier)) <= bar)
    as_after = steady & (np.abs(across - after) <= SAME_PACE * after)
    # What the record holds before its first rows is no pace.
    known = row > PACE_ROWS
    before = [step_at(time, np.maximum(row - 2 - k, 0)) for k in range(PACE_ROWS)]
    changed = np.abs(np.median(before, axis=0) - after) > OTHER_PACE * after
    early = before[0] < (1.0 - OTHER_PACE) * across
    tells = steady & known & (changed | early)
    # A row stored just after the edge leaves nothing to tell.
    asked = np.count_nonzero(tells & (across > OTHER_PACE * after))
    told = np.count_nonzero(tells & as_after)
    if told >= CHANCE_SHARE * asked:
        habit = told >= max(HABIT_EDGES, HABIT_SHARE * asked)
        begun[inside] = as_after & (tells | habit)
    return begun


def shares_before(time, current, charge, rows):
    """Share of the interval before each row that lies before the step of the current, (k,) [1].

    By the charge counted in it; NaN where that is of the mean of both currents, or beyond both: it
    then says nothing of the edge.

    Parameters
    ----------
    time, current, charge : (n,) [s], [A], net charge [Ah]. rows : (k,) from `step_rows`.
    """
    mean = 3600.0 * (charge[rows] - charge[rows - 1]) / (time[rows] - time[rows - 1])
    share = (mean - current[rows]) / (current[rows - 1] - current[rows])
    return np.where(np.abs(share - 0.5) > GUESSED, np.clip(share, 0.0, 1.0), np.nan)


def edge_variance(time, current, charge):
    """Variance of the charge that each interval (n − 1,) may hold, its step being anywhere [Ah²].

    Zero where nothing steps or where the counted charge tells when: of a step of ΔI within Δt that
    may lie anywhere the charge is known to ΔI·Δt/√12. Of a load that rested meanwhile, which
    counts nothing, the end and the beginning lie anywhere within a row's pace of the rows beside.

    Parameters
    ----------
    time, current, charge : (n,) [s], [A], net charge [Ah].
    """
    variance = np.zeros(max(len(time) - 1, 0))
    rows = step_rows(time, current)
    rows = rows[np.isnan(shares_before(time, current, charge, rows))]
    held = (current[rows] - current[rows - 1]) * (time[rows] - time[rows - 1]) / 3600.0
    variance[rows - 1] = held**2 / 12.0
    return variance + _stop_variance(np.diff(time), current, np.diff(charge))


def _stop_variance(interval, current, counted):
    """Variance (n − 1,) where a load rested between two rows and nothing was counted [Ah²].

    It ended within a row's pace after the row before, and began again within one before the next:
    a uniform distribution from nothing on, for the charge counted is the least that can be.
    """
    variance = np.zeros(len(interval))
    rows = np.flatnonzero((counted == 0) & (current[1:] * current[:-1] > 0))
    before = interval[np.maximum(rows - 1, 0)]
    after = interval[np.minimum(rows + 1, len(interval) - 1)]
    held = np.array([before * current[rows], after * current[rows + 1]]) / 3600.0
    # Within the pace of its neighbours a counter of few digits has not moved yet.
    variance[rows] = np.where(interval[rows] > before + after, np.sum(held**2, axis=0) / 3.0, 0.0)
    return variance
