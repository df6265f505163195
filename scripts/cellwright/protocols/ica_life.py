"""Charges of an ageing record whose dQ/dV is taken: a few dozen, evenly over the life."""

import numpy as np

from cellwright.refusal import Refusal

AHEAD_SECOND = 1.0


def charges_of_life(cycles, steps, charge_ampere_hour, *, most):
    """Constant-current parts of complete charges, evenly over a life.

    Parameters
    ----------
    cycles : columns of stage `ageing_cycles`: cycle, direction, start_time_second, (k,) each.
    steps : columns kind, first_row, last_row, cv_first_row, start_time_second,
        current_mean_ampere, c_rate.
    charge_ampere_hour : (n,) of the clean series [Ah]. most : number of charges at most.

    Returns
    -------
    charges : list of (cycle, first row, last row, rate [1/h]), in time order.

    Raises
    ------
    Refusal : no complete charge in the record.
    """
    charging = np.flatnonzero(np.asarray(cycles["direction"]) == "charge")
    if not len(charging):
        raise Refusal("no complete charge in the ageing record, so no dQ/dV over its life")
    picked = charging[np.unique(np.linspace(0, len(charging) - 1, most).round().astype(int))]
    begins = np.append(np.asarray(cycles["start_time_second"], float), np.inf)
    found = []
    for k in picked:
        rows = _largest_step(steps, charge_ampere_hour, begins[k], begins[k + 1])
        if rows is not None:
            found.append((float(cycles["cycle"][k]), *rows))
    return found


def _largest_step(steps, charge, begin, end):
    """First and last row and rate of the constant-current step that moves most between times."""
    start = np.asarray(steps["start_time_second"])
    inside = (start > begin - AHEAD_SECOND) & (start < end - AHEAD_SECOND)
    inside &= np.isin(steps["kind"], ["CC", "CCCV"]) & (steps["current_mean_ampere"] > 0)
    first, held = steps["first_row"], steps["cv_first_row"]
    last = np.where(held > first, held - 1, steps["last_row"])
    moved = np.where(inside, charge[last] - charge[first], 0.0)
    if not len(moved) or moved.max() <= 0:
        return None
    step = int(moved.argmax())
    return int(first[step]), int(last[step]), float(steps["c_rate"][step])
