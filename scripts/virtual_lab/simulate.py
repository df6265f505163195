"""Protocols walked through by a cell: steps → noise-free behaviour at any instant."""

import numpy as np
import pybamm

from virtual_lab import physics
from virtual_lab.behaviour import Behaviour
from virtual_lab.cells import Cell
from virtual_lab.protocols import Step

TOLERANCE = 1e-6


def run(
    steps: list[Step], cell: Cell, *, ambient_celsius: float, initial_soc: float = 1.0
) -> list[Behaviour]:
    """Take a rested cell through a protocol.

    Parameters
    ----------
    steps : what the cycler is told to do.
    cell : whose physics.
    ambient_celsius : chamber temperature [°C].
    initial_soc : state of charge at the start [1]; 1 is after a CCCV charge.

    Returns
    -------
    One behaviour per step.
    """
    simulation = pybamm.Simulation(
        physics.model(),
        parameter_values=physics.parameters(cell, ambient_celsius=ambient_celsius),
        experiment=pybamm.Experiment([_instruction(step) for step in steps]),
        solver=pybamm.IDAKLUSolver(rtol=TOLERANCE, atol=TOLERANCE),
    )
    solution = simulation.solve(initial_soc=physics.window_soc(cell, initial_soc))
    return [_behaviour(cycle.steps[0]) for cycle in solution.cycles]


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


def _behaviour(solution) -> Behaviour:
    begin = solution.t[0]

    def quantity(name, sign=1.0, shift=0.0):
        found = solution[name]
        return lambda second: sign * found(begin + np.asarray(second)) + shift

    return Behaviour(
        duration_second=float(solution.t[-1] - begin),
        current=quantity("Current [A]", sign=-1.0),
        voltage=quantity("Voltage [V]"),
        temperature=quantity(
            "Volume-averaged cell temperature [K]", shift=-physics.ZERO_CELSIUS_KELVIN
        ),
    )
