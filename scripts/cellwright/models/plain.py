"""The member of a model for what knows resistors and RC pairs only: packs, look-up tables."""

import numpy as np

from cellwright.refusal import Refusal


def is_plain(member):
    """Whether a member is made of an ohmic resistance and RC pairs, and of nothing that warms them.

    Parameters
    ----------
    member : dict, a member of a model file.
    """
    if "own_heat" in member:
        return False
    branches = [branch for entry in member["conditions"] for branch in entry["branches"]]
    return all(branch.get("kind", "RC") == "RC" for branch in branches)


def plain_member(model):
    """Name of the member for tools that know resistors and capacitors only.

    Kinetics are not taken linear, nor hysteresis left out: the rest of such a member was fitted
    beside them and is no model by itself.

    Parameters
    ----------
    model : dict, a model file.

    Returns
    -------
    name : the chosen member where it is plain, else the plain one of the smallest error of what was
        left out of its fit (`left_out_rmse_volt`); where none states it, that of most pairs.

    Raises
    ------
    Refusal : no member is plain.
    """
    plain = [member for member in model["members"] if is_plain(member)]
    if not plain:
        raise Refusal(f"no member of the model of {model['cell']} is made of RC pairs alone")
    if model["chosen"] in [member["model"] for member in plain]:
        return model["chosen"]
    return min(plain, key=_rank)["model"]


def _rank(member):
    error = member.get("left_out_rmse_volt")
    return np.inf if error is None else error, -len(member["conditions"][0]["branches"])
