"""A reference cell's model with other resistances, open-circuit voltage and capacity."""

import numpy as np

from cellwright.bias.courses import FAST_SECOND, SLOW_SECOND, fast_share, risen
from cellwright.refusal import Refusal

NO_COURSES = ("soc", "branches", "tests", "at_bound")
LEAST = 0.1  # of the reference's resistance: no cell of its type has less
RESISTANCES = ("r_ohm", "r_charge_ohm", "r_discharge_ohm")


def refined(entry, knots):
    """A condition of a model with further knots of SoC; it says the same as before.

    Parameters
    ----------
    entry : dict, a condition of a member. knots : (k,) SoC; those beyond its own do not count.

    Returns
    -------
    entry : dict.
    """
    known = np.asarray(entry["soc"], float)
    soc = np.union1d(known, [z for z in knots if known[0] < z < known[-1]])

    def course(values):
        if not isinstance(values, list) or len(values) != len(known):
            return values
        there = np.array([np.nan if value is None else value for value in values], float)
        over = np.interp(soc, known, there)
        return [None if np.isnan(value) else value for value in over.tolist()]

    of_entry = {n: course(v) for n, v in entry.items() if n not in NO_COURSES}
    branches = [{n: course(v) for n, v in branch.items()} for branch in entry["branches"]]
    return entry | of_entry | {"soc": soc.tolist(), "branches": branches}


def changed(reference, change, *, cell, capacity, kind, notes, knots=()):
    """Model of a cell as its type's reference with other resistances, OCV and capacity.

    Parameters
    ----------
    reference : model dict of schema cellwright-model/2.
    change : function (soc (k,)) → ratio of the fast, of the slow resistance [1], addition to the
        OCV [V]; each a scalar or one value per knot. No resistance falls below `LEAST`.
    cell : id of the new cell.
    capacity : its capacity [Ah].
    kind : of the model, "bias" or "scaled". notes : list of sentences for the report.
    knots : (k,) SoC at which the change bends, which its conditions get besides their own.

    Returns
    -------
    model : dict.
    """
    size = capacity / reference["capacity_ampere_hour"]

    def entry_of(entry):
        entry = refined(entry, knots)
        *ratios, ocv = change(np.asarray(entry["soc"], float))
        fast, slow = factors_of(entry, *ratios)
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
    cell_fields = {
        "cell": cell,
        "capacity_ampere_hour": float(capacity),
        "kind": kind,
        "members": members,
    }
    # Neither the reference's left-out blocks nor its other capacities say anything of this cell,
    # and what is scaled here are tables over SoC, not a particle.
    of_reference = ("left_out", "checkups", "capacity_std_ampere_hour", "particle")
    of_reference += ("fitted_to", "intervals", "left_out_temperatures", "alike")
    rest = {name: value for name, value in reference.items() if name not in of_reference}
    return {**rest, **cell_fields, "notes": list(notes)}


def factors_of(entry, fast_ratio, slow_ratio):
    """Factors on what acts fast and slowly, that give these ratios of the responses to a step.

    A time constant between the two takes part in both responses: two linear equations at each knot,
    for the response after ten seconds and for what it grows until ten minutes.

    Parameters
    ----------
    entry : dict, a condition of a member.
    fast_ratio, slow_ratio : new over old response, scalar or (k,) [1].

    Returns
    -------
    fast, slow : (k,) factors, at least `LEAST`.
    """
    parts = [{"r_ohm": entry["r0_ohm"]}, *(b for b in entry["branches"] if "r_ohm" in b)]
    shares = [np.asarray(fast_share(part)) for part in parts]
    early, late = (
        [np.asarray(part["r_ohm"], float) * risen(part, second) for part in parts]
        for second in (FAST_SECOND, SLOW_SECOND)
    )
    rows = []
    for responses in (early, [b - a for a, b in zip(early, late, strict=True)]):
        by_fast = sum(share * r for share, r in zip(shares, responses, strict=True))
        rows.append((by_fast, sum(responses) - by_fast))
    (a, b), (c, d) = rows
    wanted = fast_ratio * (a + b), slow_ratio * (c + d)
    determinant = a * d - b * c
    solvable = determinant > 1e-6 * (a + b) * (c + d)
    divisor = np.where(solvable, determinant, 1.0)
    fast = np.where(solvable, (wanted[0] * d - wanted[1] * b) / divisor, fast_ratio)
    slow = np.where(solvable, (wanted[1] * a - wanted[0] * c) / divisor, slow_ratio)
    return np.maximum(fast, LEAST), np.maximum(slow, LEAST)


def _branch(branch, fast, slow, size):
    # ASSUME: Cells of one type have the same hysteresis, kinetics and diffusion over SoC, whatever
    # their capacity: charge constants go with the capacity, the lead of a surface with its inverse.
    share = fast_share(branch)
    factors = dict.fromkeys(RESISTANCES, share * fast + (1 - share) * slow)
    factors |= {"soc_per_ampere": 1.0 / size, "charge_ampere_hour": size}
    scaled = {n: (np.asarray(branch[n]) * f).tolist() for n, f in factors.items() if n in branch}
    return branch | scaled


def scaled_reference(reference, *, cell, capacity, resistance_ratio):
    """Model of a cell as the reference with its own capacity and all resistances scaled.

    Parameters
    ----------
    reference : model dict of schema cellwright-model/2.
    cell : id of the new cell.
    capacity : its capacity [Ah].
    resistance_ratio : its resistance over the reference's [1].

    Returns
    -------
    model : dict, kind "scaled". Time constants, the scale of the kinetics and the size of the
        hysteresis stay; its charge goes with the capacity, the lead of diffusion with its inverse.

    Raises
    ------
    Refusal : ratio or capacity not positive.
    """
    # ASSUME: A cell without its own pulses has the reference's OCV over SoC and its resistances
    # times one factor.
    if not (resistance_ratio > 0 and capacity > 0):
        raise Refusal(f"capacity {capacity} Ah or resistance ratio {resistance_ratio} not positive")
    note = f"scaled from {reference['cell']}: resistances times {resistance_ratio:.3f}"
    return changed(
        reference,
        lambda soc: (resistance_ratio, resistance_ratio, np.zeros(len(soc))),
        cell=cell,
        capacity=capacity,
        kind="scaled",
        notes=[note],
    )
