"""Cells in parallel on one bar, given as tables of resistors and RC pairs."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.fast import tables_of
from cellwright.circuits.model_file import capacity_of, member_of, plain_member
from cellwright.packs.cells import PackCells
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.wiring import Wiring
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
    """Branch currents, terminal voltage and SoC of cells in parallel: `simulate_pack` of a star.

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
    Refusal : as `simulate_pack`.

    Source: thesis 5.3 (one RC per cell, equal small wire resistance, Coulomb counting per cell).
    """
    cells = cells_of_group(group)
    count = len(cells.names)
    contact = np.broadcast_to(np.asarray(wire_resistance_ohm, float), (count,))
    wiring = Wiring("the group", "parallel", cells.names, tuple(contact), (0.0,) * count)
    run = simulate_pack(
        test_time_second, total_current_ampere, cells, wiring, initial_soc=initial_soc
    )
    return ParallelRun(run.cell_current_ampere, run.voltage_volt, run.soc)


def cells_of_group(group):
    """A Group as PackCells.

    Parameters
    ----------
    group : Group.
    """
    cells, pairs, points = group.r_ohm.shape
    none = np.zeros((1, cells, 0, points))
    r0 = group.r0_ohm[None, :, None]
    return PackCells(
        names=tuple(f"cell {k + 1}" for k in range(cells)),
        members=(f"{pairs}RC",) * cells,
        capacity_ampere_hour=np.asarray(group.capacity_ampere_hour, float),
        near_end_soc=np.zeros(cells),
        temperature_celsius=np.array([25.0]),
        ocv_volt=np.ascontiguousarray(group.ocv_volt[None, :, None], float),
        ocv_shift_volt=np.zeros((1, cells, 1, points)),
        r0_ohm=np.ascontiguousarray(r0, float),
        two_way_ohm=none,
        r_ohm=np.ascontiguousarray(group.r_ohm[None], float),
        tau_second=np.ascontiguousarray(group.tau_second[None], float),
        kinetic_r_ohm=none,
        kinetic_tau_second=none,
        kinetic_scale_volt=none,
        hysteresis_volt=none,
        hysteresis_ampere_hour=none,
        soc_per_ampere=none,
        soc_tau_second=none,
    )


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
