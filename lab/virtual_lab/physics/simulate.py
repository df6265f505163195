"""Protocols and spectra simulated by PyBaMM: one cell, and two cells in parallel.

For two cells PyBaMM gives the equations of each, Kirchhoff's laws join them, and CasADi's IDAS
solves all as one system: both branches (cell and wire) have one voltage at every instant.
"""

from functools import partial
from itertools import pairwise
from typing import NamedTuple

import casadi
import numpy as np
import pybamm

from virtual_lab.behaviour import Behaviour
from virtual_lab.chamber import Chamber, steady, temperature_at
from virtual_lab.instruments.chain import EARLY_SECOND
from virtual_lab.instruments.measurement import Columns
from virtual_lab.physics import Cell, porous
from virtual_lab.protocols import Step

TOLERANCE = 1e-6
KELVIN = "Volume-averaged cell temperature [K]"
FOREVER_SECOND = 1e9
SHORTEST_STRIDE_SECOND = 5.0


def run(
    steps: list[Step],
    cell: Cell,
    *,
    chamber: Chamber | None = None,
    ambient_celsius: float | None = None,
    initial_soc: float = 1.0,
) -> list[Behaviour]:
    """Simulate a rested cell in a protocol.

    Parameters
    ----------
    steps : what the cycler is told to do.
    cell : its parameters.
    chamber : temperature around the cell; it begins at that of the first instant.
    ambient_celsius : of a chamber that holds its temperature [°C], in place of `chamber`.
    initial_soc : state of charge at the start [1]; 1 is after a CCCV charge.

    Returns
    -------
    One behaviour per step.
    """
    around = steady(ambient_celsius) if chamber is None else chamber
    simulation = pybamm.Simulation(
        porous.model(cell),
        parameter_values=_parameters(cell, around, initial_soc),
        experiment=pybamm.Experiment([_instruction(step) for step in steps]),
        solver=pybamm.IDAKLUSolver(rtol=TOLERANCE, atol=TOLERANCE, options=_solver_options(around)),
    )
    solution = simulation.solve()
    full, drawn, behaviours = porous.full_charge_ampere_hour(cell), 0.0, []
    for cycle in solution.cycles:
        behaviours.append(_behaviour(cycle.steps[0], drawn, initial_soc, full))
        drawn = float(cycle.steps[0]["Discharge capacity [A.h]"].data[-1])
    return behaviours


def _parameters(cell, chamber, initial_soc):
    celsius = float(temperature_at(chamber, 0.0))
    values = porous.parameters(cell, ambient_celsius=celsius)
    # Not by solve(initial_soc=…): that would take the SoC between the branches of a hysteresis.
    values.set_initial_state(porous.window_soc(cell, initial_soc))
    if chamber.second.size > 1:
        # PyBaMM would go on along the last line; a chamber stays where it is.
        first, last = chamber.second[0] - FOREVER_SECOND, chamber.second[-1] + FOREVER_SECOND
        second = np.concatenate([[first], chamber.second, [last]])
        kelvin = np.pad(chamber.celsius + porous.ZERO_CELSIUS_KELVIN, 1, mode="edge")
        values["Ambient temperature [K]"] = lambda y, z, t: pybamm.Interpolant(second, kelvin, t)
    # A cell set to a state of charge got there by a discharge from full.
    if porous.has_hysteresis(cell) and initial_soc < 1:
        values["Initial hysteresis state in positive electrode"] = -1.0
    return values


def _solver_options(chamber) -> dict:
    """Longest internal step: at rest the solver would step over changes of the chamber."""
    if chamber.second.size == 1:
        return {}
    return {"dt_max": max(float(np.diff(chamber.second).min()) / 2, SHORTEST_STRIDE_SECOND)}


def _instruction(step: Step):
    """A step as PyBaMM takes it; its current is positive on discharge."""
    ends = []
    if step.until_volt is not None:
        # Only of a profile PyBaMM cannot tell from the current's sign which cut-off is meant.
        below = "< " if step.kind == "profile" else ""
        ends.append(f"{below}{step.until_volt} V")
    if step.until_ampere is not None:
        ends.append(f"{step.until_ampere} A")
    common = {"duration": step.duration_second, "termination": ends}
    if step.kind == "hold":
        return pybamm.step.voltage(step.value, **common)
    if step.kind == "profile":
        value = step.value * np.array([1.0, -1.0])
    elif step.value == 0.0:
        return pybamm.step.rest(duration=step.duration_second)
    else:
        value = -step.value
    return pybamm.step.current(value, **common)


def _behaviour(solution, drawn_before, initial_soc, full_ampere_hour) -> Behaviour:
    begin, end = solution.t[0], solution.t[-1]

    def quantity(name, sign=1.0, shift=0.0):
        variable = solution[name]

        def at(second):
            # PyBaMM gives a number for an array of one.
            shown = variable(np.minimum(begin + np.asarray(second), end))
            return sign * np.reshape(shown, np.shape(second)) + shift

        return at

    drawn = quantity("Discharge capacity [A.h]")
    return Behaviour(
        duration_second=float(end - begin),
        current=quantity("Current [A]", sign=-1.0),
        voltage=quantity("Voltage [V]"),
        temperature=quantity(KELVIN, shift=-porous.ZERO_CELSIUS_KELVIN),
        charge=lambda second: drawn_before - drawn(second),
        soc=lambda second: initial_soc - drawn(second) / full_ampere_hour,
    )


