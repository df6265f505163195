"""The Arrhenius law written apart from the code: a truth for tests."""

import numpy as np


def arrhenius_law(celsius, value_at_25_celsius, activation_energy_joule_per_mole):
    """Value at 25 °C times exp(Ea/R (1/T − 1/298.15 K)); celsius : scalar or (n,) [°C]."""
    inverse = 1 / (np.asarray(celsius, float) + 273.15) - 1 / 298.15
    return value_at_25_celsius * np.exp(activation_energy_joule_per_mole / 8.314462618 * inverse)
