"""Capacity over rate, and over ageing where several check-ups were made."""

import numpy as np

import figure


def draw(tests):
    """Figure of the capacities of a cell; `tests` are (columns, about) of stage `capacity`."""
    cycles = [_fact(about, "cycle") or 0 for _, about in tests]
    aged = len(set(cycles)) > 1
    canvas, axes = figure.canvas(1, 2 if aged else 1, height=3.0)
    for (columns, about), cycle in zip(tests, cycles, strict=True):
        celsius = _fact(about, "ambient_temperature_celsius")
        _points(axes[0, 0], columns["c_rate"], columns, celsius)
        if aged:
            _points(axes[0, 1], np.full(len(columns["c_rate"]), cycle), columns, celsius)
    axes[0, 0].set(xscale="log", xlabel="C-rate [1/h]", ylabel="capacity [Ah]")
    low, high = axes[0, 0].get_ylim()
    # A percent either way, so that the last digits of one cell do not fill the picture.
    axes[0, 0].set_ylim(min(low, 0.99 * high), max(high, 1.01 * low))
    axes[0, 0].set_title("Capacity over rate (▼ discharge, ▲ charge)")
    figure.legend_once(axes[0, 0], ncols=2)
    if aged:
        axes[0, 1].set(xlabel="cycle", ylabel="capacity [Ah]", title="Capacity over ageing")
    return canvas


def _fact(about, name):
    return about["params"]["test"][name]


def _points(axes, x, columns, celsius):
    for direction, marker in figure.MARKERS.items():
        chosen = columns["direction"] == direction
        spread = columns["capacity_std_ampere_hour"][chosen]
        axes.errorbar(
            x[chosen],
            columns["capacity_ampere_hour"][chosen],
            yerr=np.where(np.isfinite(spread), spread, 0),
            fmt=marker,
            color=figure.temperature_colour(celsius),
            label=figure.temperature_label(celsius) if chosen.any() else None,
            capsize=2,
        )
