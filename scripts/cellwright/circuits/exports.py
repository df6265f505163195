"""A cell's model for other tools: tables for PyBaMM, and a plain look-up table."""

import numpy as np

from cellwright.circuits import particle
from cellwright.circuits.circuit import KINDS
from cellwright.circuits.model_file import (
    capacity_of,
    circuit_at,
    in_use,
    is_plain,
    member_of,
    open_circuit_volt,
    standing_in,
)
from cellwright.circuits.temperature import (
    COLD_KELVIN,
    SMALLEST,
    celsius_of,
    coldest_first,
    temperature_weights,
)
from cellwright.numerics.hysteresis import WIDTHS
from cellwright.numerics.lines import ZERO_CELSIUS_KELVIN
from cellwright.records.conditions import REFERENCE_CELSIUS
from cellwright.refusal import Refusal

SCHEMA = "cellwright-pybamm/1"
DIVIDED = {"r_ohm", "m_volt"}  # parameters that a capacitance is made by
SAME_SOC = 1e-9


def pybamm_parameters(model, member, temperature_celsius):
    """Tables over SoC of a model's member at one temperature, for PyBaMM's Thevenin model.

    PyBaMM's OCV knows no temperature, so there is one set per temperature. Linear kinds become a
    resistor and RC elements; kinds that are `over_current` keep their parameters, which the loader
    turns into an element whose resistance depends on the current.

    Parameters
    ----------
    model : dict, a model file.
    member : name of a member, or None for the chosen one.
    temperature_celsius : [degC]; NaN where the model has one condition of unknown temperature.

    Returns
    -------
    tables : dict of temperature_celsius, capacity_ampere_hour, soc, ocv_volt, r0_ohm (lists over
        SoC), elements (list of dicts of kind and parameters, lists over SoC), and identified_soc.

    Raises
    ------
    Refusal : a kind that PyBaMM has no element for.

    Source: PyBaMM, pybamm.equivalent_circuit.Thevenin: of an element du/dt = (R·I − u)/(R·C), R and
    C functions of temperature, current and SoC.
    """
    entry = member_of(model, member)
    soc = _knots(model, entry, temperature_celsius)
    sampled = circuit_at(entry["conditions"], soc, temperature_celsius)
    r0, elements = np.zeros(len(soc)), []
    for branch in sampled.circuit:
        direct, lagged = _elements(branch, len(soc))
        r0 = r0 + direct
        elements += lagged
    inside = soc[~sampled.outside_soc]
    return {
        "temperature_celsius": float(temperature_celsius),
        "capacity_ampere_hour": capacity_of(model, entry, temperature_celsius),
        "identified_soc": [inside.min(), inside.max()],
        "soc": soc,
        "ocv_volt": open_circuit_volt(model, sampled, temperature_celsius),
        "r0_ohm": r0,
        "elements": elements,
    }


def particle_tables(model):
    """A model's particle for PyBaMM: numbers, courses over SoC, faces of its shells.

    Parameters
    ----------
    model : dict, a model file that has a particle.

    Returns
    -------
    tables : dict of capacity_ampere_hour, identified_soc, soc and ocv_volt (lists), shell_faces
        (radii, of 1 at the surface), celsius with missing and stretch (lists over temperature),
        reference_celsius and bend_celsius of the Arrhenius laws, stop_widths of the hysteresis
        (over the capacity), numbers (by name) and courses (by name: soc and value). PARTS of
        circuits/particle.py tells names, units and what is linear in the logarithm.
    """
    document = model["particle"]
    cell, courses = particle.of_document(document), {}
    for part in particle.PARTS:
        if part.knots:
            values = {"soc": list(part.knots), "value": document[part.name]}
            courses[part.name] = values | {"logarithmic": part.logarithmic}
    return {
        "capacity_ampere_hour": model["capacity_ampere_hour"],
        "identified_soc": document["fitted_soc"],
        "soc": np.linspace(0.0, 1.0, len(cell.ocv_volt)),
        "ocv_volt": cell.ocv_volt,
        "shell_faces": particle.shell_faces(),
        "celsius": cell.celsius,
        **{name: document[name] for name in particle.SCALES},
        "reference_celsius": REFERENCE_CELSIUS,
        "bend_celsius": COLD_KELVIN - ZERO_CELSIUS_KELVIN,
        "stop_widths": particle.TURN_SHARE * WIDTHS,
        "numbers": {p.name: document[p.name][0] for p in particle.PARTS if not p.knots},
        "courses": courses,
    }


def validation_errors(rows):
    """Error of each member over all tests that took no part in its fit [V], by its name.

    Parameters
    ----------
    rows : list of dict, scores of members on tests: model, rmse_volt [V], samples.
    """
    squares = {}
    for row in rows:
        square, samples = squares.get(row["model"], (0.0, 0.0))
        more = row["samples"] * row["rmse_volt"] ** 2
        squares[row["model"]] = (square + more, samples + row["samples"])
    return {name: float(np.sqrt(square / count)) for name, (square, count) in squares.items()}


