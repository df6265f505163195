"""Resistance as an indicator of health: mean R0 over SoC against capacity over a fleet of cells."""

from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal

LEAST_CELLS = 6
MOST_OUTLIERS = 0.15  # of the cells: more than that are no outliers, but no line
ALARM = 0.05  # chance that a fleet without an outlier has one named
SAME_DELAY, LEAST_DELAY_SECOND = 2.0, 0.01  # first samples this near in time are alike
LEAST_EXPLAINED = 0.2  # of the variance: below it resistance tells nothing of capacity


class FleetCell(NamedTuple):
    """One cell of a fleet: measured, and predicted by the line through the other cells.

    capacity : [Ah]. resistance : mean of R0 over SoC [Ω]. predicted, its std : capacity by the line
    without this cell [Ah]. error : predicted minus measured [Ah]. distance : that over its std [1].
    outlier : whether it does not belong to the line. reason : in words.
    """

    cell: str
    capacity_ampere_hour: float
    resistance_ohm: float
    predicted_ampere_hour: float
    predicted_std_ampere_hour: float
    error_ampere_hour: float
    distance: float
    outlier: bool
    reason: str


class FleetLine(NamedTuple):
    """Line of mean R0 over capacity of a fleet, and how well it predicts a cell left out.

    intercept, slope : of resistance over capacity [Ω], [Ω/Ah], each with std; of the cells that
    are no outliers. correlation : of the two [1]. held_out_rms : error of the capacity of a cell
    that took no part [Ah]; share : of the mean capacity [1]; spread : standard deviation of the
    capacities, the error without any resistance [Ah]. covered : share of cells within 95 % [1].
    cells, outliers : how many; the latter named. verdict : in words.
    """

    intercept_ohm: float
    intercept_std_ohm: float
    slope_ohm_per_ampere_hour: float
    slope_std_ohm_per_ampere_hour: float
    correlation: float
    held_out_rms_ampere_hour: float
    held_out_share: float
    spread_ampere_hour: float
    covered: float
    cells: int
    outliers: str
    verdict: str


def resistance_against_capacity(cells):
    """Line of mean R0 over capacity over a fleet, its error on cells left out, its outliers.

    1. R0 = a + b · capacity by least squares. 2. The cell whose residual, over the scatter of the
    others, is the largest is an outlier where a fleet of this size without one would have as
    large a residual in 5 % of cases; it is taken out and the rest looked at again, up to 15 %.
    3. Each cell's capacity is predicted from its R0 by the line through the other cells that are
    no outliers.

    Parameters
    ----------
    cells : list of (name, capacity [Ah], mean R0 [Ω]) of one type at one temperature.

    Returns
    -------
    line : FleetLine. rows : list of FleetCell.

    Raises
    ------
    Refusal : fewer than six cells with both; all alike.

    Source: thesis 4.4 (50 cells of one used pack: mean R0 over SoC is a line over capacity);
    outliers: R. D. Cook, S. Weisberg, Residuals and Influence in Regression (1982), 2.2.2.
    """
    known = [cell for cell in cells if np.isfinite(cell[1]) and np.isfinite(cell[2])]
    if len(known) < LEAST_CELLS:
        raise Refusal(
            f"{len(known)} cells with capacity and resistance over SoC; a fleet needs {LEAST_CELLS}"
        )
    names = [cell[0] for cell in known]
    capacity, resistance = (np.array([cell[k] for cell in known], float) for k in (1, 2))
    if np.ptp(capacity) < 1e-3 * capacity.mean() or np.ptp(resistance) == 0:
        raise Refusal("all cells have one capacity or one resistance: no line")
    inside = _inliers(capacity, resistance)
    rows = [_cell(names, capacity, resistance, inside, k) for k in range(len(names))]
    return _line(capacity, resistance, inside, rows), rows


def _inliers(capacity, resistance):
    """Which cells belong to one line."""
    from scipy.stats import t as student

    inside = np.ones(len(capacity), bool)
    for _ in range(int(MOST_OUTLIERS * len(capacity))):
        places = np.flatnonzero(inside)
        distance = np.abs(_studentised(capacity[places], resistance[places]))
        worst = int(np.argmax(distance))
        chance = 2 * student.sf(distance[worst], len(places) - 3) * len(places)
        if chance > ALARM:
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
    variance = np.maximum(left / freedom, (1e-9 * np.abs(y).max()) ** 2)
    return residual / np.sqrt(variance * (1 - hat))


