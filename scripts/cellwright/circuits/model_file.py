"""Model file (results/models/<cell>.json): entries, parameters per sample, simulation."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits import instrument, particle
from cellwright.circuits.cell import overpotentials
from cellwright.circuits.circuit import KINDS, Branch
from cellwright.circuits.temperature import (
    SMALLEST,
    coldest_first,
    continued_ocv_at,
    kind_of_resistance,
    laws_over_temperature,
    log_factor,
    mixed_by,
    mixed_resistances,
    scaled_soc,
    temperature_weights,
)
from cellwright.refusal import Refusal


def condition_entry(condition, *, ambient_temperature_celsius, tests):
    """Entry of one condition in a model file.

    Parameters
    ----------
    condition : identify.Condition.
    ambient_temperature_celsius : chamber temperature [degC], NaN or None where unknown.
    tests : ids of the tests that were fitted.

    Returns
    -------
    entry : dict of lists and numbers; NaN is written as None.
    """
    return {
        "ambient_temperature_celsius": _plain(ambient_temperature_celsius),
        "soc": _plain(condition.soc),
        "r0_ohm": _plain(condition.r0_ohm),
        "r0_std_ohm": _plain(condition.r0_std_ohm),
        "steady_std_ohm": _plain(condition.steady_std_ohm),
        "first_sample_second": _plain(condition.first_sample_second),
        "first_sample_missed_ohm": _plain(condition.first_sample_missed_ohm),
        "branches": [_branch(element) for element in condition.branches],
        "ocv_shift_volt": _plain(condition.ocv_shift_volt),
        "ocv_scale": {"missing": condition.missing, "stretch": condition.stretch},
        "at_bound": list(condition.at_bound),
        "fit_rmse_volt": condition.fit_rmse_volt,
        "samples": condition.samples,
        "tests": list(tests),
    }


def std_of_r0(condition):
    """Standard deviation of a condition's R0 at its knots as a list [ohm], None where not known.

    R0 is what makes the circuit show the cell's resistance at the first sample after a step. So
    what the fit misses there is part of it; `r0_std_ohm` takes the circuit as right.

    Parameters
    ----------
    condition : dict of a model file.
    """
    stds = condition.get("r0_std_ohm") or [None] * len(condition["soc"])
    missed = condition.get("first_sample_missed_ohm") or [0.0] * len(stds)
    pairs = zip(stds, missed, strict=True)
    return [std if None in (std, ohm) else float(np.hypot(std, ohm)) for std, ohm in pairs]


def std_name(name):
    """Name of a parameter's standard deviation: r_ohm → r_std_ohm."""
    quantity, unit = name.split("_", 1)
    return f"{quantity}_std_{unit}"


def _branch(element):
    entry = {"kind": element.kind}
    for name, values in element.values.items():
        entry |= {name: _plain(values), std_name(name): _plain(element.stds[name])}
    return entry


def ocv_from_slow_branch(soc, slow_volt, current_ampere, condition):
    """Open-circuit voltage [V] from one slow branch, corrected by its resistive drop.

    At a slow steady current every relaxation has settled, so in the linear model the drop is
    exactly I·(R0 + ΣR). Identify with the branch itself first, correct, identify again.

    Parameters
    ----------
    soc, slow_volt : (p,) the slow branch [1], [V].
    current_ampere : its current, negative on discharge [A].
    condition : identify.Condition of a first pass.

    Returns
    -------
    ocv_volt : (p,) [V].
    """
    # ASSUME: Where only one slow branch was measured, its distance from OCV is the current times
    # the sum of the model's resistances; hysteresis stays in it.
    branches = [
        element.values["r_ohm"] for element in condition.branches if "r_ohm" in element.values
    ]
    total = sum(branches, condition.r0_ohm)
    return slow_volt - current_ampere * np.interp(soc, condition.soc, total)


def _plain(values):
    if values is None or np.ndim(values) == 0:
        return None if values is None or np.isnan(values) else float(values)
    return [_plain(value) for value in values]


SMALLEST_RESISTANCE_OHM = 1e-9  # of a resistance [ohm] and of a share: none has no share to take


def with_shared_scale(circuit):
    """Circuit whose kinetic branches share one scale by their part of the resistance.

    The share is taken where the resistances are looked up: between two knots or temperatures of
    which one holds no resistance, a share of its own would have no meaning.

    Parameters
    ----------
    circuit : tuple of Branch; `scale_volt` of each kinetic one is the common scale [V].

    Returns
    -------
    circuit : tuple of Branch, each kinetic one with its own scale.
    """
    kinetic = [b.parameters["r_ohm"] for b in circuit if "scale_volt" in b.parameters]
    total = np.maximum(sum(kinetic), SMALLEST_RESISTANCE_OHM)

    def shared(parameters):
        share = np.maximum(parameters["r_ohm"] / total, SMALLEST_RESISTANCE_OHM)
        return parameters | {"scale_volt": share * parameters["scale_volt"]}

    return tuple(
        branch._replace(parameters=shared(branch.parameters))
        if "scale_volt" in branch.parameters
        else branch
        for branch in circuit
    )


