"""A model file as rows of a table, and one cell's model out of a group's."""

from cellwright.models.circuit import KINDS, UNRESOLVED_SECOND
from cellwright.models.conditions import std_name
from cellwright.refusal import Refusal

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
}


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
        without SoC ocv_missing, ocv_stretch and activation_energy, of the condition as a whole.
    """
    conditions = [(m["model"], c) for m in model["members"] for c in m["conditions"]]
    return [row for name, condition in conditions for row in _rows(name, condition)]


def _rows(member, condition):
    celsius = condition["ambient_temperature_celsius"]
    about = {"model": member, "ambient_temperature_celsius": celsius}
    for name, flag, values, stds, unit in _columns(condition):
        stds = stds or [None] * len(values)
        for soc, value, std in zip(condition["soc"], values, stds, strict=True):
            row = {"soc": soc, "parameter": name, "value": value, "std": std, "unit": unit}
            yield about | row | {"at_bound": _bounded(condition, name, flag, soc)}
    scale = condition.get("ocv_scale", {})
    whole = [(f"ocv_{name}", scale.get(name), "1") for name in ("missing", "stretch")]
    energy = condition.get("activation_energy_joule_per_mole")
    for name, value, unit in [*whole, ("activation_energy", energy, "J/mol")]:
        row = {"soc": None, "parameter": name, "value": value, "std": None, "unit": unit}
        if value is not None:
            yield about | row | {"at_bound": False}


def _columns(condition):
    """Name, name of the bound, values, deviations and unit of everything that runs over SoC."""
    yield "r0", "R0", condition["r0_ohm"], condition["r0_std_ohm"], "Ohm"
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
            flag = f"{short}{label}".upper()
            yield name, flag, branch[parameter], branch.get(std_name(parameter)), unit
    if "ocv_shift_volt" in condition:
        yield "ocv_shift", "", condition["ocv_shift_volt"], None, "V"


def _bounded(condition, name, flag, soc):
    flags = condition.get("at_bound", [])
    return name in flags or f"{flag} at SoC {soc:.3f}" in flags