CURRENT = "Current function [A]"
EDGE_SECOND = 0.001
IDAS = {"abstol": TOLERANCE, "reltol": TOLERANCE, "max_num_steps": 100_000}


class Branch(NamedTuple):
    """Equations of one cell with its wire; the current is positive on discharge, as in PyBaMM.

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


def run_pair(
    steps: list[Step],
    cells: tuple[Cell, Cell],
    *,
    wire_ohm: tuple[float, float],
    initial_soc: tuple[float, float],
    ambient_celsius: float,
) -> list[Behaviour]:
    """Simulate two cells in parallel in a protocol of set currents.

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
    grids = [_pair_grid(step) for step in steps]
    begins = np.cumsum([0.0, *[step.duration_second for step in steps]])
    time = np.concatenate(
        [begin + second for begin, (second, _) in zip(begins, grids, strict=False)]
    )
    current = np.concatenate([ampere for _, ampere in grids])
    shown = _solve(branches, np.append(0.0, time), np.append(0.0, current))
    return [_pair_behaviour(time, shown, *ends) for ends in pairwise(begins)]


def _branch(cell, wire_ohm, soc, *, ambient_celsius) -> Branch:
    values = porous.parameters(cell, ambient_celsius=ambient_celsius)
    values[CURRENT] = "[input]"
    simulation = pybamm.Simulation(porous.model(cell), parameter_values=values)
    at_rest = {CURRENT: 0.0}
    simulation.build(initial_soc=porous.window_soc(cell, soc), inputs=at_rest)
    model = simulation.built_model
    x, z = casadi.MX.sym("x", model.len_rhs), casadi.MX.sym("z", model.len_alg)
    current = casadi.MX.sym("current")

    def symbolic(expression):
        return expression.to_casadi(casadi.MX(0), casadi.vertcat(x, z), inputs={CURRENT: current})

    begin = np.ravel(model.concatenated_initial_conditions.evaluate(inputs=at_rest))
    kelvin = model.get_processed_variable(KELVIN)
    return Branch(
        x, z, current,
        x_change=symbolic(model.concatenated_rhs),
        z_residual=symbolic(model.concatenated_algebraic),
        voltage=symbolic(model.get_processed_variable("Voltage [V]")) - wire_ohm * current,
        temperature=symbolic(kelvin) - porous.ZERO_CELSIUS_KELVIN,
        x_begin=begin[: model.len_rhs],
        z_begin=begin[model.len_rhs :],
    )  # fmt: skip


def _pair_grid(step):
    """Times [s] of one step at which it is solved, and its currents [A] there."""
    if step.kind == "profile":
        second, ampere = step.value.T
        return np.append(EDGE_SECOND, second[1:]), ampere
    regular = np.arange(step.period_second, step.duration_second, step.period_second)
    second = np.concatenate([[EDGE_SECOND], EARLY_SECOND, regular, [step.duration_second]])
    second = np.unique(second)
    return second, np.full(second.size, step.value)


def _system(branches) -> dict:
    """Equations of both cells joined by Kirchhoff's laws; `u` is the slope of the group's current.

    That current and the first branch's are states; all are positive on discharge.
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
    """Channels at time[1:] [s]; the current [A], positive on charge, is linear between points."""
    first, second = branches
    system = _system(branches)
    balance = {"x": system["z"], "p": system["x"], "g": system["alg"]}
    begin = np.concatenate([first.x_begin, second.x_begin, [0.0]])
    guess = np.concatenate([first.z_begin, second.z_begin, [0.0]])
    march = casadi.integrator("march", "idas", system, time[0], time[1:].tolist(), IDAS)
    solution = march(
        x0=begin,
        z0=casadi.rootfinder("balance", "newton", balance)(guess, begin),
        u=-(np.diff(current) / np.diff(time))[None, :],
    )
    read = casadi.Function("read", [system["x"], system["z"]], [first.voltage, first.temperature])
    voltage, temperature = read.map(time.size - 1)(solution["xf"], solution["zf"])
    branch = -np.ravel(solution["zf"][-1, :])
    return {
        "current": current[1:],
        "voltage": np.ravel(voltage),
        "temperature": np.ravel(temperature),
        "branch_1": branch,
        "branch_2": current[1:] - branch,
    }


def _pair_behaviour(time, shown, begin, end) -> Behaviour:
    rows = (time > begin) & (time <= end + EDGE_SECOND / 2)
    second = time[rows] - begin
    read = {name: partial(np.interp, xp=second, fp=shown[name][rows]) for name in shown}
    return Behaviour(
        duration_second=float(end - begin),
        branches=(read.pop("branch_1"), read.pop("branch_2")),
        **read,
    )


OHMIC_FREQUENCY_HERTZ = 1e6


def spectrum(cell: Cell, frequency_hertz: np.ndarray, *, ambient_celsius: float, soc: float):
    """Complex impedance [ohm] at each frequency [Hz]; capacitive arcs have a negative part."""
    simulation = pybamm.EISSimulation(
        porous.model(cell, hysteresis=False),
        parameter_values=porous.parameters(cell, ambient_celsius=ambient_celsius),
    )
    solution = simulation.solve(frequency_hertz, initial_soc=porous.window_soc(cell, soc))
    return np.asarray(solution.impedance)