def model_of(document, cell):
    """The model of `cell` from a model file, or from a group's file {"models": {cell: model}}.

    Raises
    ------
    Refusal
        The group's file holds no model of the cell.
    """
    if "models" not in document:
        return document
    if cell not in document["models"]:
        raise Refusal(f"the group has no model of {cell}; it has {', '.join(document['models'])}")
    return document["models"][cell]


BEYOND_KELVIN = 5.0


class SampledCircuit(NamedTuple):
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
    """Circuit of a member with its parameters at every SoC and temperature.

    Linear in SoC inside each condition and held flat outside its knots. The logarithms of the sums
    of the resistances of one kind (ohmic, kinetic, relaxing) follow `laws_over_temperature`, and
    meet what was identified at each temperature; those of every other parameter are linear in 1/T,
    as OCV shifts are themselves, and held flat outside the measured temperatures.

    Parameters
    ----------
    conditions : sequence of condition dicts, as in a model's member.
    soc : (n,) state of charge [1].
    temperature_celsius : scalar or (n,) [degC]; NaN takes a single condition as it is.

    Returns
    -------
    sampled : SampledCircuit; its first branch is the ohmic resistance, then the member's.

    Raises
    ------
    Refusal : no condition, or no temperature where there are several conditions.
    """
    # ASSUME: Outside the measured range of SoC a model keeps its last value; outside that of
    # temperature all but its resistances does.
    conditions, measured = coldest_first(conditions)
    celsius = np.broadcast_to(np.asarray(temperature_celsius, float), np.shape(soc))
    weights = temperature_weights(measured, celsius)
    elements = [_elements(condition) for condition in conditions]
    kinds = [kind_of_resistance(kind) for kind, _ in elements[0]]
    laws = laws_over_temperature(conditions)
    factors = [log_factor(law, measured, celsius) for law in laws]

    def courses(index, name):
        pairs = zip(conditions, elements, strict=True)
        return [_course(c, e[index][1][name], soc) for c, e in pairs]

    met = [k for k, weight in enumerate(weights) if weight.any()]  # a record sees few temperatures

    def mixed(index, name):
        pairs = [(conditions[k], elements[k][index][1][name]) for k in met]
        logs = [np.log(np.maximum(_course(c, values, soc), SMALLEST)) for c, values in pairs]
        by_law = sum(
            factor
            for law, factor in zip(laws, factors, strict=True)
            if name in instrument.WARMED and kinds[index] in law.kinds
        )
        return np.exp(mixed_by([weights[k] for k in met], logs) + by_law)

    resistive = [k for k, (_, parameters) in enumerate(elements[0]) if "r_ohm" in parameters]
    resistances = mixed_resistances(
        *([courses(k, "r_ohm") for k in resistive], [kinds[k] for k in resistive]),
        *(weights, laws, factors),
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
    outside_knots = [(soc < c["soc"][0]) | (soc > c["soc"][-1]) for c in conditions]
    outside = mixed_by(weights, outside_knots) > 0
    circuit = with_shared_scale(circuit)
    scaled = scaled_soc(conditions, weights, soc)
    # Cells warm a little in a chamber: a few kelvin beyond the measured range count as inside.
    cold, hot = measured[0] - BEYOND_KELVIN, measured[-1] + BEYOND_KELVIN
    return SampledCircuit(circuit, scaled, shift, outside, (celsius < cold) | (celsius > hot))


def open_circuit_volt(model, sampled, temperature_celsius):
    """Open-circuit voltage of a member at the samples of its circuit [V].

    Parameters
    ----------
    model : dict of a model file. sampled : SampledCircuit, from `circuit_at`.
    temperature_celsius : scalar or (n,) [degC], as in `circuit_at`.

    Returns
    -------
    ocv_volt : (n,) [V].
    """
    return (
        continued_ocv_at(model["ocv"], sampled.table_soc, temperature_celsius)
        + sampled.ocv_shift_volt
    )


def member_of(model, name=None):
    """Member of a model by name ("1RC", "2RC"), or its chosen one."""
    name = model["chosen"] if name is None else name
    members = [member for member in model["members"] if member["model"] == name]
    if not members:
        available = ", ".join(member["model"] for member in model["members"])
        raise Refusal(f"model of {model['cell']} has no member {name!r}; it has {available}")
    return members[0]


def names_of(model):
    """Names of all that a model can be simulated with: its members, and its particle."""
    names = [member["model"] for member in model["members"]]
    return [*names, particle.NAME] if model.get("particle") else names


def in_use(model):
    """Name of what predicts best: the particle, or the chosen member.

    The chosen member serves wherever tables of a circuit are asked for.
    """
    by_particle = (model.get("particle") or {}).get("in_use", False)
    return particle.NAME if by_particle else model["chosen"]


def capacity_of(model, member, celsius=None):
    """Capacity of a cell by a member of its model at a temperature [Ah].

    Parameters
    ----------
    model, member : dicts of a model file. celsius : scalar [degC]; None or NaN: as at 25 °C.
    """
    return model["capacity_ampere_hour"] * float(instrument.capacity_factor(member, celsius))


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
    member : "1RC", "2RC", …, None for the chosen one, or the entry of one, which need not be in the
        model.
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
    time, celsius = test_time_second, temperature_celsius
    record = time, current_ampere, np.asarray(soc, float), celsius
    if member == particle.NAME:
        return _as_particle(model, record)
    member = member if isinstance(member, dict) else member_of(model, member)
    capacity = model["capacity_ampere_hour"]
    flowing, _, true_soc = instrument.corrected(member, capacity, *record, kind=kind)
    sampled = circuit_at(member["conditions"], true_soc, celsius)
    ocv = open_circuit_volt(model, sampled, celsius)
    curve = (lambda z: continued_ocv_at(model["ocv"], z, celsius)), sampled.table_soc
    settings = {"hold": hold or instrument.hold_of(member, current_ampere), "open_circuit": curve}
    through = (time, np.asarray(flowing, float))
    over = _overpotentials(member, sampled.circuit, through, celsius, settings)
    if "history" in member:
        over = instrument.with_history(
            *(member, sampled.circuit, over, through, current_ampere),
            soc_at_start=true_soc[0],
            capacity_ampere_hour=capacity,
            hold=settings["hold"],
        )
    at_once = over[instrument.at_once(sampled.circuit)].sum(axis=0)
    volt = instrument.as_read(member, time, ocv + over.sum(axis=0), at_once, hold=settings["hold"])
    return Simulated(volt, ocv, over, *sampled[3:])


def _as_particle(model, record):
    """Simulation of the particle of a model: see `simulate_model`."""
    if not model.get("particle"):
        raise Refusal(f"model of {model['cell']} has no particle")
    document = model["particle"]
    cell = particle.of_document(document)
    run = particle.run(cell, *record, capacity_ampere_hour=model["capacity_ampere_hour"])
    soc, celsius = record[2], np.broadcast_to(record[3], record[2].shape)
    low, high = document["fitted_soc"]
    cold, hot = cell.celsius[0] - BEYOND_KELVIN, cell.celsius[-1] + BEYOND_KELVIN
    outside = (celsius < cold) | (celsius > hot)
    return Simulated(
        run.voltage_volt, run.ocv_volt, run.overpotential_volt, (soc < low) | (soc > high), outside
    )


def _overpotentials(member, circuit, record, celsius, settings):
    """Voltage over each branch (branches, n) [V], run again at the warmed circuit with own heat."""
    over = overpotentials(circuit, *record, **settings)
    if "own_heat" not in member:
        return over
    time, current = record
    heat = current * over[instrument.heating(member, circuit)].sum(axis=0)
    steps = np.diff(time)
    warm = instrument.warmed_within(member, circuit, heat, steps, celsius, hold=settings["hold"])
    return overpotentials(warm, *record, **settings)


def _elements(condition):
    """(kind, parameters) of every branch of a condition, the ohmic resistance first."""
    pairs = [("R", {"r_ohm": condition["r0_ohm"]})]
    for branch in condition["branches"]:
        kind = branch.get("kind", "RC")
        pairs.append((kind, {name: branch[name] for name in KINDS[kind].parameters}))
    return pairs


def _course(condition, values, soc):
    return np.interp(soc, condition["soc"], values)


def is_plain(member):
    """Whether a member is an ohmic resistance and RC pairs only, without own heat.

    Parameters
    ----------
    member : dict, a member of a model file.
    """
    if "own_heat" in member:
        return False
    branches = [branch for entry in member["conditions"] for branch in entry["branches"]]
    return all(branch.get("kind", "RC") == "RC" for branch in branches)


def plain_member(model):
    """Name of the member of RC pairs that stands for a model in tools without other elements.

    Kinetics are not taken linear, nor hysteresis left out: the rest of such a member was fitted
    beside them and is no model by itself.

    Parameters
    ----------
    model : dict, a model file.

    Returns
    -------
    name : of the plain members the one that `standing_in` takes.

    Raises
    ------
    Refusal : no member is plain.
    """
    plain = [member["model"] for member in model["members"] if is_plain(member)]
    if not plain:
        raise Refusal(f"no member of the model of {model['cell']} is made of RC pairs alone")
    return standing_in(model, plain)


def standing_in(model, names):
    """Which of some members stands for the chosen one where only they can be used.

    Parameters
    ----------
    model : dict, a model file. names : of those members, at least one.

    Returns
    -------
    name : the chosen member where it is among them, else the one of the smallest
        `left_out_rmse_volt`; where none states it, that of most branches.
    """
    if model["chosen"] in names:
        return model["chosen"]
    able = [member for member in model["members"] if member["model"] in names]
    return min(able, key=_left_out_rank)["model"]


def _left_out_rank(member):
    error = member.get("left_out_rmse_volt")
    return np.inf if error is None else error, -len(member["conditions"][0]["branches"])
