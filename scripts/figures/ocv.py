"""Figures of the open-circuit voltage of a cell over SoC and temperature."""

import numpy as np

from figures import style
from figures.style import ambient_celsius, rows_where

ERRORS = {  # of an OCV function: (label, colour, place of its bar)
    "rmse_volt": ("fitted", style.QUIET, -0.2),
    "cross_validation_rmse_volt": ("temperature left out", style.SERIES[0], 0.2),
}


def draw_ocv(tests):
    """OCV over SoC: both branches, their mean, and half the gap between them.

    `tests` are (columns, about) of stage `ocv`.
    """
    figure, axes = style.subplots(1, 2, height=3.4, width_ratios=[3, 2])
    curve, gap = axes[0]
    for columns, about in tests:
        celsius = ambient_celsius(about)
        colour = style.temperature_colour(celsius)
        label = f"{about['wildcards']['test']} ({style.temperature_label(celsius)})"
        soc = 100 * columns["soc"]
        for branch in ("charge_volt", "discharge_volt"):
            curve.plot(soc, columns[branch], color=colour, linewidth=0.6, alpha=0.7)
        curve.plot(soc, columns["ocv_volt"], color=colour, linewidth=1.6, label=label)
        if np.isfinite(columns["half_gap_volt"]).any():
            gap.plot(soc, 1e3 * columns["half_gap_volt"], color=colour)
    curve.set(xlabel="SoC [%]", ylabel="voltage [V]", title="OCV (thin: discharge and charge)")
    gap.set(xlabel="SoC [%]", ylabel="half gap [mV]", title="Half the gap: hysteresis and I·R")
    if not gap.lines:
        style.hide([gap])
    style.legend_once(curve)
    return figure


def draw_ocv_temperature(bias, entropic, surface, functions):
    """OCV over temperature: its bias, a map of it, the entropic coefficient, errors of functions.

    `bias`, `entropic`, `surface` are columns of stages `ocv_temperature`, `ocv_entropic` and
    `ocv_surface`; `functions` rows of `ocv_functions_temperature`.
    """
    figure, axes = style.subplots(2, 2, height=6.2, width_ratios=[3, 2])
    _bias(axes[0, 0], bias, surface["reference_celsius"][0])
    _bias_map(axes[0, 1], bias)
    _entropic(axes[1, 0], entropic)
    _functions(axes[1, 1], functions)
    return figure


def _bias(axes, columns, reference):
    for celsius in np.unique(columns["temperature_celsius"]):
        curve = rows_where(columns, columns["temperature_celsius"] == celsius)
        colour, soc = style.temperature_colour(celsius), 100 * curve["soc"]
        inside = np.where(curve["tested"], 1e3 * curve["bias_volt"], np.nan)
        axes.plot(soc, 1e3 * curve["bias_volt"], color=colour, linewidth=0.8, linestyle=":")
        axes.plot(soc, inside, color=colour, label=f"{celsius:.0f} °C")
        axes.plot(soc, 1e3 * curve["measured_bias_volt"], ".", color=colour, markersize=2)
    tested = np.append(1e3 * columns["bias_volt"][columns["tested"]], 0.0)
    margin = 0.3 * np.ptp(tested) + 1
    axes.axhline(0, color=style.INK, linewidth=0.6)
    axes.set(
        xlabel="SoC [%]",
        ylabel="bias [mV]",
        title=f"OCV minus that at {reference:.0f} °C (dots: read)",
        ylim=(tested.min() - margin, tested.max() + margin),
    )
    style.legend_once(axes, ncols=2)


def _bias_map(axes, columns):
    levels = np.unique(columns["temperature_celsius"])
    curves = [rows_where(columns, columns["temperature_celsius"] == celsius) for celsius in levels]
    soc = 100 * curves[0]["soc"]
    bias = 1e3 * np.stack([curve["bias_volt"] for curve in curves])
    tested = columns["tested"].reshape(len(levels), -1) if len(soc) else None
    shown = np.where(tested, bias, np.nan)
    # Even limits about zero, or no bias would have a colour.
    largest = max(np.nanmax(np.abs(shown)), 1.0) if np.isfinite(shown).any() else 1.0
    limit = 5 * np.ceil(largest / 5)
    filled = axes.contourf(soc, levels, shown, levels=np.linspace(-limit, limit, 21), cmap="RdBu_r")
    reference = np.argmin(np.nansum(np.abs(shown), axis=1))
    without_reference = np.where(np.arange(len(levels))[:, None] == reference, np.nan, shown)
    axes.contour(soc, levels, without_reference, levels=[0.0], colors=style.INK, linewidths=1.0)
    ticks = np.linspace(-limit, limit, 5)
    style.colour_bar(axes.figure, filled, [axes], label="bias [mV]", ticks=ticks)
    axes.set(xlabel="SoC [%]", ylabel="temperature [°C]", title="Bias map (line: no bias)")


def _entropic(axes, columns):
    for colour, source in zip(style.SERIES, np.unique(columns["source"]), strict=False):
        of_source = columns["source"] == source
        soc = 100 * columns["soc"][of_source]
        value, low, high = (
            columns[f"{name}_millivolt_per_kelvin"][of_source]
            for name in ("entropic", "lower", "upper")
        )
        line = "o-" if len(soc) < 40 else "-"
        used = " (used)" if columns["used"][of_source][0] else ""
        axes.plot(soc, value, line, color=colour, label=f"{source}{used}")
        axes.fill_between(soc, low, high, color=colour, alpha=0.2, linewidth=0)
    value = np.append(columns["entropic_millivolt_per_kelvin"], 0.0)
    # At the ends of SoC dOCV/dT goes off by tens of times: the middle sets the scale.
    middle = np.append((columns["soc"] > 0.2) & (columns["soc"] < 0.9), True)
    low, high = np.min(value[middle]), np.max(value[middle])
    margin = 0.8 * (high - low) + 0.05
    axes.axhline(0, color=style.INK, linewidth=0.6)
    axes.set(
        xlabel="SoC [%]",
        ylabel="dOCV/dT [mV/K]",
        title="Entropic coefficient and its 95 % interval",
        ylim=(low - margin, high + margin),
    )
    style.legend_once(axes)


def _functions(axes, rows):
    rows = [row for row in rows if np.isfinite(row["rmse_volt"])]
    position = np.arange(len(rows))
    for name, (label, colour, offset) in ERRORS.items():
        values = [1e3 * row[name] for row in rows]
        axes.barh(position + offset, values, height=0.38, color=colour, label=label)
    names = [
        row["function"].removesuffix("(T)").replace("_", " ") + " ★" * row["chosen"] for row in rows
    ]
    axes.set_yticks(position, names)
    axes.set(xlabel="RMSE [mV]", title="Functions (★ chosen)")
    style.legend_once(axes, loc="upper center", bbox_to_anchor=(0.4, -0.24), ncols=2)
