"""Whether a discharge begins full and a charge empty: from what came before, else from its rest.

A full cell rests below its upper cut-off, an aged one further below: how far is no sign of how full
it is. What tells is the half cycle before, in this record or in the test before it in time. Where
neither is known, a rest tells no more than how much charge may be missing.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

NEAR_VOLT = 0.010  # a limit counts as reached this near to it
MOST_MISSING = 0.10  # of the charge moved: beyond it a start is not known well enough to be counted
ENDS = {-1: "full", 1: "empty"}  # how a discharge (-1) and a charge (+1) are to begin


class Start(NamedTuple):
    """How a half cycle begins.

    fault : why it does not begin full (discharge) or empty (charge), "" where it does.
    missing_ampere_hour : standard deviation of the charge that it may lack [Ah], 0 where what came
        before tells its start. words : what an unsure start is known from.
    """

    fault: str = ""
    missing_ampere_hour: float = 0.0
    words: str = ""


def start_at_rest(columns, rows, sign, limits, *, known_rests_volt=(), cut_short_volt=None):
    """How a half cycle begins whose cell rests before it, by the voltage of that rest.

    1. Resting no lower than the same cell did before half cycles of which the start is known (for a
    charge: no higher), it begins as they did. 2. Else the voltage that lacks to the cut-off bounds
    the charge that may be missing: open-circuit curves are steepest at their ends, so it is no more
    than what it takes to lower the voltage as far again. Under load this is counted from the first
    loaded sample on; it is then somewhat too small, for the load's own polarisation still grows,
    and stands for the standard deviation instead of a bound. 3. Where that exceeds 10 % of the
    charge moved, the start is not known.

    Parameters
    ----------
    columns : (current [A] positive on charge, voltage [V], charge [Ah]), (n,) each.
    rows : first row, at rest, and last row of the half cycle.
    sign : +1 charge, -1 discharge. limits : lower and upper cut-off [V], not None.
    known_rests_volt : rest voltages before half cycles whose start is known [V].
    cut_short_volt : loaded voltage at which the half cycle before ended short of its cut-off [V].

    Returns
    -------
    start : Start.
    """
    current, voltage, charge = (column[rows[0] : rows[1] + 1] for column in columns)
    rest, end = float(voltage[0]), ENDS[sign]
    if cut_short_volt is not None and sign * (rest - cut_short_volt) >= 0:
        return Start(f"it does not start {end}: what came before was cut short")
    lacking = sign * (rest - limits[sign < 0]) - NEAR_VOLT
    if lacking <= 0:
        return Start()
    if any(sign * (rest - known) <= NEAR_VOLT for known in known_rests_volt):
        return Start(words=f"rests at {rest:.3f} V as before cycles that start {end}")
    missing = _charge_of_fall(np.abs(current), sign * voltage, charge, lacking)
    moved = abs(float(charge[-1] - charge[0]))
    if missing > MOST_MISSING * moved:
        share = f"{min(missing / moved, 1):.0%} of its charge" if moved else "all of its charge"
        may = f"may lack {share}" if sign < 0 else f"may already hold {share}"
        words = (
            f"it does not start {end} or is not known to: with a rest voltage of {rest:.3f} V it "
        )
        return Start(f"{words}{may}, and no test before it tells more")
    return Start("", missing, f"start by a rest voltage of {rest:.3f} V, ± {missing:.2g} Ah")


def _charge_of_fall(size, along, charge, fall_volt):
    """Charge [Ah] until the loaded voltage has gone on by `fall_volt` since the load was on.

    size, along : current [A] without its sign; voltage, rising in the direction of the load [V].
    """
    loaded = np.flatnonzero(size >= np.median(size[1:]) / 2)
    loaded = loaded[loaded > 0]
    if not len(loaded):
        return abs(float(charge[-1] - charge[0]))
    beyond = np.flatnonzero(along[loaded] - along[loaded[0]] >= fall_volt)
    last = loaded[beyond[0]] if len(beyond) else -1
    return abs(float(charge[last] - charge[0]))


ANEW_SHARE = 0.3  # of the charge to the cut-off: more after it than this was never left in the cell
RISEN_SHARE = 0.5  # of the way back from the cut-off to the rest before: a cell charged in between


def spans_with_lost_charges(spans, columns, steps, limits):
    """Half cycles cut where the one between them was not logged.

    Without the charge between them two discharges look like one. They are two where the first has
    reached its cut-off, the cell then rests at more than half of the way back to the rest that the
    first began with, and the second moves at least 30 % of the first's charge: no cell gives that
    after its cut-off. Likewise two charges.

    Parameters
    ----------
    spans : list of (sign, first step, last step), from `capacity.turns`.
    columns : (current [A], voltage [V], charge [Ah]), (n,) each. steps : Steps of the record.
    limits : lower and upper cut-off [V]; one that is None cuts nothing.

    Returns
    -------
    spans : list of the same.
    """
    return [part for span in spans for part in _parts(span, columns, steps, limits)]


def _parts(span, columns, steps, limits):
    sign, first, last = span
    limit = limits[sign > 0]
    if limit is None:
        return [span]
    _, voltage, charge = columns
    loads = [k for k in range(first, last + 1) if steps.kind[k] != "rest"]
    begins = [loads[0]] if loads else []
    for earlier, load in pairwise(loads):
        row, start = steps.last_row[earlier], steps.first_row[begins[-1]] - 1
        if sign * voltage[row] < sign * limit - NEAR_VOLT:
            continue
        rest, rest_before = voltage[steps.first_row[load] - 1], voltage[max(start, 0)]
        back = (rest - voltage[row]) / ((rest_before - voltage[row]) or np.inf)
        moved = abs(charge[row] - charge[max(start, 0)])
        after = _to_cutoff(sign, load, loads, (voltage, charge), steps, limit)
        if back >= RISEN_SHARE and after >= ANEW_SHARE * moved:
            begins.append(load)
    ends = [*[k - 1 for k in begins[1:]], last]
    return [(sign, k, end) for k, end in zip([first, *begins[1:]], ends, strict=True)]


def _to_cutoff(sign, load, loads, columns, steps, limit):
    """Charge [Ah] from a load to the first end of one that reaches the cut-off, or to the last."""
    voltage, charge = columns
    later = loads[loads.index(load) :]
    ends = [steps.last_row[k] for k in later]
    reached = [row for row in ends if sign * voltage[row] >= sign * limit - NEAR_VOLT]
    begin = max(steps.first_row[load] - 1, 0)
    return abs(charge[(reached or ends[-1:])[0]] - charge[begin])
