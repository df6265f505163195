"""Models, filters and parallel cells over what was measured, along the time of one test."""

from itertools import cycle

import numpy as np

from figures import style
from figures.columns import thinned

NORMAL_95 = 1.96
FILTERS_WITH_INTERVAL = ("ekf", "aekf", "dual")


def draw_validation(series, scores, test):
    """Model over measurement, what is left between them, and how all members compare.

    `series` are columns of stage `simulation`, `scores` rows of `validation`.
    """
    height = 5.2 + 0.16 * len(scores)
    ratios = [3, 2, 1, 0.6 + 0.25 * len(scores)]
    figure, axes = style.subplots(4, 1, height=height, height_ratios=ratios)
    voltage, residual, current, members = axes[:, 0]
    chosen = next(row for row in scores if row["chosen"])
    hours, measured = series["test_time_second"] / 3600, series["voltage_volt"]
    simulated = series[f"simulated_{chosen['model']}_volt"]
    label = f"{chosen['model']}: RMSE {1e3 * chosen['rmse_volt']:.1f} mV"
    lines = ((measured, style.MEASURED, "measured"), (simulated, style.SERIES[0], label))
    for values, colour, name in lines:
        style.plot_thinned(voltage, hours, values, color=colour, linewidth=0.8, label=name)
    error = 1e3 * (measured - simulated)
    residual.axhline(0.0, color=style.QUIET, linewidth=0.6)
    style.plot_thinned(residual, hours, error, color=style.SERIES[0], linewidth=0.7)
    style.shade_unscored(residual, hours, series["scored"])
    style.plot_thinned(current, hours, series["current_ampere"], color=style.QUIET, linewidth=0.6)
    voltage.set(ylabel="voltage [V]", title=f"{test}: model over measurement")
    residual.set(ylabel="residual [mV]", title="Measured − simulated (grey: not scored)")
    current.set(ylabel="current [A]", xlabel="time [h]")
    for panel in (residual, current):
        panel.sharex(voltage)
    for panel in (voltage, residual):
        panel.tick_params(labelbottom=False)
    style.legend_once(voltage, loc="lower left")
    _members(members, scores)
    return figure


def _members(axes, scores):
    """RMS error of every member, the chosen one in colour."""
    for place, row in enumerate(scores):
        colour = style.SERIES[0] if row["chosen"] else style.QUIET
        size = 1e3 * row["rmse_volt"]
        axes.barh(place, size, height=0.7, color=colour)
        axes.annotate(f" {size:.1f}", (size, place), va="center", fontsize=8)
    names = [row["model"] + (" (chosen)" if row["chosen"] else "") for row in scores]
    style.name_bars(axes, names, fontsize=8)
    axes.set(xlabel="RMS error of every member [mV]")


def draw_soc(series, scores, test):
    """Estimated state of charge over the counted one, with the filters' own intervals.

    `series` are columns of stage `soc_series`, `scores` rows of `soc`.
    """
    figure, axes = style.subplots(2, 1, height=4.6, sharex=True, height_ratios=[3, 2])
    level, error = axes[:, 0]
    hours, counted = series["test_time_second"] / 3600, 100 * series["soc"]
    style.plot_thinned(level, hours, counted, color=style.MEASURED, linewidth=1, label="counted")
    first_run = {}  # of each filter: the series that is kept
    for row in scores:
        first_run.setdefault(row["filter"], row)
    for (name, row), colour in zip(first_run.items(), cycle(style.SERIES), strict=False):
        estimated = 100 * series[f"estimated_{name}_soc"]
        look = {"color": colour, "linewidth": 0.8}
        style.plot_thinned(level, hours, estimated, **look, label=_filter_label(row))
        if name in FILTERS_WITH_INTERVAL:
            style.plot_thinned(error, hours, estimated - counted, **look)
            half_width = NORMAL_95 * (100 * series[f"std_{name}_soc"])
            _interval(error, hours, estimated - counted, half_width, colour)
    style.shade_unscored(error, hours, series["scored"])
    level.set(ylabel="SoC [%]", title=f"{test}: state of charge by filters", ylim=(-5, 105))
    error.set(ylabel="error [%]", xlabel="time [h]", ylim=(-15, 15))
    error.set_title("Estimated − counted, with 95 % intervals (grey: not scored)")
    style.legend_once(level, loc="lower left")
    return figure


def _interval(axes, hours, middle, half_width, colour):
    grid = np.linspace(hours[0], hours[-1], 500)
    edges = [thinned(hours, middle + side * half_width) for side in (-1, 1)]
    low, high = (np.interp(grid, *edge) for edge in edges)
    axes.fill_between(grid, low, high, color=colour, alpha=0.15, linewidth=0)


def _filter_label(row):
    after = row["convergence_second"]
    when = "does not converge" if np.isnan(after) else f"{after:.0f} s, then"
    return f"{row['filter']}: {when} RMSE {100 * row['rmse_soc']:.1f} %"


def draw_pack(series, scores, test):
    """Branch currents of parallel cells: those of the models over the measured ones.

    `series` are columns of stage `pack_series`, `scores` rows of `pack`.
    """
    figure, axes = style.subplots(3, 1, height=5.4, sharex=True, height_ratios=[3, 2, 2])
    current, residual, voltage = axes[:, 0]
    hours = series["test_time_second"] / 3600
    for index, row in enumerate(scores):
        colour, branch = style.SERIES[index % len(style.SERIES)], row["branch"]
        measured = series[f"branch_{branch}_current_ampere"]
        simulated = series[f"simulated_branch_{branch}_current_ampere"]
        label = f"branch {branch}: RMSE {1e3 * row['current_rmse_ampere']:.0f} mA"
        style.plot_thinned(current, hours, measured, color=colour, linewidth=0.6, alpha=0.6)
        style.plot_thinned(current, hours, simulated, color=colour, linewidth=1.2, label=label)
        error = 1e3 * (measured - simulated)
        style.plot_thinned(residual, hours, error, color=colour, linewidth=0.7)
    style.shade_unscored(residual, hours, series["scored"])
    measured, simulated = series["voltage_volt"], series["simulated_voltage_volt"]
    label = f"simulated: RMSE {1e3 * scores[0]['voltage_rmse_volt']:.0f} mV"
    style.plot_thinned(voltage, hours, measured, color=style.MEASURED, label="measured")
    style.plot_thinned(voltage, hours, simulated, color=style.ERROR, linewidth=0.8, label=label)
    current.set(ylabel="current [A]", title=f"{test}: branch currents (pale: measured)")
    residual.set(ylabel="residual [mA]", title="Measured − simulated (grey: fitted, not scored)")
    voltage.set(ylabel="voltage [V]", xlabel="time [h]")
    style.legend_once(current)
    style.legend_once(voltage)
    return figure
