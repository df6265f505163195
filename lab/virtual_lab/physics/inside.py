"""What a cell has beyond its type's physics (`physics.Inside`), put into PyBaMM's parameters.

Also the ways in which PyBaMM's parameter functions are multiplied and made to follow temperature.
"""

import pybamm

from virtual_lab.physics import Inside

GAS_CONSTANT = 8.314462618
REFERENCE_KELVIN = 298.15
SIDES = ("Negative", "Positive")
# ASSUME: the can of a 21700 (20 g of steel) with the outer windings, which follow its temperature.
CAN_JOULE_PER_KELVIN = 15.0


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


def put_hysteresis(values, *, half_gap_volt: float, decay: float) -> None:
    """Two branches of the positive electrode's potential about its middle, into PyBaMM's values.

    Parameters
    ----------
    values : pybamm.ParameterValues, changed. half_gap_volt : of either branch from the middle [V].
    decay : of the way to the other branch, per lithiation [1].
    """
    middle = values["Positive electrode OCP [V]"]
    new = {
        "Positive electrode lithiation OCP [V]": lambda sto: middle(sto) - half_gap_volt,
        "Positive electrode delithiation OCP [V]": lambda sto: middle(sto) + half_gap_volt,
        "Positive particle lithiation hysteresis decay rate": decay,
        "Positive particle delithiation hysteresis decay rate": decay,
        "Initial hysteresis state in positive electrode": 1.0,
    }
    values.update(new, check_already_exists=False)


def options(inside: Inside) -> dict[str, str]:
    """Further options of PyBaMM's models that a cell needs."""
    return {"surface temperature": "lumped"} if inside.core_kelvin_per_watt else {}


def sensor_kelvin(inside: Inside) -> str:
    """PyBaMM's variable that the temperature sensor on the can shows."""
    if inside.core_kelvin_per_watt:
        return "Surface temperature [K]"
    return "Volume-averaged cell temperature [K]"


def put(values, inside: Inside) -> None:
    """Change PyBaMM's values of a cell as said.

    Parameters
    ----------
    values : pybamm.ParameterValues, changed. inside : what the cell has.
    """
    values["Total heat transfer coefficient [W.m-2.K-1]"] *= inside.cooling
    for side, factor in zip(
        SIDES, (inside.diffusivity_negative, inside.diffusivity_positive), strict=True
    ):
        if factor != 1.0:
            name = f"{side} particle diffusivity [m2.s-1]"
            values[name] = _slower(values[name], factor)
    if inside.kinetics_joule_per_mole:
        for side in SIDES:
            name = f"{side} electrode exchange-current density [A.m-2]"
            values[name] = steeper(values[name], inside.kinetics_joule_per_mole)
    if inside.kinetics_per_lithiation:
        name = "Negative electrode exchange-current density [A.m-2]"
        values[name] = _over_lithiation(values[name], inside.kinetics_per_lithiation)
    if inside.hysteresis_volt:
        put_hysteresis(values, half_gap_volt=inside.hysteresis_volt, decay=inside.hysteresis_decay)
    if inside.core_kelvin_per_watt:
        _put_two_temperatures(values, inside.core_kelvin_per_watt)


def _slower(function, factor):
    return lambda sto, T: factor * function(sto, T)


def _over_lithiation(function, slope):
    def exchange(c_e, c_s, c_max, T):
        return function(c_e, c_s, c_max, T) * pybamm.exp(slope * (c_s / c_max - 0.5))

    return exchange


def _put_two_temperatures(values, core_kelvin_per_watt):
    """The chamber cools the can as it cooled the cell; the electrodes are cooled by the can."""
    area = values["Cell cooling surface area [m2]"]
    cooled = values["Total heat transfer coefficient [W.m-2.K-1]"] * area
    new = {
        "Total heat transfer coefficient [W.m-2.K-1]": 1 / (core_kelvin_per_watt * area),
        "Environment thermal resistance [K.W-1]": 1 / cooled,
        "Casing heat capacity [J.K-1]": CAN_JOULE_PER_KELVIN,
    }
    values.update(new, check_already_exists=False)
