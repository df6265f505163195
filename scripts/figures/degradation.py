"""Figures of what ages in cells: degradation modes, capacity from peaks, lives side by side."""

import numpy as np

from cellwright.numerics.statistics import rms
from figures import style

MOST_LIVES = 40
MODES = {
    "lli": ("lithium lost", style.SERIES[0]),
    "lam_negative": ("material lost, negative", style.SERIES[1]),
    "lam_positive": ("material lost, positive", style.SERIES[3]),
}


def draw_modes(modes):
    """Degradation modes of a cell over its check-ups: stacked, and each with its 95 % band.

    `modes` are columns of stage `degradation_modes`. A mode that is not identifiable at a check-up
    is left out of the stack there, and a hollow point has its value from that check-up alone.
    """
    figure, axes = style.subplots(1, 2, width=9.5, height=3.3)
    order = np.argsort(modes["cycle"])
    drawn = ["cycle", "capacity_ampere_hour"]
    drawn += [f"{name}{end}" for name in MODES for end in ("", "_std", "_single")]
    columns = {name: np.asarray(modes[name], float)[order] for name in drawn}
    cycle = columns["cycle"]
    # A loss below zero is scatter; in a stack it would eat what lies below it.
    stacked = [100 * np.maximum(np.nan_to_num(columns[name]), 0.0) for name in MODES]
    labels, colours = zip(*MODES.values(), strict=True)
    axes[0, 0].stackplot(cycle, *stacked, labels=labels, colors=colours, alpha=0.55, lw=0)
    for name, (label, colour) in MODES.items():
        _band(axes[0, 1], columns, name, {"label": label, "color": colour})
    lost = 100 * (1 - columns["capacity_ampere_hour"] / columns["capacity_ampere_hour"][0])
    axes[0, 1].plot(cycle, lost, "k--", lw=0.9, label="capacity lost")
    axes[0, 0].set(xlabel="cycle", ylabel="share of the fresh cell [%]", title="Modes, stacked")
    axes[0, 1].set(xlabel="cycle", ylabel="share of the fresh cell [%]", title="With 95 % bands")
    for panel in axes[0]:
        style.legend_once(panel, loc="upper left")
    return figure


def _band(panel, columns, name, shown):
    """One mode with its band; hollow points where only the check-up's own estimate is there."""
    cycle, value, std = columns["cycle"], 100 * columns[name], 100 * columns[f"{name}_std"]
    told = np.isfinite(value)
    panel.plot(cycle[told], value[told], "o-", **shown)
    limits = (value - 1.96 * std)[told], (value + 1.96 * std)[told]
    panel.fill_between(cycle[told], *limits, color=shown["color"], alpha=0.2, lw=0)
    alone = 100 * columns[f"{name}_single"][~told]
    hollow = {"markerfacecolor": "white", "label": "not identifiable", "color": shown["color"]}
    panel.plot(cycle[~told], alone, "o", **hollow)


