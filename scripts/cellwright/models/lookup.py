"""A finished model (results/models/<cell>.json) as values per sample, and its simulation."""

from typing import NamedTuple

import numpy as np

from cellwright.models import instrument
from cellwright.models.circuit import KINDS, Branch
from cellwright.models.kinetics import with_shared_scale
from cellwright.models.simulate import OpenCircuit, overpotentials
from cellwright.models.tables import (
    SMALLEST,
    celsius_of,
    continued_ocv_at,
    mixed_by,
    scaled_soc,
    temperature_weights,
)
from cellwright.models.temperature_laws import (
    law_weights,
    laws_of,
    mixed_resistances,
    warmth_beyond,
)
from cellwright.refusal import Refusal

SAME_KELVIN = 5.0


class Parameters(NamedTuple):
    """Look-up of the plain RC part of a member at every sample; r, tau: (branches, n)."""

    r0_ohm: np.ndarray
    r_ohm: np.ndarray
    tau_second: np.ndarray
    ocv_shift_volt: np.ndarray
    outside_soc: np.ndarray
    outside_temperature: np.ndarray


class Found(NamedTuple):
    """A member's circuit with one value per sample, and where it was never measured; (n,) each.

    table_soc : SoC at which the model's OCV tables are to be read.
    """

    circuit: tuple
    table_soc: np.ndarray
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
    the logarithms of the sums of the resistances of one kind (ohmic, kinetic, relaxing) and of
    every other parameter are linear in 1/T (an Arrhenius law through the two); outside the
    measured temperatures resistances follow the condition's `activation_energy_joule_per_mole`
    where it has one, all else is held flat. OCV shifts are linear in 1/T themselves. Where the
    conditions name `resistance_laws`, the sums follow them (`law_weights`).

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
    conditions = sorted(conditions, key=lambda c: celsius_of(c["ambient_temperature_celsius"]))
    known = np.array([celsius_of(c["ambient_temperature_celsius"]) for c in conditions])
    here = np.broadcast_to(np.asarray(temperature_celsius, float), np.shape(soc))
    weights = temperature_weights(known, here)
    elements = [_elements(condition) for condition in conditions]
    by_law = law_weights(known, here, laws_of(conditions))
    beyond = warmth_beyond(conditions, known, here)

    def courses(index, name):
        pairs = zip(conditions, elements, strict=True)
        return [_course(c, e[index][1][name], soc) for c, e in pairs]

    def mixed(index, name):
        logs = [np.log(np.maximum(course, SMALLEST)) for course in courses(index, name)]
        factor = beyond if name in instrument.WARMED else 1.0
        return factor * np.exp(mixed_by(weights, logs))

    resistive = [k for k, (_, parameters) in enumerate(elements[0]) if "r_ohm" in parameters]
    origins = [elements[0][k][0] for k in resistive]
    resistances = beyond * mixed_resistances(
        [courses(k, "r_ohm") for k in resistive], origins, weights, by_law
    )
    by_index = dict(zip(resistive, resistances, strict=True))
    circuit = [
        Branch(
            kind,
            {
                name: by_index[index] if name == "r_ohm" else mixed(index, name)
                for name in parameters
            },
        )
        for index, (kind, parameters) in enumerate(elements[0])
    ]
    shifts = [c.get("ocv_shift_volt", np.zeros(len(c["soc"]))) for c in conditions]
    shift = mixed_by(weights, [_course(c, s, soc) for c, s in zip(conditions, shifts, strict=True)])
    far = [(soc < c["soc"][0]) | (soc > c["soc"][-1]) for c in conditions]
    outside = mixed_by(weights, far) > 0
    circuit = with_shared_scale(circuit)
    scaled = scaled_soc(conditions, weights, soc)
    return Found(circuit, scaled, shift, outside, _outside(known, here))


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
    values = ([pair[name] for pair in pairs] for name in ("r_ohm", "tau_second"))
    r, tau = (np.reshape(one, (-1, len(soc))) for one in values)
    return Parameters(found.circuit[0].parameters["r_ohm"], r, tau, *found[2:])


def open_circuit_volt(model, found, temperature_celsius):
    """Open-circuit voltage of a member where its circuit was looked up.

    Parameters
    ----------
    model : dict of a model file. found : Found, from `circuit_at`.
    temperature_celsius : scalar or (n,) [degC], as in `circuit_at`.

    Returns
    -------
    ocv_volt : (n,) [V].
    """
    return (
        continued_ocv_at(model["ocv"], found.table_soc, temperature_celsius) + found.ocv_shift_volt
    )


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
    hold=None,
    kind=None,
):
    """Terminal voltage of a cell's model under a measured current, as the instrument reads it.

    Parameters
    ----------
    model : dict of schema cellwright-model/2.
    member : "1RC", "2RC", …, or None for the chosen one.
    test_time_second, current_ampere : (n,) [s], [A], positive on charge.
    soc : (n,) state of charge at each sample [1].
    temperature_celsius : scalar or (n,) [degC].
    hold : hold of the current between samples; None: the one that the member was found with, else
        "first_order".
    kind : of the test, or None: what a member says of the charge may not hold in capacity tests.

    Returns
    -------
    simulated : Simulated; `instrument` says what a member may correct of the record.
    """
    own = member_of(model, member)
    capacity, time, celsius = model["capacity_ampere_hour"], test_time_second, temperature_celsius
    read = (time, current_ampere, np.asarray(soc, float))
    true = instrument.corrected(own, capacity, *read, celsius, kind=kind)
    found = circuit_at(own["conditions"], true.soc, celsius)
    ocv = open_circuit_volt(model, found, celsius)
    curve = OpenCircuit(lambda z: continued_ocv_at(model["ocv"], z, celsius), found.table_soc)
    settings = {"hold": hold or instrument.hold_of(own, current_ampere), "open_circuit": curve}
    record = (time, np.asarray(true.current_ampere, float))
    over = _overpotentials(own, found.circuit, record, celsius, settings)
    if "history" in own:
        before = (true.soc, capacity)
        over = over + instrument.led(own, found.circuit, *record, *before, hold=settings["hold"])
    at_once = over[instrument.at_once(found.circuit)].sum(axis=0)
    volt = instrument.as_read(own, time, ocv + over.sum(axis=0), at_once, hold=settings["hold"])
    return Simulated(volt, ocv, over, *found[3:])


def _overpotentials(member, circuit, record, celsius, settings):
    """Over each branch; where the cell's own heat counts, once to know it and once with it."""
    over = overpotentials(circuit, *record, **settings)
    if "own_heat" not in member:
        return over
    time, current = record
    heat = current * over[instrument.heating(circuit)].sum(axis=0)
    steps = np.diff(time)
    warm = instrument.warmed_within(member, circuit, heat, steps, celsius, hold=settings["hold"])
    return overpotentials(warm, *record, **settings)


def _outside(known, here):
    """Further than a few kelvin from all that was measured: cells warm a little in a chamber."""
    return (here < known[0] - SAME_KELVIN) | (here > known[-1] + SAME_KELVIN)


def _elements(condition):
    """(kind, parameters) of every branch of a condition, the ohmic resistance first."""
    pairs = [("R", {"r_ohm": condition["r0_ohm"]})]
    for branch in condition["branches"]:
        kind = branch.get("kind", "RC")
        pairs.append((kind, {name: branch[name] for name in KINDS[kind].parameters}))
    return pairs


def _course(condition, values, soc):
    return np.interp(soc, condition["soc"], values)
