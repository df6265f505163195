"""PyBaMM's model and parameters of a cell: five chemistries, any data sheet, fresh or aged.

"NMC" is the LG M50 of Chen et al. 2020 with the temperature dependence of O'Kane et al. 2022. The
others have the same can, electrolyte (Nyman et al. 2008, activation energies of Ecker et al.
2015), separator and collectors; their electrodes (see MATERIALS) are published ones, balanced and
sized by `electrodes`, whose potentials they have.

The single-particle model with electrolyte (SPMe) stays within 0.7 mV (root mean square) of the
Doyle-Fuller-Newman model on the hard drive of the demo (NMC), at a fifth of its cost.
"""

import warnings
from functools import cache
from typing import NamedTuple

import numpy as np
import pybamm

from virtual_lab import electrodes, physics
from virtual_lab.behaviour import Rating
from virtual_lab.electrodes import HALF_CELLS

FARADAY_COULOMB = 96485.33212
GAS_CONSTANT = 8.314462618
REFERENCE_KELVIN = 298.15
# Activation energies [J/mol] added to those of OKane2022, so that the sum is what Ecker et al.
# (J. Electrochem. Soc. 162, 2015, A1836) measured for kinetics (53.4 and 43.6 kJ/mol) and near
# to what they measured for diffusion. With the set alone a cell hardly feels the cold.
ADDED_ACTIVATION_ENERGY = {
    "Negative electrode exchange-current density [A.m-2]": 18_400.0,
    "Positive electrode exchange-current density [A.m-2]": 25_800.0,
    "Negative particle diffusivity [m2.s-1]": 10_000.0,
    "Positive particle diffusivity [m2.s-1]": 15_000.0,
}
KINETICS = [name for name in ADDED_ACTIVATION_ENERGY if "exchange-current" in name]
# OKane2022 holds the measured points of this curve, with their noise: dQ/dV would drown in it.
# Chen2020 holds the smooth function fitted to the same points.
GRAPHITE_OCP = "Negative electrode OCP [V]"
# Double layer per volume of electrode [F/m³], as in the LG M50's positive one. ASSUME: the same in
# all; 0.2 F/m² on the surface of LFP's fine particles would hold half a percent of the charge.
DOUBLE_LAYER = 0.2 * 3 * 0.665 / 5.22e-6


class Material(NamedTuple):
    """A porous electrode; activation energies [J/mol] by Arrhenius from 25 °C.

    `rate` [A/m² (m³/mol)^1.5] times √(c_e·c_s·(c_max − c_s)) is the exchange-current density.
    """

    most_mole_per_cubic_metre: float
    radius_metre: float
    diffusivity_square_metre_per_second: float
    diffusion_joule_per_mole: float
    rate: float
    kinetic_joule_per_mole: float
    active_share: float
    porosity: float


# Graphite has Ecker's energies (2015) throughout. Positive materials and the rest:
# LFP: Prada et al. 2013 (PyBaMM's set) with the graphite of the LG M50, whose potential it has.
#   ASSUME: that is four times as fast (a 2.3 Ah power cell has about 12 mΩ); LFP diffuses with
#   the energy of its kinetics.
# LMO: concentrations, radius, diffusivity of Doyle et al. 1996. ASSUME: a coating of an EV cell
#   (90 µm, half of it active). Kinetics of both electrodes from the thesis' table 3.1:
#   70 kJ/mol, and rates that give a 32 Ah cell its 0.65 mΩ at 50 % and 20 °C.
# LCO: Marquis et al. 2019.
# NCA: Kim et al. 2011, exchange current 4 A/m² at y = 0.41. ASSUME: graphite as in the LG M50
#   (Kim's 0.5 µm belong to a cell for power), energies of Ecker's positive electrode.
MATERIALS = {
    "LFP": (
        Material(33133.0, 5.86e-6, 3.3e-14, 40_300.0, 2.6e-6, 53_400.0, 0.58, 0.36),
        Material(22806.0, 5e-8, 5.9e-18, 39_570.0, 6e-7, 39_570.0, 0.374, 0.426),
        80e-6,
    ),
    "LMO": (
        Material(26390.0, 8e-6, 3.9e-14, 40_300.0, 7.5e-6, 70_000.0, 0.55, 0.36),
        Material(22860.0, 8.5e-6, 1e-13, 35_000.0, 7.5e-6, 70_000.0, 0.50, 0.35),
        90e-6,
    ),
    "LCO": (
        Material(24983.0, 1e-5, 3.9e-14, 42_770.0, 2e-5, 53_400.0, 0.60, 0.30),
        Material(51218.0, 1e-5, 1e-13, 18_550.0, 6e-7, 39_570.0, 0.50, 0.30),
        100e-6,
    ),
    "NCA": (
        Material(33133.0, 5.86e-6, 3.3e-14, 40_300.0, 6.48e-7, 53_400.0, 0.58, 0.36),
        Material(49000.0, 1.633e-6, 3e-15, 40_000.0, 4.8e-6, 43_600.0, 0.41, 0.40),
        50e-6,
    ),
}


