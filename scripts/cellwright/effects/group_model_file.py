"""A group's model with the effects found in it, as a document and back."""

import numpy as np

from cellwright.effects.group_model import Branch, Placed, group_fields
from cellwright.effects.library.groups import GROUP_LIBRARY


def document(case, state):
    """All that a simulation of the group needs.

    Parameters
    ----------
    case : group_case.GroupCase. state : group_case.GroupState.

    Returns
    -------
    model : dict: branches (each as Branch), values (of group_names and effects by name), effects
    (effect and branch, from 1), initial_soc (f, b) of the records fitted [1], hold.
    """
    return {
        "branches": [_plain(cell) for cell in case.cells],
        "values": {name: float(value) for name, value in state.solution.values.items()},
        "effects": [{"effect": p.effect.id, "branch": p.branch + 1} for p in state.placed],
        "initial_soc": case.fit_soc.tolist(),
        "hold": case.fit.hold,
    }


def _plain(cell):
    return cell._asdict() | {"ocv_volt": np.asarray(cell.ocv_volt).tolist()}


def fields_of(model):
    """The group of a document as `group_model.group_run` takes it, at the starts of its records.

    Parameters
    ----------
    model : dict, of `document`.

    Returns
    -------
    fields : group_model.GroupFields.
    """
    cells = [
        Branch(**{**one, "ocv_volt": np.asarray(one["ocv_volt"], float)})
        for one in model["branches"]
    ]
    placed = [Placed(GROUP_LIBRARY[e["effect"]], e["branch"] - 1) for e in model["effects"]]
    return group_fields(cells, np.asarray(model["initial_soc"], float), model["values"], placed)
