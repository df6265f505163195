"""Capacity loss as stacked bars: reached, false and true, by temperature and rate."""

import numpy as np

import figure

REACHED, FALSE, TRUE = figure.SERIES[0], "#f2c14e", figure.ERROR


def draw(losses):
    """Figure of a cell from the columns of stage `capacity_loss`."""
    directions = list(dict.fromkeys(losses["direction"]))
    counts = [int((losses["direction"] == name).sum()) for name in directions]
    canvas, axes = figure.canvas(
        1, len(directions), height=3.6, sharey=True, width_ratios=[n + 2 for n in counts]
    )
    for panel, direction in zip(axes[0], directions, strict=True):
        mine = losses["direction"] == direction
        _bars(panel, {name: values[mine] for name, values in losses.items()})
        panel.set_title(direction.capitalize())
    axes[0, 0].set(ylabel="share of the reference [%]", ylim=(0, 108))
    handles, labels = _legend(axes[0])
    canvas.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    return canvas


def _bars(axes, rows):
    place = np.arange(len(rows["c_rate"]))
    known = rows["known"].astype(bool)
    reached = 100 - rows["total_percent"]
    true, false = (
        np.where(known, rows[f"{name}_percent"], rows[f"{name}_lower_percent"])
        for name in ("true", "false")
    )
    either = np.where(known, 0, rows["total_percent"] - true - false)
    # A part below zero is scatter: it is not drawn, its bar says so.
    parts = [np.maximum(part, 0) for part in (false, either, true)]
    axes.bar(place, reached, color=REACHED, label="reached", width=0.75)
    base = reached
    styles = [
        {"color": FALSE, "label": "false: comes back when slow"},
        {
            "color": "white",
            "edgecolor": TRUE,
            "hatch": "///",
            "label": "true or false: not knowable",
        },
        {"color": TRUE, "label": "true: not reached even slowly"},
    ]
    for part, style in zip(parts, styles, strict=True):
        axes.bar(place, part, bottom=base, width=0.75, **style)
        base = base + part
    axes.errorbar(
        place[known],
        (100 - np.maximum(rows["true_percent"], 0))[known],
        yerr=1.96 * rows["true_std_percent"][known],
        fmt="none",
        ecolor=figure.INK,
        capsize=2,
        label="95 % interval of the true part",
    )
    names = zip(rows["temperature_celsius"], rows["c_rate"], strict=True)
    axes.set_xticks(place, [f"{t:g} °C\n{rate:.2g}C" for t, rate in names], fontsize=7)
    axes.grid(False, axis="x")


def _legend(panels):
    """Each label once, with something drawn behind it."""
    found = {}
    for panel in panels:
        handles, labels = panel.get_legend_handles_labels()
        found |= {label: handle for handle, label in zip(handles, labels, strict=True)}
    return list(found.values()), list(found)
