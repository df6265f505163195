"""Between measured temperatures: weights, the warmth of resistances, OCV tables."""

import numpy as np

from cellwright.refusal import Refusal

ZERO_CELSIUS_KELVIN = 273.15
GAS_CONSTANT = 8.314462618
SMALLEST = 1e-9  # of any parameter: the logarithm of none would be −∞


def ocv_at(tables, soc, temperature_celsius):
    """Open-circuit voltage from tables at one or several temperatures, linear between them.

    Parameters
    ----------
    tables : sequence of dicts with `soc`, `ocv_volt`, `ambient_temperature_celsius`.
    soc : (n,) [1]; held flat outside a table.
    temperature_celsius : scalar or (n,) [degC]; held flat outside the measured ones.

    Returns
    -------
    ocv_volt : (n,) [V].
    """
    tables = sorted(tables, key=lambda t: celsius_of(t["ambient_temperature_celsius"]))
    known = np.array([celsius_of(t["ambient_temperature_celsius"]) for t in tables])
    weights = temperature_weights(known, np.broadcast_to(temperature_celsius, np.shape(soc)))
    curves = [np.interp(soc, table["soc"], table["ocv_volt"]) for table in tables]
    return sum(weight * curve for weight, curve in zip(weights, curves, strict=True))


def continued_ocv_at(tables, soc, temperature_celsius):
    """As `ocv_at`, but continued on its first and last slope outside 0…1.

    The surface of a particle may run empty before its mean does; there the voltage falls on.

    Parameters
    ----------
    tables, soc, temperature_celsius : as in `ocv_at`.
    """
    inside = np.clip(soc, 0.0, 1.0)
    ends = np.array([0.0, 0.005, 0.995, 1.0])
    at = [ocv_at(tables, np.full(np.shape(soc), end), temperature_celsius) for end in ends]
    below, above = np.minimum(soc, 0.0), np.maximum(soc - 1.0, 0.0)
    beyond = below * (at[1] - at[0]) / 0.005 + above * (at[3] - at[2]) / 0.005
    return ocv_at(tables, inside, temperature_celsius) + beyond


def table_soc(soc, missing, stretch):
    """SoC of an OCV table that belongs to a counted SoC.

    Full may not have been quite full, nor the capacity quite right.

    Parameters
    ----------
    soc : (n,) counted [1]. missing : what the full charge left out [1].
    stretch : by how much the capacity is smaller than the SoC takes it for [1].
    """
    return 1.0 - missing - (1.0 - soc) * (1.0 + stretch)


def scaled_soc(conditions, weights, soc):
    """SoC of the OCV tables at counted ones, by the `ocv_scale` of each condition.

    Parameters
    ----------
    conditions : sequence of condition dicts. weights : of each, (n,). soc : (n,) counted [1].
    """
    scales = [c.get("ocv_scale", {"missing": 0.0, "stretch": 0.0}) for c in conditions]
    names = ("missing", "stretch")
    return table_soc(soc, *(mixed_by(weights, [one[name] for one in scales]) for name in names))


def warmth(temperature_celsius, reference_celsius, activation_joule_per_mole):
    """Factor on resistances at a temperature, 1 at the reference (Arrhenius law).

    Parameters
    ----------
    temperature_celsius : scalar or (n,) [degC]. reference_celsius : scalar or (n,) [degC].
    activation_joule_per_mole : activation energy [J/mol].
    """
    inverse = [
        1.0 / (np.asarray(t) + ZERO_CELSIUS_KELVIN)
        for t in (temperature_celsius, reference_celsius)
    ]
    return np.exp(activation_joule_per_mole / GAS_CONSTANT * (inverse[0] - inverse[1]))


def temperature_weights(known, temperature):
    """Weight of each measured temperature at each sample, linear in 1/T between two.

    Parameters
    ----------
    known : (c,) measured temperatures, ascending [degC]. temperature : (n,) [degC].

    Returns
    -------
    weights : list of (n,), one a measured temperature.

    Raises
    ------
    Refusal : nothing measured, or several temperatures of which one is not known.
    """
    if not len(known):
        raise Refusal("the model holds nothing measured: no temperature to look up")
    if len(known) == 1:
        return [np.ones(len(temperature))]
    if np.isnan(known).any() or np.isnan(temperature).any():
        raise Refusal(f"{len(known)} measured conditions, but a temperature is not known")
    inverse = -1.0 / (known + ZERO_CELSIUS_KELVIN)
    here = -1.0 / (temperature + ZERO_CELSIUS_KELVIN)
    return [np.interp(here, inverse, row) for row in np.eye(len(known))]


def mixed_by(weights, values):
    """Sum of values, each by its weight.

    Parameters
    ----------
    weights : sequence of (n,), see `temperature_weights`. values : sequence of scalars or (n,).
    """
    return sum(weight * value for weight, value in zip(weights, values, strict=True))


def celsius_of(value):
    """A stated temperature [degC], NaN where none is.

    Parameters
    ----------
    value : number or None.
    """
    return np.nan if value is None else float(value)
