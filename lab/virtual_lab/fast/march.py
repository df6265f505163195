"""A protocol's step solved in internal steps, until its time or a limit ends it.

Internal steps are small after a jump of the current and grow in proportion to the time since; so
any sum of exponentials is followed, whatever their time constants.
"""

import math
from typing import NamedTuple

import numpy as np

from virtual_lab.fast.kernel import advance, chamber_at, commit, njit, slow_voltage

RUNNING, ENDED, LOST = 0, 1, 2
# Columns of the rows written at each instant; the current of each branch follows.
NOTED = ("second", "current", "volt", "celsius", "soc", "charge", "unrest", "unrest_rate", "r0")
COLUMNS = len(NOTED)
EXACT_SECOND = 1e-9
EXACT_BEYOND = 1e-9


class Order(NamedTuple):
    """One step of a protocol as the kernel reads it.

    `second`, `value`: points between which the current [A] (or, with `hold`, the voltage [V]) runs
    straight, from the begin of the step; two points at one time are a jump. `side` 1 or -1: ends
    where the voltage passes `limit_volt` upwards or downwards, 0: never. `limit_ampere`: ends
    where the current falls to it, negative: never. `begin`: of the step, from the begin of the
    test [s].
    """

    second: np.ndarray
    value: np.ndarray
    hold: bool
    side: float
    limit_volt: float
    limit_ampere: float
    begin: float


class Progress(NamedTuple):
    """How far a step has come, each in an array of one.

    Time [s], number of the point passed, time of the last jump [s], charge since the begin [Ah],
    voltage [V], distance beyond the limit [V or A].
    """

    second: np.ndarray
    point: np.ndarray
    jump: np.ndarray
    charge: np.ndarray
    volt: np.ndarray
    beyond: np.ndarray


@njit
def march(packed, state, work, order, progress, grid, rows):
    """Internal steps to the end of the step, or until `rows` is full: (rows filled, status)."""
    status, count = RUNNING, 0
    while status == RUNNING and count < rows.shape[0]:
        if progress.point[0] < 0:
            status = _edge(packed, state, work, order, progress, 0)
        elif order.second[progress.point[0] + 1] <= progress.second[0]:
            status = _edge(packed, state, work, order, progress, progress.point[0] + 1)
        else:
            status = _internal_step(packed, state, work, order, progress, grid)
        _note(packed, state, work, order, progress, rows[count])
        count += 1
    return count, status


@njit
def _edge(packed, state, work, order, progress, point):
    """The current jumps to its value after an edge, in no time."""
    before = state.current.sum()
    second = order.begin + progress.second[0]
    progress.volt[0] = advance(packed, state, work, second, 0.0, order.hold, order.value[point])
    commit(packed, state, work, 0.0)
    progress.point[0] = point
    if order.hold or state.current.sum() != before:
        progress.jump[0] = progress.second[0]
    progress.beyond[0] = _past_limit(order, state.current.sum(), progress.volt[0])
    if math.isnan(progress.volt[0]):
        return LOST
    return ENDED if point == order.second.size - 1 else RUNNING


@njit
def _internal_step(packed, state, work, order, progress, grid):
    """One internal step; its status."""
    rest = order.second[progress.point[0] + 1] - progress.second[0]
    dt = _step_length(packed, state, work, order, progress, grid)
    dt = rest if dt >= rest else min(dt, 0.6 * rest)
    volt, beyond = _try_step(packed, state, work, order, progress, dt)
    while _has_switch(packed, state, work, dt, grid):
        dt *= 0.5
        volt, beyond = _try_step(packed, state, work, order, progress, dt)
    status = RUNNING
    if beyond >= 0.0:
        status = ENDED
        if progress.beyond[0] < 0.0:
            dt = _locate(packed, state, work, order, progress, dt, beyond)
            volt, beyond = _try_step(packed, state, work, order, progress, dt)
    progress.charge[0] += 0.5 * dt * (state.current.sum() + work.current.sum()) / 3600.0
    commit(packed, state, work, dt)
    progress.volt[0], progress.beyond[0] = volt, beyond
    if dt < rest:
        progress.second[0] += dt
    else:
        # The current has a kink at this point.
        progress.point[0] += 1
        progress.second[0] = order.second[progress.point[0]]
    if math.isnan(volt):
        return LOST
    return ENDED if progress.point[0] == order.second.size - 1 else status


