"""Open-circuit voltage over SoC: both branches, their mean, and half the gap between them."""

import numpy as np

import figure


def draw(tests):
    """Figure of the OCV curves of a cell; `tests` are (columns, about) of stage `ocv`."""
    canvas, axes = figure.canvas(1, 2, height=3.4, width_ratios=[3, 2])
    curve, gap = axes[0]
    for columns, about in tests:
        celsius = about["params"]["test"]["ambient_temperature_celsius"]
        colour = figure.temperature_colour(celsius)
        label = f"{about['wildcards']['test']} ({figure.temperature_label(celsius)})"
        soc = 100 * columns["soc"]
        for branch in ("charge_volt", "discharge_volt"):
            curve.plot(soc, columns[branch], color=colour, linewidth=0.6, alpha=0.7)
        curve.plot(soc, columns["ocv_volt"], color=colour, linewidth=1.6, label=label)
        if np.isfinite(columns["half_gap_volt"]).any():
            gap.plot(soc, 1e3 * columns["half_gap_volt"], color=colour)
    curve.set(xlabel="SoC [%]", ylabel="voltage [V]", title="OCV (thin: discharge and charge)")
    gap.set(xlabel="SoC [%]", ylabel="half gap [mV]", title="Half the gap: hysteresis and I·R")
    if not gap.lines:
        gap.text(0.5, 0.5, "one branch only", ha="center", transform=gap.transAxes)
    figure.legend_once(curve)
    return canvas
