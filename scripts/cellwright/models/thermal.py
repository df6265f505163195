"""Lumped thermal state of a cell: one temperature, warmed by its losses, cooled to its ambient."""

from typing import NamedTuple

import numpy as np

from cellwright.models.kernels import lag
from cellwright.models.lookup import Simulated, simulate_model
from cellwright.models.tables import ZERO_CELSIUS_KELVIN
from cellwright.refusal import Refusal


class Warmed(NamedTuple):
    """A simulated record with the temperature that its own heat gives it; (n,) each.

    passes : how often voltage and temperature were computed until both agreed.
    """

    simulated: Simulated
    temperature_celsius: np.ndarray
    heat_watt: np.ndarray
    passes: int


def heat(
    current_ampere,
    voltage_volt,
    ocv_volt,
    *,
    temperature_celsius=None,
    entropic_volt_per_kelvin=None,
):
    """Heat that a cell makes: its losses, and the reversible heat where its coefficient is given.

    Parameters
    ----------
    current_ampere : (n,) positive on charge [A].
    voltage_volt, ocv_volt : (n,) [V].
    temperature_celsius : scalar or (n,), needed for the reversible part [degC].
    entropic_volt_per_kelvin : scalar or (n,) slope of the OCV over temperature [V/K], or None.

    Returns
    -------
    heat_watt : (n,) I·(V − OCV) + I·T·dOCV/dT [W]; the first part is never negative at rest or in
        a steady load.

    Raises
    ------
    Refusal : an entropic coefficient without a temperature.

    Source: D. Bernardi, E. Pawlikowski, J. Newman, J. Electrochem. Soc. 132 (1985) 5, without
    heat of mixing.
    """
    losses = current_ampere * (voltage_volt - ocv_volt)
    if entropic_volt_per_kelvin is None:
        return losses
    if temperature_celsius is None:
        raise Refusal("reversible heat needs a temperature beside the entropic coefficient")
    kelvin = np.asarray(temperature_celsius) + ZERO_CELSIUS_KELVIN
    return losses + current_ampere * kelvin * entropic_volt_per_kelvin


def temperature(
    test_time_second,
    heat_watt,
    ambient_celsius,
    *,
    heat_capacity_joule_per_kelvin,
    resistance_kelvin_per_watt,
    initial_celsius=None,
):
    """Temperature of a cell from its heat, exact for heat and ambient that run straight.

    C·dT/dt = heat − (T − T_ambient)/R, a first-order lag of T_ambient + R·heat with tau = R·C.

    Parameters
    ----------
    test_time_second : (n,) never falling [s].
    heat_watt : (n,) [W].
    ambient_celsius : scalar or (n,) [degC].
    heat_capacity_joule_per_kelvin : C [J/K]. resistance_kelvin_per_watt : R to the ambient [K/W].
    initial_celsius : temperature at the first sample [degC]; None is that of the ambient.

    Returns
    -------
    temperature_celsius : (n,) [degC].

    Raises
    ------
    Refusal : C or R is not above zero.
    """
    # ASSUME: A cell has one temperature, and all its heat leaves through one resistance.
    if not (heat_capacity_joule_per_kelvin > 0 and resistance_kelvin_per_watt > 0):
        found = f"{heat_capacity_joule_per_kelvin:g} J/K and {resistance_kelvin_per_watt:g} K/W"
        raise Refusal(f"heat capacity and resistance are {found}; both must be above zero")
    ambient = np.broadcast_to(np.asarray(ambient_celsius, float), np.shape(heat_watt))
    start = ambient[0] if initial_celsius is None else initial_celsius
    tau = resistance_kelvin_per_watt * heat_capacity_joule_per_kelvin
    drive = ambient + resistance_kelvin_per_watt * np.asarray(heat_watt, float)
    return lag(np.diff(test_time_second), tau, drive, hold="first_order", initial=start)


def simulate_warm(
    model,
    member,
    test_time_second,
    current_ampere,
    soc,
    ambient_celsius,
    *,
    heat_capacity_joule_per_kelvin,
    resistance_kelvin_per_watt,
    initial_celsius=None,
    entropic_volt_per_kelvin=None,
    hold="first_order",
    passes=30,
    tolerance_kelvin=0.001,
):
    """Terminal voltage of a cell's model at the temperature that its own heat gives it.

    Voltage and temperature are computed in turn until the temperature stands still. As heat acts
    only on what comes after it, that always ends, if the passes suffice.

    Parameters
    ----------
    model, member, test_time_second, current_ampere, soc, hold : as in `lookup.simulate_model`.
    ambient_celsius : scalar or (n,) [degC].
    heat_capacity_joule_per_kelvin, resistance_kelvin_per_watt, initial_celsius : as in
        `temperature`. entropic_volt_per_kelvin : as in `heat`.
    passes : at most so many turns.
    tolerance_kelvin : the largest change of temperature from one turn to the next at the end [K].

    Returns
    -------
    warmed : Warmed.

    Raises
    ------
    Refusal : the temperature still moves after the last pass, or what `simulate_model` refuses.
    """
    cooling = {
        "heat_capacity_joule_per_kelvin": heat_capacity_joule_per_kelvin,
        "resistance_kelvin_per_watt": resistance_kelvin_per_watt,
        "initial_celsius": initial_celsius,
    }
    current = np.asarray(current_ampere, float)
    now = temperature(test_time_second, 0.0 * current, ambient_celsius, **cooling)
    moved = np.inf
    for turn in range(1, passes + 1):
        run = simulate_model(model, member, test_time_second, current, soc, now, hold=hold)
        reversible = {"entropic_volt_per_kelvin": entropic_volt_per_kelvin}
        watt = heat(current, run.voltage_volt, run.ocv_volt, temperature_celsius=now, **reversible)
        before, now = now, temperature(test_time_second, watt, ambient_celsius, **cooling)
        moved = np.abs(now - before).max()
        if moved < tolerance_kelvin:
            return Warmed(run, before, watt, turn)
    raise Refusal(f"temperature still moves by {moved:.2g} K after {passes} passes")
