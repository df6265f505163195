"""A protocol's step solved in internal steps, until its time or a limit ends it.

Internal steps are small after a jump of the current and grow in proportion to the time since; so
any sum of exponentials is followed, whatever their time constants.
"""

import math
from typing import NamedTuple

import numpy as np

from virtual_lab.fast.kernel import advance, around, njit, take, unrest

RUNNING, ENDED, LOST = 0, 1, 2
# What is noted at each instant, then the current of each branch.
NOTED = ("second", "current", "volt", "celsius", "soc", "charge", "unrest", "unrest_rate", "r0")
COLUMNS = len(NOTED)
EXACT_SECOND = 1e-9
EXACT_BEYOND = 1e-9


class Order(NamedTuple):
    """One step as the kernel reads it.

    `second`, `value`: points between which the current [A] (or, with `hold`, the voltage [V]) runs
    straight, from the begin of the step; two points at one time are a jump. `side` 1 or -1: ends
    where the voltage passes `limit_volt` upwards or downwards, 0: never. `limit_ampere`: ends where
    the current falls to it, negative: never. `begin`: of the step, from the begin of the test [s].
    """

    second: np.ndarray
    value: np.ndarray
    hold: bool
    side: float
    limit_volt: float
    limit_ampere: float
    begin: float


class Place(NamedTuple):
    """How far a step has come, each in an array of one: time, number of the point passed, time of
    the last jump, charge since the begin [Ah], voltage, how far beyond its limit."""

    second: np.ndarray
    point: np.ndarray
    jump: np.ndarray
    charge: np.ndarray
    volt: np.ndarray
    beyond: np.ndarray


@njit
def march(packed, kept, room, order, place, grid, rows):
    """Internal steps until the end of the step or of the room for `rows`: (rows filled, status)."""
    status, count = RUNNING, 0
    while status == RUNNING and count < rows.shape[0]:
        if place.point[0] < 0:
            status = _jump(packed, kept, room, order, place, 0)
        elif order.second[place.point[0] + 1] <= place.second[0]:
            status = _jump(packed, kept, room, order, place, place.point[0] + 1)
        else:
            status = _stride(packed, kept, room, order, place, grid)
        _note(packed, kept, room, order, place, rows[count])
        count += 1
    return count, status


@njit
def _jump(packed, kept, room, order, place, point):
    """The current becomes what it is after an edge, in no time."""
    before = kept.current.sum()
    second = order.begin + place.second[0]
    place.volt[0] = advance(packed, kept, room, second, 0.0, order.hold, order.value[point])
    take(packed, kept, room, 0.0)
    place.point[0] = point
    if order.hold or kept.current.sum() != before:
        place.jump[0] = place.second[0]
    place.beyond[0] = _beyond(order, kept.current.sum(), place.volt[0])
    if math.isnan(place.volt[0]):
        return LOST
    return ENDED if point == order.second.size - 1 else RUNNING


@njit
def _stride(packed, kept, room, order, place, grid):
    """One internal step."""
    rest = order.second[place.point[0] + 1] - place.second[0]
    dt = _wish(packed, kept, room, order, place, grid)
    dt = rest if dt >= rest else min(dt, 0.6 * rest)
    volt, beyond = _try(packed, kept, room, order, place, dt)
    while _turns(packed, kept, room, dt, grid):
        dt *= 0.5
        volt, beyond = _try(packed, kept, room, order, place, dt)
    status = RUNNING
    if beyond >= 0.0:
        status = ENDED
        if place.beyond[0] < 0.0:
            dt = _locate(packed, kept, room, order, place, dt, beyond)
            volt, beyond = _try(packed, kept, room, order, place, dt)
    place.charge[0] += 0.5 * dt * (kept.current.sum() + room.current.sum()) / 3600.0
    take(packed, kept, room, dt)
    place.volt[0], place.beyond[0] = volt, beyond
    if dt < rest:
        place.second[0] += dt
    else:
        _pass(order, place)
    if math.isnan(volt):
        return LOST
    return ENDED if place.point[0] == order.second.size - 1 else status


@njit
def _turns(packed, kept, room, dt, grid):
    """Whether something jumps within the step that a shorter step would place better: the sign
    that the instant hysteresis remembers, or in a group the resistance of an asymmetric cell."""
    turns = 0
    for j in range(kept.soc.size):
        turns += dt > grid.first_second and kept.direction[j] != room.direction[j]
        bends = kept.soc.size > 1 and packed.asymmetry[j] != 0.0 and dt > grid.bend_second
        turns += bends and kept.current[j] * room.current[j] < 0.0
    return turns > 0


@njit
def _pass(order, place):
    """A point is reached: the current has a kink there."""
    place.point[0] += 1
    place.second[0] = order.second[place.point[0]]


