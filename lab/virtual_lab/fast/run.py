"""Protocols simulated with equivalent-circuit cells; what is known of such a cell at rest."""

from functools import partial
from typing import NamedTuple

import numpy as np

from virtual_lab.behaviour import Behaviour
from virtual_lab.chamber import Chamber
from virtual_lab.fast import parameters
from virtual_lab.fast.kernel import REFERENCE_CELSIUS, arrhenius, smooth, straight
from virtual_lab.fast.march import COLUMNS, LOST, NOTED, RUNNING, Order, Progress, march
from virtual_lab.fast.parameters import Cell, Pack
from virtual_lab.protocols import Step

ROWS = 4096


class Grid(NamedTuple):
    """Bounds of the internal steps.

    The first after a jump [s]; growth as a share of the time since; longest [s]; most state of
    charge; most error of the interpolation of exponentials between steps [V], and of the sharing
    of currents in a group [V]; largest share of the shortest thermal time constant; in a group of
    cells that are not linear, most current (C-rate), and longest [s] where the current of an
    asymmetric cell changes its sign.
    """

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
    steps: list[Step],
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
    cell : its parameters.
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
    steps: list[Step],
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
    packed = parameters.packed_cells(cells, wire_ohm, chambers)
    state = parameters.rested_state(packed, initial_soc, initial_hysteresis, begin_second)
    return _run_steps(steps, packed, state, begin_second, grid)


def run_changing(
    parts: list[tuple[list[Step], Cell]],
    *,
    chamber: Chamber,
    initial_soc: float = 1.0,
    initial_hysteresis: float = 1.0,
    grid: Grid = GRID,
) -> list[Behaviour]:
    """Take a cell that changes from part to part through all of them, as one test.

    Parameters
    ----------
    parts : steps, and the cell's parameters during them; with as many exponentials each time.
    chamber, initial_soc, initial_hysteresis, grid : as for one cell.

    Returns
    -------
    One behaviour per step. State of charge, heat, polarisation and hysteresis go on from part to
    part.
    """
    behaviours, state, begin = [], None, 0.0
    for steps, cell in parts:
        packed = parameters.packed_cells([cell], [0.0], [chamber])
        state = state or parameters.rested_state(packed, [initial_soc], initial_hysteresis, begin)
        done = _run_steps(steps, packed, state, begin, grid)
        begin += sum(behaviour.duration_second for behaviour in done)
        behaviours += [behaviour._replace(branches=()) for behaviour in done]
    return behaviours


def _run_steps(steps, packed, state, begin_second, grid):
    """Behaviours of all steps; each step updates `state`."""
    work, rows = parameters.work_arrays(packed), np.empty((ROWS, COLUMNS + packed.r0.size))
    behaviours, begin = [], float(begin_second)
    for step in steps:
        order = _order(step, begin, packed)
        noted = _run_step(packed, state, work, order, grid, rows)
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
    second, value = _current_points(step, packed)
    return Order(
        second,
        value,
        step.kind == "hold",
        side,
        limit,
        -1.0 if until is None else float(until),
        begin,
    )


def _current_points(step, packed):
    """Points of a step from its begin to its end, with straight lines between them."""
    end = float(step.duration_second)
    if step.kind != "profile":
        return np.array([0.0, end]), np.full(2, float(step.value))
    second, value = np.asarray(step.value, float).T
    inside = (second > 0.0) & (second < end)
    ends = np.interp([0.0, end], second, value)
    second = np.concatenate([[0.0], second[inside], [end]])
    value = np.concatenate([ends[:1], value[inside], ends[1:]])
    # A point is added where the first cell's current changes its sign: charge and hysteresis have
    # a kink there.
    level = float(packed.leak[0]) * packed.r0.size
    before, after = value[:-1] - level, value[1:] - level
    k = np.flatnonzero(before * after < 0)
    crossing = second[k] - before[k] * (second[k + 1] - second[k]) / (value[k + 1] - value[k])
    return np.insert(second, k + 1, crossing), np.insert(value, k + 1, level)


def _run_step(packed, state, work, order, grid, rows) -> np.ndarray:
    """Rows written in a step, shape (instants, columns); see `march.NOTED`."""
    integer = np.array([-1])
    progress = Progress(np.zeros(1), integer, *(np.zeros(1) for _ in Progress._fields[2:]))
    parts, status = [], RUNNING
    while status == RUNNING:
        count, status = march(packed, state, work, order, progress, grid, rows)
        parts.append(rows[:count].copy())
    if status == LOST:
        raise ValueError(
            f"no currents found that give all branches one voltage, {progress.second[0]:.3f} s "
            f"into a step; the state of charge of the first cell is {state.soc[0]:.4f}"
        )
    return np.concatenate(parts)


def behaviour_of(noted: np.ndarray, packed: Pack, *, held: bool) -> Behaviour:
    """Behaviour in one step from the rows (instants, columns) of the kernel; held: at a voltage."""
    column = dict(zip(NOTED, noted.T.copy(), strict=False))
    branches = tuple(noted[:, COLUMNS:].T.copy())
    straight = {
        name: partial(np.interp, xp=column["second"], fp=column[name])
        for name in ("current", "volt", "celsius", "soc")
    }
    column["branch"] = branches[0]
    first = tuple(
        float(values[0])
        for values in (packed.leak, packed.asymmetry, packed.kinetic_share, packed.kinetic_volt)
    )
    column["rest"] = (
        column["volt"] - column["unrest"] - _ohmic(column["branch"], column["r0"], first)
    )
    return Behaviour(
        duration_second=float(column["second"][-1]),
        current=straight["current"],
        voltage=straight["volt"] if held else partial(_voltage, column=column, first=first),
        temperature=straight["celsius"],
        branches=tuple(partial(np.interp, xp=column["second"], fp=one) for one in branches),
        charge=partial(_charge, column=column),
        soc=straight["soc"],
    )


