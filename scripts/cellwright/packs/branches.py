"""Models of cells known only from inside a parallel group: from their branch currents.

All cells of a group see one voltage: V = f(z_c) + d_c(z_c) + R0_c(z_c)·I_c + u_c for every cell
c. With the charge of each branch counted, this is linear in the common OCV curve f (monotone), in
each cell's small deviation d_c from it, and in all resistances.
"""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.lags import lag
from cellwright.numerics.linear import hats, solve
from cellwright.numerics.statistics import rms
from cellwright.packs.parallel import Group
from cellwright.refusal import Refusal


class GroupFit(NamedTuple):
    """Identified group (every SoC is 0 at the first sample) and how well it fits."""

    group: Group
    fit_rmse_volt: float


class Knots(NamedTuple):
    """SoC knots of the common OCV curve, of each cell's deviation and of each resistance."""

    ocv: np.ndarray
    deviation: np.ndarray
    resistance: np.ndarray


def rest_offset(branch_current_ampere, total_current_ampere, *, rest_ampere):
    """Mean branch currents over a long rest, in which nothing should flow any more.

    Parameters
    ----------
    branch_current_ampere, total_current_ampere : (n, cells), (n,) of the rest [A].
    rest_ampere : total current below which the group rests [A].

    Returns
    -------
    offset_ampere : (cells,) [A].

    Raises
    ------
    Refusal : the rows are not a rest.
    """
    # ASSUME: What a branch sensor reads at the end of a long rest of the whole group is its offset.
    if not len(total_current_ampere) or np.abs(total_current_ampere).max() > rest_ampere:
        raise Refusal(f"no rest: the total current reaches more than {rest_ampere:g} A")
    return np.mean(branch_current_ampere, axis=0)


def identify_branches(
    test_time_second,
    branch_current_ampere,
    voltage_volt,
    *,
    tau_second=(30.0, 100.0, 300.0, 1000.0, 3000.0),
    knots=(60, 9, 5),
    penalty=(1e-3, 1e-2, 1e-2),
    hold="first_order",
    points=201,
):
    """One-RC models of all cells of a group from one full slow charge of the group.

    The stretch starts from rest at the group's empty state and ends after its full state; between
    them the SoC of every cell runs from 0 to 1 by definition, and its charge is its capacity.

    Parameters
    ----------
    test_time_second : (n,) [s].
    branch_current_ampere : (n, cells) positive on charge, sensor offsets removed [A].
    voltage_volt : (n,) [V].
    tau_second : time constants to choose from, one for all cells [s].
    knots : numbers of SoC knots of OCV, deviation and resistances.
    penalty : on the bend of the OCV [V], the size of the deviations [1] and the bend of the
        resistances [A], each against the voltage errors.
    hold : hold of the branch currents between samples.
    points : size of the SoC grid of the result.

    Returns
    -------
    fit : GroupFit.

    Raises
    ------
    Refusal : fewer than two branches, values not finite, or a branch that is not charged.
    """
    # ASSUME: Cells known only from a group share one OCV curve but for a small smooth deviation;
    # their SoC 0 and 1 are the empty and full states of the group's own slow charge.
    soc, capacity = _counted(test_time_second, branch_current_ampere, voltage_volt)
    at = Knots(_even_knots(soc.mean(axis=1), voltage_volt, knots[0]), *map(_grid, knots[1:]))
    steps = np.diff(test_time_second)
    found = []
    for tau in tau_second:
        matrix = _design(steps, branch_current_ampere, soc, at, tau, hold)
        parameters = _solve(matrix, voltage_volt, at, soc.shape[1], penalty)
        error = matrix @ parameters - np.tile(voltage_volt, soc.shape[1])
        found.append((rms(error), tau, parameters))
    rmse, tau, parameters = min(found, key=lambda entry: entry[0])
    return GroupFit(_group(parameters, at, capacity, tau, points), rmse)


def _counted(time, current, voltage):
    if np.ndim(current) != 2 or current.shape[1] < 2:
        raise Refusal("branch currents of at least two cells are needed")
    if not (np.isfinite(current).all() and np.isfinite(voltage).all()):
        raise Refusal("branch currents or voltage hold values that are not finite")
    moved = np.diff(time)[:, None] * (current[1:] + current[:-1]) / 7200.0
    charge = np.vstack([np.zeros(current.shape[1]), np.cumsum(moved, axis=0)])
    if np.any(charge[-1] <= 0):
        raise Refusal(f"branch {int(np.argmin(charge[-1])) + 1} is not charged in this stretch")
    return charge / charge[-1], charge[-1]


def _grid(count):
    return np.linspace(0.0, 1.0, count)


def _even_knots(soc, voltage, count):
    """Knots at even distances along the curve: dense where the voltage is steep."""
    along = np.maximum.accumulate(soc + (voltage - voltage.min()) / np.ptp(voltage))
    along, rows = np.unique(along, return_index=True)
    middle = np.interp(np.linspace(along[0], along[-1], count)[1:-1], along, soc[rows])
    inside = middle[(middle > 0.0) & (middle < 1.0)]
    return np.unique(np.concatenate([[0.0], inside, [1.0]]))


def _design(steps, current, soc, at, tau, hold):
    """Columns: deviations of all cells, OCV start and increments, then (R0, R1) of each cell."""
    cells, rows = soc.shape[1], []
    for c in range(cells):
        driven = hats(soc[:, c], at.resistance) * current[:, c : c + 1]
        own = np.hstack([driven, lag(steps, tau, driven, hold=hold)])
        deviation = hats(soc[:, c], at.deviation)
        ocv = np.cumsum(hats(soc[:, c], at.ocv)[:, ::-1], axis=1)[:, ::-1]
        spread = [np.kron(np.eye(cells)[c : c + 1], block) for block in (deviation, own)]
        rows.append(np.hstack([spread[0], ocv, spread[1]]))
    return np.vstack(rows)


def _solve(matrix, voltage, at, cells, penalty):
    bend, size, wiggle = penalty
    slope = np.diff(np.eye(len(at.ocv)), axis=0) / np.diff(at.ocv)[:, None]
    increments = np.tril(np.ones((len(at.ocv), len(at.ocv))))
    blocks = [size * np.eye(cells * len(at.deviation)), bend * np.diff(slope, axis=0) @ increments]
    blocks += [wiggle * np.diff(np.eye(len(at.resistance)), 2, axis=0)] * (2 * cells)
    gram, column = matrix.T @ matrix, 0
    for block in blocks:
        own = slice(column, column + block.shape[1])
        gram[own, own] += len(matrix) * block.T @ block
        column = own.stop
    moment = matrix.T @ np.tile(voltage, cells)
    return solve(gram, moment, cells * len(at.deviation))


def _group(parameters, at, capacity, tau, points, *, smallest_ohm=1e-4):
    cells, grid = len(capacity), _grid(points)
    cuts = np.cumsum([cells * len(at.deviation), len(at.ocv)])
    deviation, ocv, resistance = np.split(parameters, cuts)
    common = np.interp(grid, at.ocv, np.cumsum(ocv))
    own = [np.interp(grid, at.deviation, d) for d in deviation.reshape(cells, -1)]
    table = resistance.reshape(cells, 2, -1)
    table = np.array([[np.interp(grid, at.resistance, r) for r in cell] for cell in table])
    return Group(
        ocv_volt=np.maximum.accumulate(common + np.array(own), axis=1),
        r0_ohm=np.maximum(table[:, 0], smallest_ohm),
        r_ohm=table[:, 1:],
        tau_second=np.full((cells, 1, points), tau),
        capacity_ampere_hour=capacity,
    )
