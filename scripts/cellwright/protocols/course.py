"""The tests of one cell in the order of time: how each of them left the cell for the next one."""

from typing import NamedTuple

import numpy as np

from cellwright.protocols.half_cycles import NEAR_VOLT, TURN_SHARE, columns_of, half_cycles
from cellwright.records import inputs
from cellwright.records.anchor import in_its_half
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.series.steps import assumed_rating

STATES = {1: "full", -1: "empty"}  # in which a charge (+1) and a discharge (-1) end


class _TestEnds(NamedTuple):
    """Begin and end of a test by the dates in its record, and how it left the cell.

    test : name. begin_second, end_second : since 1970, NaN where the record has no dates [s].
    begin_volt, end_volt : first and last voltage [V]. state_at_end : "full", "empty" or "".
    """

    test: str
    begin_second: float
    end_second: float
    begin_volt: float
    end_volt: float
    state_at_end: str


# ASSUME: Between two tests of a cell, by their dates, nothing was done to it that is not in a file.
def course(tests, cell):
    """The tests of one cell in time: which came before each, and whether it left the cell full.

    What anchors the SoC of a test that starts at rest. Nothing is known where a test has no dates,
    overlaps another one, follows more than 30 days after, or where its first voltage contradicts: a
    cell that was left full rests above the middle of its window and no higher than it was left; an
    empty one below, and no lower.

    tests : (test, series, result of `segment`) each.

    Returns rows: columns, one entry a test: test; test_before, the last one that ended before it
    began, "" where none is known; hour_between, since then [h]; state_at_begin, "full", "empty" or
    "" where not known; words, why. Raises Refusal: a cut-off is not stated, so that no end of a
    test can be told. Source: docs/capacity.md.
    """
    limits, rated = tuple(inputs.cutoffs(cell).values()), inputs.rating(cell)
    if None in limits:
        raise Refusal("a cut-off is not stated, so whether a test ends full or empty is not known")
    ends = []
    for test, series, steps in tests:
        series = inputs.columns(series, *inputs.COUNTED)
        ends.append(_ends_of_test(inputs.test_facts(test).test, series, steps, limits, rated))
    rows = [(one.test, *_before(one, ends, limits)) for one in ends]
    names = ("test", "test_before", "hour_between", "state_at_begin", "words")
    return Result({"rows": {name: [row[k] for row in rows] for k, name in enumerate(names)}})


def _ends_of_test(test, series, steps, limits, rated):
    """When a test begins and ends, and whether it leaves the cell full or empty.

    It leaves it full where its last half cycle is a charge that reaches the upper cut-off within
    10 mV, and no more than 1 % of the rating flows after it; empty likewise.
    """
    columns = columns_of(series)
    dates = series.get("unix_time_second", np.full(1, np.nan))
    rated = rated or assumed_rating(columns[0], columns[2])
    halves = half_cycles(columns, inputs.steps(steps), limits, least_ampere_hour=TURN_SHARE * rated)
    state = ""
    if halves and halves[-1].reached:
        # What may flow after the cut-off for the cell to be left full, or empty.
        after = abs(columns[2][-1] - columns[2][halves[-1].turn_row])
        state = STATES[halves[-1].sign] if after <= 0.01 * rated else ""
    volts = float(columns[1][0]), float(columns[1][-1])
    return _TestEnds(test, float(dates[0]), float(dates[-1]), *volts, state)


def _before(one, ends, limits):
    """Test before, hours since, state at the begin and words, for one test."""
    unknown = ("", np.nan, "")
    if np.isnan(one.begin_second):
        return *unknown, "its record has no dates, so what came before it is not known"
    others = [other for other in ends if other is not one and other.begin_second <= one.end_second]
    # Dates of two files may disagree by a minute: their clocks, and their resolution.
    earlier = [o for o in others if o.end_second <= one.begin_second + 60.0]
    if len(earlier) < len(others):
        return *unknown, "by their dates another test runs at the same time"
    if not earlier:
        return *unknown, "no test before it has dates"
    last = max(earlier, key=lambda other: other.end_second)
    hour = max(one.begin_second - last.end_second, 0.0) / 3600
    found = (last.test, float(hour))
    if not last.state_at_end:
        return *found, "", f"{last.test} before it does not end at a cut-off"
    # Longer than a month, self-discharge and calendar ageing have moved the cell.
    if hour > 720.0:
        return *found, "", f"{last.test} before it ended {hour / 24:.0f} days earlier"
    sign = 1 if last.state_at_end == "full" else -1
    fits = in_its_half(one.begin_volt, limits, full=sign > 0)
    if not fits or sign * (one.begin_volt - last.end_volt) > NEAR_VOLT:
        words = f"{last.test} before it ended {last.state_at_end} at {last.end_volt:.3f} V, "
        return *found, "", f"{words}but it begins at {one.begin_volt:.3f} V"
    words = f"{last.test} ended {last.state_at_end} {hour:.1f} h before it"
    return *found, last.state_at_end, f"starts {last.state_at_end}: {words}"
