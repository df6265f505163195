"""Cells in parallel: how a total current divides between them, step by step."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.fast import tables_of
from cellwright.circuits.model_file import capacity_of, member_of, plain_member
from cellwright.native import array, count, function
from cellwright.refusal import Refusal


class Group(NamedTuple):
    """Look-up tables of the cells of a parallel group on one uniform SoC grid from 0 to 1.

    ocv_volt, r0_ohm : (cells, p); r_ohm, tau_second : (cells, branches, p);
    capacity_ampere_hour : (cells,).
    """

    ocv_volt: np.ndarray
    r0_ohm: np.ndarray
    r_ohm: np.ndarray
    tau_second: np.ndarray
    capacity_ampere_hour: np.ndarray


class ParallelRun(NamedTuple):
    """Simulated group: currents (n, cells) positive on charge, voltage (n,), SoC (n, cells)."""

    branch_current_ampere: np.ndarray
    voltage_volt: np.ndarray
    soc: np.ndarray


def simulate_parallel(
    test_time_second, total_current_ampere, group, *, initial_soc, wire_resistance_ohm=0.0
):
    """Branch currents, terminal voltage and SoC of cells in parallel.

    Every sample: all cells see one voltage and their currents sum to the total (Kirchhoff), with
    the resistances, relaxations and the slope of the OCV of that moment. The branch current found
    at a sample is taken to flow since the sample before.

    SoC enters semi-implicitly (OCV of the new SoC to first order in the unknown current). With
    the OCV of the old SoC alone, stiff corners (a steep OCV, a milliohm cell, a step of a minute)
    would swing charge between the cells ever harder; this form only damps. RC states are exact
    for the current of the step.

    Parameters
    ----------
    test_time_second, total_current_ampere : (n,) [s], [A], positive on charge.
    group : Group.
    initial_soc : scalar or (cells,) [1]; unequal ones equalise from the first step on.
    wire_resistance_ohm : scalar or (cells,) in series with each cell [ohm].

    Returns
    -------
    run : ParallelRun.

    Raises
    ------
    Refusal : time runs back, or a branch has no resistance at all.

    Source: thesis 5.3 (one RC per cell, equal small wire resistance, Coulomb counting per cell).
    """
    # ASSUME: Wires of a parallel group are equal resistances from each cell to a common bar.
    steps = np.diff(np.asarray(test_time_second, float), prepend=test_time_second[0])
    if np.any(steps < 0) or not np.isfinite(total_current_ampere).all():
        raise Refusal("time runs back or the total current is not finite")
    cells = len(group.capacity_ampere_hour)
    wire = np.broadcast_to(np.asarray(wire_resistance_ohm, float), (cells,))
    if np.any(group.r0_ohm.min(axis=1) + wire <= 0):
        raise Refusal("a branch of the group has neither a resistance in its cell nor in its wire")
    soc = np.broadcast_to(np.asarray(initial_soc, float), (cells,)).copy()
    total = np.ascontiguousarray(total_current_ampere, float)
    kernel = function("parallel", count, *[array] * 2, *[count] * 3, *[array] * 10)
    if kernel is None:
        return _run_step_by_step(group, wire, soc, steps, total)
    return _run_compiled(kernel, group, wire, soc, steps, total)


def _run_compiled(kernel, group, wire, soc, steps, total):
    tables = (group.ocv_volt, group.r0_ohm, group.r_ohm, group.tau_second)
    cells, pairs, points = group.r_ohm.shape
    tables_and_cell = (*tables, 3600.0 * group.capacity_ampere_hour, wire)
    tables_and_cell = [np.ascontiguousarray(table, float) for table in tables_and_cell]
    run = _empty_run(len(steps), cells)
    work = np.zeros((11 + 5 * pairs, cells))
    work[10] = soc
    kernel(len(steps), steps, total, cells, pairs, points, *tables_and_cell, work, *run)
    return run


def _run_step_by_step(group, wire, soc, steps, total):
    """The kernel's result in numpy, step by step."""
    relaxed = np.zeros(group.r_ohm.shape[:2])
    run = _empty_run(len(steps), len(soc))
    for k, step in enumerate(steps):
        current, voltage, soc, relaxed = _step(group, wire, soc, relaxed, step, total[k])
        run.branch_current_ampere[k], run.voltage_volt[k], run.soc[k] = current, voltage, soc
    return run


