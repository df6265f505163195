"""Resistance as an indicator of health: capacity from R0 over SoC over a fleet of cells."""

from typing import NamedTuple

import numpy as np

from cellwright.laws.points import pulses_of_kind
from cellwright.numerics.shrunk_regression import predicted, shrunk
from cellwright.numerics.statistics import NORMAL_95, rms
from cellwright.records import inputs
from cellwright.records.conditions import SAME_SOC
from cellwright.refusal import Refusal
from cellwright.result import Result


class Fleet(NamedTuple):
    """Resistances of the cells of a fleet at the same states of charge.

    cells : names. capacity_ampere_hour : (n,), NaN where not known [Ah]. resistance_ohm : (n, k)
    at soc (k,) [Ω], [1]. delay : into the pulse, "first sample" or "1 s". left_out : name → reason.
    """

    cells: list
    capacity_ampere_hour: np.ndarray
    resistance_ohm: np.ndarray
    soc: np.ndarray
    delay: str
    left_out: dict


def fleet_resistance(cells):
    """Capacity of each cell of a fleet from its resistances over SoC, as the other cells tell it.

    cells : (name, first row of `check_ups`, its rows of growth) each, of one type and temperature.

    Returns rows, one a cell; line: of resistance over capacity, a dict. Raises Refusal: fewer than
    six cells, or all alike. Source: thesis 4.4; docs/health.md.
    """
    # Means over the SoC that all cells were pulsed at: resistance rises steeply when empty.
    ready = [(name, inputs.rows([row])[0], inputs.rows(growth)) for name, row, growth in cells]
    fleet = over_shared_soc(ready)
    line, rows = capacity_from_resistance(fleet)
    return Result({"rows": rows}, {"line": line, "delay": fleet.delay})


def capacity_from_resistance(fleet):
    """Capacity of each cell from its resistances over SoC, by what the other cells tell.

    1. R0 = a + b · capacity by least squares, R0 the mean over SoC. 2. The cell whose residual,
    over the scatter of the others, is the largest is an outlier where a fleet of this size without
    one would have as large a residual in 5 % of cases; it is taken out and the rest looked at
    again, up to 15 %. 3. Each cell's capacity is predicted from its resistances at all states of
    charge by a ridge regression over the other cells that are no outliers. Its penalty is chosen
    without the cell; where resistance does not clearly help, the mean of the others is predicted.

    Parameters
    ----------
    fleet : Fleet of one type at one temperature.

    Returns
    -------
    line : dict as of `tables/fleet_health_lines`; what it says of errors is of the cells that are
        no outliers, each predicted by the others.
    rows : list of dict as of `tables/fleet_health`, those of unknown capacity and of no use last.

    Raises
    ------
    Refusal : fewer than six cells with both; all alike.

    Source: thesis 4.4 (50 cells of one used pack: mean R0 over SoC is a line over capacity);
    outliers: R. D. Cook, S. Weisberg, Residuals and Influence in Regression (1982), 2.2.2.
    """
    known = np.isfinite(fleet.capacity_ampere_hour)
    if known.sum() < 6:
        found = f"{known.sum()} of its cells have them"
        raise Refusal(
            f"no fleet comparison: it needs 6 cells with capacity and pulse tests, {found}"
        )
    capacity, ohms = fleet.capacity_ampere_hour, fleet.resistance_ohm
    mean = ohms.mean(axis=1)
    ordered = np.sort(capacity[known])
    spread = min(np.ptp(ordered[1:]), np.ptp(ordered[:-1]))
    # A line over capacities that are alike but for one cell would hang on that cell.
    if spread < 1e-3 * ordered.mean() or np.ptp(mean[known]) == 0:
        raise Refusal("all cells but one have one capacity, or all one resistance: no line")
    inside = known.copy()
    inside[known] = _inliers(capacity[known], mean[known])
    order = np.argsort(~known, kind="stable")
    rows = [_cell(fleet, inside, place) for place in order]
    unknown = [np.nan] * 6
    rows += [_row(name, unknown, False, reason) for name, reason in fleet.left_out.items()]
    known_rows = [row for row in rows if np.isfinite(row["error_ampere_hour"])]
    return _line(fleet, inside, known_rows), rows


def _row(cell, numbers, outlier, reason):
    """One row of the table of a fleet's cells."""
    names = ("capacity_ampere_hour", "resistance_ohm", "predicted_ampere_hour")
    names += ("predicted_std_ampere_hour", "error_ampere_hour", "distance")
    known = dict(zip(names, numbers, strict=True))
    return {"cell": cell} | known | {"outlier": outlier, "reason": reason}


