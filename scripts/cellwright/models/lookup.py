"""A finished model (results/models/<cell>.json) as values per sample, and its simulation."""

from typing import NamedTuple

import numpy as np

from cellwright.models.circuit import rc_circuit
from cellwright.models.simulate import overpotentials
from cellwright.refusal import Refusal

ZERO_CELSIUS_KELVIN = 273.15
SMALLEST_OHM = 1e-7


class Parameters(NamedTuple):
    """Look-up of one member of a model at every sample; `branch` arrays are (branches, n)."""

    r0_ohm: np.ndarray
    r_ohm: np.ndarray
    tau_second: np.ndarray
    ocv_shift_volt: np.ndarray
    outside_soc: np.ndarray
    outside_temperature: np.ndarray


class Simulated(NamedTuple):
    """A simulated record; `extrapolated` marks samples outside the identified SoC range."""

    voltage_volt: np.ndarray
    ocv_volt: np.ndarray
    overpotential_volt: np.ndarray
    extrapolated: np.ndarray
    outside_temperature: np.ndarray


def parameters_at(conditions, soc, temperature_celsius):
    """Parameters of a model at every sample.

    Linear in SoC inside each condition and held flat outside its knots; between two temperatures
    the logarithm of each parameter is linear in 1/T (an Arrhenius law through the two), held flat
    outside the measured temperatures. OCV shifts are linear in 1/T themselves.

    Parameters
    ----------
    conditions : sequence of condition dicts, as in a model's member.
    soc : (n,) [1].
    temperature_celsius : scalar or (n,) [degC]; NaN takes a single condition as it is.

    Returns
    -------
    parameters : Parameters.

    Raises
    ------
    Refusal : no condition, or no temperature where there are several conditions.
    """
    # ASSUME: Between two measured temperatures every model parameter follows an Arrhenius law.
    # ASSUME: Outside the measured range of SoC or temperature the model keeps its last value.
    conditions = sorted(conditions, key=lambda c: _celsius(c["ambient_temperature_celsius"]))
    known = np.array([_celsius(c["ambient_temperature_celsius"]) for c in conditions])
    weights = _temperature_weights(known, np.broadcast_to(temperature_celsius, np.shape(soc)))
    tables = [_at_soc(condition, soc) for condition in conditions]
    mixed = [
        np.exp(
            sum(
                w * np.log(np.maximum(values, SMALLEST_OHM))
                for w, values in zip(weights, column, strict=True)
            )
        )
        for column in list(zip(*tables, strict=True))[:3]
    ]
    shift = sum(w * table[3] for w, table in zip(weights, tables, strict=True))
    outside = sum(w * table[4] for w, table in zip(weights, tables, strict=True)) > 0
    return Parameters(*mixed, shift, outside, _outside(known, temperature_celsius, soc))


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
    tables = sorted(tables, key=lambda t: _celsius(t["ambient_temperature_celsius"]))
    known = np.array([_celsius(t["ambient_temperature_celsius"]) for t in tables])
    weights = _temperature_weights(known, np.broadcast_to(temperature_celsius, np.shape(soc)))
    curves = [np.interp(soc, table["soc"], table["ocv_volt"]) for table in tables]
    return sum(weight * curve for weight, curve in zip(weights, curves, strict=True))


def member_of(model, name=None):
    """Member of a model by name ("1RC", "2RC"), or its chosen one."""
    name = model["chosen"] if name is None else name
    found = [member for member in model["members"] if member["model"] == name]
    if not found:
        known = ", ".join(member["model"] for member in model["members"])
        raise Refusal(f"model of {model['cell']} has no member {name!r}; it has {known}")
    return found[0]


def simulate_model(
    model,
    member,
    test_time_second,
    current_ampere,
    soc,
    temperature_celsius,
    *,
    hold="first_order",
):
    """Terminal voltage of a cell's model under a measured current.

    Parameters
    ----------
    model : dict of schema cellwright-model/1.
    member : "1RC", "2RC", …, or None for the chosen one.
    test_time_second, current_ampere : (n,) [s], [A], positive on charge.
    soc : (n,) state of charge at each sample [1].
    temperature_celsius : scalar or (n,) [degC].
    hold : hold of the current between samples.

    Returns
    -------
    simulated : Simulated.
    """
    soc = np.asarray(soc, float)
    p = parameters_at(member_of(model, member)["conditions"], soc, temperature_celsius)
    ocv = ocv_at(model["ocv"], soc, temperature_celsius) + p.ocv_shift_volt
    circuit = rc_circuit(p.r0_ohm, p.r_ohm, p.tau_second)
    over = overpotentials(circuit, test_time_second, current_ampere, hold=hold)
    return Simulated(ocv + over.sum(axis=0), ocv, over, p.outside_soc, p.outside_temperature)


def _celsius(value):
    return np.nan if value is None else float(value)


def _outside(known, temperature, soc):
    temperature = np.broadcast_to(temperature, np.shape(soc))
    return (temperature < known[0]) | (temperature > known[-1])


def _temperature_weights(known, temperature):
    """Weight of each measured temperature at each sample, linear in 1/T between two."""
    if not len(known):
        raise Refusal("the model holds nothing measured: no temperature to look up")
    if len(known) == 1:
        return [np.ones(len(temperature))]
    if np.isnan(known).any() or np.isnan(temperature).any():
        raise Refusal(f"{len(known)} measured conditions, but a temperature is not known")
    inverse = -1.0 / (known + ZERO_CELSIUS_KELVIN)
    here = -1.0 / (temperature + ZERO_CELSIUS_KELVIN)
    return [np.interp(here, inverse, row) for row in np.eye(len(known))]


def _at_soc(condition, soc):
    knots = condition["soc"]

    def course(values):
        return np.interp(soc, knots, values)

    r0 = course(condition["r0_ohm"])
    r = np.array([course(b["r_ohm"]) for b in condition["branches"]]).reshape(-1, len(soc))
    tau = np.array([course(b["tau_second"]) for b in condition["branches"]])
    shift = course(condition.get("ocv_shift_volt", np.zeros(len(knots))))
    return r0, r, tau.reshape(-1, len(soc)), shift, (soc < knots[0]) | (soc > knots[-1])