def _empty_run(rows, cells):
    return ParallelRun(*(np.empty((rows, *shape)) for shape in ((cells,), (), (cells,))))


def _step(group, wire, soc, relaxed, step_second, total_ampere):
    ocv, slope, r0, r, tau = _tables_at(group, soc)
    charge = step_second / (3600.0 * group.capacity_ampere_hour)
    gain = -np.expm1(-step_second / tau)
    source = ocv + (relaxed * (1.0 - gain)).sum(axis=1)
    effective = r0 + wire + slope * charge + (gain * r).sum(axis=1)
    conductance = 1.0 / effective
    voltage = (total_ampere + conductance @ source) / conductance.sum()
    current = conductance * (voltage - source)
    relaxed = relaxed * (1.0 - gain) + gain * r * current[:, None]
    return current, voltage, soc + charge * current, relaxed


def _tables_at(group, soc):
    """OCV, its slope, R0, R and tau of each cell; outside 0…1 OCV on its end slope, R held."""
    last, rows = group.ocv_volt.shape[1] - 1, np.arange(len(soc))
    lower = np.clip((soc * last).astype(int), 0, last - 1)
    share = soc * last - lower
    inside = np.minimum(np.maximum(share, 0.0), 1.0)
    ocv = group.ocv_volt[rows, lower]
    rise = group.ocv_volt[rows, lower + 1] - ocv
    r0 = group.r0_ohm[rows, lower] * (1 - inside) + group.r0_ohm[rows, lower + 1] * inside
    column = inside[:, None]
    r = group.r_ohm[rows, :, lower] * (1 - column) + group.r_ohm[rows, :, lower + 1] * column
    return ocv + rise * share, np.maximum(rise, 0.0) * last, r0, r, group.tau_second[rows, :, lower]


def group_of(models, *, temperature_celsius=None, member=None, points=201):
    """Stack the models of a group's cells on one SoC grid.

    Parameters
    ----------
    models : sequence of model dicts, in the order of the branches.
    temperature_celsius : temperature of the group [degC]; None only for models of one condition.
    member : name of a member of RC pairs for all cells, or None for that of
        `model_file.plain_member` of each.
    points : size of the SoC grid.

    Returns
    -------
    group : Group. Cells with fewer RC pairs than others get pairs without resistance.

    Raises
    ------
    Refusal : no model, or see `fast.tables_of`.
    """
    if not models:
        raise Refusal("a group without models cannot be simulated")
    celsius = temperature_celsius
    settings = {"temperature_celsius": celsius, "member": member, "points": points}
    tables = [tables_of(model, **settings) for model in models]
    pairs = max(len(cell_tables.r_ohm) for cell_tables in tables)
    return Group(
        ocv_volt=np.array([cell_tables.ocv_volt for cell_tables in tables]),
        r0_ohm=np.array([cell_tables.r0_ohm for cell_tables in tables]),
        r_ohm=np.array([_padded(cell_tables.r_ohm, pairs, 0.0) for cell_tables in tables]),
        tau_second=np.array(
            [_padded(cell_tables.tau_second, pairs, 1.0) for cell_tables in tables]
        ),
        capacity_ampere_hour=np.array(
            [
                capacity_of(model, member_of(model, member or plain_member(model)), celsius)
                for model in models
            ]
        ),
    )


def _padded(table, pairs, fill):
    return np.vstack([table, np.full((pairs - len(table), table.shape[1]), fill)])
