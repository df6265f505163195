"""Two cells in parallel as one system of equations, solved by CasADi's IDAS.

PyBaMM gives the equations of each cell; Kirchhoff's laws join them. The current is shared so that
both branches (cell and wire) show one voltage at every instant; nothing is iterated or relaxed.
"""

from functools import partial
from itertools import pairwise
from typing import NamedTuple

import casadi
import numpy as np
import pybamm

from virtual_lab import physics
from virtual_lab.behaviour import Behaviour
from virtual_lab.cells import Cell
from virtual_lab.measurement import EARLY_SECOND, Columns
from virtual_lab.protocols import Step
from virtual_lab.simulate import TOLERANCE

CURRENT = "Current function [A]"
EDGE_SECOND = 0.001
IDAS = {"abstol": TOLERANCE, "reltol": TOLERANCE, "max_num_steps": 100_000}


class Branch(NamedTuple):
    """Equations of one cell with its wire; its current is positive on discharge, as in PyBaMM.

    `x`, `z`: differential and algebraic states; `x_begin`, `z_begin`: their values at rest.
    """

    x: casadi.MX
    z: casadi.MX
    current: casadi.MX
    x_change: casadi.MX
    z_residual: casadi.MX
    voltage: casadi.MX
    temperature: casadi.MX
    x_begin: np.ndarray
    z_begin: np.ndarray


def run(
    steps: list[Step],
    cells: tuple[Cell, Cell],
    *,
    wire_ohm: tuple[float, float],
    initial_soc: tuple[float, float],
    ambient_celsius: float,
) -> list[Behaviour]:
    """Take two cells in parallel through a protocol of set currents.

    Parameters
    ----------
    steps : currents and profiles only, each ended by its duration.
    cells : of both branches.
    wire_ohm : resistance [ohm] in series with each cell.
    initial_soc : of each cell [1].
    ambient_celsius : chamber temperature [°C].

    Returns
    -------
    One behaviour per step; temperature is that of the first cell.
    """
    settings = zip(cells, wire_ohm, initial_soc, strict=True)
    branches = [_branch(*setting, ambient_celsius=ambient_celsius) for setting in settings]
    grids = [_grid(step) for step in steps]
    begins = np.cumsum([0.0, *[step.duration_second for step in steps]])
    time = np.concatenate(
        [begin + second for begin, (second, _) in zip(begins, grids, strict=False)]
    )
    current = np.concatenate([ampere for _, ampere in grids])
    shown = _solve(branches, np.append(0.0, time), np.append(0.0, current))
    return [_behaviour(time, shown, *ends) for ends in pairwise(begins)]


def _branch(cell, wire_ohm, soc, *, ambient_celsius) -> Branch:
    values = physics.parameters(cell, ambient_celsius=ambient_celsius)
    values[CURRENT] = "[input]"
    simulation = pybamm.Simulation(physics.model(cell), parameter_values=values)
    at_rest = {CURRENT: 0.0}
    simulation.build(initial_soc=physics.window_soc(cell, soc), inputs=at_rest)
    model = simulation.built_model
    x, z = casadi.MX.sym("x", model.len_rhs), casadi.MX.sym("z", model.len_alg)
    current = casadi.MX.sym("current")

    def symbolic(expression):
        return expression.to_casadi(casadi.MX(0), casadi.vertcat(x, z), inputs={CURRENT: current})

    begin = np.ravel(model.concatenated_initial_conditions.evaluate(inputs=at_rest))
    kelvin = model.get_processed_variable("Volume-averaged cell temperature [K]")
    return Branch(
        x, z, current,
        x_change=symbolic(model.concatenated_rhs),
        z_residual=symbolic(model.concatenated_algebraic),
        voltage=symbolic(model.get_processed_variable("Voltage [V]")) - wire_ohm * current,
        temperature=symbolic(kelvin) - physics.ZERO_CELSIUS_KELVIN,
        x_begin=begin[: model.len_rhs],
        z_begin=begin[model.len_rhs :],
    )  # fmt: skip


def _grid(step):
    """Grid of one step: its edge, then dense, then by the sampling period or the profile."""
    if step.kind == "profile":
        second, ampere = step.value.T
        return np.append(EDGE_SECOND, second[1:]), ampere
    regular = np.arange(step.period_second, step.duration_second, step.period_second)
    second = np.concatenate([[EDGE_SECOND], EARLY_SECOND, regular, [step.duration_second]])
    second = np.unique(second)
    return second, np.full(second.size, step.value)


def _system(branches) -> dict:
    """Both cells' equations joined by Kirchhoff's laws; `u` is the slope of the group's current.

    That current and the first branch's are states: all is positive on discharge.
    """
    first, second = branches
    group, slope = casadi.MX.sym("group"), casadi.MX.sym("slope")
    x_change, z_residual, voltage = casadi.substitute(
        [second.x_change, second.z_residual, second.voltage],
        [second.current],
        [group - first.current],
    )
    return {
        "x": casadi.vertcat(first.x, second.x, group),
        "z": casadi.vertcat(first.z, second.z, first.current),
        "u": slope,
        "ode": casadi.vertcat(first.x_change, x_change, slope),
        "alg": casadi.vertcat(first.z_residual, z_residual, first.voltage - voltage),
    }


def _solve(branches, time, current) -> Columns:
    """Channels at time[1:] [s]; the current [A], positive on charge, runs straight in between."""
    first, second = branches
    system = _system(branches)
    balance = {"x": system["z"], "p": system["x"], "g": system["alg"]}
    begin = np.concatenate([first.x_begin, second.x_begin, [0.0]])
    guess = np.concatenate([first.z_begin, second.z_begin, [0.0]])
    march = casadi.integrator("march", "idas", system, time[0], time[1:].tolist(), IDAS)
    found = march(
        x0=begin,
        z0=casadi.rootfinder("balance", "newton", balance)(guess, begin),
        u=-(np.diff(current) / np.diff(time))[None, :],
    )
    read = casadi.Function("read", [system["x"], system["z"]], [first.voltage, first.temperature])
    voltage, temperature = read.map(time.size - 1)(found["xf"], found["zf"])
    branch = -np.ravel(found["zf"][-1, :])
    return {
        "current": current[1:],
        "voltage": np.ravel(voltage),
        "temperature": np.ravel(temperature),
        "branch_1": branch,
        "branch_2": current[1:] - branch,
    }


def _behaviour(time, shown, begin, end) -> Behaviour:
    rows = (time > begin) & (time <= end + EDGE_SECOND / 2)
    second = time[rows] - begin
    read = {name: partial(np.interp, xp=second, fp=shown[name][rows]) for name in shown}
    return Behaviour(
        duration_second=float(end - begin),
        branches=(read.pop("branch_1"), read.pop("branch_2")),
        **read,
    )
