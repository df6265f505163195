"""Pulse resistance over SoC, at the first sample and later in the pulse."""

import numpy as np

import figure


def draw(tests):
    """Figure of a cell's pulse resistances; `tests` are (columns, about) of stage `resistance`."""
    delays = sorted({delay for columns, _ in tests for delay in columns["delay_second"]})
    shown = [delays[0], *([min(delays[1:], key=lambda d: abs(d - 10))] if delays[1:] else [])]
    canvas, axes = figure.canvas(1, len(shown), height=3.2, sharex=True)
    for panel, delay in zip(axes[0], shown, strict=True):
        for columns, about in tests:
            _pulses(panel, columns, about, delay)
        name = "first sample" if delay == 0 else f"{delay:g} s into the pulse"
        panel.set(xlabel="SoC [%]", ylabel="resistance [mΩ]", title=f"Resistance, {name}")
        panel.set_ylim(bottom=0)
    figure.legend_once(axes[0, 0])
    return canvas


def _pulses(axes, columns, about, delay):
    celsius = about["params"]["test"]["ambient_temperature_celsius"]
    colour, label = figure.temperature_colour(celsius), figure.temperature_label(celsius)
    for direction, marker in figure.MARKERS.items():
        chosen = (columns["delay_second"] == delay) & (columns["direction"] == direction)
        for rate in np.unique(np.round(columns["c_rate"][chosen], 1)):
            same = np.flatnonzero(chosen & (np.round(columns["c_rate"], 1) == rate))
            order = same[np.argsort(columns["soc"][same])]
            axes.errorbar(
                100 * columns["soc"][order],
                1e3 * columns["resistance_ohm"][order],
                yerr=1e3 * np.nan_to_num(columns["resistance_std_ohm"][order]),
                fmt=f"{marker}-",
                linewidth=0.5,
                color=colour,
                label=label,
            )