@njit
def _has_switch(packed, state, work, dt, grid):
    """Whether a shorter step would place a switch within the step better.

    It is the sign that the instant hysteresis remembers, or in a group the resistance of an
    asymmetric cell.
    """
    turns = 0
    for j in range(state.soc.size):
        turns += dt > grid.first_second and state.direction[j] != work.direction[j]
        bends = state.soc.size > 1 and packed.asymmetry[j] != 0.0 and dt > grid.bend_second
        turns += bends and state.current[j] * work.current[j] < 0.0
    return turns > 0


@njit
def _step_length(packed, state, work, order, progress, grid):
    """Length of the next internal step [s]."""
    wish = max(grid.first_second, grid.growth * (progress.second[0] - progress.jump[0]))
    wish = min(wish, grid.longest_second)
    k, n = progress.point[0], state.soc.size
    span = order.second[k + 1] - order.second[k]
    slope = 0.0 if order.hold else (order.value[k + 1] - order.value[k]) / span / n
    for j in range(n):
        wish = min(wish, _longest_interpolated(packed, state, work, j, slope, grid))
        flow = abs(state.current[j]) / work.coulomb[j]
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
def _longest_interpolated(packed, state, work, j, slope, grid):
    """Longest step [s] over which interpolation follows the exponentials of a cell.

    Under a straight current v = straight line + d·exp(-t/tau); a cubic with the right values and
    rates at both ends is off by at most dt⁴/384 of the fourth derivative, d/tau⁴. In a group each
    d bends the currents of the branches, which are straight between instants: off by
    d/8·(dt/tau)².
    """
    through = state.current[j] - packed.leak[j]
    longest = math.inf
    for e in range(work.r.shape[1]):
        tau = work.tau[j, e]
        d = abs(state.element[j, e] - work.r[j, e] * (through - slope * tau))
        if d > grid.error_volt:
            longest = min(longest, tau * math.sqrt(math.sqrt(384.0 * grid.error_volt / d)))
        if d > grid.group_error_volt and state.soc.size > 1:
            longest = min(longest, tau * math.sqrt(8.0 * grid.group_error_volt / d))
    return longest


@njit
def _try_step(packed, state, work, order, progress, dt):
    """Voltage after an internal step, and its distance beyond the limit."""
    k = progress.point[0]
    span = order.second[k + 1] - order.second[k]
    share = min((progress.second[0] + dt - order.second[k]) / span, 1.0)
    target = order.value[k] + share * (order.value[k + 1] - order.value[k])
    second = order.begin + progress.second[0] + dt
    volt = advance(packed, state, work, second, dt, order.hold, target)
    return volt, _past_limit(order, work.current.sum(), volt)


@njit
def _past_limit(order, ampere, volt):
    """Distance beyond the limit that ends the step [V or A]; negative before it."""
    if order.side != 0.0:
        return order.side * (volt - order.limit_volt)
    if order.limit_ampere >= 0.0:
        return order.limit_ampere - abs(ampere)
    return -1.0


@njit
def _locate(packed, state, work, order, progress, dt, beyond):
    """Length of the internal step that ends at the limit [s] (false position, Illinois rule)."""
    low, high, below, above = 0.0, dt, progress.beyond[0], beyond
    side = 0
    for _ in range(60):
        middle = high - above * (high - low) / (above - below)
        distance = _try_step(packed, state, work, order, progress, middle)[1]
        if abs(distance) < EXACT_BEYOND or high - low < EXACT_SECOND:
            return middle
        if distance < 0.0:
            low, below = middle, distance
            above *= 0.5 if side == -1 else 1.0
            side = -1
        else:
            high, above = middle, distance
            below *= 0.5 if side == 1 else 1.0
            side = 1
    return high


@njit
def _note(packed, state, work, order, progress, row):
    """Write the state of the group into a row (see NOTED)."""
    second = order.begin + progress.second[0]
    air = chamber_at(packed, 0, second)
    whole = packed.core_resistance[0] + packed.surface_resistance[0]
    surface = packed.surface_resistance[0] / whole if packed.heat_capacity[0] > 0.0 else 1.0
    row[0] = progress.second[0]
    row[1] = state.current.sum()
    row[2] = progress.volt[0]
    row[3] = air + (state.core[0] - air) * surface
    row[4] = state.soc[0]
    row[5] = progress.charge[0]
    row[6], row[7] = slow_voltage(packed, state, work, 0)
    row[8] = work.r0[0]
    for j in range(state.soc.size):
        row[COLUMNS + j] = state.current[j]
