"""Incremental capacity dQ/dV of a cell over voltage, and its peaks over temperature."""

import numpy as np

from figures import style
from figures.columns import rows_where


def draw_ica(tests):
    """Incremental capacity over voltage with its peaks; `tests` are (curve, peaks, about)."""
    figure, axes = style.subplots(1, 1, height=3.0)
    panel = axes[0, 0]
    for index, (curve, peaks, about) in enumerate(tests):
        colour = style.SERIES[index % len(style.SERIES)]
        panel.plot(
            curve["voltage_volt"],
            curve["dq_dv_ampere_hour_per_volt"],
            color=colour,
            label=about["wildcards"]["test"],
        )
        heights = peaks.get("height_ampere_hour_per_volt", [])
        for volt, height in zip(peaks.get("voltage_volt", []), heights, strict=True):
            panel.plot(volt, height, "o", color=colour)
            panel.annotate(f"{volt:.3f} V", (volt, height), (0, 5), textcoords="offset points")
    panel.set(xlabel="voltage [V]", ylabel="dQ/dV [Ah/V]", title="Incremental capacity on charge")
    style.legend_once(panel)
    return figure


def draw_ica_temperature(curves, peaks, matches):
    """Incremental capacity by temperature, one curve above the other, matched peaks joined.

    `curves` and `peaks` are columns of stages `ica_temperature_curve` and `ica_temperature_peaks`,
    `matches` rows of `ica_temperature`. The warmest curve is on top.
    """
    levels = sorted(set(curves["temperature_celsius"]), reverse=True)
    gap = 0.55 * curves["dq_dv_ampere_hour_per_volt"].max()
    figure, axes = style.subplots(1, 1, height=1.6 + 0.7 * len(levels))
    panel = axes[0, 0]
    base = {celsius: gap * (len(levels) - 1 - k) for k, celsius in enumerate(levels)}
    own = {c: rows_where(peaks, peaks["temperature_celsius"] == c) for c in base}
    for celsius in levels:
        mine = curves["temperature_celsius"] == celsius
        _curve(panel, celsius, base[celsius], rows_where(curves, mine), own[celsius])
    for match in matches:
        if match["reference_peaks"] and match["peaks"]:
            _join(panel, match, base, own)
    panel.set(xlabel="voltage [V]", ylabel="dQ/dV [Ah/V], shifted", title="Peaks over temperature")
    panel.set_xlim(right=curves["voltage_volt"].max() + 0.09)
    return figure


def _curve(axes, celsius, base, curve, peaks):
    colour = style.temperature_colour(celsius)
    volt, height = curve["voltage_volt"], curve["dq_dv_ampere_hour_per_volt"]
    axes.plot(volt, base + height, color=colour)
    axes.annotate(
        style.temperature_label(celsius),
        (volt[-1], base + height[-1]),
        (4, 0),
        textcoords="offset points",
        va="center",
        color=colour,
    )
    tops = peaks["voltage_volt"], peaks["height_ampere_hour_per_volt"], peaks["clear"]
    for volt, height, clear in zip(*tops, strict=True):
        face = colour if clear else "white"
        axes.plot(volt, base + height, "o", color=colour, markerfacecolor=face)


def _join(axes, match, base, peaks):
    """Lines from the peaks at the reference to those that they became, with a word for the rest."""
    at_reference = _tops(match["reference_celsius"], match["reference_peaks"], base, peaks)
    here = _tops(match["temperature_celsius"], match["peaks"], base, peaks)
    line = ":" if match["fate"] == "unresolved" else "-"
    for start in at_reference:
        for end in here:
            axes.plot(*np.array([start, end]).T, line, color=style.QUIET, lw=0.7, zorder=0)
    if match["fate"] not in ("kept", "changed"):
        axes.annotate(match["fate"], here[0], (3, 6), textcoords="offset points", fontsize=7)


def _tops(celsius, numbers, base, peaks):
    """(voltage, drawn height) of the peaks at a temperature whose numbers are `1+2`."""
    chosen = [int(number) - 1 for number in numbers.split("+")]
    one = rows_where(peaks[celsius], chosen)
    height = base[celsius] + one["height_ampere_hour_per_volt"]
    return list(zip(one["voltage_volt"], height, strict=True))
