"""A model as another cell's with other resistances, open-circuit voltage and capacity."""

import numpy as np

from cellwright.models.design import FAST_SECOND

LEAST = 0.1  # of the reference's resistance: no cell of its type has less
RESISTANCES = ("r_ohm", "r_charge_ohm", "r_discharge_ohm")


def fast_and_slow(elements):
    """Resistance that acts within `FAST_SECOND`, and what is slower.

    Which part of the fast resistance is ohmic, charge transfer or a short time constant depends on
    the sampling and on the member; their sum compares between cells.

    Parameters
    ----------
    elements : dicts of parameters over SoC; those without r_ohm count nothing, one without
        tau_second acts at once.

    Returns
    -------
    fast_ohm, slow_ohm : (k,) at small currents [ohm].
    """
    pairs = [
        (np.asarray(one["r_ohm"], float), np.asarray(one.get("tau_second", 0.0)) <= FAST_SECOND)
        for one in elements
        if "r_ohm" in one
    ]
    return tuple(sum(np.where(fast == way, r, 0.0) for r, fast in pairs) for way in (True, False))


def ratio_of(resistance, more):
    """By what a resistance is to be multiplied to grow by a difference, at least `LEAST`.

    Parameters
    ----------
    resistance, more : (k,) [ohm], or more a scalar.
    """
    ratio = np.divide(
        resistance + more, resistance, out=np.ones_like(resistance), where=resistance > 0
    )
    return np.maximum(ratio, LEAST)


def changed(reference, change, *, cell, capacity, kind, note):
    """Model of a cell as its type's reference with other resistances, OCV and capacity.

    Parameters
    ----------
    reference : model dict of schema cellwright-model/2.
    change : function (condition) → ((factor on fast, on slow resistance), addition to the OCV [V]),
        each a scalar or one value per knot.
    cell : id of the new cell.
    capacity : its capacity [Ah].
    kind : what it was made from, "bias" or "scaled".
    note : what is to be said of it.

    Returns
    -------
    model : dict.
    """
    size = capacity / reference["capacity_ampere_hour"]

    def entry_of(entry):
        (fast, slow), ocv = change(entry)
        shift = np.asarray(entry.get("ocv_shift_volt", np.zeros(len(entry["soc"]))))
        return entry | {
            "r0_ohm": (fast * np.asarray(entry["r0_ohm"])).tolist(),
            "branches": [_branch(branch, fast, slow, size) for branch in entry["branches"]],
            "ocv_shift_volt": (shift + ocv).tolist(),
        }

    members = [
        member | {"conditions": [entry_of(entry) for entry in member["conditions"]]}
        for member in reference["members"]
    ]
    own = {"cell": cell, "capacity_ampere_hour": float(capacity), "kind": kind, "members": members}
    # What was left out of the reference's fit says nothing of this cell.
    known = {name: value for name, value in reference.items() if name != "left_out"}
    return {**known, **own, "notes": [note]}


def _branch(branch, fast, slow, size):
    # ASSUME: Cells of one type have the same hysteresis, kinetics and diffusion over SoC, whatever
    # their capacity: charge constants go with the capacity, the lead of a surface with its inverse.
    at_once = np.asarray(branch.get("tau_second", 0.0)) <= FAST_SECOND
    factors = dict.fromkeys(RESISTANCES, np.where(at_once, fast, slow))
    factors |= {"soc_per_ampere": 1.0 / size, "charge_ampere_hour": size}
    moved = {n: (np.asarray(branch[n]) * f).tolist() for n, f in factors.items() if n in branch}
    return branch | moved
