"""A model file as rows of a table, and one cell's model out of a group's."""

from cellwright.refusal import Refusal


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
    yield "r0", condition["r0_ohm"], condition["r0_std_ohm"], "Ohm"
    for number, branch in enumerate(condition["branches"], 1):
        yield f"r{number}", branch["r_ohm"], branch["r_std_ohm"], "Ohm"
        yield f"tau{number}", branch["tau_second"], branch["tau_std_second"], "s"


def _bounded(condition, name, soc):
    flags = condition.get("at_bound", [])
    return name in flags or f"{name.upper()} at SoC {soc:.3f}" in flags
