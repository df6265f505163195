"""Figures of capacity: over rate, ageing and temperature; incremental capacity and its peaks."""

import numpy as np
from matplotlib.ticker import LogLocator

from figures import style
from figures.style import ambient_celsius, rows_where

REACHED, FALSE_LOSS, TRUE_LOSS = style.SERIES[0], style.YELLOW, style.ERROR


def draw_capacity(tests):
    """Capacity over rate, and over ageing where several check-ups were made.

    `tests` are (columns, about) of stage `capacity`.
    """
    cycles = [about["params"]["test"]["cycle"] or 0 for _, about in tests]
    # One check-up over cycles is a single column of points, which says nothing.
    aged = len(set(cycles)) > 1
    figure, axes = style.subplots(1, 2 if aged else 1, height=3.0)
    for (columns, about), cycle in zip(tests, cycles, strict=True):
        celsius = ambient_celsius(about)
        _points(axes[0, 0], columns["c_rate"], columns, celsius)
        if aged:
            _points(axes[0, 1], np.full(len(columns["c_rate"]), cycle), columns, celsius)
    axes[0, 0].set(xscale="log", xlabel="C-rate [1/h]", ylabel="capacity [Ah]")
    axes[0, 0].xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    style.plain_numbers(axes[0, 0].xaxis)
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
        in_direction = columns["direction"] == direction
        spread = columns["capacity_std_ampere_hour"][in_direction]
        axes.errorbar(
            x[in_direction],
            columns["capacity_ampere_hour"][in_direction],
            yerr=np.where(np.isfinite(spread), spread, 0),
            fmt=marker,
            color=style.temperature_colour(celsius),
            label=style.temperature_label(celsius) if in_direction.any() else None,
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
    position = np.arange(len(rows["c_rate"]))
    # Where no slow test was made at a temperature, nobody knows whether the loss is true.
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
    axes.bar(position, reached, color=REACHED, label="reached", width=0.75)
    base = reached
    for share, look in parts:
        height = np.maximum(share, 0)  # a share below zero is scatter, and is not drawn
        axes.bar(position, height, bottom=base, width=0.75, **look)
        base = base + height
    axes.errorbar(
        position[known],
        (100 - np.maximum(rows["true_percent"], 0))[known],
        yerr=1.96 * rows["true_std_percent"][known],
        fmt="none",
        ecolor=style.INK,
        capsize=2,
        label="95 % interval of the true part",
    )
    names = zip(rows["temperature_celsius"], rows["c_rate"], strict=True)
    axes.set_xticks(position, [f"{t:g} °C\n{rate:.2g}C" for t, rate in names], fontsize=7)
    axes.grid(False, axis="x")


NAMED_CURVES = 2  # whose voltages of peaks do not lie on each other; tables have all
# Of the voltages written beside peaks [point]: a discharge has its own just below a charge's.
PLACES = {"charge": (0, 5), "discharge": (0, -16)}


def draw_ica(charges, discharges=()):
    """Incremental capacity over voltage with its peaks, each (curve, peaks, about).

    Discharges are dashed: of one plateau they lie lower in voltage, by the polarisation and the
    hysteresis of both.
    """
    discharges = [one for one in discharges if len(one[0].get("voltage_volt", ()))]
    if not charges and not discharges:
        return style.message("No slow charge or discharge with dQ/dV.")
    figure, axes = style.subplots(1, 1, height=3.0)
    panel = axes[0, 0]
    tests = list(dict.fromkeys(one[2]["wildcards"]["test"] for one in [*charges, *discharges]))
    named = len(charges) + len(discharges) <= NAMED_CURVES
    for direction, curves in (("charge", charges), ("discharge", discharges)):
        for curve, peaks, about in curves:
            test = about["wildcards"]["test"]
            colour = style.SERIES[tests.index(test) % len(style.SERIES)]
            line = {"color": colour, "linestyle": "-" if direction == "charge" else "--"}
            label = test if direction == "charge" else f"{test}, discharge"
            dq_dv = curve["dq_dv_ampere_hour_per_volt"]
            panel.plot(curve["voltage_volt"], dq_dv, label=label, **line)
            _name_peaks(panel, peaks, colour, PLACES[direction] if named else None)
    panel.set(xlabel="voltage [V]", ylabel="dQ/dV [Ah/V]", title="Incremental capacity")
    style.legend_once(panel)
    return figure


def _name_peaks(panel, peaks, colour, place):
    heights = peaks.get("height_ampere_hour_per_volt", [])
    for volt, height in zip(peaks.get("voltage_volt", []), heights, strict=True):
        panel.plot(volt, height, "o", color=colour)
        if place:
            panel.annotate(f"{volt:.3f} V", (volt, height), place, textcoords="offset points")


def draw_ica_temperature(curves, peaks, matches):
    """Incremental capacity by temperature, one curve above the other, matched peaks joined.

    `curves` and `peaks` are columns of stages `ica_temperature_curve` and `ica_temperature_peaks`,
    `matches` rows of `ica_temperature`. The warmest curve is on top.
    """
    # Warmest on top: peaks fade and move from there downwards.
    levels = sorted(set(curves["temperature_celsius"]), reverse=True)
    gap = 0.55 * curves["dq_dv_ampere_hour_per_volt"].max()
    figure, axes = style.subplots(1, 1, height=1.6 + 0.7 * len(levels))
    panel = axes[0, 0]
    base = {celsius: gap * (len(levels) - 1 - k) for k, celsius in enumerate(levels)}
    peaks_at = {c: rows_where(peaks, peaks["temperature_celsius"] == c) for c in base}
    for celsius in levels:
        at_celsius = curves["temperature_celsius"] == celsius
        _curve(panel, celsius, base[celsius], rows_where(curves, at_celsius), peaks_at[celsius])
    for match in matches:
        if match["reference_peaks"] and match["peaks"]:
            _join(panel, match, base, peaks_at)
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
    at_temperature = _tops(match["temperature_celsius"], match["peaks"], base, peaks)
    # Two peaks that may have become one or another are joined, but not as if it were known.
    line = ":" if match["fate"] == "unresolved" else "-"
    for start in at_reference:
        for end in at_temperature:
            axes.plot(*np.array([start, end]).T, line, color=style.QUIET, lw=0.7, zorder=0)
    if match["fate"] not in ("kept", "changed"):
        axes.annotate(
            match["fate"], at_temperature[0], (3, 6), textcoords="offset points", fontsize=7
        )


def _tops(celsius, numbers, base, peaks):
    """(voltage, drawn height) of the peaks at a temperature whose numbers are `1+2`."""
    indices = [int(number) - 1 for number in numbers.split("+")]
    tops = rows_where(peaks[celsius], indices)
    height = base[celsius] + tops["height_ampere_hour_per_volt"]
    return list(zip(tops["voltage_volt"], height, strict=True))
