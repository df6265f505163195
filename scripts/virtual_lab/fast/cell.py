"""A cell of the fast generator: what it is made of, and what is wrong with it."""

from typing import NamedTuple

import numpy as np

from virtual_lab.rating import Rating

Table = np.ndarray | float


class Cell(NamedTuple):
    """Parameters at 25 °C; tables over the state of charge (0 … 1, evenly spaced; or one number).

    With the defaults a cell is an open-circuit voltage, an ohmic resistance and RC pairs, the same
    at every temperature and as warm as its chamber. U is the open-circuit voltage, I the current
    (positive on charge), T the temperature of the core.

    Open circuit and charge
        rating : what its data sheet says.
        ocv_volt : table of U [V], at least 4 points; a smooth curve (spline) runs through them.
        capacity_ampere_hour : charge between state of charge 0 and 1 [Ah].
        capacity_per_kelvin : k of Q(T) = Q·(1 + k·(T - 25 °C)), T of the chamber [1/K]. ASSUME: the
            state of charge stays while Q moves.
        entropic_volt_per_kelvin : table of dU/dT [V/K].
        leak_ampere : current that no instrument sees: the cell gets I minus it [A].
        coulombic_efficiency : share of the charging current that is stored [1].

    Ohmic element
        r0_ohm, r0_factor : resistance [ohm] and its table over the state of charge [1].
        r0_activation_joule_per_mole : exp(E/R·(1/T - 1/298.15 K)) multiplies it.
        charge_asymmetry : (1 + a) multiplies it on charge [1].
        r0_drift_per_hour : (1 + d·hours since the test began) multiplies it [1/h].
        kinetic_share : share s of r0 that follows 2·I0·asinh(I / (2·I0)) instead of I [1]; its
            slope at zero current is that of a resistance. Where r0 moves with temperature or
            state of charge, I0 moves against it: the voltage 2·I0·s·r0 stays.
        exchange_current_ampere : I0 [A].

    RC pairs (any number; one entry per pair, activations and factors may be left empty)
        pair_r_ohm, pair_tau_second, pair_factor : r [ohm], tau [s], table of r over charge [1].
        pair_activation_joule_per_mole, pair_tau_activation_joule_per_mole : of r and of tau.

    Solid diffusion (see `diffusion`)
        warburg_r_ohm : its resistance to a steady current [ohm], 0: none.
        warburg_tau_second : length² over diffusivity [s].
        warburg_shape : "spherical" or "planar".
        warburg_factor, warburg_activation_joule_per_mole, warburg_tau_activation_joule_per_mole :
            as those of a pair.

    Hysteresis
        hysteresis_instant_volt : times the sign of the last current above C/100 [V].
        hysteresis_volt, hysteresis_per_soc : M [V] and g [1] of U + M·h, where
            dh = -g·|dsoc|·(h - sign of dsoc).

    Heat
        heat_capacity_joule_per_kelvin : of the whole cell [J/K]; 0: as warm as the chamber.
        core_resistance_kelvin_per_watt, surface_resistance_kelvin_per_watt : from the core to the
            surface, and from there to the chamber [K/W].
        rise_kelvin_per_watt, rise_tau_second : a rise of temperature that acts on resistances and
            time constants, and that no sensor shows [K/W, s].
        rise_activation_joule_per_mole : of all resistances by that rise alone, whatever the
            chamber's temperature does to them.
    """

    rating: Rating
    ocv_volt: np.ndarray
    capacity_ampere_hour: float
    r0_ohm: float
    pair_r_ohm: tuple[float, ...] = ()
    pair_tau_second: tuple[float, ...] = ()
    capacity_per_kelvin: float = 0.0
    entropic_volt_per_kelvin: Table = 0.0
    leak_ampere: float = 0.0
    coulombic_efficiency: float = 1.0
    r0_factor: Table = 1.0
    r0_activation_joule_per_mole: float = 0.0
    charge_asymmetry: float = 0.0
    r0_drift_per_hour: float = 0.0
    kinetic_share: float = 0.0
    exchange_current_ampere: float = 1.0
    pair_factor: tuple[Table, ...] = ()
    pair_activation_joule_per_mole: tuple[float, ...] = ()
    pair_tau_activation_joule_per_mole: tuple[float, ...] = ()
    warburg_r_ohm: float = 0.0
    warburg_tau_second: float = 0.0
    warburg_shape: str = "spherical"
    warburg_factor: Table = 1.0
    warburg_activation_joule_per_mole: float = 0.0
    warburg_tau_activation_joule_per_mole: float = 0.0
    hysteresis_instant_volt: float = 0.0
    hysteresis_volt: float = 0.0
    hysteresis_per_soc: float = 0.0
    heat_capacity_joule_per_kelvin: float = 0.0
    core_resistance_kelvin_per_watt: float = 0.0
    surface_resistance_kelvin_per_watt: float = 1.0
    rise_kelvin_per_watt: float = 0.0
    rise_tau_second: float = 0.0
    rise_activation_joule_per_mole: float = 0.0