@njit
def _wish(packed, kept, room, order, place, grid):
    """Length of the next internal step [s]."""
    wish = max(grid.first_second, grid.growth * (place.second[0] - place.jump[0]))
    wish = min(wish, grid.longest_second)
    k, n = place.point[0], kept.soc.size
    span = order.second[k + 1] - order.second[k]
    slope = 0.0 if order.hold else (order.value[k + 1] - order.value[k]) / span / n
    for j in range(n):
        wish = min(wish, _restless(packed, kept, room, j, slope, grid))
        flow = abs(kept.current[j]) / room.coulomb[j]
        wish = min(wish, grid.soc_step / flow) if flow > 0.0 else wish
        wish = min(wish, grid.share_of_heat_tau * _heat_tau(packed, j))
        bent = n > 1 and (packed.kinetic_volt[j] != 0.0 or packed.asymmetry[j] != 0.0)
        if bent and slope != 0.0:
            wish = min(wish, grid.c_rate_step * packed.c_rate_ampere[j] / abs(slope))
    return wish


@njit
def _heat_tau(packed, j):
    """Shortest time constant of the temperatures of a cell [s]."""
    whole = packed.core_resistance[j] + packed.surface_resistance[j]
    core, rise = packed.heat_capacity[j] * whole, packed.rise_tau[j]
    rises = rise > 0.0 and packed.rise_resistance[j] > 0.0
    return min(core if core > 0.0 else math.inf, rise if rises else math.inf)


@njit
def _restless(packed, kept, room, j, slope, grid):
    """Longest step [s] over which interpolation follows the exponentials of a cell.

    Under a straight current v = straight line + d·exp(-t/tau); a cubic with the right values and
    rates at both ends is off by at most dt⁴/384 of the fourth derivative, d/tau⁴. In a group each
    d bends the currents of the branches, which are straight between instants: off by d/8·(dt/tau)².
    """
    through = kept.current[j] - packed.leak[j]
    longest = math.inf
    for e in range(room.r.shape[1]):
        tau = room.tau[j, e]
        d = abs(kept.element[j, e] - room.r[j, e] * (through - slope * tau))
        if d > grid.error_volt:
            longest = min(longest, tau * math.sqrt(math.sqrt(384.0 * grid.error_volt / d)))
        if d > grid.group_error_volt and kept.soc.size > 1:
            longest = min(longest, tau * math.sqrt(8.0 * grid.group_error_volt / d))
    return longest


@njit
def _try(packed, kept, room, order, place, dt):
    """Voltage after an internal step, and how far beyond the limit it is."""
    k = place.point[0]
    span = order.second[k + 1] - order.second[k]
    share = min((place.second[0] + dt - order.second[k]) / span, 1.0)
    target = order.value[k] + share * (order.value[k + 1] - order.value[k])
    second = order.begin + place.second[0] + dt
    volt = advance(packed, kept, room, second, dt, order.hold, target)
    return volt, _beyond(order, room.current.sum(), volt)


@njit
def _beyond(order, ampere, volt):
    """Not negative where the step has to end; in V or A."""
    if order.side != 0.0:
        return order.side * (volt - order.limit_volt)
    if order.limit_ampere >= 0.0:
        return order.limit_ampere - abs(ampere)
    return -1.0


@njit
def _locate(packed, kept, room, order, place, dt, beyond):
    """Length of the internal step that ends at the limit [s] (false position, Illinois rule)."""
    low, high, below, above = 0.0, dt, place.beyond[0], beyond
    side = 0
    for _ in range(60):
        middle = high - above * (high - low) / (above - below)
        found = _try(packed, kept, room, order, place, middle)[1]
        if abs(found) < EXACT_BEYOND or high - low < EXACT_SECOND:
            return middle
        if found < 0.0:
            low, below = middle, found
            above *= 0.5 if side == -1 else 1.0
            side = -1
        else:
            high, above = middle, found
            below *= 0.5 if side == 1 else 1.0
            side = 1
    return high


@njit
def _note(packed, kept, room, order, place, row):
    """Where the group is now."""
    second = order.begin + place.second[0]
    air = around(packed, 0, second)
    whole = packed.core_resistance[0] + packed.surface_resistance[0]
    surface = packed.surface_resistance[0] / whole if packed.heat_capacity[0] > 0.0 else 1.0
    row[0] = place.second[0]
    row[1] = kept.current.sum()
    row[2] = place.volt[0]
    row[3] = air + (kept.core[0] - air) * surface
    row[4] = kept.soc[0]
    row[5] = place.charge[0]
    row[6], row[7] = unrest(packed, kept, room, 0)
    row[8] = room.r0[0]
    for j in range(kept.soc.size):
        row[COLUMNS + j] = kept.current[j]