def draw_peak_health(rows, cell):
    """Capacity estimated from peaks over the measured one, and state of health over cycles.

    `rows` are columns of stage `peak_calibration`: all cells of the type, those of `cell` in
    colour, the others grey.
    """
    figure, axes = style.subplots(1, 2, width=9.5, height=3.6)
    own = rows["cell"] == cell
    known = np.isfinite(rows["measured_ampere_hour"]) & np.isfinite(rows["capacity_ampere_hour"])
    panel = axes[0, 0]
    panel.plot(*_pair(rows, known & ~own), ".", color=style.QUIET, ms=3, label="cells of the type")
    rates = _rates(rows["c_rate"][own])
    for colour, rate in zip(style.SERIES, rates, strict=False):
        # Rates as close are one protocol, whose current falls with the capacity.
        chosen = own & (np.abs(np.log(rows["c_rate"] / rate)) < 0.12)
        label = f"{cell}, {rate:.2g}C"
        shown = {"color": colour, "ms": 4, "capsize": 2, "lw": 0.8, "label": label}
        panel.errorbar(
            *_pair(rows, known & chosen), yerr=_bars(rows, known & chosen), fmt="o", **shown
        )
        at = chosen & np.isfinite(rows["soh"])
        spread = 100 * np.nan_to_num(rows["soh_std"][at])
        soh = 100 * rows["soh"][at]
        axes[0, 1].errorbar(rows["cycle"][at], soh, yerr=1.96 * spread, fmt="o", **shown)
    values = np.concatenate(_pair(rows, known))
    if len(values):
        ends = [values.min(), values.max()]
        panel.plot(ends, ends, color=style.INK, lw=0.6, ls=":")
    panel.set(xlabel="measured capacity [Ah]", ylabel="from peaks, check-up left out [Ah]")
    error = 100 * rms(rows["left_out_error"][known & own])
    panel.set_title(f"From peaks: {error:.2g} % RMS" if np.isfinite(error) else "From peaks")
    measured = 100 * rows["measured_ampere_hour"][own] / rows["fresh_ampere_hour"][own]
    order = np.argsort(rows["cycle"][own])
    line = {"color": style.MEASURED, "lw": 0.9, "label": "measured"}
    axes[0, 1].plot(rows["cycle"][own][order], measured[order], **line)
    axes[0, 1].set(xlabel="cycle", ylabel="state of health [%]", title="Over cycles")
    if len(values):
        style.legend_once(panel, loc="upper left")
    else:
        panel.set_title("")
        style.hide([panel])
    style.legend_once(axes[0, 1], loc="lower left")
    return figure


def _pair(rows, chosen):
    return rows["measured_ampere_hour"][chosen], rows["capacity_ampere_hour"][chosen]


def _bars(rows, chosen):
    """Lengths of the intervals below and above; none where there is no interval."""
    size = rows["capacity_ampere_hour"][chosen]
    ends = [rows[f"capacity_{end}_ampere_hour"][chosen] for end in ("lower", "upper")]
    return np.nan_to_num([np.maximum(size - ends[0], 0), np.maximum(ends[1] - size, 0)])


def _rates(rates):
    """Rates that differ by more than 12 %, from slow to fast."""
    found = []
    for rate in np.sort(rates[np.isfinite(rates)]):
        if not found or rate > 1.12 * found[-1]:
            found.append(float(rate))
    return found


def draw_lives(lives):
    """State of health over cycles of all cells, protocols side by side, with knees.

    `lives` are dicts of cell, protocol ("" where not stated), cycle and soh (n,), knee_cycle, and
    peaks: (cycle, soh) told by dQ/dV peaks.
    """
    if not lives:
        return style.message("No cell was seen at two cycles of its life.")
    protocols = sorted({life["protocol"] for life in lives})
    figure, axes = style.subplots(1, len(protocols), width=9.5, height=3.8, sharey=True)
    for panel, protocol in zip(axes[0], protocols, strict=True):
        alike = [life for life in lives if life["protocol"] == protocol]
        for place in style.evenly_spread(len(alike), MOST_LIVES):
            _life(panel, alike[place], style.SERIES[place % len(style.SERIES)])
        panel.axhline(80, color=style.QUIET, lw=0.7, ls="--")
        panel.set_title(protocol.replace("_", " ") or "protocol not stated")
        panel.set_xlabel("cycle")
        style.legend_once(panel, fontsize=7, loc="lower left")
    axes[0, 0].set_ylabel("state of health [%]")
    return figure


def _life(panel, life, colour):
    order = np.argsort(life["cycle"])
    cycle, soh = life["cycle"][order], 100 * life["soh"][order]
    style.plot_thinned(panel, cycle, soh, points=300, color=colour, label=life["cell"])
    if np.isfinite(life["knee_cycle"]):
        at = life["knee_cycle"], np.interp(life["knee_cycle"], cycle, soh)
        panel.plot(*at, "D", color=colour, ms=6, mfc="none", label="knee")
    peaks = np.asarray(life["peaks"], float).reshape(-1, 2)
    if len(peaks):
        panel.plot(peaks[:, 0], 100 * peaks[:, 1], "+", color=colour, ms=6, label="from peaks")
