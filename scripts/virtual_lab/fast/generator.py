"""Protocols walked through by behavioural cells: steps → noise-free behaviour at any instant."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from virtual_lab.behaviour import Behaviour
from virtual_lab.chamber import Chamber
from virtual_lab.fast import packing
from virtual_lab.fast.cell import Cell
from virtual_lab.fast.march import COLUMNS, LOST, RUNNING, Order, Place, march
from virtual_lab.fast.reading import behaviour_of

if TYPE_CHECKING:
    from virtual_lab.protocols import Step

ROWS = 4096


class Grid(NamedTuple):
    """Internal steps: the first after a jump [s]; then so large a share of the time since; at most
    so long [s]; at most so much state of charge; so short that interpolation between them misses
    no exponential by more than so much [V]; the same for the sharing of currents in a group; at
    most so large a share of the shortest thermal time constant; in a group
    of cells that are not linear, at most so much current (C-rate), and so short [s]
    where the current of an asymmetric one changes its sign."""

    first_second: float = 0.001
    growth: float = 0.25
    longest_second: float = 20.0
    soc_step: float = 0.002
    error_volt: float = 2e-6
    group_error_volt: float = 3e-5
    share_of_heat_tau: float = 0.03
    c_rate_step: float = 0.1
    bend_second: float = 0.02


GRID = Grid()


def run(
    steps: "list[Step]",
    cell: Cell,
    *,
    chamber: Chamber,
    initial_soc: float = 1.0,
    begin_second: float = 0.0,
    initial_hysteresis: float = 1.0,
    grid: Grid = GRID,
) -> list[Behaviour]:
    """Take a rested cell through a protocol.

    Parameters
    ----------
    steps : what the cycler is told to do.
    cell : what it is made of.
    chamber : temperature around it over the time of the test.
    initial_soc : state of charge at the start [1]; 1 is full by the cell's table.
    begin_second : the clock of the test at the first step [s], for chamber and drift.
    initial_hysteresis : h and sign of the last current before the start; 1: it was charged.
    grid : internal steps.

    Returns
    -------
    One behaviour per step, `charge` and `soc` filled; temperature is that of the surface. A step
    whose limit is passed when it begins lasts one internal step, 1 ms.
    """
    behaviours = run_group(
        steps,
        [cell],
        wire_ohm=[0.0],
        initial_soc=[initial_soc],
        chambers=[chamber],
        begin_second=begin_second,
        initial_hysteresis=initial_hysteresis,
        grid=grid,
    )
    return [behaviour._replace(branches=()) for behaviour in behaviours]


def run_group(
    steps: "list[Step]",
    cells: list[Cell],
    *,
    wire_ohm: list[float],
    initial_soc: list[float],
    chambers: list[Chamber],
    begin_second: float = 0.0,
    initial_hysteresis: float = 1.0,
    grid: Grid = GRID,
) -> list[Behaviour]:
    """Take cells in parallel, joined in a star of wires, through a protocol.

    Parameters
    ----------
    steps : what the cycler is told to do; currents and voltages are those of the group.
    cells : of each branch.
    wire_ohm : resistance [ohm] in series with each cell.
    initial_soc : of each cell [1]. They were joined an instant before the start.
    chambers : temperature around each cell.
    begin_second, initial_hysteresis, grid : as for one cell.

    Returns
    -------
    One behaviour per step; temperature and state of charge are those of the first cell.
    """
    if not len(cells) == len(wire_ohm) == len(initial_soc) == len(chambers) > 0:
        raise ValueError("cells, wires, states of charge and chambers differ in number")
    packed = packing.pack(cells, wire_ohm, chambers)
    kept = packing.state(packed, initial_soc, initial_hysteresis, begin_second)
    return _through(steps, packed, kept, begin_second, grid)


def run_changing(
    parts: "list[tuple[list[Step], Cell]]",
    *,
    chamber: Chamber,
    initial_soc: float = 1.0,
    initial_hysteresis: float = 1.0,
    grid: Grid = GRID,
) -> list[Behaviour]:
    """Take a cell that changes from part to part through all of them, as one test.

    Parameters
    ----------
    parts : steps, and what the cell is made of during them; with as many exponentials each time.
    chamber, initial_soc, initial_hysteresis, grid : as for one cell.

    Returns
    -------
    One behaviour per step. State of charge, heat, polarisation and hysteresis go on from part to
    part.
    """
    behaviours, kept, begin = [], None, 0.0
    for steps, cell in parts:
        packed = packing.pack([cell], [0.0], [chamber])
        kept = kept or packing.state(packed, [initial_soc], initial_hysteresis, begin)
        done = _through(steps, packed, kept, begin, grid)
        begin += sum(behaviour.duration_second for behaviour in done)
        behaviours += [behaviour._replace(branches=()) for behaviour in done]
    return behaviours


def _through(steps, packed, kept, begin_second, grid):
    """Behaviours of all steps; `kept` is the cells' state, which each step moves on."""
    room, rows = packing.work(packed), np.empty((ROWS, COLUMNS + packed.r0.size))
    behaviours, begin = [], float(begin_second)
    for step in steps:
        order = _order(step, begin, packed)
        noted = _walk(packed, kept, room, order, grid, rows)
        behaviours.append(behaviour_of(noted, packed, held=order.hold))
        begin += noted[-1, 0]
    return behaviours


def _order(step, begin, packed) -> Order:
    side, limit = 0.0, 0.0
    if step.until_volt is not None and step.kind != "hold":
        limit = float(step.until_volt)
        # A profile is ended by the lower cut-off; a current by the one that it runs into.
        side = -1.0 if step.kind == "profile" else float(np.sign(step.value))
    until = step.until_ampere if step.kind == "hold" else None
    second, value = _points(step, packed)
    return Order(
        second,
        value,
        step.kind == "hold",
        side,
        limit,
        -1.0 if until is None else float(until),
        begin,
    )


def _points(step, packed):
    """Points of a step from its begin to its end, straight between them."""
    end = float(step.duration_second)
    if step.kind != "profile":
        return np.array([0.0, end]), np.full(2, float(step.value))
    second, value = np.asarray(step.value, float).T
    inside = (second > 0.0) & (second < end)
    ends = np.interp([0.0, end], second, value)
    second = np.concatenate([[0.0], second[inside], [end]])
    value = np.concatenate([ends[:1], value[inside], ends[1:]])
    # The first cell's charge and hysteresis have a kink where its current changes its sign.
    return _with_crossings(second, value, float(packed.leak[0]) * packed.r0.size)


def _with_crossings(second, value, level):
    """Points added where the current crosses a level."""
    before, after = value[:-1] - level, value[1:] - level
    k = np.flatnonzero(before * after < 0)
    crossing = second[k] - before[k] * (second[k + 1] - second[k]) / (value[k + 1] - value[k])
    return np.insert(second, k + 1, crossing), np.insert(value, k + 1, level)


def _walk(packed, kept, room, order, grid, rows) -> np.ndarray:
    """What was noted in a step, shape (instants, columns)."""
    integer = np.array([-1])
    place = Place(np.zeros(1), integer, *(np.zeros(1) for _ in Place._fields[2:]))
    parts, status = [], RUNNING
    while status == RUNNING:
        count, status = march(packed, kept, room, order, place, grid, rows)
        parts.append(rows[:count].copy())
    if status == LOST:
        raise ValueError(
            f"no currents found that give all branches one voltage, {place.second[0]:.3f} s into "
            f"a step; the state of charge of the first cell is {kept.soc[0]:.4f}"
        )
    return np.concatenate(parts)
