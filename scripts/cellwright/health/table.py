"""The table of health: one row a check-up or cycle and method, from what each method found."""

from typing import NamedTuple

import numpy as np

LOST = ("lli", "lam_negative", "lam_positive")
NEAR = 7  # discharges around a check-up whose median tells the capacity there
CHECK_UP, CYCLES, MODES, PEAKS = "check-up", "ageing cycles", "degradation modes", "dQ/dV peaks"
DISAGREE = "capacity and peaks of this check-up disagree"  # so a row's reason says it


class HealthRow(NamedTuple):
    """State of health of one cell at one cycle by one method; NaN where the method tells nothing.

    knee_cycle, remaining_cycles : of the cell's life, the latter from this cycle on.
    """

    cycle: float
    capacity_ampere_hour: float
    soh: float
    method: str
    soh_std: float
    knee_cycle: float = np.nan
    remaining_cycles: float = np.nan
    lli: float = np.nan
    lam_negative: float = np.nan
    lam_positive: float = np.nan


def health_rows(*, check_ups=(), life=None, course=None, modes=(), peaks=()):
    """Rows of the health of one cell.

    Parameters
    ----------
    check_ups : rows of stage `checkups`. life, course : row of stage `life` and columns of
        `fade_course`, or None. modes, peaks : rows of stages `degradation_modes` and
        `health_from_peaks`; where capacity and peaks of a check-up disagree one of them is wrong,
        and the estimate stays in its artefact.

    Returns
    -------
    rows : list of HealthRow by method and cycle. Where cells were cycled: their state at each
        check-up's cycle and at the last one.
    """
    knee = life["knee_cycle"] if life else np.nan
    end = life["end_of_life_cycle"] if life else np.nan
    rows = [
        HealthRow(row["cycle"], row["capacity_ampere_hour"], row["soh"], CHECK_UP, row["soh_std"])
        for row in check_ups
        if np.isfinite(row["capacity_ampere_hour"])
    ]
    if life:
        rows += _of_cycles(life, course, [row["cycle"] for row in check_ups])
    told = sorted(modes, key=lambda row: row["cycle"])
    rows += [_of_modes(row, told[0]) for row in told if any(np.isfinite(row[m]) for m in LOST)]
    rows += [
        HealthRow(row["cycle"], row["capacity_ampere_hour"], row["soh"], PEAKS, row["soh_std"])
        for row in peaks
        if np.isfinite(row["capacity_ampere_hour"]) and DISAGREE not in row["reason"]
    ]
    return [
        row._replace(knee_cycle=knee, remaining_cycles=max(end - row.cycle, 0.0)) for row in rows
    ]


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
        near = capacity[np.argsort(np.abs(cycle - at), kind="stable")[:NEAR]]
        size = float(np.median(near))
        # Of a median of few; neighbours are not independent, so no less than their scatter.
        spread = float(np.std(near))
        std = float(np.hypot(spread / start, size / start * start_std / start))
        rows.append(HealthRow(float(at), size, size / start, CYCLES, std))
    last = life["last_cycle"]
    return [*rows, HealthRow(last, life["soh"] * start, life["soh"], CYCLES, life["soh_std"])]


def _of_modes(row, fresh):
    """A row of degradation modes; its state of health over the first one by the same method."""
    size = row["capacity_ampere_hour"]
    base = HealthRow(row["cycle"], size, size / fresh["capacity_ampere_hour"], MODES, np.nan)
    return base._replace(**{name: row[name] for name in LOST})
