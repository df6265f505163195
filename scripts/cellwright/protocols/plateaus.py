"""Rests of a record, and in them the stretches in which the temperature stands still."""

from typing import NamedTuple

import numpy as np

BIN_SECOND = 600.0


class Plateau(NamedTuple):
    """Rows first to last (inclusive) of one temperature [degC], and how many bins of 600 s."""

    first: int
    last: int
    celsius: float
    bins: int


def joined_rests(steps):
    """First and last row (inclusive) of each rest, rests without a step between them as one.

    Parameters
    ----------
    steps : `series.segments.Steps`.
    """
    found = []
    for kind, first, last in zip(steps.kind, steps.first_row, steps.last_row, strict=True):
        if kind != "rest":
            continue
        if found and found[-1][1] == first - 1:
            found[-1] = (found[-1][0], int(last))
        else:
            found.append((int(first), int(last)))
    return found


def plateaus_of(test_time_second, temperature_celsius, *, settled_kelvin_per_hour, least_second):
    """Stretches in which the temperature moves slower than a limit.

    Parameters
    ----------
    test_time_second, temperature_celsius : (n,) [s], [degC].
    settled_kelvin_per_hour : the limit, over 20 minutes [K/h].
    least_second : a shorter stretch does not count [s].

    Returns
    -------
    plateaus : list of Plateau, in order of time.
    """
    time = np.asarray(test_time_second, float)
    celsius = np.asarray(temperature_celsius, float)
    number = ((time - time[0]) // BIN_SECOND).astype(int)
    edges = np.append(np.flatnonzero(np.diff(number, prepend=-1)), len(time))
    if len(edges) < 3:
        return []
    means = np.add.reduceat(celsius, edges[:-1]) / np.diff(edges)
    middle = np.add.reduceat(time, edges[:-1]) / np.diff(edges) / 3600
    still = np.abs(np.gradient(means, middle)) < settled_kelvin_per_hour
    turns = np.flatnonzero(np.diff(still.astype(int), prepend=0, append=0))
    rows = [(edges[a], edges[b] - 1, b - a) for a, b in zip(turns[::2], turns[1::2], strict=True)]
    return [
        Plateau(int(a), int(b), float(np.mean(celsius[a : b + 1])), int(bins))
        for a, b, bins in rows
        if time[b] - time[a] >= least_second
    ]