def _cell(names, capacity, resistance, inside, place):
    """One cell beside the line through the others."""
    others = inside.copy()
    others[place] = False
    x, y = resistance[others], capacity[others]
    design = np.column_stack([np.ones(len(x)), x - x.mean()])
    values = np.linalg.lstsq(design, y, rcond=None)[0]
    scatter = np.sqrt(np.sum((y - design @ values) ** 2) / (len(x) - 2))
    at = resistance[place] - x.mean()
    predicted = float(values[0] + values[1] * at)
    std = float(scatter * np.sqrt(1 + 1 / len(x) + at**2 / np.sum((x - x.mean()) ** 2)))
    error, out = predicted - capacity[place], not inside[place]
    higher = "more" if error < 0 else "less"
    reason = (
        f"resistance of a cell of {predicted:.4g} Ah, {higher} than its {capacity[place]:.4g} Ah: "
        "it does not belong to the line of the others"
    )
    return FleetCell(
        names[place],
        float(capacity[place]),
        float(resistance[place]),
        predicted,
        std,
        float(error),
        float(error / std),
        out,
        reason if out else "",
    )


def _line(capacity, resistance, inside, rows):
    """The line of a fleet and its scores."""
    from scipy.stats import t as student

    x, y = capacity[inside], resistance[inside]
    design = np.column_stack([np.ones(len(x)), x])
    values = np.linalg.lstsq(design, y, rcond=None)[0]
    variance = np.sum((y - design @ values) ** 2) / (len(x) - 2)
    std = np.sqrt(np.diagonal(np.linalg.inv(design.T @ design)) * variance)
    errors = np.array([row.error_ampere_hour for row in rows])[inside]
    distance = np.array([row.distance for row in rows])[inside]
    correlation = float(np.corrcoef(x, y)[0, 1])
    held_out, spread = float(np.sqrt(np.mean(errors**2))), float(np.std(x, ddof=1))
    told = correlation**2 >= LEAST_EXPLAINED and held_out < spread
    share = held_out / x.mean()
    word = f"capacity of a cell left out to {100 * share:.1f} % by its resistance"
    return FleetLine(
        *(float(number) for number in (values[0], std[0], values[1], std[1])),
        correlation,
        held_out,
        float(share),
        spread,
        float(np.mean(np.abs(distance) <= student.ppf(0.975, len(x) - 3))),
        len(rows),
        ", ".join(row.cell for row in rows if row.outlier),
        word if told else "resistance does not tell capacity in this fleet",
    )


def alike_measured(check_ups):
    """Mean resistances that may be compared: of the first samples if taken alike, else at 1 s.

    A first sample 0.5 s into a pulse holds a tenth more than one at 10 ms, which a line over cells
    of two instruments would take for scatter, or for age.

    Parameters
    ----------
    check_ups : pairs (name, ratings.CheckUp or mapping with its fields) of one check-up each.

    Returns
    -------
    cells : list of (name, capacity [Ah], mean resistance [Ω]). delay : "first sample" or "1 s".
    """
    rows = [(name, row._asdict() if hasattr(row, "_asdict") else row) for name, row in check_ups]
    delays = np.array([row["first_delay_second"] for _, row in rows], float)
    known = delays[np.isfinite(delays)]
    alike = len(known) and known.max() <= SAME_DELAY * max(known.min(), LEAST_DELAY_SECOND)
    column = "resistance_mean_ohm" if alike else "resistance_mean_1s_ohm"
    cells = [(name, row["capacity_ampere_hour"], row[column]) for name, row in rows]
    return cells, "first sample" if alike else "1 s"


def mean_over_soc(soc, resistance, *, least_span=0.6):
    """Mean resistance over SoC [Ω]: the area under its course over the span that was measured.

    Parameters
    ----------
    soc, resistance : (n,) [1], [Ω]. least_span : of the SoC that must be covered [1].

    Returns
    -------
    mean : float; NaN where less is covered or fewer than four pulses are there.
    """
    order = np.argsort(soc)
    soc, resistance = np.asarray(soc, float)[order], np.asarray(resistance, float)[order]
    if len(soc) < 4 or soc[-1] - soc[0] < least_span:
        return np.nan
    return float(np.trapezoid(resistance, soc) / (soc[-1] - soc[0]))
