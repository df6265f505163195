"""A finished model (results/models/<cell>.json) as values per sample, and its simulation."""

from typing import NamedTuple

import numpy as np

from cellwright.models.circuit import KINDS, Branch
from cellwright.models.simulate import OpenCircuit, overpotentials
from cellwright.refusal import Refusal

ZERO_CELSIUS_KELVIN = 273.15
SMALLEST = 1e-7  # of any parameter: the logarithm of none would be −∞


class Parameters(NamedTuple):
    """Look-up of the plain RC part of a member at every sample; `branch` arrays (branches, n)."""

    r0_ohm: np.ndarray
    r_ohm: np.ndarray
    tau_second: np.ndarray
    ocv_shift_volt: np.ndarray
    outside_soc: np.ndarray
    outside_temperature: np.ndarray


class Found(NamedTuple):
    """A member's circuit with one value per sample, and where it was never measured; (n,) each."""

    circuit: tuple
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


def circuit_at(conditions, soc, temperature_celsius):
    """Circuit of a model's member with its parameters looked up at every sample.

    Linear in SoC inside each condition and held flat outside its knots; between two temperatures
    the logarithm of each parameter is linear in 1/T (an Arrhenius law through the two), held flat
    outside the measured temperatures. OCV shifts are linear in 1/T themselves.

    Parameters
    ----------
    conditions : sequence of condition dicts, as in a model's member.
    soc : (n,) state of charge [1].
    temperature_celsius : scalar or (n,) [degC]; NaN takes a single condition as it is.

    Returns
    -------
    found : Found; its first branch is the ohmic resistance, the others in the member's order.

    Raises
    ------
    Refusal : no condition, or no temperature where there are several conditions.
    """
    # ASSUME: Between two measured temperatures every model parameter follows an Arrhenius law.
    # ASSUME: Outside the measured range of SoC or temperature the model keeps its last value.
    conditions = sorted(conditions, key=lambda c: _celsius(c["ambient_temperature_celsius"]))
    known = np.array([_celsius(c["ambient_temperature_celsius"]) for c in conditions])
    weights = _temperature_weights(known, np.broadcast_to(temperature_celsius, np.shape(soc)))
    elements = [_elements(condition) for condition in conditions]

    def mixed(index, name):
        return np.exp(
            sum(
                weight * np.log(np.maximum(_course(c, e[index][1][name], soc), SMALLEST))
                for weight, c, e in zip(weights, conditions, elements, strict=True)
            )
        )

    circuit = [
        Branch(kind, {name: mixed(index, name) for name in parameters})
        for index, (kind, parameters) in enumerate(elements[0])
    ]
    none = [np.zeros(len(c["soc"])) for c in conditions]
    shifts = [c.get("ocv_shift_volt", zero) for c, zero in zip(conditions, none, strict=True)]
    courses = [_course(c, s, soc) for c, s in zip(conditions, shifts, strict=True)]
    shift = sum(weight * course for weight, course in zip(weights, courses, strict=True))
    beyond = [(soc < c["soc"][0]) | (soc > c["soc"][-1]) for c in conditions]
    outside = sum(weight * far for weight, far in zip(weights, beyond, strict=True)) > 0
    return Found(tuple(circuit), shift, outside, _outside(known, temperature_celsius, soc))


def parameters_at(conditions, soc, temperature_celsius):
    """As `circuit_at`, but only resistance and RC pairs, as arrays.

    Parameters
    ----------
    conditions, soc, temperature_celsius : as in `circuit_at`.

    Returns
    -------
    parameters : Parameters.
    """
    found = circuit_at(conditions, soc, temperature_celsius)
    pairs = [branch.parameters for branch in found.circuit if branch.kind == "RC"]
    r, tau = ([pair[name] for pair in pairs] for name in ("r_ohm", "tau_second"))
    shape = (-1, len(soc))
    r, tau = np.reshape(r, shape), np.reshape(tau, shape)
    return Parameters(found.circuit[0].parameters["r_ohm"], r, tau, *found[1:])


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


def continued_ocv_at(tables, soc, temperature_celsius):
    """As `ocv_at`, but continued on its first and last slope outside 0…1.

    The surface of a particle may run empty before its mean does; there the voltage falls on.

    Parameters
    ----------
    tables, soc, temperature_celsius : as in `ocv_at`.
    """
    inside = np.clip(soc, 0.0, 1.0)
    ends = np.array([0.0, 0.01, 0.99, 1.0])
    at = [ocv_at(tables, np.full(np.shape(soc), end), temperature_celsius) for end in ends]
    below, above = np.minimum(soc, 0.0), np.maximum(soc - 1.0, 0.0)
    beyond = below * (at[1] - at[0]) / 0.01 + above * (at[3] - at[2]) / 0.01
    return ocv_at(tables, inside, temperature_celsius) + beyond


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
    found = circuit_at(member_of(model, member)["conditions"], soc, temperature_celsius)
    ocv = ocv_at(model["ocv"], soc, temperature_celsius) + found.ocv_shift_volt
    open_circuit = OpenCircuit(lambda z: continued_ocv_at(model["ocv"], z, temperature_celsius), soc)
    over = overpotentials(
        found.circuit, test_time_second, current_ampere, hold=hold, open_circuit=open_circuit
    )
    return Simulated(ocv + over.sum(axis=0), ocv, over, *found[2:])


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


def _elements(condition):
    """(kind, parameters) of every branch of a condition, the ohmic resistance first."""
    pairs = [("R", {"r_ohm": condition["r0_ohm"]})]
    for branch in condition["branches"]:
        kind = branch.get("kind", "RC")
        pairs.append((kind, {name: branch[name] for name in KINDS[kind].parameters}))
    return pairs


def _course(condition, values, soc):
    return np.interp(soc, condition["soc"], values)
