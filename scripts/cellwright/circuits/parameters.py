"""A model file as rows: each parameter over SoC and temperature, for `models.csv`."""

from cellwright.circuits import particle
from cellwright.circuits.circuit import KINDS, UNRESOLVED_SECOND
from cellwright.circuits.model_file import std_name, std_of_r0
from cellwright.result import Result

# Parameters of branches: name in the table, without the branch's number or kind, and unit.
NAMES = {
    "r_ohm": ("r", "Ohm"),
    "r_charge_ohm": ("r_charge", "Ohm"),
    "r_discharge_ohm": ("r_discharge", "Ohm"),
    "tau_second": ("tau", "s"),
    "scale_volt": ("scale", "V"),
    "m_volt": ("m", "V"),
    "charge_ampere_hour": ("charge", "Ah"),
    "soc_per_ampere": ("gain", "1/A"),
    "exchange_ampere": ("exchange", "A"),
    "charge_coefficient": ("charge_coefficient", "1"),
}


def model_result(content):
    """Result of a step that makes a model: the document, its parameters as rows, its notes."""
    return Result({"parameters": parameter_rows(content)}, content, tuple(content["notes"]))


def parameter_rows(model):
    """Rows model, ambient_temperature_celsius, soc, parameter, value, std, unit, at_bound.

    Parameters
    ----------
    model : dict of schema cellwright-model/2.

    Returns
    -------
    rows : list of dict, by member, condition, parameter and SoC: r0, then r1, tau1, … of RC pairs
        and kinetics (these with scale1, …), rct, tauct, scalect of the charge transfer that no
        sample resolves, hysteresis_m, hysteresis_charge, diffusion_gain, diffusion_tau, ocv_shift;
        steady_resistance, the sum of r0 and all resistances of branches for small currents, of
        members that were identified;
        without SoC ocv_missing, ocv_stretch, r0_delay (how long after a step of the current the
        first fitted samples lie: what relaxes sooner is part of r0) and activation_energy, of the
        condition as a whole.
        Of a particle each of its parameters, over SoC where it has knots, "P".
    """
    conditions = [(m["model"], c) for m in model["members"] for c in m["conditions"]]
    rows = [row for name, condition in conditions for row in _rows(name, condition)]
    return [*rows, *_of_particle(model.get("particle") or {})]


def _of_particle(document):
    """Rows of a particle's parameters; the energies are of all temperatures together."""
    about = {"model": particle.NAME, "ambient_temperature_celsius": None, "at_bound": False}
    for part in particle.PARTS if document else ():
        values, stds = document[part.name], document[f"{part.name}_std"]
        for soc, value, std in zip(part.knots or [None], values, stds, strict=True):
            row = {"soc": soc, "parameter": part.name, "value": value, "std": std}
            yield about | row | {"unit": part.unit}


def _rows(member, condition):
    celsius = condition["ambient_temperature_celsius"]
    about = {"model": member, "ambient_temperature_celsius": celsius}
    flags = {(one["parameter"], one["soc"]) for one in condition.get("at_bound", [])}
    for name, flag, values, stds, unit in _columns(condition):
        stds = stds or [None] * len(values)
        for soc, value, std in zip(condition["soc"], values, stds, strict=True):
            row = {"soc": soc, "parameter": name, "value": value, "std": std, "unit": unit}
            yield about | row | {"at_bound": bool(flags & {(flag, soc), (flag, None)})}
    scale = condition.get("ocv_scale", {})
    whole = [(f"ocv_{name}", scale.get(name), "1") for name in ("missing", "stretch")]
    whole.append(("r0_delay", condition.get("first_sample_second"), "s"))
    whole.append(("activation_energy", condition.get("activation_energy_joule_per_mole"), "J/mol"))
    for name, value, unit in whole:
        row = {"soc": None, "parameter": name, "value": value, "std": None, "unit": unit}
        if value is not None:
            yield about | row | {"at_bound": False}


def _columns(condition):
    """Name, name of the bound, values, deviations and unit of each quantity over SoC."""
    yield "r0", "r0", condition["r0_ohm"], std_of_r0(condition), "Ohm"
    number = 0
    for branch in condition["branches"]:
        kind, label = branch.get("kind", "RC"), ""
        if kind in ("RC", "kinetic"):
            resolved = kind == "RC" or branch["tau_second"][0] > UNRESOLVED_SECOND
            number += resolved
            label = str(number) if resolved else "ct"
        for parameter in KINDS[kind].parameters:
            short, unit = NAMES[parameter]
            name = f"{short}{label}" if label else f"{kind}_{short}"
            yield name, f"{short}{label}", branch[parameter], branch.get(std_name(parameter)), unit
    if "steady_std_ohm" in condition:
        parts = [branch["r_ohm"] for branch in condition["branches"] if "r_ohm" in branch]
        steady = [sum(at_knot) for at_knot in zip(condition["r0_ohm"], *parts, strict=True)]
        yield "steady_resistance", "", steady, condition["steady_std_ohm"], "Ohm"
    if "ocv_shift_volt" in condition:
        yield "ocv_shift", "", condition["ocv_shift_volt"], None, "V"
