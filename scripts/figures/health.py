"""Figures of health: fade with law, knee and end of life; resistance over SoC; fleets."""

import numpy as np

from figures import style


def draw_fade(course, life):
    """Capacities of a life over its cycles, the law of the fade, its knee and its end.

    `course` are columns of stage `fade_course`, `life` the row of `life`.
    """
    figure, axes = style.subplots(1, 2, width=9.5, height=3.4, width_ratios=[1.7, 1])
    _capacities(axes[0, 0], course)
    _knee_and_end(axes[0, 0], course, life)
    style.legend_once(axes[0, 0], fontsize=7, loc="lower left")
    _efficiencies(axes[0, 1], course)
    return figure


def _capacities(axes, course):
    used = course["used"].astype(bool)
    cycle, measured = course["cycle"], course["capacity_ampere_hour"]
    axes.plot(cycle[~used], measured[~used], "x", color=style.QUIET, ms=3, label="left out")
    axes.plot(cycle[used], measured[used], ".", color=style.MEASURED, ms=2, label="measured")
    at_reference = course["at_reference_ampere_hour"]
    if not np.allclose(at_reference, measured):
        shown = {"color": style.SERIES[2], "ms": 2, "label": "temperature out"}
        axes.plot(cycle[used], at_reference[used], ".", **shown)
    colour = style.SERIES[1]
    limits = course["law_lower_ampere_hour"], course["law_upper_ampere_hour"]
    axes.fill_between(cycle, *limits, color=colour, alpha=0.25, lw=0)
    axes.plot(cycle, course["law_ampere_hour"], color=colour, label="law of the fade")
    if np.any(course["recovered_ampere_hour"] > 0):
        whole = course["law_ampere_hour"] + course["recovered_ampere_hour"]
        axes.plot(cycle, whole, color=colour, lw=0.7, ls="--", label="with recovery after rests")
    axes.set(xlabel="cycle", ylabel="capacity [Ah]")


def _knee_and_end(axes, course, life):
    """The knee with its interval, the end of life with its own, and the law's name."""
    title = f"Fade: {life['law']}, SoH {100 * life['soh']:.1f} %"
    if np.isfinite(life["knee_cycle"]):
        limits = life["knee_lower_cycle"], life["knee_upper_cycle"]
        axes.axvspan(*limits, color=style.SERIES[3], alpha=0.15, lw=0)
        label = f"knee {life['knee_cycle']:.0f} ({limits[0]:.0f} to {limits[1]:.0f})"
        axes.axvline(life["knee_cycle"], color=style.SERIES[3], lw=0.9, label=label)
    end, last = life["end_of_life_cycle"], life["last_cycle"]
    if np.isfinite(end):
        lower = last + life["remaining_lower_cycles"]
        upper = last + life["remaining_upper_cycles"]
        # An end of life far beyond the record would squeeze all that was measured to the left.
        seen = 3 * last
        label = f"end of life {end:.0f}"
        if not life["end_of_life_reached"]:
            known = np.isfinite(upper)
            label += f" ({lower:.0f} to {upper:.0f})" if known else f" ({lower:.0f} or later)"
            span = lower, min(upper, seen) if known else seen
            axes.axvspan(*span, color=style.SERIES[4], alpha=0.1, lw=0)
        axes.axvline(min(end, seen), color=style.SERIES[4], lw=0.9, ls=":", label=label)
    axes.set_title(title, loc="left")
    # Left-out discharges, often of a tenth of the capacity, must not set the scale.
    size = course["capacity_ampere_hour"][course["used"].astype(bool)]
    axes.set_ylim(0.97 * size.min(), 1.03 * size.max())


def _efficiencies(axes, course):
    """Energy and coulombic efficiency over the cycles, where charges were recorded."""
    drawn = False
    for name, label in (("energy_efficiency", "energy"), ("coulombic_efficiency", "charge")):
        known = np.isfinite(course[name]) & course["used"].astype(bool)
        if known.any():
            values = 100 * course[name][known]
            axes.plot(course["cycle"][known], values, ".", ms=2, label=label)
            drawn = True
    axes.set(xlabel="cycle", ylabel="efficiency [%]")
    axes.set_title("Out over in" if drawn else "Efficiency: charges not recorded", loc="left")
    style.legend_once(axes)


