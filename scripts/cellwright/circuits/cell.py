"""A cell as tables over SoC: how they are looked up, what holds beyond their ends, its voltage.

What all rooms mean by the OCV at a SoC: linear between the points of a table; below 0 and above 1
straight on with the slope of the outermost half percent of SoC, where a particle's surface may run
empty before its mean does. All other parameters stay there what they are at the ends.

A circuit of RC pairs runs over such tables at a few nanoseconds a sample, with the same numbers as
`simulate`, which serves every kind of branch.
"""

from typing import NamedTuple

import numpy as np

from cellwright.native import array, count, function, real
from cellwright.numerics.lags import HOLDS, lag
from cellwright.refusal import Refusal

MOST_PAIRS = 16  # as in native/simulate.c
TYPES = (count, array, count, count, array, count, count, *[array] * 4, count, array, real)
TYPES = (*TYPES, array, array)
NOT_FINITE = "a current is not finite"
END_SOC = 0.005  # over which the slope is taken with which an OCV goes on beyond its table


def place(soc, points):
    """Where SoC lie on an even grid from 0 to 1: the point below, and the share to the next one.

    Beyond the ends the outermost interval is kept, with a share below 0 or above 1.

    Parameters
    ----------
    soc : number or array [1]. points : of the grid, two or more.

    Returns
    -------
    below : int, shape of soc. share : shape of soc [1].
    """
    spot = np.asarray(soc, float) * (points - 1)
    # fmin and fmax, for a SoC that is not a number then has an interval too, and no value.
    below = np.fmax(np.fmin(spot, points - 2), 0).astype(int)
    return below, spot - below


def ocv_on_grid(ocv_volt, soc):
    """OCV of a table on an even grid from 0 to 1, straight on beyond it [V].

    The grid's outermost interval is the slope there: half a percent of SoC on 201 points.

    Parameters
    ----------
    ocv_volt : (p,) [V]. soc : number or array [1].
    """
    below, share = place(soc, len(ocv_volt))
    return ocv_volt[below] + share * (ocv_volt[below + 1] - ocv_volt[below])


def continued(volt_at, soc):
    """OCV at any SoC by a look-up that knows those from 0 to 1, straight on beyond them [V].

    Parameters
    ----------
    volt_at : function of SoC (n,), within 0 to 1 [1], and of a mask (n,) of the samples that they
        belong to → (m,) [V]. soc : (n,) [1].
    """
    soc = np.asarray(soc, float)
    volt = volt_at(np.clip(soc, 0.0, 1.0), np.ones(soc.shape, bool))
    for end, inner, beyond in ((0.0, END_SOC, soc < 0.0), (1.0, 1.0 - END_SOC, soc > 1.0)):
        if beyond.any():
            at_end, inside = (volt_at(np.full(beyond.sum(), at), beyond) for at in (end, inner))
            volt[beyond] += (soc[beyond] - end) * (at_end - inside) / (end - inner)
    return volt


class Tables(NamedTuple):
    """A cell's parameters on a uniform grid of SoC from 0 to 1, with p points.

    ocv_volt, r0_ohm : (p,) [V], [ohm]. r_ohm : (pairs, p) [ohm].
    tau_second : (pairs,), or (pairs, p) where it moves with SoC [s].
    """

    ocv_volt: np.ndarray
    r0_ohm: np.ndarray
    r_ohm: np.ndarray
    tau_second: np.ndarray


class Run(NamedTuple):
    """Simulated voltage [V] and state of charge [1], (n,) each."""

    voltage_volt: np.ndarray
    soc: np.ndarray


def simulate_counted(
    tables, step_second, current_ampere, *, initial_soc, capacity_ampere_hour, hold
):
    """Voltage of a cell from rest, its SoC counted from the current.

    Parameters
    ----------
    tables : Tables; linear in SoC between the points. Outside 0…1 the OCV goes on as steeply as it
        ends, all else stays what it is.
    step_second : scalar for uniform samples, which is the fastest, or (n−1,) true steps [s]; zero
        is allowed (an edge of the current).
    current_ampere : (n,) positive on charge [A].
    initial_soc : state of charge at the first sample [1].
    capacity_ampere_hour : charge from SoC 0 to 1 [Ah].
    hold : "zero_order" (the current keeps its value until the next sample) or "first_order" (it
        moves on a straight line to the next sample).

    Returns
    -------
    run : Run.

    Raises
    ------
    Refusal : tables of different lengths, an unknown hold, a step below zero, values that are not
        finite, a time constant or a capacity that is not positive.

    Source: exact solution of tau·du/dt = R·I − u between samples, with R·I held as the current is;
    thesis (2.8), (2.12) and (2.21). R moves with SoC at the samples, tau from sample to sample.
    """
    if not capacity_ampere_hour > 0:
        raise Refusal(f"capacity is {capacity_ampere_hour} Ah; it has to be positive")
    if not np.isfinite(initial_soc):
        raise Refusal(f"SoC at the first sample is {initial_soc}")
    tables, current, step = _checked(tables, step_second, current_ampere, hold)
    soc = np.empty(len(current))
    soc[0] = initial_soc
    return _run(tables, step, current, soc, hold, 3600.0 * capacity_ampere_hour)