@cache
def fresh_parameters(chemistry: str, rating: Rating) -> pybamm.ParameterValues:
    """Parameters of a fresh cell by PyBaMM's names; take a copy before changing any."""
    values = _lg_m50()
    values.update(
        {
            "Nominal cell capacity [A.h]": rating.capacity_ampere_hour,
            # The protocols end at the cut-offs; beyond these limits the model is not valid.
            "Lower voltage cut-off [V]": round(rating.lower_cutoff_volt - 0.5, 3),
            "Upper voltage cut-off [V]": round(rating.upper_cutoff_volt + 0.4, 3),
            "Open-circuit voltage at 0% SOC [V]": rating.lower_cutoff_volt,
            "Open-circuit voltage at 100% SOC [V]": rating.upper_cutoff_volt,
        }
    )
    if chemistry != "NMC":
        _put_materials(values, chemistry)
    _put_size(values, chemistry, rating)
    if chemistry == "LFP":
        _put_hysteresis(values)
    return values


def entropic(chemistry: str, share: float) -> dict:
    """Entropic coefficients of both electrodes, as PyBaMM takes them, times a share [1]."""

    def shared(material):
        return lambda sto: share * HALF_CELLS[material].entropic_volt_per_kelvin(sto)

    design = electrodes.CHEMISTRIES[chemistry]
    return {
        "Negative electrode OCP entropic change [V.K-1]": shared(design.negative),
        "Positive electrode OCP entropic change [V.K-1]": shared(design.positive),
    }


def _lg_m50():
    values = pybamm.ParameterValues("OKane2022")
    values[GRAPHITE_OCP] = pybamm.ParameterValues("Chen2020")[GRAPHITE_OCP]
    for name, energy in ADDED_ACTIVATION_ENERGY.items():
        values[name] = steeper(values[name], energy)
    values["Total heat transfer coefficient [W.m-2.K-1]"] = 20.0
    values.update({"Contact resistance [Ohm]": 0.0}, check_already_exists=False)
    return values


def _put_materials(values, chemistry):
    design = electrodes.CHEMISTRIES[chemistry]
    negative, positive, thickness_metre = MATERIALS[chemistry]
    values["Positive electrode thickness [m]"] = thickness_metre
    for side, name, material in (
        ("Negative", design.negative, negative),
        ("Positive", design.positive, positive),
    ):
        values[f"{side} electrode OCP [V]"] = HALF_CELLS[name].potential_volt
        values.update(_by_pybamm_names(side, material))


def _by_pybamm_names(side, material):
    def diffusivity(sto, T):
        energy = material.diffusion_joule_per_mole
        return material.diffusivity_square_metre_per_second * arrhenius(energy, T)

    def exchange(c_e, c_s, c_max, T):
        occupied = c_e**0.5 * c_s**0.5 * (c_max - c_s) ** 0.5
        return material.rate * occupied * arrhenius(material.kinetic_joule_per_mole, T)

    most = f"Maximum concentration in {side.lower()} electrode [mol.m-3]"
    surface_per_metre = 3 * material.active_share / material.radius_metre
    return {
        f"{side} electrode double-layer capacity [F.m-2]": DOUBLE_LAYER / surface_per_metre,
        most: material.most_mole_per_cubic_metre,
        f"{side} particle radius [m]": material.radius_metre,
        f"{side} electrode active material volume fraction": material.active_share,
        f"{side} electrode porosity": material.porosity,
        f"{side} particle diffusivity [m2.s-1]": diffusivity,
        f"{side} electrode exchange-current density [A.m-2]": exchange,
    }


