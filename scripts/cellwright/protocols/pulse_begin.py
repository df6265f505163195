"""When a pulse began, as far as its rows and those of the rest before it tell."""

from typing import NamedTuple

import numpy as np

from cellwright.protocols.messages import say

# Of the rows' own intervals: rows of one pace may miss a beat of it; of fewer rows none is known.
LATE_SHARE, LEAST_REST_ROWS = 1.5, 5
LEAST_PULSES, FAR_LATER = 3, 10.0  # that show how one instrument logs the edge of a pulse
DECADE = 10.0  # of time, over which a polarisation grows with its logarithm


class Begin(NamedTuple):
    """What is known of the begin of a pulse.

    from_rest : whether it begins from rest. interval_second : between the last row before it and
    its first one [s]. unsure_ohm : standard deviation of the ratio of its
    first sample by when it began [ohm]. lacking : in words, that rows are missing before it, or "".
    """

    from_rest: bool
    interval_second: float
    unsure_ohm: float
    lacking: str


def begin_of(rest_second, first_second, pace_second, delay_second, ratio_ohm):
    """Begin of a pulse.

    Parameters
    ----------
    rest_second : (m,) times of the rows of the rest before it [s]; empty where a load is.
    first_second : time of its first row [s]. pace_second : between its rows [s].
    delay_second, ratio_ohm : (n,) of its samples [s], [ohm].
    """
    if not len(rest_second) or not np.isfinite(pace_second):
        return Begin(len(rest_second) > 0, np.nan, 0.0, "")
    interval = float(first_second - rest_second[-1])
    if len(rest_second) >= LEAST_REST_ROWS:
        return Begin(True, interval, 0.0, _lacking(np.diff(rest_second), interval, pace_second))
    unsure = _unsure_of_start(delay_second, ratio_ohm, interval, pace_second)
    return Begin(True, interval, unsure, "")


def late_among_others(intervals_second):
    """Of each pulse of a record, in words, that it begins far later than the others do; or "".

    intervals_second : (n,) of `Begin` [s]. One instrument logs the edges of one record alike.
    """
    intervals = np.array(intervals_second)
    known = intervals[np.isfinite(intervals)]
    usual = float(np.median(known)) if len(known) >= LEAST_PULSES else np.inf
    return [
        say("resistance.later_than_others", second=interval, usual=usual)
        if interval > FAR_LATER * usual
        else ""
        for interval in intervals
    ]


def _lacking(rest_intervals, interval, pace):
    """In words, that a pulse begins later than rows lie apart, at rest or in it; or "".

    A logger that waits for a change may leave its longest interval at the end of the rest.
    """
    longest = max(pace, float(np.max(rest_intervals[-LEAST_REST_ROWS:])))
    said = say("resistance.rows_missing", second=interval, longest=longest)
    return said if interval > LATE_SHARE * longest else ""


def _unsure_of_start(delay, ratio, interval, pace):
    """Standard deviation [ohm] of a first ratio whose pulse began anywhere in an interval [s].

    In it the ratio grew as it goes on to grow, with the logarithm of time.
    """
    more = max(interval - pace, 0.0)
    near = np.isfinite(ratio) & (delay + more <= DECADE * (delay[0] + more))
    if not more or np.sum(near) < 2:
        return 0.0
    slope = np.polyfit(np.log(delay[near] + more), ratio[near], 1)[0]
    return float(max(slope, 0.0) * np.log(interval / pace) / np.sqrt(3.0))
