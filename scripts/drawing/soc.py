"""Estimated state of charge over the counted one, with the filters' own intervals."""

import numpy as np

import figure

NORMAL_95 = 1.96
BANDED = ("ekf", "aekf", "dual")


def draw(series, scores, test):
    """Figure of one test from stages `soc_series` (series) and `soc` (scores)."""
    canvas, axes = figure.canvas(2, 1, height=4.6, sharex=True, height_ratios=[3, 2])
    level, error = axes[:, 0]
    hours = series["test_time_second"] / 3600
    counted = figure.thin(hours, 100 * series["soc"])
    level.plot(*counted, color=figure.MEASURED, linewidth=1, label="counted")
    for index, row in enumerate(_shown(scores)):
        name, colour = row["filter"], figure.SERIES[index]
        found, std = 100 * series[f"estimated_{name}_soc"], 100 * series[f"std_{name}_soc"]
        level.plot(*figure.thin(hours, found), color=colour, linewidth=0.8, label=_label(row))
        if name not in BANDED:
            continue
        off = found - 100 * series["soc"]
        error.plot(*figure.thin(hours, off), color=colour, linewidth=0.8)
        low, high = (figure.thin(hours, off + side * NORMAL_95 * std) for side in (-1, 1))
        grid = np.linspace(hours[0], hours[-1], 500)
        edges = [np.interp(grid, *edge) for edge in (low, high)]
        error.fill_between(grid, *edges, color=colour, alpha=0.15, linewidth=0)
    figure.shade_unscored(error, hours, series["scored"])
    level.set(ylabel="SoC [%]", title=f"{test}: state of charge by filters", ylim=(-5, 105))
    error.set(ylabel="error [%]", xlabel="time [h]", ylim=(-15, 15))
    error.set_title("Estimated − counted, with 95 % intervals (grey: not scored)")
    figure.legend_once(level, loc="lower left")
    return canvas


def _shown(scores):
    """The first run of each filter: the series that was kept."""
    first = {}
    for row in scores:
        first.setdefault(row["filter"], row)
    return first.values()


def _label(row):
    after = row["convergence_second"]
    when = "does not converge" if np.isnan(after) else f"{after:.0f} s, then"
    return f"{row['filter']}: {when} RMSE {100 * row['rmse_soc']:.1f} %"
