"""A model file as rows of a table, and one cell's model out of a group's."""

from cellwright.models.circuit import KINDS
from cellwright.models.conditions import std_name
from cellwright.refusal import Refusal

UNITS = {
    "r_ohm": "Ohm",
    "tau_second": "s",
    "scale_volt": "V",
    "m_volt": "V",
    "charge_ampere_hour": "Ah",
    "soc_per_ampere": "1/A",
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
    model : dict of schema cellwright-model/1.

    Returns
    -------
    rows : list of dict, by member, condition, parameter and SoC.
    """
    conditions = [(m["model"], c) for m in model["members"] for c in m["conditions"]]
    return [row for name, condition in conditions for row in _rows(name, condition)]


def _rows(member, condition):
    celsius = condition["ambient_temperature_celsius"]
    for name, values, stds, unit in _columns(condition):
        stds = stds or [None] * len(values)
        for soc, value, std in zip(condition["soc"], values, stds, strict=True):
            yield {
                "model": member,
                "ambient_temperature_celsius": celsius,
                "soc": soc,
                "parameter": name,
                "value": value,
                "std": std,
                "unit": unit,
                "at_bound": _bounded(condition, name, soc),
            }


def _columns(condition):
    """Name, values, deviations and unit; resistances and time constants numbered by their RC."""
    yield "r0", condition["r0_ohm"], condition["r0_std_ohm"], "Ohm"
    number = 0
    for branch in condition["branches"]:
        kind = branch.get("kind", "RC")
        pair = kind in ("RC", "kinetic")
        number += pair
        for name in KINDS[kind].parameters:
            label = f"{name.split('_')[0]}{number}" if pair else f"{kind}_{name.split('_')[0]}"
            yield label, branch[name], branch.get(std_name(name)), UNITS[name]


def _bounded(condition, name, soc):
    flags = condition.get("at_bound", [])
    return name in flags or f"{name.upper()} at SoC {soc:.3f}" in flags
