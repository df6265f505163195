"""Charge balance of a cycle: what stays in the cell, and what its two ends explain of that."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.relaxing import still_to_go_volt
from cellwright.protocols.half_cycles import unsure_of_edges, unsure_of_instrument
from cellwright.series.doubts import is_negative_electrode

LOST_SHARE = 0.01  # of a cycle's charge that side reactions keep: it went in and comes not back
FORMATION_SHARE = 0.5  # which formation may keep: silicon and hard carbon keep so much
ENDS_VOLT = 0.003  # by which one cell rests elsewhere at one state: digits, some kelvin, hysteresis
SIGMAS = 2.0
SLOW_HOUR = 10.0  # of a full charge: in more no overpotential ends it far below full


class Balance(NamedTuple):
    """Charge balance of a cycle, in Ah, positive where more was charged than discharged.

    left_ampere_hour : counted from its begin to its end. least_ampere_hour, most_ampere_hour : what
    ends, side reactions and the instrument explain. ends_ampere_hour : standard deviation of what
    the ends leave open.
    """

    left_ampere_hour: float
    least_ampere_hour: float
    most_ampere_hour: float
    ends_ampere_hour: float

    @property
    def off_ampere_hour(self):
        """What nothing explains [Ah], 0 where all is explained."""
        explained = np.clip(self.left_ampere_hour, self.least_ampere_hour, self.most_ampere_hour)
        return abs(float(self.left_ampere_hour - explained))


# ASSUME: Near full and near empty a volt of open-circuit voltage is at most twice the charge that
# it is on the mean over the cell's window.
def balance_of(half, partner, columns, time, steps, limits, *, unsure_ampere_hour, inserts):
    """Balance of the cycle that two half cycles make, from the begin of one to the other's turn.

    The first begins and the second ends at a rest. Between two voltages of rest lies no charge to
    twice the cell's mean slope, of the sign that they have: a cell that was charged in the cold
    rests lower and gave back more. By as much as a rest would relax further it may be off. A load
    that the record begins with hides a rest up to the cut-off behind it; a record that ends with a
    load hides one as far on either side. A charge that ends at its cut-off by its overpotential,
    without a hold, and rests lower, may end far below full: on a plateau no rest says how far.
    Side reactions keep up to 1 % of what a cycle inserts, of the first insertion of a negative
    electrode half.

    Parameters
    ----------
    half, partner : HalfCycle, one of them a charge. columns, steps, limits : as of `half_cycles`.
    time : (n,) [s]. unsure_ampere_hour : standard deviation of the counted charge by instrument and
        edges [Ah]. inserts : sign of what a cycle begins with, see `inserting_sign`.

    Returns balance : Balance.
    """
    first, second = sorted((half, partner), key=lambda one: one.first_row)
    charge = columns[2]
    lowest, highest, unsure = _apart(first, second, columns[1], time, steps, limits)
    larger = max(first.moved_ampere_hour, second.moved_ampere_hour)
    slope = 2.0 * larger / (limits[1] - limits[0])
    slack = slope * unsure + SIGMAS * unsure_ampere_hour
    forms = inserts < 0 and first.sign == inserts and not _any_load_before(first, steps)
    lost = inserts * larger * (FORMATION_SHARE if forms else LOST_SHARE)
    rest = second.loads[-1] + 1
    rested = rest < len(steps.kind) and steps.kind[rest] == "rest"
    rises = lowest + unsure if rested else np.nan
    unfilled = _unfilled(first, second, columns[0], steps, rises) if inserts > 0 else 0.0
    open_ampere_hour = max(slope * max(abs(lowest), abs(highest)), unfilled) + slope * unsure
    return Balance(
        left_ampere_hour=float(charge[second.turn_row] - charge[first.first_row]),
        least_ampere_hour=min(slope * lowest, -unfilled, 0.0) + min(lost, 0.0) - slack,
        most_ampere_hour=slope * max(highest, 0.0) + max(lost, 0.0) + slack,
        ends_ampere_hour=open_ampere_hour / np.sqrt(3.0),
    )


def _unfilled(first, second, current, steps, rises_volt):
    """By how much a charge without a hold may end below where its cycle began, at most [Ah].

    All that was discharged before it, for on a plateau no voltage of rest says how full it is. 0
    where the charge was held, was slow, or rests as high as its cycle began.

    rises_volt : from the begin of the cycle to the rest after it; NaN where the record has none.
    """
    held = second.sign < 0 or np.any(steps.cv_first_row[list(second.loads)] >= 0)
    slow = first.moved_ampere_hour > SLOW_HOUR * abs(float(current[second.turn_row]))
    return 0.0 if held or slow or rises_volt >= 0.0 else first.moved_ampere_hour


def _apart(first, second, voltage, time, steps, limits):
    """How far the end of a cycle rests above its begin, least and most, and their deviation [V]."""
    begin, end = first.loads[0] - 1, int(np.searchsorted(steps.last_row, second.turn_row)) + 1
    rests = [0 <= k < len(steps.kind) and steps.kind[k] == "rest" for k in (begin, end)]
    last = int(steps.last_row[end]) if rests[1] else second.turn_row
    lowest = highest = float(voltage[last] - voltage[first.first_row])
    unsure = ENDS_VOLT
    if rests[0]:
        unsure += _to_go_volt(voltage, time, steps, begin)
    else:
        hidden = limits[first.sign < 0] - float(voltage[first.first_row])
        lowest, highest = lowest - max(hidden, 0.0), highest - min(hidden, 0.0)
    if rests[1]:
        unsure += _to_go_volt(voltage, time, steps, end)
    else:
        lowest, highest = min(lowest, -abs(highest)), max(highest, abs(lowest))
    return lowest, highest, unsure


def _to_go_volt(voltage, time, steps, rest):
    """By how much a rest is from its end [V], 0 where noise hides whether it moves."""
    rows = slice(int(steps.first_row[rest]), int(steps.last_row[rest]) + 1)
    begin = float(time[max(rows.start - 1, 0)])
    ahead, std = still_to_go_volt(time[rows], voltage[rows], begin)
    return abs(ahead) if abs(ahead) > SIGMAS * std else 0.0


def inserting_sign(limits):
    """Sign of what a cycle begins with: the charge of a cell, the discharge of a half cell.

    limits : lower and upper cut-off [V], None where not stated.
    """
    return -1 if is_negative_electrode(limits) else 1


def unsure_of_count(halves, columns, test_time_second, variance, limits, share, rest_ampere):
    """Standard deviation [Ah] of what is counted over half cycles, by edges and the instrument.

    The instrument is off by the same in all of them; edges each by itself. Parameters as of
    `unsure_of_edges` and `unsure_of_instrument`.
    """
    edges = [unsure_of_edges(half, variance, columns, limits) for half in halves]
    instrument = sum(
        unsure_of_instrument(half, test_time_second, columns[0], share, rest_ampere)
        for half in halves
    )
    return float(np.linalg.norm([*edges, instrument]))


def _any_load_before(half, steps):
    return any(steps.kind[k] != "rest" for k in range(half.loads[0]))
