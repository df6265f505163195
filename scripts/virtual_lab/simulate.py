"""Protocols walked through by a cell: steps → noise-free behaviour at any instant."""

import numpy as np
import pybamm

from virtual_lab import physics
from virtual_lab.behaviour import Behaviour
from virtual_lab.cells import Cell
from virtual_lab.chamber import Chamber, at, steady
from virtual_lab.protocols import Step

TOLERANCE = 1e-6
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
    """Take a rested cell through a protocol.

    Parameters
    ----------
    steps : what the cycler is told to do.
    cell : whose physics.
    chamber : temperature around the cell; it begins at that of the first instant.
    ambient_celsius : of a chamber that holds its temperature [°C], in place of `chamber`.
    initial_soc : state of charge at the start [1]; 1 is after a CCCV charge.

    Returns
    -------
    One behaviour per step.
    """
    around = steady(ambient_celsius) if chamber is None else chamber
    simulation = pybamm.Simulation(
        physics.model(cell),
        parameter_values=_parameters(cell, around, initial_soc),
        experiment=pybamm.Experiment([_instruction(step) for step in steps]),
        solver=pybamm.IDAKLUSolver(rtol=TOLERANCE, atol=TOLERANCE, options=_options(around)),
    )
    solution = simulation.solve()
    full = physics.full_charge_ampere_hour(cell)
    return _behaviours([cycle.steps[0] for cycle in solution.cycles], initial_soc, full)


def _parameters(cell, chamber, initial_soc):
    celsius = float(at(chamber, 0.0))
    values = physics.parameters(cell, ambient_celsius=celsius)
    # Set here and not by solve: that would count the soc between the branches of a hysteresis.
    values.set_initial_state(physics.window_soc(cell, initial_soc))
    if chamber.second.size > 1:
        kelvin = chamber.celsius + physics.ZERO_CELSIUS_KELVIN
        values["Ambient temperature [K]"] = _function_of_time(chamber.second, kelvin)
    # A cell set to a state of charge got there by a discharge from full.
    if cell.chemistry == "LFP" and initial_soc < 1:
        values["Initial hysteresis state in positive electrode"] = -1.0
    return values


def _function_of_time(second, kelvin):
    # PyBaMM would go on along the last line; a chamber stays where it is.
    second = np.concatenate([[second[0] - FOREVER_SECOND], second, [second[-1] + FOREVER_SECOND]])
    kelvin = np.concatenate([kelvin[:1], kelvin, kelvin[-1:]])
    return lambda y, z, t: pybamm.Interpolant(second, kelvin, t)


def _options(chamber) -> dict:
    """A rested cell lets the solver stride far: never over a line of the chamber unseen."""
    if chamber.second.size == 1:
        return {}
    return {"dt_max": max(float(np.diff(chamber.second).min()) / 2, SHORTEST_STRIDE_SECOND)}


def _instruction(step: Step):
    """PyBaMM's step; its current is positive on discharge."""
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


def _behaviours(solutions, initial_soc, full_ampere_hour):
    drawn_before, behaviours = 0.0, []
    for solution in solutions:
        behaviours.append(_behaviour(solution, drawn_before, initial_soc, full_ampere_hour))
        drawn_before = float(solution["Discharge capacity [A.h]"].data[-1])
    return behaviours


def _behaviour(solution, drawn_before, initial_soc, full_ampere_hour) -> Behaviour:
    begin, end = solution.t[0], solution.t[-1]

    def quantity(name, sign=1.0, shift=0.0):
        found = solution[name]

        def at(second):
            # PyBaMM gives a number where it is asked for an array of one.
            shown = found(np.minimum(begin + np.asarray(second), end))
            return sign * np.reshape(shown, np.shape(second)) + shift

        return at

    drawn = quantity("Discharge capacity [A.h]")
    return Behaviour(
        duration_second=float(end - begin),
        current=quantity("Current [A]", sign=-1.0),
        voltage=quantity("Voltage [V]"),
        temperature=quantity(
            "Volume-averaged cell temperature [K]", shift=-physics.ZERO_CELSIUS_KELVIN
        ),
        charge=lambda second: drawn_before - drawn(second),
        soc=lambda second: initial_soc - drawn(second) / full_ampere_hour,
    )