def _inliers(capacity, resistance):
    """Which cells belong to one line."""
    from scipy.stats import t as student

    inside = np.ones(len(capacity), bool)
    # More than 15 % of the cells are no outliers, but no line.
    for _ in range(int(0.15 * len(capacity))):
        places = np.flatnonzero(inside)
        distance = np.abs(_studentised(capacity[places], resistance[places]))
        worst = int(np.argmax(distance))
        chance = 2 * student.sf(distance[worst], len(places) - 3) * len(places)
        if chance > 0.05:
            break
        inside[places[worst]] = False
    return inside


def _studentised(x, y):
    """Residuals of a line over what each is expected to be, by the scatter of the others."""
    design = np.column_stack([np.ones(len(x)), x - x.mean()])
    hat = np.einsum("ij,jk,ik->i", design, np.linalg.inv(design.T @ design), design)
    residual = y - design @ np.linalg.lstsq(design, y, rcond=None)[0]
    freedom = len(x) - 3
    left = np.sum(residual**2) - residual**2 / (1 - hat)
    # A perfect line has no scatter to divide by.
    variance = np.maximum(left / freedom, (1e-9 * np.abs(y).max()) ** 2)
    return residual / np.sqrt(variance * (1 - hat))


def _cell(fleet, inside, place):
    """One cell beside what the others tell of its capacity."""
    others = inside.copy()
    others[place] = False
    size, std = _predicted(fleet, others, place)
    own, mean = fleet.capacity_ampere_hour[place], float(fleet.resistance_ohm[place].mean())
    error, outlier = size - own, bool(np.isfinite(own) and not inside[place])
    reason = ""
    if outlier:
        line = np.polyfit(
            fleet.capacity_ampere_hour[others], fleet.resistance_ohm[others].mean(axis=1), 1
        )
        usual = 1e3 * np.polyval(line, own)
        reason = (
            f"mean resistance {1e3 * mean:.3g} mΩ, where the line of the others has {usual:.3g} at "
            f"its {own:.4g} Ah: it does not belong to them"
        )
    numbers = (float(own), mean, size, std, error, error / std)
    return _row(fleet.cells[place], numbers, outlier, reason)


def _predicted(fleet, others, place):
    """Capacity [Ah] of a cell from its resistances, by other cells, and its standard deviation."""
    ohms, capacity = fleet.resistance_ohm[others], fleet.capacity_ampere_hour[others]
    centre, scale = ohms.mean(axis=0), ohms.std(axis=0, ddof=1)
    # A SoC at which all cells are alike tells nothing, and is no fault.
    scale = np.where(scale > 0, scale, 1.0)
    fit = shrunk((ohms - centre) / scale, (capacity - capacity.mean())[:, None])
    found = predicted(fit, (fleet.resistance_ohm[place] - centre) / scale)
    return float(capacity.mean() + found.change[0]), float(found.half_interval[0] / NORMAL_95)


def _line(fleet, inside, rows):
    """The line of a fleet and its scores; rows of the cells of known capacity, in their order."""
    x, y = fleet.capacity_ampere_hour[inside], fleet.resistance_ohm[inside].mean(axis=1)
    design = np.column_stack([np.ones(len(x)), x])
    values = np.linalg.lstsq(design, y, rcond=None)[0]
    variance = np.sum((y - design @ values) ** 2) / (len(x) - 2)
    std = np.sqrt(np.diagonal(np.linalg.inv(design.T @ design)) * variance)
    of_line = [row for row in rows if not row["outlier"]]
    held_out = rms([row["error_ampere_hour"] for row in of_line])
    spread = rms(_left_out(x, np.ones((len(x), 1))))
    # Where resistance explains less than a fifth of the variance, it is of no use.
    helps = "predicts" if held_out**2 <= (1 - 0.2) * spread**2 else "does not tell"
    share = 100 / x.mean()
    verdict = (
        f"resistance over SoC {helps} the capacity of a cell left out: to "
        f"{share * held_out:.1f} %, without it {share * spread:.1f} %"
    )
    by_line = rms(_left_out(x, np.column_stack([np.ones(len(x)), y / y.mean() - 1])))
    return {
        "intercept_ohm": float(values[0]),
        "intercept_std_ohm": float(std[0]),
        "slope_ohm_per_ampere_hour": float(values[1]),
        "slope_std_ohm_per_ampere_hour": float(std[1]),
        "correlation": float(np.corrcoef(x, y)[0, 1]),
        "held_out_rms_ampere_hour": held_out,
        "held_out_share": float(held_out / x.mean()),
        "line_held_out_rms_ampere_hour": by_line,
        "spread_ampere_hour": spread,
        "covered": float(np.mean([abs(row["distance"]) <= NORMAL_95 for row in of_line])),
        "cells": len(rows),
        "outliers": ", ".join(row["cell"] for row in rows if row["outlier"]),
        "socs": len(fleet.soc),
        "first_soc": float(fleet.soc[0]),
        "last_soc": float(fleet.soc[-1]),
        "verdict": verdict,
    }