def pybamm_document(model, errors=None):
    """PyBaMM tables of all members of a model at all temperatures, and why members are missing.

    A particle is a member beside the circuits, of one set of tables for all temperatures.

    Parameters
    ----------
    model : dict, a model file. errors : of members, see `validation_errors`, or None.

    Returns
    -------
    document : dict of schema, cell, chosen (what predicts best), exported (the same, or which
        stands for it where it is refused; None where all are), members (list of model, its
        validation_rmse_volt [V] and its `tables`, one per temperature), refused (member → reason)
        and refused_validation_rmse_volt.
    """
    members, refused, errors = [], {}, errors or {}
    for member in model["members"]:
        name = member["model"]
        try:
            tables = [pybamm_parameters(model, name, t) for t in _temperatures(member)]
        except Refusal as refusal:
            refused[name] = str(refusal)
        else:
            error = {"validation_rmse_volt": errors.get(name)}
            members.append({"model": name} | error | {"tables": tables})
    able, best = [member["model"] for member in members], in_use(model)
    if model.get("particle"):
        error = {"validation_rmse_volt": errors.get(particle.NAME)}
        members.append({"model": particle.NAME} | error | {"tables": [particle_tables(model)]})
    about = {"schema": SCHEMA, "cell": model["cell"], "chosen": best}
    instead = standing_in(model, able) if able else None
    about["exported"] = best if best == particle.NAME else instead
    left = {name: errors.get(name) for name in refused}
    return about | {
        "members": members,
        "refused": refused,
        "refused_validation_rmse_volt": left,
    }


def lookup_table(model, member, errors=None):
    """Look-up table of a member of RC pairs: one row per temperature and SoC, on one grid of SoC.

    Parameters
    ----------
    model : dict, a model file.
    member : name of a member of RC pairs, see `plain_member`.
    errors : of members, see `validation_errors`, or None.

    Returns
    -------
    columns : dict of model, ambient_temperature_celsius, soc, ocv_volt, r0_ohm, and of each pair
        r1_ohm, tau1_second, c1_farad, …; `extrapolated` where the SoC was not identified. The same
        in each row: chosen, what predicts best, and the validation errors of both [V], NaN where no
        test tells them.

    Raises
    ------
    Refusal : a branch that is no RC pair.
    """
    entry = member_of(model, member)
    if not is_plain(entry):
        raise Refusal(f"{member} holds more than RC pairs; a look-up table has no column for it")
    temperatures = _temperatures(entry)
    soc = _distinct_soc(np.concatenate([_knots(model, entry, celsius) for celsius in temperatures]))
    blocks = [_lookup_block(model, entry, soc, celsius) for celsius in temperatures]
    columns = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    rows, known, best = len(columns["soc"]), errors or {}, in_use(model)
    return columns | {
        "chosen": np.full(rows, best),
        "validation_rmse_volt": np.full(rows, known.get(member, np.nan)),
        "chosen_validation_rmse_volt": np.full(rows, known.get(best, np.nan)),
    }


def _lookup_block(model, member, soc, celsius):
    sampled = circuit_at(member["conditions"], soc, celsius)
    columns = {
        "model": np.full(len(soc), member["model"]),
        "ambient_temperature_celsius": np.full(len(soc), celsius),
        "soc": soc,
        "ocv_volt": open_circuit_volt(model, sampled, celsius),
        "extrapolated": sampled.outside_soc,
        "r0_ohm": sampled.circuit[0].parameters["r_ohm"],
    }
    for k, branch in enumerate(sampled.circuit[1:], 1):
        r, tau = _positive(branch.parameters["r_ohm"]), branch.parameters["tau_second"]
        columns |= {f"r{k}_ohm": r, f"tau{k}_second": tau, f"c{k}_farad": tau / r}
    return columns


def _knots(model, entry, celsius):
    """SoC of all knots of parameters and OCV at a measured temperature, ascending."""
    conditions = [
        condition
        for condition in entry["conditions"]
        if np.array_equal(
            celsius_of(condition["ambient_temperature_celsius"]), celsius, equal_nan=True
        )
    ]
    tables, measured = coldest_first(model["ocv"])
    weights = temperature_weights(measured, np.array([celsius]))
    read = [np.asarray(tables[k]["soc"]) for k, weight in enumerate(weights) if weight[0] > 0]
    soc = [[0.0, 1.0], *(condition["soc"] for condition in conditions)]
    for condition in conditions:
        # Counted SoC at which a table is read at its own knots, see `circuit_at`.
        scale = condition.get("ocv_scale", {"missing": 0.0, "stretch": 0.0})
        moved = scale["missing"] + scale["stretch"]
        soc += [(table_soc + moved) / (1.0 + scale["stretch"]) for table_soc in read]
    return _distinct_soc(np.clip(np.concatenate(soc), 0.0, 1.0))


def _distinct_soc(soc):
    """SoC values ascending, without those that differ by rounding only."""
    soc = np.unique(soc)
    return soc[np.append(True, np.diff(soc) > SAME_SOC)]


def _positive(values):
    """Values with a small one for zero, over which tools divide for a capacitance [ohm], [V]."""
    return np.where(np.abs(values) < SMALLEST, SMALLEST, values)


def _temperatures(member):
    temperatures = [condition["ambient_temperature_celsius"] for condition in member["conditions"]]
    return sorted({np.nan if celsius is None else float(celsius) for celsius in temperatures})


def _elements(branch, points):
    """Resistance that acts at once (n,), and the elements, of one branch on a grid of SoC."""
    kind, parameters = KINDS[branch.kind], branch.parameters
    if kind.over_current:
        sizes = {name: _positive(parameters[name]) for name in DIVIDED & parameters.keys()}
        return np.zeros(points), [{"kind": branch.kind} | parameters | sizes]
    if not kind.linear or kind.output != "volt":
        reason = kind.no_element or "it has no such element"
        name = branch.kind.replace("_", " ")
        raise Refusal(f"PyBaMM's Thevenin model cannot run {name}: {reason}")
    gain, lags = kind.drive(np.ones(points), **parameters), kind.lags(**parameters)
    direct = 1.0 - sum(lag.share for lag in lags)
    pairs = [(_positive(lag.share * gain), lag.constant + np.zeros(points)) for lag in lags]
    elements = [{"kind": "RC", "r_ohm": r, "tau_second": tau} for r, tau in pairs]
    return direct * gain, elements
