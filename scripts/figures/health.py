"""Figures of health: lithium and active material lost over a life."""

import numpy as np

from figures import style

SHOWN = (
    ("lli", "lithium inventory", style.SERIES[0]),
    ("lam_negative", "negative electrode's material", style.SERIES[1]),
    ("lam_positive", "positive electrode's material", style.SERIES[2]),
)


def draw_degradation_modes(columns):
    """Losses of one cell over its check-ups: stacked areas, and each mode with its 95 % band.

    `columns` are those of stage `degradation_modes`. A mode that is not identifiable at a check-up
    is left out of the stack there and marked by a hollow point at its value from that check-up
    alone.
    """
    figure, axes = style.subplots(1, 2, height=3.2)
    cycle = np.asarray(columns["cycle"], float)
    known = [100 * np.nan_to_num(np.asarray(columns[name], float)) for name, _, _ in SHOWN]
    names, colours = ([row[k] for row in SHOWN] for k in (1, 2))
    axes[0, 0].stackplot(cycle, *np.maximum(known, 0.0), labels=names, colors=colours, alpha=0.6)
    axes[0, 0].set_title("Modes, one above the other")
    for name, label, colour in SHOWN:
        _band(axes[0, 1], cycle, columns, (name, label, colour))
    axes[0, 1].set_title("Each with its 95 % band")
    for panel in axes[0]:
        panel.set(xlabel="cycle", ylabel="lost [% of the fresh cell's]")
    style.legend_once(axes[0, 0])
    return figure


def _band(axes, cycle, columns, shown):
    """One mode with its band; hollow points where only the single estimate is there."""
    name, label, colour = shown
    value, std = (100 * np.asarray(columns[key], float) for key in (name, f"{name}_std"))
    seen = np.isfinite(value)
    axes.plot(cycle[seen], value[seen], "o-", color=colour, label=label)
    low, high = value - 1.96 * std, value + 1.96 * std
    axes.fill_between(cycle[seen], low[seen], high[seen], color=colour, alpha=0.25, linewidth=0)
    alone = 100 * np.asarray(columns[f"{name}_single"], float)
    axes.plot(cycle[~seen], alone[~seen], "o", color=colour, markerfacecolor="white")