def draw_resistance_growth(growth):
    """Resistance over SoC at every check-up, and its factor since the first one.

    `growth` are columns of stage `resistance_growth`; none where no pulse has a resistance.
    """
    shown = growth and (growth["direction"] == "discharge") & (growth["delay_second"] == 0)
    cycles = np.unique(growth["cycle"][shown]) if growth else ()
    if len(cycles) < 2:
        return style.message("Resistance growth needs pulse tests at two check-ups; there is one.")
    figure, axes = style.subplots(1, 2, height=3.4)
    for place, cycle in enumerate(cycles):
        rows = shown & (growth["cycle"] == cycle)
        soc = 100 * growth["soc"][rows]
        look = {"color": style.SERIES[place % len(style.SERIES)], "label": f"cycle {cycle:.0f}"}
        axes[0, 0].plot(soc, 1e3 * growth["resistance_ohm"][rows], "o-", ms=3, **look)
        axes[0, 1].plot(soc, growth["factor"][rows], "o-", ms=3, **look)
    axes[0, 0].set(xlabel="state of charge [%]", ylabel="resistance, first sample [mΩ]")
    axes[0, 1].set(xlabel="state of charge [%]", ylabel="over that of the first check-up")
    axes[0, 0].set_title("At each check-up", loc="left")
    axes[0, 1].set_title("Growth", loc="left")
    style.legend_once(axes[0, 0])
    return figure


def draw_fleet(rows, lines):
    """Fleets, a row a type: mean resistance over capacity with its line, and capacity as predicted.

    Outliers are named. `rows` and `lines` are rows of tables/fleet_health and
    tables/fleet_health_lines as numbers.
    """
    types = [line for line in lines if np.isfinite(line["slope_ohm_per_ampere_hour"])]
    if not types:
        reasons = "; ".join(f"{line['type']}: {line['verdict']}" for line in lines)
        return style.message(reasons or "no type has two cells with capacity and resistance")
    figure, axes = style.subplots(len(types), 2, width=10.0, height=3.6 * len(types))
    for pair, line in zip(axes, types, strict=True):
        cells = [row for row in rows if row["type"] == line["type"]]
        known = [row for row in cells if np.isfinite(row["error_ampere_hour"])]
        _resistance_panel(pair[0], known, line)
        _prediction_panel(pair[1], known, line)
    return figure


def _prediction_panel(axes, cells, line):
    """Capacity of each cell as the others predict it from its resistances, over the known one."""
    capacity, predicted, std = (
        np.array([cell[f"{name}_ampere_hour"] for cell in cells])
        for name in ("capacity", "predicted", "predicted_std")
    )
    axes.errorbar(capacity, predicted, 1.96 * std, fmt="o", color=style.MEASURED, elinewidth=0.6)
    ends = np.array([capacity.min(), capacity.max()])
    axes.plot(ends, ends, color=style.SERIES[1])
    axes.set(xlabel="capacity [Ah]", ylabel="from resistance, cell left out, 95 % [Ah]")
    axes.set_title(
        f"from {line['socs']:.0f} resistances over SoC: to {100 * line['held_out_share']:.1f} %"
    )


def _resistance_panel(axes, cells, line):
    """One type of cells: points, line, names of outliers."""
    capacity = np.array([cell["capacity_ampere_hour"] for cell in cells])
    resistance = 1e3 * np.array([cell["resistance_ohm"] for cell in cells])
    out = np.array([bool(cell["outlier"]) for cell in cells])
    axes.plot(capacity[~out], resistance[~out], "o", color=style.MEASURED)
    axes.plot(capacity[out], resistance[out], "o", color=style.SERIES[4])
    for cell, x, y in zip(cells, capacity, resistance, strict=True):
        if cell["outlier"]:
            axes.annotate(cell["cell"], (x, y), (4, 4), textcoords="offset points")
    # The line only between the cells that it was fitted to.
    ends = np.array([capacity.min(), capacity.max()])
    law = 1e3 * (line["intercept_ohm"] + line["slope_ohm_per_ampere_hour"] * ends)
    axes.plot(ends, law, color=style.SERIES[1])
    axes.set(xlabel="capacity [Ah]", ylabel=f"mean resistance over SoC, {line['delay']} [mΩ]")
    by_line = line["line_held_out_rms_ampere_hour"] / np.mean(capacity)
    axes.set_title(f"{line['type']}: by the line, cell left out to {100 * by_line:.1f} %")