def arrhenius(energy, temperature):
    """Factor [1] of an activation energy [J/mol] at a temperature [K], 1 at 25 °C."""
    return pybamm.exp(energy / GAS_CONSTANT * (1 / REFERENCE_KELVIN - 1 / temperature))


def steeper(function, energy):
    """The same function of (…, temperature) with an activation energy [J/mol] added."""
    if function.__code__.co_argcount == 2:
        return lambda sto, T: function(sto, T) * arrhenius(energy, T)
    return lambda c_e, c_s, c_max, T: function(c_e, c_s, c_max, T) * arrhenius(energy, T)


def scaled(function, factor: float):
    """An exchange-current density times a factor [1]."""
    return lambda c_e, c_s, c_max, T: factor * function(c_e, c_s, c_max, T)


def _put_hysteresis(values):
    """Two branches of LFP's potential about its middle, into PyBaMM's values."""
    middle, half_gap = values["Positive electrode OCP [V]"], physics.LFP_HALF_GAP_VOLT
    new = {
        "Positive electrode lithiation OCP [V]": lambda sto: middle(sto) - half_gap,
        "Positive electrode delithiation OCP [V]": lambda sto: middle(sto) + half_gap,
        "Positive particle lithiation hysteresis decay rate": physics.LFP_DECAY,
        "Positive particle delithiation hysteresis decay rate": physics.LFP_DECAY,
        "Initial hysteresis state in positive electrode": 1.0,
    }
    values.update(new, check_already_exists=False)


def _put_size(values, chemistry, rating):
    """Set area and thickness of the electrodes by the charges that they must hold."""
    window = electrodes.window(chemistry, rating)
    # The area follows from the positive electrode, the thickness of the negative one from its own.
    scale = window.positive_ampere_hour / _ampere_hour(values, "Positive")
    # The demo's cell keeps PyBaMM's own numbers: the balance was solved from them.
    if abs(scale - 1) < 1e-9:
        return
    for side, share in (("negative", window.x_100), ("positive", window.y_100)):
        most = values[f"Maximum concentration in {side} electrode [mol.m-3]"]
        values[f"Initial concentration in {side} electrode [mol.m-3]"] = share * most
    values["Electrode width [m]"] *= scale
    values["Negative electrode thickness [m]"] *= window.negative_ampere_hour / _ampere_hour(
        values, "Negative"
    )
    # A can of the same shape: its surface grows with the power 2/3 of what is in it.
    grown = rating.capacity_ampere_hour / 5.0
    values["Cell volume [m3]"] *= grown
    values["Cell cooling surface area [m2]"] *= grown ** (2 / 3)


def _ampere_hour(values, side):
    share = values[f"{side} electrode active material volume fraction"]
    most = values[f"Maximum concentration in {side.lower()} electrode [mol.m-3]"]
    metre = values[f"{side} electrode thickness [m]"]
    area = values["Electrode width [m]"] * values["Electrode height [m]"]
    return share * most * metre * area * FARADAY_COULOMB / 3600


# A note about an older PyBaMM that does not apply here; it would appear for every LFP cell.
warnings.filterwarnings("ignore", message="The definition of the hysteresis decay rate")

ZERO_CELSIUS_KELVIN = 273.15
OPTIONS = {"thermal": "lumped", "contact resistance": "true", "surface form": "differential"}
HYSTERESIS = {"open-circuit potential": ("single", "one-state hysteresis")}


def model(cell: physics.Cell, *, hysteresis: bool = True):
    """PyBaMM's model of a cell, with double layers (charge transfer takes time).

    `hysteresis`: where a cell has it; small signals about rest stay on one branch, so spectra go
    without.
    """
    branches = HYSTERESIS if hysteresis and has_hysteresis(cell) else {}
    return pybamm.lithium_ion.SPMe(OPTIONS | branches)


