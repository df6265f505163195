"""Porous-electrode cells solved by PyBaMM: single particles with electrolyte, lumped heat.

The single-particle model with electrolyte (SPMe) stays within 0.7 mV (root mean square) of the
Doyle-Fuller-Newman model on the hard drive of the demo (NMC), at a fifth of its cost.
"""

import warnings
from functools import cache

import numpy as np

from virtual_lab import cells, chemistries  # sets PyBaMM's environment before PyBaMM is loaded

# isort: split
import pybamm

# A note on an older PyBaMM, of no meaning here, told for every LFP cell.
warnings.filterwarnings("ignore", message="The definition of the hysteresis decay rate")

ZERO_CELSIUS_KELVIN = 273.15
OPTIONS = {"thermal": "lumped", "contact resistance": "true", "surface form": "differential"}
HYSTERESIS = {"open-circuit potential": ("single", "one-state hysteresis")}


def model(cell: cells.Cell, *, hysteresis: bool = True):
    """The physics of a cell, with double layers (charge transfer takes time).

    `cell.equations`: SPM (single particles), SPMe (with the electrolyte) or DFN (whole electrodes).
    `hysteresis`: of LFP; small signals about rest stay on one branch, so spectra go without.
    """
    branches = HYSTERESIS if hysteresis and cell.chemistry == "LFP" else {}
    return getattr(pybamm.lithium_ion, cell.equations)(OPTIONS | branches)


def parameters(cell: cells.Cell, *, ambient_celsius: float) -> pybamm.ParameterValues:
    """Parameters of a cell in a chamber; it begins rested at the upper cut-off.

    Parameters
    ----------
    cell : what sets the cell apart.
    ambient_celsius : chamber temperature [°C].

    Returns
    -------
    PyBaMM parameter values.
    """
    values = _aged(cell)
    kelvin = ambient_celsius + ZERO_CELSIUS_KELVIN
    values.update({"Ambient temperature [K]": kelvin, "Initial temperature [K]": kelvin})
    return values


def stoichiometry(cell: cells.Cell) -> dict[str, float]:
    """Electrode state at both ends of the voltage window: x_0, x_100, y_0, y_100, Q and others."""
    return _balance(_with_losses(cell), cell)


def open_circuit_volt(cell: cells.Cell, discharged_ampere_hour: np.ndarray) -> np.ndarray:
    """Equilibrium voltage [V] at 25 °C after a charge [Ah] has been taken from the full cell."""
    values, ends = _with_losses(cell), stoichiometry(cell)
    x = ends["x_100"] - discharged_ampere_hour / ends["Q_n"]
    y = ends["y_100"] + discharged_ampere_hour / ends["Q_p"]
    positive, negative = (values[f"{side} electrode OCP [V]"] for side in ("Positive", "Negative"))
    volt = positive(pybamm.Vector(y)) - negative(pybamm.Vector(x))
    return volt.evaluate().ravel()


@cache
def full_charge_ampere_hour(cell: cells.Cell) -> float:
    """Charge [Ah] above the lower cut-off (at rest) after a C/2 CCCV charge to C/20 at 25 °C.

    A little less than the whole window, and what a laboratory calls 100 %.
    """
    upper = cell.rating.upper_cutoff_volt
    charge = [f"Charge at C/2 until {upper} V", f"Hold at {upper} V until C/20"]
    values = parameters(cell, ambient_celsius=25)
    values.set_initial_state(0.5)
    simulation = pybamm.Simulation(
        model(cell), parameter_values=values, experiment=pybamm.Experiment(charge)
    )
    solution = simulation.solve()
    return stoichiometry(cell)["Q"] / 2 - solution["Discharge capacity [A.h]"].data[-1]


def window_soc(cell: cells.Cell, soc: float) -> float:
    """State of charge of the window between the cut-offs at rest, from the laboratory's."""
    return soc * full_charge_ampere_hour(cell) / stoichiometry(cell)["Q"]


def rested_volt(cell: cells.Cell, soc: np.ndarray) -> np.ndarray:
    """Open-circuit voltage [V] at 25 °C over the laboratory's state of charge [1]."""
    left = np.asarray(soc) * full_charge_ampere_hour(cell)
    return open_circuit_volt(cell, stoichiometry(cell)["Q"] - left)


def soc_at(cell: cells.Cell, volt: float) -> float:
    """State of charge [1] of a rested cell that shows a voltage [V] at 25 °C."""
    soc = np.linspace(0.0, 1.0, 2001)
    return float(np.interp(volt, rested_volt(cell, soc), soc))


def _with_losses(cell):
    values = chemistries.fresh(cell.chemistry, cell.rating).copy()
    kept = {"Negative": 1 - cell.lam_negative, "Positive": 1 - cell.lam_positive}
    for side, fraction in kept.items():
        values[f"{side} electrode active material volume fraction"] *= fraction
    for name in chemistries.KINETICS:
        values[name] = chemistries.scaled(values[name], cell.kinetics)
    values["Contact resistance [Ohm]"] = cell.contact_resistance_ohm
    if cell.entropy:
        values.update(chemistries.entropic(cell.chemistry, cell.entropy))
    return values


def _balance(values, cell):
    """Where the two electrodes stand against each other with a part of the lithium lost."""
    symbols = pybamm.LithiumIonParameters()
    fresh = chemistries.fresh(cell.chemistry, cell.rating)
    known = {
        "Q_Li": fresh.evaluate(symbols.Q_Li_particles_init) * (1 - cell.lli),
        "Q_n": values.evaluate(symbols.n.Q_init),
        "Q_p": values.evaluate(symbols.p.Q_init),
    }
    solver = pybamm.lithium_ion.ElectrodeSOHSolver(values, symbols)
    return {name: float(value) for name, value in solver.solve(known).items()}


def _aged(cell):
    values = _with_losses(cell)
    ends = _balance(values, cell)
    for side, fraction in (("negative", ends["x_100"]), ("positive", ends["y_100"])):
        most = values[f"Maximum concentration in {side} electrode [mol.m-3]"]
        values[f"Initial concentration in {side} electrode [mol.m-3]"] = fraction * most
    return values
