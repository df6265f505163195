"""The Arrhenius law: its axis, its value, and its one fit."""

import numpy as np

from cellwright.numerics.lines import fit_line

GAS_CONSTANT = 8.314462618  # J/(mol K)
ZERO_CELSIUS_KELVIN = 273.15
REFERENCE_KELVIN = 298.15


def inverse_temperature(celsius):
    """(1/T − 1/298.15 K)/R [mol/J], the axis on which ln of an Arrhenius law is a line.

    Parameters
    ----------
    celsius : scalar or (n,) [°C].
    """
    kelvin = np.asarray(celsius, float) + ZERO_CELSIUS_KELVIN
    return (1 / kelvin - 1 / REFERENCE_KELVIN) / GAS_CONSTANT


def arrhenius_law(temperature_celsius, value_at_25_celsius, activation_energy_joule_per_mole):
    """Value at 25 °C times exp(Ea/R (1/T − 1/298.15 K)): falls with temperature for Ea > 0.

    Parameters
    ----------
    temperature_celsius : scalar or (n,) [°C].
    value_at_25_celsius, activation_energy_joule_per_mole : [any unit], [J/mol].
    """
    return value_at_25_celsius * np.exp(
        activation_energy_joule_per_mole * inverse_temperature(temperature_celsius)
    )


def fit_arrhenius(temperature_celsius, value, value_std=None):
    """Line through the logarithm of a value over 1/T.

    Parameters
    ----------
    temperature_celsius, value : (n,) [°C], [any unit], positive.
    value_std : (n,) standard deviation of each value in its unit, or None.

    Returns
    -------
    line : `lines.Line` of ln(value at 25 °C) and the activation energy [J/mol]. Its errors are
        those of `lines.fit_line`: the stated ones with the scatter that is found beyond them;
        without stated ones the scatter about the line alone.

    Source: thesis (3.7).
    """
    columns = np.stack(
        [np.ones(len(temperature_celsius)), inverse_temperature(temperature_celsius)], axis=1
    )
    relative = None if value_std is None else value_std / value
    return fit_line(columns, np.log(value), relative)
