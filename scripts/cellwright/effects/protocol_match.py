"""Whether two cells went through the same protocol, and which time of one is which of the other.

Clocks of two cells drift apart where a voltage, not a clock, ended a step. Both are tied at the
edges of their long rests; between these, time runs in proportion.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects.records import LOADED_C_RATE
from cellwright.refusal import Refusal

NEXT_ROWS = np.arange(-1, 3)
STEP_C_RATE = 0.02  # between two rows, from which the current steps


class Sameness(NamedTuple):
    """How far two runs of one protocol may differ.

    rest_second : least length of a rest that ties two clocks. duration : relative difference of a
    stretch between two ties, beyond `slack_second`. c_rate : root mean square difference of the
    currents over `window_second` [1/h]. celsius : difference of the mean temperatures.
    covered : least share of a record's rows to which the other has a counterpart.
    """

    rest_second: float = 120.0
    duration: float = 0.08
    slack_second: float = 30.0
    c_rate: float = 0.1
    window_second: float = 600.0
    celsius: float = 2.0
    covered: float = 0.9


class Part(NamedTuple):
    """One record out of a stack: its rows, and what it says of them."""

    test: str
    rows: np.ndarray
    second: np.ndarray
    current_ampere: np.ndarray
    celsius: np.ndarray
    capacity_ampere_hour: float


def part(stack, test, kind, capacity_ampere_hour):
    """The record of a test out of a stack, or a Refusal where no such test is there."""
    if (test, kind) not in zip(stack.tests, stack.kinds, strict=True):
        raise Refusal(f"{test}: no such {kind} test in this role, found {', '.join(stack.tests)}")
    rows = np.flatnonzero(stack.file == stack.tests.index(test))
    taken = (stack.second[rows], stack.current_ampere[rows], stack.celsius[rows])
    return Part(test, rows, *taken, capacity_ampere_hour)


def counterpart_second(mine, other, limits=None):
    """Time on the other's clock of each row of mine, where both ran the same protocol.

    Parameters
    ----------
    mine, other : Part. limits : Sameness.

    Returns
    -------
    second : (n,) on the other's clock [s]; NaN after the end of the shorter of the two.

    Raises
    ------
    Refusal : other durations, currents or temperature; with test, row and difference.
    """
    limits = limits or Sameness()
    ties, others = _ties(mine, limits.rest_second), _ties(other, limits.rest_second)
    count = min(len(ties), len(others))
    _same_durations(mine, mine.second[ties[:count]], other.second[others[:count]], ties, limits)
    own, its = mine.second[ties[:count]], other.second[others[:count]]
    found = np.interp(mine.second, own, its)
    after = mine.second > own[-1]
    found[after] = mine.second[after] - own[-1] + its[-1]
    found[found > other.second[-1]] = np.nan
    _covers(mine, found, limits)
    known = np.flatnonzero(np.isfinite(found))
    row, apart = _nearest(mine, other, found, known)
    _same_currents(mine, known, apart, limits)
    _same_warmth(mine, other, limits)
    steps = _steps(other, found[known], mine.capacity_ampere_hour)
    found[known[steps]] = other.second[row[steps]]
    return found


def _ties(one, least_second):
    """First row, and the rows at which long rests begin and end."""
    rest = np.abs(one.current_ampere) <= LOADED_C_RATE * one.capacity_ampere_hour
    edges = np.flatnonzero(np.diff(np.r_[0, rest, 0])).reshape(-1, 2)
    last = len(one.second) - 1
    lasting = [e for e in edges if one.second[min(e[1], last)] - one.second[e[0]] >= least_second]
    inner = {int(row) for pair in lasting for row in pair if row <= last}
    return np.array(sorted({0} | inner))


def _same_durations(mine, own, its, ties, limits):
    long, other = np.diff(own), np.diff(its)
    allowed = np.maximum(limits.slack_second, limits.duration * long)
    wrong = np.flatnonzero(np.abs(other - long) > allowed)
    if len(wrong):
        k = wrong[0]
        raise Refusal(
            f"{mine.test}: after row {ties[k]} it goes on for {long[k]:.0f} s until a rest begins "
            f"or ends, the reference for {other[k]:.0f} s; wanted a difference of at most "
            f"{allowed[k]:.0f} s"
        )


def _covers(mine, found, limits):
    share = np.isfinite(found).mean()
    if share < limits.covered:
        row = int(np.flatnonzero(~np.isfinite(found))[0])
        raise Refusal(
            f"{mine.test}: the reference ends where this cell is in row {row}, after "
            f"{100 * share:.0f} % of the rows; wanted {100 * limits.covered:.0f} %"
        )


def _nearest(mine, other, found, known):
    """Row of the other nearest in current, among those next to the counterpart in time.

    Where the current steps, a clock that is off by a part of a row would pair load with rest.
    """
    spot = np.searchsorted(other.second, found[known], side="right") - 1
    beside = np.clip(spot[:, None] + NEXT_ROWS, 0, len(other.second) - 1)
    apart = np.abs(other.current_ampere[beside] - mine.current_ampere[known][:, None])
    return beside[np.arange(len(spot)), np.argmin(apart, axis=1)], apart.min(axis=1)


def _steps(other, second, capacity):
    """Whether the other's current steps within the rows next to a time: (n,) bool."""
    step = np.abs(np.diff(other.current_ampere, prepend=other.current_ampere[0]))
    near = np.convolve(step > STEP_C_RATE * capacity, np.ones(5), "same") > 0
    return near[np.clip(np.searchsorted(other.second, second), 0, len(near) - 1)]


def _same_currents(mine, known, apart, limits):
    window = (mine.second[known] // limits.window_second).astype(int)
    window -= window[0]
    count = np.maximum(np.bincount(window), 1)
    size = np.sqrt(np.bincount(window, apart**2) / count) / mine.capacity_ampere_hour
    worst = int(np.argmax(size))
    if size[worst] > limits.c_rate:
        row = int(known[np.argmax(window == worst)])
        raise Refusal(
            f"{mine.test}: from row {row} on the current differs from the reference's by "
            f"{size[worst]:.3f} C (root mean square over {limits.window_second:g} s); wanted at "
            f"most {limits.c_rate:g} C"
        )


def _same_warmth(mine, other, limits):
    own, its = float(np.mean(mine.celsius)), float(np.mean(other.celsius))
    if abs(own - its) > limits.celsius:
        raise Refusal(
            f"{mine.test}: from row 0 on at {own:.1f} degC in the mean, the reference at "
            f"{its:.1f} degC; wanted a difference of at most {limits.celsius:g} K"
        )