def _ohmic(ampere, r0, first):
    """Voltage [V] over the ohmic element of the first cell, by the kernel's law."""
    leak, asymmetry, share, scale = first
    through = ampere - leak
    volt = np.where(through > 0.0, 1.0 + asymmetry, 1.0) * r0 * through
    if scale == 0.0:
        return volt
    return (1.0 - share) * volt + scale * np.arcsinh(share * volt / scale)


def _interval(second, grid):
    """Number of the interval of each instant, its length [s], and the share of it passed."""
    second = np.clip(second, 0.0, grid[-1])
    k = np.clip(np.searchsorted(grid, second, side="right") - 1, 0, grid.size - 2)
    length = grid[k + 1] - grid[k]
    return k, length, (second - grid[k]) / np.where(length > 0.0, length, 1.0)


def _voltage(second, column, first):
    """Voltage [V] between instants.

    Open circuit, exponentials and hysteresis by a cubic, for their rates are known; the ohmic
    element by its law, for the current is known; the rest by a straight line.
    """
    k, length, u = _interval(second, column["second"])

    def between(name):
        return column[name][k] + u * (column[name][k + 1] - column[name][k])

    rise = column["unrest"][k + 1] - column["unrest"][k]
    begin, end = column["unrest_rate"][k] * length, column["unrest_rate"][k + 1] * length
    bend = u * (1 - u) * ((1 - u) * (begin - rise) + u * (rise - end))
    prompt = _ohmic(between("branch"), between("r0"), first)
    return between("unrest") + bend + prompt + between("rest")


def _charge(second, column):
    """Charge [Ah] between instants, where the current runs straight."""
    k, length, u = _interval(second, column["second"])
    current = column["current"]
    mean = current[k] + 0.5 * u * (current[k + 1] - current[k])
    return column["charge"][k] + u * length * mean / 3600.0


PULSE_SECOND = 10.0


def rested_volt(cell: Cell, soc: np.ndarray, *, celsius: float) -> np.ndarray:
    """Open-circuit voltage [V] over the state of charge [1], without hysteresis."""
    one = parameters.cell_arrays(cell)
    warmer = celsius - REFERENCE_CELSIUS
    return np.array(
        [
            smooth(one["ocv"], one["ocv_slope"], z)[0] + warmer * straight(one["entropic"], z)
            for z in np.asarray(soc, float)
        ]
    )


def resistances(
    cell: Cell,
    soc: np.ndarray,
    *,
    celsius: float,
    after_second: tuple[float, ...] = (PULSE_SECOND,),
) -> dict[str, np.ndarray]:
    """Resistances [ohm] of a discharge at small current, over the state of charge [1].

    Returns
    -------
    r0: at once; r_10s and the like: so long after a step; r_total: in the long run, without the
    change of the OCV.
    """
    one = parameters.cell_arrays(cell)
    names = ("r", "tau", "r_energy", "tau_energy")
    elements = list(zip(*(one[name] for name in names), one["factor"][1:], strict=True))
    r0 = one["r0"] * arrhenius(one["r0_energy"], celsius) * _table_values(one["factor"][0], soc)
    times = {"r0": 0.0} | {f"r_{second:g}s": second for second in after_second}
    totals = dict.fromkeys([*times, "r_total"], r0)
    for r, tau, of_r, of_tau, factor in elements:
        whole = r * arrhenius(of_r, celsius) * _table_values(factor, soc)
        for name, second in (times | {"r_total": np.inf}).items():
            share = 1 - np.exp(-second / (tau * arrhenius(of_tau, celsius)))
            totals[name] = totals[name] + share * whole
    return totals


def _table_values(table, soc):
    return np.array([straight(table, z) for z in np.asarray(soc, float)])


def impedance(cell: Cell, frequency_hertz: np.ndarray, *, soc: float, celsius: float) -> np.ndarray:
    """Complex impedance of a cell at rest: the same parameters, linearised.

    Parameters
    ----------
    cell : its parameters.
    frequency_hertz : frequencies [Hz].
    soc : state of charge [1].
    celsius : temperature of the cell [°C].

    Returns
    -------
    impedance [ohm] at each frequency; capacitive arcs have a negative imaginary part. It is the
    ohmic resistance (where charge and discharge differ, the mean of both), the exponentials, and
    the capacitance of the open-circuit curve, slope / (j·2·pi·f·Q). Hysteresis does not respond to
    currents that move no charge.
    """
    omega = 1j * 2 * np.pi * np.asarray(frequency_hertz, float)
    one = parameters.cell_arrays(cell)
    warmer = celsius - REFERENCE_CELSIUS
    coulomb = one["coulomb"] + one["coulomb_per_kelvin"] * warmer
    factor = [straight(table, soc) for table in one["factor"]]
    slope = smooth(one["ocv"], one["ocv_slope"], soc)[1]
    r0 = one["r0"] * arrhenius(one["r0_energy"], celsius) * factor[0]
    total = r0 * (1 + one["asymmetry"] / 2) + slope / (omega * coulomb)
    names = ("r", "tau", "r_energy", "tau_energy")
    for r, tau, of_r, of_tau, f in zip(*(one[n] for n in names), factor[1:], strict=True):
        element = r * arrhenius(of_r, celsius) * f
        total = total + element / (1 + omega * tau * arrhenius(of_tau, celsius))
    return total
