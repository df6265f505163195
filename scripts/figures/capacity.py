"""Capacity of a cell over rate and ageing, and what temperature and rate take of it."""

import numpy as np

from figures import style
from figures.columns import ambient_celsius, rows_where

REACHED, FALSE_LOSS, TRUE_LOSS = style.SERIES[0], style.YELLOW, style.ERROR


def draw_capacity(tests):
    """Capacity over rate, and over ageing where several check-ups were made.

    `tests` are (columns, about) of stage `capacity`.
    """
    cycles = [about["params"]["test"]["cycle"] or 0 for _, about in tests]
    aged = len(set(cycles)) > 1
    figure, axes = style.subplots(1, 2 if aged else 1, height=3.0)
    for (columns, about), cycle in zip(tests, cycles, strict=True):
        celsius = ambient_celsius(about)
        _points(axes[0, 0], columns["c_rate"], columns, celsius)
        if aged:
            _points(axes[0, 1], np.full(len(columns["c_rate"]), cycle), columns, celsius)
    axes[0, 0].set(xscale="log", xlabel="C-rate [1/h]", ylabel="capacity [Ah]")
    low, high = axes[0, 0].get_ylim()
    # A percent either way, so that the last digits of one cell do not fill the picture.
    axes[0, 0].set_ylim(min(low, 0.99 * high), max(high, 1.01 * low))
    axes[0, 0].set_title("Capacity over rate (▼ discharge, ▲ charge)")
    style.legend_once(axes[0, 0], ncols=2)
    if aged:
        axes[0, 1].set(xlabel="cycle", ylabel="capacity [Ah]", title="Capacity over ageing")
    return figure


def _points(axes, x, columns, celsius):
    for direction, marker in style.MARKERS.items():
        chosen = columns["direction"] == direction
        spread = columns["capacity_std_ampere_hour"][chosen]
        axes.errorbar(
            x[chosen],
            columns["capacity_ampere_hour"][chosen],
            yerr=np.where(np.isfinite(spread), spread, 0),
            fmt=marker,
            color=style.temperature_colour(celsius),
            label=style.temperature_label(celsius) if chosen.any() else None,
            capsize=2,
        )


def draw_capacity_loss(losses):
    """Stacked bars by temperature and rate: capacity reached, lost to the rate, and lost for good.

    `losses` are the columns of stage `capacity_loss`.
    """
    directions = list(dict.fromkeys(losses["direction"]))
    counts = [int((losses["direction"] == name).sum()) for name in directions]
    figure, axes = style.subplots(
        1, len(directions), height=3.6, sharey=True, width_ratios=[n + 2 for n in counts]
    )
    for panel, direction in zip(axes[0], directions, strict=True):
        _bars(panel, rows_where(losses, losses["direction"] == direction))
        panel.set_title(direction.capitalize())
    axes[0, 0].set(ylabel="share of the reference [%]", ylim=(0, 108))
    handles = {}
    for panel in axes[0]:
        handles |= dict(zip(*panel.get_legend_handles_labels()[::-1], strict=True))
    figure.legend(
        handles.values(), handles.keys(), loc="outside lower center", ncols=4, frameon=False
    )
    return figure


def _bars(axes, rows):
    place = np.arange(len(rows["c_rate"]))
    known = rows["known"].astype(bool)
    reached = 100 - rows["total_percent"]
    true, false = (
        np.where(known, rows[f"{name}_percent"], rows[f"{name}_lower_percent"])
        for name in ("true", "false")
    )
    either = np.where(known, 0, rows["total_percent"] - true - false)
    hatched = {"color": "white", "edgecolor": TRUE_LOSS, "hatch": "///"}
    parts = [
        (false, {"color": FALSE_LOSS, "label": "false: comes back when slow"}),
        (either, hatched | {"label": "true or false: not knowable"}),
        (true, {"color": TRUE_LOSS, "label": "true: not reached even slowly"}),
    ]
    axes.bar(place, reached, color=REACHED, label="reached", width=0.75)
    base = reached
    for share, look in parts:
        height = np.maximum(share, 0)  # a share below zero is scatter, and is not drawn
        axes.bar(place, height, bottom=base, width=0.75, **look)
        base = base + height
    axes.errorbar(
        place[known],
        (100 - np.maximum(rows["true_percent"], 0))[known],
        yerr=1.96 * rows["true_std_percent"][known],
        fmt="none",
        ecolor=style.INK,
        capsize=2,
        label="95 % interval of the true part",
    )
    names = zip(rows["temperature_celsius"], rows["c_rate"], strict=True)
    axes.set_xticks(place, [f"{t:g} °C\n{rate:.2g}C" for t, rate in names], fontsize=7)
    axes.grid(False, axis="x")
