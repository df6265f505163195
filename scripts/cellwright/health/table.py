"""The table of health: one row a check-up or cycle and method, from what each method found."""

import numpy as np

from cellwright.health.electrodes.names import MODES as LOST
from cellwright.records import inputs
from cellwright.refusal import Refusal
from cellwright.result import Result

LOST_STD = tuple(f"{name}_std" for name in LOST)
METHODS = ("check-up", "ageing cycles", "degradation modes", "dQ/dV peaks")
CHECK_UP, CYCLES, MODES, PEAKS = METHODS
DISAGREE = "capacity and peaks of this check-up disagree"  # so a row's reason says it


def state_of_health(check_ups=(), fade=None, modes=(), peaks=()):
    """State of health of a cell by each method, at each check-up or cycle.

    check_ups : result of `check_ups` or its rows.
    fade : result of `fade`, or a pair (summary, columns), or None.
    modes, peaks : rows of degradation modes, of capacities from peaks; where capacity and peaks of
        a check-up disagree one of them is wrong, and the estimate is passed over.

    Returns rows, one a method and check-up or cycle, NaN where a method tells nothing. Where cells
    were cycled: their state at each check-up's cycle and at the last one. Raises Refusal: no method
    tells anything. Source: docs/health.md.
    """
    (life, course), check_ups = summary_and_columns(fade) or (None, None), inputs.rows(check_ups)
    trusted = [row for row in peaks if DISAGREE not in row["reason"]]
    rows = [
        _row(row["cycle"], row["capacity_ampere_hour"], row["soh"], method, row["soh_std"], row)
        for method, found in ((CHECK_UP, check_ups), (PEAKS, trusted))
        for row in found
        if np.isfinite(row["capacity_ampere_hour"])
    ]
    if life and life["source"] == CYCLES:
        rows += _of_cycles(life, course, [row["cycle"] for row in check_ups])
    by_age = sorted(modes, key=lambda row: row["cycle"])
    for row in by_age:
        if any(np.isfinite(row[mode]) for mode in LOST):
            # Its state of health is over the state that its losses refer to.
            size, lost = row["capacity_ampere_hour"], {n: row[n] for n in (*LOST, *LOST_STD)}
            soh = size / row["fresh_ampere_hour"]
            rows.append(_row(row["cycle"], size, soh, MODES, np.nan, row) | lost)
    for row in rows if life else ():
        row["knee_cycle"] = life["knee_cycle"]
        row["remaining_cycles"] = max(life["end_of_life_cycle"] - row["cycle"], 0.0)
    if not rows:
        raise Refusal("no capacity of a check-up and no life: no state of health")
    return Result({"rows": sorted(rows, key=lambda row: METHODS.index(row["method"]))})


def summary_and_columns(found, table="columns"):
    """(summary, columns) of a result; a pair or None as it is."""
    return (found.summary, getattr(found, table)) if hasattr(found, "summary") else found


def _row(cycle, capacity, soh, method, soh_std, found):
    """A row; `found` is what it is from, whose doubt it shares."""
    about = {"cycle": cycle, "capacity_ampere_hour": capacity, "soh": soh}
    lacking = dict.fromkeys(("knee_cycle", "remaining_cycles", *LOST, *LOST_STD), np.nan)
    doubt = {"doubt": found.get("doubt") or ""}
    return about | {"method": method, "soh_std": soh_std} | lacking | doubt


def _of_cycles(life, course, wanted):
    """Rows of the ageing cycles around those of check-ups, and of the last cycle.

    The median of the discharges next to a check-up: the law of the fade is smoother than a cell.
    """
    used = np.asarray(course["used"], bool)
    cycle = np.asarray(course["cycle"])[used]
    capacity = np.asarray(course["at_reference_ampere_hour"])[used]
    start, start_std = life["start_ampere_hour"], life["start_std_ampere_hour"]
    rows = []
    for at in (at for at in wanted if cycle[0] <= at < cycle[-1]):
        near = capacity[np.argsort(np.abs(cycle - at), kind="stable")[:7]]
        size = float(np.median(near))
        # Of a median of few; neighbours are not independent, so no less than their scatter.
        spread = float(np.std(near))
        # The share's error: of the capacity, and of what it is a share of.
        std = float(np.hypot(spread / start, size / start * start_std / start))
        rows.append(_row(float(at), size, size / start, CYCLES, std, life))
    last, soh = life["last_cycle"], life["soh"]
    end = _row(last, soh * start, soh, CYCLES, life["soh_std"], life)
    return [*rows, end]
