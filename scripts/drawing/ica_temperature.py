"""Incremental capacity by temperature, smoothed alike, with the matched peaks joined."""

import numpy as np

import figure

STYLE = {
    "kept": "-",
    "changed": "-",
    "merged": "-",
    "split": "-",
    "unresolved": ":",
}


def draw(curves, peaks, matches):
    """Figure of a cell from the columns of the stages `ica_temperature_curve`, `_peaks` and rows
    of `ica_temperature`; one curve above the other, the reference lowest in its group."""
    levels = sorted(set(curves["temperature_celsius"]), reverse=True)
    gap = 0.55 * curves["dq_dv_ampere_hour_per_volt"].max()
    canvas, axes = figure.canvas(1, 1, height=1.6 + 0.7 * len(levels))
    panel = axes[0, 0]
    base = {celsius: gap * (len(levels) - 1 - k) for k, celsius in enumerate(levels)}
    for celsius in levels:
        _curve(panel, celsius, base[celsius], curves, peaks)
    for match in matches:
        _join(panel, match, base, peaks)
    panel.set(xlabel="voltage [V]", ylabel="dQ/dV [Ah/V], shifted", title="Peaks over temperature")
    panel.set_xlim(right=curves["voltage_volt"].max() + 0.09)
    return canvas


def _curve(axes, celsius, base, curves, peaks):
    mine = curves["temperature_celsius"] == celsius
    colour = figure.temperature_colour(celsius)
    volt, height = curves["voltage_volt"][mine], curves["dq_dv_ampere_hour_per_volt"][mine]
    axes.plot(volt, base + height, color=colour)
    axes.annotate(
        figure.temperature_label(celsius),
        (volt[-1], base + height[-1]),
        (4, 0),
        textcoords="offset points",
        va="center",
        color=colour,
    )
    own = peaks["temperature_celsius"] == celsius
    for volt, height, clear in zip(
        peaks["voltage_volt"][own],
        peaks["height_ampere_hour_per_volt"][own],
        peaks["clear"][own],
        strict=True,
    ):
        face = colour if clear else "white"
        axes.plot(volt, base + height, "o", color=colour, markerfacecolor=face)


def _join(axes, match, base, peaks):
    """Thin lines from the peaks of the reference to what became of them; words for the rest."""
    if not (match["reference_peaks"] and match["peaks"]):
        return
    ends = [
        _tops(peaks, match[celsius], match[names], base)
        for celsius, names in (
            ("reference_celsius", "reference_peaks"),
            ("temperature_celsius", "peaks"),
        )
    ]
    for start in ends[0]:
        for end in ends[1]:
            pair = np.array([start, end]).T
            axes.plot(*pair, STYLE.get(match["fate"], "-"), color=figure.QUIET, lw=0.7, zorder=0)
    if match["fate"] not in ("kept", "changed"):
        axes.annotate(match["fate"], ends[1][0], (3, 6), textcoords="offset points", fontsize=7)


def _tops(peaks, celsius, names, base):
    mine = peaks["temperature_celsius"] == celsius
    chosen = [int(name) - 1 for name in names.split("+")]
    volt = peaks["voltage_volt"][mine][chosen]
    return list(
        zip(volt, base[celsius] + peaks["height_ampere_hour_per_volt"][mine][chosen], strict=True)
    )
