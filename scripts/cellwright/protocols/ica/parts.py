"""The parts of an interrupted charge as one: without what its polarisation takes to come back.

A pause lets the polarisation relax; as the charge goes on it builds up again, and V(Q) is bent by
it as by a peak of dQ/dV. In a linear cell the voltage is short of what it would be without the
pause by I·(R(t + P) − R(t)) at a time t after a pause of length P, with the step response R that
the pause itself shows.
"""

from itertools import pairwise

import numpy as np

from cellwright.numerics.relaxing import drift_of_rest
from cellwright.protocols.half_cycles import TURN_SHARE
from cellwright.protocols.ica.charge import USUAL_SHARE, constant_rows
from cellwright.protocols.messages import say
from cellwright.series.steps import constant_current_end

SURE = 2.0  # standard deviations by which a relaxation is seen
SLOPE_ROWS = 10  # and a tenth of a part: the rows that tell how fast its voltage rises
WINDOW = 0.5  # of the time at rest: over so much of its end the relaxation is read
GRID = 1.1  # ratio of the times after a pause that are tried


def parts_joined(time, current, voltage, charge, steps, step, ends, *, half="charge"):
    """Rows of a constant-current charge with the parts before and after its pauses.

    1. Parts of the same current, within 2 %, with rests alone between them are one charge. 2. After
    each pause the rows are left out in which what comes back of the polarisation changes the slope
    of the voltage by more than 2 %. 3. Where the charge goes on, or has begun, at another current
    or after a gap of the record, the curve ends there, which is said.

    time, current, voltage, charge : (n,) of the record [s], [A], [V], [Ah].
    steps : columns as of `constant_current_charge`, with start_time_second, end_time_second and
        duration_second. step : of the largest part, ends : its first and last row.
    half : as of `constant_current_charge`.

    Returns rows: (m,) of the charge in the order of time. notes : sentences on where it was cut.
    """
    columns = time, current, voltage, charge
    parts, notes = [ends], []
    for way in (1, -1):
        last = step
        while (beside := _beside(steps, last, way)) is not None:
            at = ends[way > 0] if last == step else parts[-1 if way > 0 else 0][way > 0]
            part = _part(steps, beside, current)
            reason = _not_one(steps, last, beside, part, ends, columns)
            if reason:
                if _moved(charge, part) > TURN_SHARE * _moved(charge, ends):
                    code = "ica.curve_ends" if way > 0 else "ica.curve_begins"
                    notes.append(say(code, volt=abs(voltage[at]), why=reason))
                break
            parts = [*parts, part] if way > 0 else [part, *parts]
            last = beside
    rows, words = _without_returns(parts, columns, half)
    return rows, (*words, *notes)


def _beside(steps, step, way):
    """Number of the next charging step in one direction of time, only rests between; or None."""
    number = step + way
    while 0 <= number < len(steps["kind"]) and steps["kind"][number] == "rest":
        number += way
    if not 0 <= number < len(steps["kind"]):
        return None
    of_charge = steps["kind"][number] in ("CC", "CCCV") and steps["current_mean_ampere"][number] > 0
    return number if of_charge else None


def _part(steps, step, current):
    """First and last row of the constant current of a step."""
    first = int(steps["first_row"][step])
    held = steps["cv_first_row"][step]
    last = constant_current_end(first, steps["last_row"][step], held) - 1
    return constant_rows(current, first, int(last))


def _moved(charge, part):
    return float(charge[part[1]] - charge[part[0]])


def _not_one(steps, last, beside, part, ends, columns):
    """Why two steps are not parts of one charge, "" where they are."""
    first, second = min(last, beside), max(last, beside)
    current = columns[1]
    usual, other = (np.median(current[a : b + 1]) for a, b in (ends, part))
    if abs(other / usual - 1.0) > USUAL_SHARE:
        return say("ica.other_current", other=other, usual=usual)
    if steps["cv_first_row"][first] >= 0:
        return say("ica.held")
    between = np.arange(first + 1, second + 1)
    if not (steps["start_time_second"][between] == steps["end_time_second"][between - 1]).all():
        return say("ica.gap")
    return ""


def _without_returns(parts, columns, half):
    """Rows of the parts, and a sentence on their pauses and what is left out after them."""
    time, _, voltage, charge = columns
    rows, pauses, left = [np.arange(parts[0][0], parts[0][1] + 1)], [], 0.0
    for before, part in pairwise(parts):
        pause = slice(before[1] + 1, part[0])
        second = _return_second(time, voltage, before, pause)
        all_rows = np.arange(part[0], part[1] + 1)
        kept = all_rows[time[all_rows] - time[part[0] - 1] >= second]
        end = kept[0] if len(kept) else part[1]
        left += float(charge[end] - charge[part[0] - 1])
        rested = time[part[0] - 1] - time[before[1]]
        pauses.append(say("ica.pause", second=rested, volt=abs(voltage[before[1]])))
        rows.append(kept)
    if not pauses:
        return rows[0], ()
    named = ", ".join(pauses[:3]) + (" …" if len(pauses) > 3 else "")
    about = {"half": half, "count": len(pauses), "pauses": named, "left": left}
    return np.concatenate(rows), (say("ica.paused", **about),)


# ASSUME: Beyond the length of a pause its relaxation would go on with the logarithm of time.
def _return_second(time, voltage, before, pause):
    """Time after a pause until what comes back changes the slope of the voltage by 2 % [s]."""
    begin, length = time[before[1]], time[pause.stop - 1] - time[before[1]]
    rested, volts = time[pause] - begin, voltage[pause]
    # A row may stand at the very edge.
    rested, volts = rested[rested > 0], volts[rested > 0]
    if not len(rested):
        return 0.0
    allowed = USUAL_SHARE * _rise(time, voltage, before)
    beyond = _rate(rested, volts, length)
    # So long a time that a pause as old changes nothing: each of it is a share of the last rate.
    longest = max(length, np.sqrt(max(beyond, 0.0) * length**2 / max(allowed, 1e-300)))
    tried = np.geomspace(rested[0], max(longest, rested[0]) * GRID, 200)
    returns = np.array(
        [
            (_rate(rested, volts, t) if t < length else beyond * length / t)
            - beyond * length / (t + length)
            for t in tried
        ]
    )
    late = np.flatnonzero(~(returns <= allowed))
    return float(tried[min(late[-1] + 1, len(tried) - 1)]) if len(late) else 0.0


def _rate(rested, volts, second):
    """Rate at which the voltage falls at a time of a pause [V/s]; 0 where noise hides it.

    Infinite where fewer than three rows tell.
    """
    rows = rested <= second * (1 + 1e-9)
    if np.count_nonzero(rested[rows] >= WINDOW * second) < 3:
        return np.inf
    drift = drift_of_rest(rested[rows], volts[rows], 0.0)
    return -drift.volt / second if abs(drift.volt) > SURE * drift.std_volt else 0.0


def _rise(time, voltage, part):
    """How fast the voltage rises at the end of a part [V/s]."""
    count = max(SLOPE_ROWS, (part[1] - part[0] + 1) // 10)
    rows = slice(max(part[1] + 1 - count, part[0]), part[1] + 1)
    if rows.stop - rows.start < 2:
        return 0.0
    return max(float(np.polyfit(time[rows], voltage[rows], 1)[0]), 0.0)
