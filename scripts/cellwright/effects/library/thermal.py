"""Effects of the temperature, as measured and inside the cell."""

from functools import cache

import numpy as np

from cellwright.circuits.instrument import capacity_over_temperature
from cellwright.circuits.temperature import resistance_factor
from cellwright.effects.base import kept_response, relaxed, slow_volt, slowed
from cellwright.effects.library.quantities import fields_with
from cellwright.effects.library.resistance import KNOTS, at_knots, course_parameters
from cellwright.effects.library.sizes import (
    THIRDS,
    WARMED_CELSIUS,
    at_thirds,
    energy,
    with_minutes,
)
from cellwright.effects.library.vocabulary import Effect, Parameter, Tie, numbers_of, worded
from cellwright.numerics.lines import ZERO_CELSIUS_KELVIN
from cellwright.records.conditions import REFERENCE_CELSIUS

# ASSUME: In a cell that warms itself resistances fall with an activation energy of 30 kJ/mol. Data
# of one chamber temperature show only the product of this and the thermal resistance.
OWN_HEAT_JOULE_PER_MOLE = 30e3
# ASSUME: That energy is known within four tenths: resistances of real cells that were searched
# (docs/missing-effect.md) have 27 to 39 kJ/mol.
OWN_HEAT_RELATIVE = 0.4
COLD_CELSIUS = -20.0
WARMED, ENERGY = "resistance_temperature", "activation_energy_joule_per_mole"
MIDDLE_ENTROPY = "coefficient_volt_per_kelvin"  # at half charge


def _resistance(fields, stack, p):
    """Arrhenius, the polarisation with an energy of its own; in the cold the slope may grow.

    The ohmic resistance holds electrolyte (low energy) and charge transfer (high energy): their
    sum has an apparent energy that grows as it gets colder. A pair's capacitance hardly changes
    with temperature, so that its time constant grows as its resistance does. An exchange current
    falls as charge transfer's resistance grows: their product is the thermal voltage.
    """
    celsius, key = (fields.celsius,), (_resistance, *p.values())
    ohmic, exchange, slow, tau_factor = kept_response(
        stack, celsius, key, lambda: _resistance_factors(fields, p)
    )
    fields = fields._replace(r0=fields.r0 * ohmic, exchange_factor=exchange)
    return slowed(stack, fields, (slow, slow), tau_factor=tau_factor)


def _resistance_factors(fields, p):
    """Factors of the ohmic resistance, of exchange currents, of the polarisation and of its time
    constants (n,) [1]."""
    about = fields.celsius, REFERENCE_CELSIUS
    bend = 1.0 + p["growth_towards_cold"] * _cold(fields.celsius)
    energy = p[ENERGY] * bend
    ohmic = resistance_factor(*about, energy)
    slow = ohmic * resistance_factor(*about, p["polarisation_excess_joule_per_mole"])
    kelvin = fields.celsius + ZERO_CELSIUS_KELVIN
    exchange = kelvin / (REFERENCE_CELSIUS + ZERO_CELSIUS_KELVIN) / ohmic
    return ohmic, exchange, slow, slow ** p["time_constant_exponent"]


def _cold(celsius):
    """How far a temperature lies towards `COLD_CELSIUS`, where it is 1, from the reference [1]."""
    ends = (resistance_factor(c, REFERENCE_CELSIUS, 1.0) for c in (celsius, COLD_CELSIUS))
    at, cold = map(np.log, ends)
    return at / cold


def without_growth(p, celsius):
    """Parameters of a resistance over temperature, its energy the mean one between temperatures.

    Two temperatures tell no growth of the energy, and what is fitted for one goes astray beyond.

    Parameters
    ----------
    p : dict of its parameters by name. celsius : lowest and highest temperature [degC].
    """
    growth = p["growth_towards_cold"] * sum(map(_cold, celsius))
    energy = float(p[ENERGY] * (1.0 + growth))
    return p | {ENERGY: energy, "growth_towards_cold": 0.0}


def _self_heating(fields, stack, p):
    """Rise of the core over the measured temperature: a lag of the heat I·(V − OCV)."""
    heat = fields.current * (fields.r0 * fields.current + slow_volt(stack, fields))
    rise = p["thermal_resistance_kelvin_per_watt"] * relaxed(stack, heat, p["time_constant_second"])
    inside = fields.celsius + rise
    factor = resistance_factor(inside, fields.celsius, OWN_HEAT_JOULE_PER_MOLE)
    return slowed(stack, fields._replace(r0=fields.r0 * factor), (factor, factor))


def _own_heat_block(p, blocks):
    energy = {ENERGY: OWN_HEAT_JOULE_PER_MOLE}
    return blocks | {"own_heat": p | energy}


def _entropic(fields, stack, p):
    steps = {name: size for name, size in p.items() if name != MIDDLE_ENTROPY}
    grid, smooth = _smooth_course()
    slope = np.interp(fields.soc, grid, smooth @ (p[MIDDLE_ENTROPY] + at_knots(steps)))
    return fields._replace(ocv=fields.ocv + slope * (fields.celsius - REFERENCE_CELSIUS))


