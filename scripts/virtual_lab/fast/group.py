"""Cells side by side: the current is shared so that all show one voltage behind their wires.

A single cell is a group of one. Unknown are the currents at the end of an internal step; the laws
of Kirchhoff are solved by Newton's method, in which they hold to rounding, for they are linear.
"""

import math

from virtual_lab.fast.compiled import njit
from virtual_lab.fast.kernel import accept, freeze, terminal, warm

MOST = 120
UNDAMPED = 20
CLOSE_AMPERE = 1e-11


@njit
def advance(packed, kept, room, second, dt, hold, target):
    """Try one internal step that ends at `second` of the test.

    The group's current becomes `target` [A], or, where `hold` is set, its voltage [V]. Gives that
    voltage; what the cells would remember stands in `room`. NaN: no currents were found.
    """
    n = kept.soc.size
    extra = 0.0 if hold else (target - kept.current.sum()) / n
    for j in range(n):
        room.direction[j] = kept.direction[j]
        room.current[j] = kept.current[j] + extra
        warm(packed, kept, room, j, second, dt)
        freeze(packed, kept, room, j, second, dt)
    volt = _settle(packed, kept, room, dt, hold, target)
    if _turned(packed, room):
        volt = _settle(packed, kept, room, dt, hold, target)
        if _turned_back(kept, room):
            volt = _settle(packed, kept, room, dt, hold, target)
    return volt


@njit
def _settle(packed, kept, room, dt, hold, target):
    """Find the currents; gives the common voltage."""
    if kept.soc.size == 1 and not hold:
        room.current[0] = target
        return terminal(packed, kept, room, 0, dt, target)[0]
    for k in range(MOST):
        # Kinks (asymmetry) and steep kinetics can send Newton's method round in a circle.
        damping = 1.0 if k < UNDAMPED else 0.5
        change, common = _newton(packed, kept, room, dt, hold, target, damping)
        if change < CLOSE_AMPERE:
            return common
    return math.nan


@njit
def _newton(packed, kept, room, dt, hold, target, damping):
    """One improvement of all currents; gives the largest change [A] and the common voltage."""
    n = kept.soc.size
    conductance, weighted, flowing = 0.0, 0.0, 0.0
    for j in range(n):
        room.volt[j], room.slope[j] = terminal(packed, kept, room, j, dt, room.current[j])
        conductance += 1.0 / room.slope[j]
        weighted += room.volt[j] / room.slope[j]
        flowing += room.current[j]
    common = target if hold else (target - flowing + weighted) / conductance
    most = 0.0
    for j in range(n):
        change = (common - room.volt[j]) / room.slope[j]
        room.current[j] += damping * change
        most = max(most, abs(change) / (1.0 + abs(room.current[j])))
    return most, common


@njit
def _turned(packed, room):
    """Whether a current large enough to count has changed its sign; the sign is set anew."""
    turned = False
    for j in range(room.current.size):
        sign = 1.0 if room.current[j] > 0.0 else -1.0
        counts = abs(room.current[j]) > packed.threshold[j] and packed.instant[j] != 0.0
        if counts and sign != room.direction[j]:
            room.direction[j] = sign
            turned = True
    return turned


@njit
def _turned_back(kept, room):
    """Whether a cell's jump of voltage turned its own current back; such a jump is not made.

    Beside other cells it would be made and undone for ever, as by a relay without a dead band.
    """
    back = False
    for j in range(room.current.size):
        turned = room.direction[j] != kept.direction[j]
        if turned and room.current[j] * room.direction[j] <= 0.0:
            room.direction[j] = kept.direction[j]
            back = True
    return back


@njit
def take(packed, kept, room, dt):
    """The step tried is made."""
    for j in range(kept.soc.size):
        accept(packed, kept, room, j, dt)