def _left_out(y, design):
    """Errors of each value as least squares over the others predict it."""
    hat = design @ np.linalg.pinv(design)
    return (hat @ y - y) / (1 - np.diagonal(hat))


def over_shared_soc(cells):
    """A fleet's resistances at the states of charge that its cells share.

    First samples are compared where all were taken alike, else the resistance at 1 s: a first
    sample 0.5 s into a pulse holds a tenth more than one at 10 ms, which a line over cells of two
    instruments would take for scatter, or for age. A cell that alone would take away more than half
    of the usual span of SoC is left out, with the reason.

    Parameters
    ----------
    cells : list of (name, row of `ratings.check_ups`, rows of `ratings.resistance_growth`), of the
        check-up that counts.

    Returns
    -------
    fleet : Fleet, cells in their order; one without discharge pulses of known SoC is left out.
    """
    delays = np.array([check_up["first_delay_second"] for _, check_up, _ in cells], float)
    known = delays[np.isfinite(delays)]
    # Within a factor of two, and below 10 ms whatever the factor, first samples are alike.
    alike = len(known) and known.max() <= 2.0 * max(known.min(), 0.01)
    delay = 0.0 if alike else 1.0
    courses = {name: _course(check_up, rows, delay) for name, check_up, rows in cells}
    word = "first sample" if alike else "1 s"
    left_out = {
        name: f"no discharge pulse of its first check-up has a known SoC and a resistance ({word})"
        for name, course in courses.items()
        if not len(course[0])
    }
    courses = {name: course for name, course in courses.items() if name not in left_out}
    if not courses:
        return Fleet([], np.empty(0), np.empty((0, 0)), np.empty(0), word, left_out)
    ends = np.array([(soc[0], soc[-1]) for soc, _ in courses.values()])
    inside = _sharing(ends)
    low, high = ends[inside, 0].max(), ends[inside, 1].min()
    counts = [
        np.sum((soc >= low - SAME_SOC) & (soc <= high + SAME_SOC)) for soc, _ in courses.values()
    ]
    # More states of charge than ten tell no more than a pulse each 5 to 10 %.
    count = int(np.clip(np.median(counts), 1, 10)) if high > low else 1
    socs = np.linspace(low, high, count) if count > 1 else np.array([(low + high) / 2])
    names = [name for name, shares in zip(courses, inside, strict=True) if shares]
    sizes = {name: check_up["capacity_ampere_hour"] for name, check_up, _ in cells}
    left_out |= {
        name: f"pulses from {100 * end[0]:.0f} to {100 * end[1]:.0f} % SoC only, where the others "
        f"share {100 * low:.0f} to {100 * high:.0f} %"
        for name, end, shares in zip(courses, ends, inside, strict=True)
        if not shares
    }
    return Fleet(
        names,
        np.array([sizes[name] for name in names], float),
        np.array([np.interp(socs, *courses[name]) for name in names]),
        socs,
        word,
        left_out,
    )


def _course(check_up, rows, delay):
    """SoC, ascending, and resistance [Ω] of the discharge pulses of a check-up at one delay."""
    course = sorted(
        (row["soc"], row["resistance_ohm"])
        for row in pulses_of_kind(rows, "discharge", delay)
        if row["cycle"] == check_up["cycle"] and np.isfinite(row["resistance_ohm"])
    )
    return np.array(course, float).reshape(-1, 2).T


def _sharing(ends):
    """Which cells share at least half of the usual span of SoC; ends (n, 2) of their pulses."""
    inside, usual = np.ones(len(ends), bool), np.median(ends, axis=0)
    wanted = 0.5 * (usual[1] - usual[0]) - SAME_SOC
    while ends[inside, 1].min() - ends[inside, 0].max() < wanted:
        lacking = np.maximum(ends[:, 0] - usual[0], usual[1] - ends[:, 1])
        inside[np.argmax(np.where(inside, lacking, -np.inf))] = False
    return inside


def mean_over_soc(soc, resistance):
    """Mean resistance over SoC [Ω]: the area under its course over the span that was measured.

    NaN where less than 60 % of SoC is covered or fewer than four pulses are there: the mean would
    depend on which part was.

    Parameters
    ----------
    soc, resistance : (n,) [1], [Ω].
    """
    order = np.argsort(soc)
    soc, resistance = np.asarray(soc, float)[order], np.asarray(resistance, float)[order]
    if len(soc) < 4 or soc[-1] - soc[0] < 0.6:
        return np.nan
    return float(np.trapezoid(resistance, soc) / (soc[-1] - soc[0]))