@cache
def _smooth_course():
    """SoC on a grid (n,), and a matrix (n, knots): a natural cubic spline through values at KNOTS.

    Straight lines between them miss a tenth of a coefficient that bends: at 20 K from the reference
    millivolts, for which the SoC at the start of the records would stand in.
    """
    from scipy.interpolate import CubicSpline  # its import takes longer than many a job

    grid = np.linspace(0.0, 1.0, 201)
    return grid, CubicSpline(KNOTS, np.eye(len(KNOTS)), bc_type="natural")(grid)


def _capacity(fields, stack, p):
    factor = capacity_over_temperature(fields.celsius, p["relative_per_kelvin"])
    return fields._replace(capacity=fields.capacity * factor)


def _ocv_per_kelvin(effect, p, values):
    warm, cold = (fields_with(effect, p, values, soc=THIRDS, celsius=c).ocv for c in (26.0, 25.0))
    return [(name, 1e3 * one, "mV/K") for name, one in zip(at_thirds(), warm - cold, strict=True)]


def _change_of_capacity(effect, p, values):
    """Between the temperatures fitted: a capacity falls in the cold and hardly rises in warmth."""
    low, high = values.get("fitted_celsius", WARMED_CELSIUS)
    cold, middle, warm = fields_with(effect, p, values, celsius=[low, 25.0, high]).capacity
    name = f"from {low:.0f} to {high:.0f} °C"
    return [(name, 100 * (warm - cold) / middle, "% of capacity")]


EFFECTS = worded(
    Effect(
        id=WARMED,
        parameters=(
            Parameter(ENERGY, "J/mol", 0.0, -2e4, 1.2e5, step=1e3, plausible=2e4),
            Parameter(
                *("polarisation_excess_joule_per_mole", "J/mol", 0.0, -6e4, 6e4),
                step=1e3,
                shape=True,
                prior_std=1.5e4,
            ),
            Parameter(
                "growth_towards_cold", "1", 0.0, -0.9, 3.0, step=0.02, shape=True, prior_std=0.3
            ),
            # Of the pairs' resistance factor: 1 where capacitances stay, 0 where time constants do.
            Parameter(
                "time_constant_exponent", "1", 1.0, 0.0, 2.0, step=0.02, shape=True, prior_std=0.5
            ),
        ),
        stage="resistance",
        act=_resistance,
        needs=("temperature",),
        asked_if_unseen=True,
        in_healthy_cells=True,
        bent_over_temperature=True,
        quantity="activation_energy",
        sizes_in_words=energy,
        sizes_need_model=True,
        of_branch=True,
        in_particle="temperature",
    ),
    Effect(
        id="self_heating",
        parameters=(
            Parameter(
                "thermal_resistance_kelvin_per_watt", "K/W", 0.0, 0.0, 60.0, step=0.2, plausible=5.0
            ),
            Parameter("time_constant_second", "s", 400.0, 60.0, 5000.0, step=20.0, shape=True),
        ),
        stage="resistance",
        act=_self_heating,
        blocks=_own_heat_block,
        starts=tuple({"time_constant_second": t} for t in (200.0, 500.0, 1500.0)),
        needs=("rates",),
        ties=(
            Tie(
                "resistance_temperature",
                "the same drive in a chamber 15 K colder or warmer",
                one_temperature=True,
            ),
        ),
        warms_core=True,
        quantity="core_rise",
        sizes_in_words=with_minutes("thermal_resistance_kelvin_per_watt", "K for each watt"),
        assumed_relative=(OWN_HEAT_RELATIVE, 0.0),
    ),
    Effect(
        id="entropic_ocv",
        parameters=(
            Parameter(MIDDLE_ENTROPY, "V/K", 0.0, -3e-3, 3e-3, step=2e-5, plausible=3e-4),
            # Lithiated electrodes order and disorder: from knot to knot the coefficient changes by
            # tenths of a millivolt (V. Viswanathan et al., J. Power Sources 195 (2010) 3720).
            *course_parameters("V/K", most=3e-3, step=2e-5, plausible=1e-4, prior_std=5e-4),
        ),
        stage="ocv",
        act=_entropic,
        needs=("temperature",),
        bent_over_temperature=True,
        quantity="ocv_per_kelvin",
        sizes_in_words=_ocv_per_kelvin,
        of_branch=True,
        in_particle="entropy",
    ),
    Effect(
        id="capacity_temperature",
        parameters=(
            Parameter("relative_per_kelvin", "1/K", 0.0, -0.01, 0.02, step=1e-4, plausible=2e-3),
        ),
        stage="counting",
        act=_capacity,
        blocks=numbers_of("counting", relative_per_kelvin="capacity_relative_per_kelvin"),
        needs=("temperature",),
        quantity="capacity_per_kelvin",
        sizes_in_words=_change_of_capacity,
        of_branch=True,
        in_particle="scale_temperature",
    ),
)
# A change of the energy that moves no time constant: of a cell never tested over temperature
# nothing is known there.
BESIDE = {p.name: p.neutral for one in EFFECTS if one.id == WARMED for p in one.parameters} | {
    "time_constant_exponent": 0.0
}
