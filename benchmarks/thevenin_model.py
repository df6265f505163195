"""The cell of these benchmarks as PyBaMM's Thevenin model; discharge positive there."""

import cell
import numpy as np


def values(time, current, initial_soc):
    """Parameter values of PyBaMM's Thevenin model with two RC elements."""
    import pybamm

    def over_soc(curve, name):
        return lambda *inputs: pybamm.Interpolant(cell.GRID, curve, inputs[-1], name=name)

    found = pybamm.ParameterValues("ECM_Example")
    r1, r2 = cell.R
    found.update(
        {
            "Cell capacity [A.h]": cell.CAPACITY_AMPERE_HOUR,
            "Nominal cell capacity [A.h]": cell.CAPACITY_AMPERE_HOUR,
            "Initial SoC": initial_soc,
            "Upper voltage cut-off [V]": 10.0,
            "Lower voltage cut-off [V]": 0.0,
            "Current function [A]": pybamm.Interpolant(time, -current, pybamm.t),
            "Open-circuit voltage [V]": over_soc(cell.OCV, "ocv"),
            "R0 [Ohm]": over_soc(cell.R0, "r0"),
            "R1 [Ohm]": over_soc(r1, "r1"),
            "R2 [Ohm]": over_soc(r2, "r2"),
            "C1 [F]": over_soc(cell.TAU[0] / r1, "c1"),
            "C2 [F]": over_soc(cell.TAU[1] / r2, "c2"),
            "Entropic change [V/K]": 0.0,
            "Element-1 initial overpotential [V]": 0.0,
            "Element-2 initial overpotential [V]": 0.0,
        },
        check_already_exists=False,
    )
    return found


def prepared(time, current, initial_soc):
    """A function that solves the built model: neither building nor compiling is timed."""
    import pybamm

    model = pybamm.equivalent_circuit.Thevenin(options={"number of rc elements": 2})
    solver = pybamm.IDAKLUSolver(rtol=1e-6, atol=1e-8)
    parameters = values(time, current, initial_soc)
    simulation = pybamm.Simulation(model, parameter_values=parameters, solver=solver)
    simulation.build()

    def run():
        solution = simulation.solve(t_eval=[time[0], time[-1]], t_interp=time)
        return np.asarray(solution["Voltage [V]"].entries)

    return run