def simulate_given(tables, step_second, current_ampere, soc, *, hold):
    """Voltage of a cell from rest under a measured current, its SoC known at every sample.

    Parameters
    ----------
    tables, step_second, current_ampere, hold : as in `simulate_counted`.
    soc : (n,) state of charge [1].

    Returns
    -------
    voltage_volt : (n,) [V].

    Raises
    ------
    Refusal : as `simulate_counted`, or as many values of SoC as of current are not there.
    """
    tables, current, step = _checked(tables, step_second, current_ampere, hold)
    soc = np.ascontiguousarray(soc, float)
    if soc.shape != current.shape or not np.isfinite(soc).all():
        raise Refusal(f"SoC of shape {soc.shape} for {len(current)} currents, or not finite")
    return _run(tables, step, current, soc, hold, 0.0).voltage_volt


def _run(tables, step, current, soc, hold, ampere_second):
    kernel = function("simulate", *TYPES, result=count)
    if kernel is None or len(tables.r_ohm) > MOST_PAIRS:
        if not np.isfinite(current).all():
            raise Refusal(NOT_FINITE)
        return _run_by_lags(tables, step, current, soc, hold, ampere_second)
    (pairs, points), moves = tables.r_ohm.shape, tables.tau_second.ndim == 2
    voltage, rows = np.empty(len(current)), np.empty(2 * (points - 1) * (2 + pairs + moves * pairs))
    settings = (len(step) != len(current) - 1, hold == "first_order")
    cell = (pairs, points - 1, *tables, moves, rows, ampere_second)
    if not kernel(len(current), step, *settings, current, *cell, soc, voltage):
        raise Refusal(NOT_FINITE)
    return Run(voltage, soc)


def _run_by_lags(tables, step, current, soc, hold, ampere_second):
    """The kernel's result in numpy: SoC, then look-up, then one lag per pair."""
    step = np.broadcast_to(step, len(current) - 1)
    if ampere_second > 0:
        between = (current[:-1] + current[1:]) / 2 if hold == "first_order" else current[:-1]
        soc = np.cumsum(np.append(soc[0], step * between / ampere_second))
    grid = np.linspace(0.0, 1.0, len(tables.ocv_volt))
    voltage = ocv_on_grid(tables.ocv_volt, soc) + np.interp(soc, grid, tables.r0_ohm) * current
    for r, tau in zip(tables.r_ohm, tables.tau_second, strict=True):
        slow = tau if np.ndim(tau) == 0 else np.interp(soc[:-1], grid, tau)
        voltage += lag(step, slow, np.interp(soc, grid, r) * current, hold=hold)
    return Run(voltage, soc)


def _checked(tables, step_second, current_ampere, hold):
    """Tables and current as contiguous arrays, and the step: one value where all are alike.

    That every current is finite is looked at in `_run`, by the kernel on its way.
    """
    current = np.ascontiguousarray(current_ampere, float)
    ocv, r0, r, tau = (np.asarray(column, float) for column in tables)
    points = len(ocv)
    shapes = {r0.shape, r.shape[1:], tau.shape[1:]}
    if points < 2 or not shapes <= {(points,), ()}:
        raise Refusal(f"tables of {points} points of OCV, but of shapes {shapes} of the others")
    if not (tau > 0).all():
        raise Refusal("a time constant is zero, negative or not a number")
    if hold not in HOLDS:
        raise Refusal(f"hold of the current is {hold!r}; allowed are {', '.join(HOLDS)}")
    step = np.ascontiguousarray(step_second, float)  # a single one as well has one axis
    if len(current) < 1 or (np.ndim(step_second) and len(step) != len(current) - 1):
        raise Refusal(f"{len(step)} steps for {len(current)} currents; one less is needed")
    shortest, longest = (step.min(), step.max()) if len(step) > 1 else (step.sum(), step.sum())
    if not (shortest >= 0 and longest < np.inf):
        raise Refusal("a step is below zero or not finite")
    whole = (ocv, r0 if r0.ndim else np.full(points, r0), r, tau)
    tables = Tables(*map(np.ascontiguousarray, whole))
    return tables, current, step[:1] if shortest == longest else step