def has_hysteresis(cell: physics.Cell) -> bool:
    """Whether the positive electrode's potential has two branches."""
    return cell.chemistry == "LFP"


def parameters(cell: physics.Cell, *, ambient_celsius: float) -> pybamm.ParameterValues:
    """PyBaMM's parameters of a cell in a chamber [°C]; it begins rested at the upper cut-off."""
    values = _with_losses(cell)
    ends = _balance(values, cell)
    for side, lithiation in (("negative", ends["x_100"]), ("positive", ends["y_100"])):
        most = values[f"Maximum concentration in {side} electrode [mol.m-3]"]
        values[f"Initial concentration in {side} electrode [mol.m-3]"] = lithiation * most
    kelvin = ambient_celsius + ZERO_CELSIUS_KELVIN
    values.update({"Ambient temperature [K]": kelvin, "Initial temperature [K]": kelvin})
    return values


def stoichiometry(cell: physics.Cell) -> dict[str, float]:
    """Lithiation x, y at both ends of the voltage window (x_0, x_100, …), and charges [Ah]."""
    return _balance(_with_losses(cell), cell)


def open_circuit_volt(cell: physics.Cell, discharged_ampere_hour: np.ndarray) -> np.ndarray:
    """Equilibrium voltage [V] at 25 °C after a discharge [Ah] of the full cell."""
    values, ends = _with_losses(cell), stoichiometry(cell)
    x = ends["x_100"] - discharged_ampere_hour / ends["Q_n"]
    y = ends["y_100"] + discharged_ampere_hour / ends["Q_p"]
    positive, negative = (values[f"{side} electrode OCP [V]"] for side in ("Positive", "Negative"))
    volt = positive(pybamm.Vector(y)) - negative(pybamm.Vector(x))
    return volt.evaluate().ravel()


@cache
def full_charge_ampere_hour(cell: physics.Cell) -> float:
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


def window_soc(cell: physics.Cell, soc: float) -> float:
    """State of charge [1] of the window between the cut-offs at rest, from the laboratory's SoC."""
    return soc * full_charge_ampere_hour(cell) / stoichiometry(cell)["Q"]


def rested_volt(cell: physics.Cell, soc: np.ndarray) -> np.ndarray:
    """Open-circuit voltage [V] at 25 °C over the laboratory's state of charge [1]."""
    remaining = np.asarray(soc) * full_charge_ampere_hour(cell)
    return open_circuit_volt(cell, stoichiometry(cell)["Q"] - remaining)


def soc_at(cell: physics.Cell, volt: float) -> float:
    """State of charge [1] at which a rested cell has a voltage [V] at 25 °C."""
    soc = np.linspace(0.0, 1.0, 2001)
    return float(np.interp(volt, rested_volt(cell, soc), soc))


def _with_losses(cell):
    values = fresh_parameters(cell.chemistry, cell.rating).copy()
    kept = {"Negative": 1 - cell.lam_negative, "Positive": 1 - cell.lam_positive}
    for side, fraction in kept.items():
        values[f"{side} electrode active material volume fraction"] *= fraction
    for name in KINETICS:
        values[name] = scaled(values[name], cell.kinetics)
    values["Contact resistance [Ohm]"] = cell.contact_resistance_ohm
    if cell.entropy:
        values.update(entropic(cell.chemistry, cell.entropy))
    return values


def _balance(values, cell):
    """Lithiation of the two electrodes at both cut-offs with a part of the lithium lost."""
    symbols = pybamm.LithiumIonParameters()
    fresh = fresh_parameters(cell.chemistry, cell.rating)
    charges = {
        "Q_Li": fresh.evaluate(symbols.Q_Li_particles_init) * (1 - cell.lli),
        "Q_n": values.evaluate(symbols.n.Q_init),
        "Q_p": values.evaluate(symbols.p.Q_init),
    }
    solver = pybamm.lithium_ion.ElectrodeSOHSolver(values, symbols)
    return {name: float(value) for name, value in solver.solve(charges).items()}
