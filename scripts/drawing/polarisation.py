"""Amplitudes and time constants of rests over SoC, and their medians over temperature."""

import numpy as np

import figure
from cellwright.laws.polarisation import Point, over_temperature
from cellwright.laws.temperature import arrhenius_law

FACTOR = {"V": (1e3, "mV"), "s": (1.0, "s")}


def draw(points, laws):
    """Figure of a cell: rows of stages `polarisation_points` and `polarisation`."""
    found = [Point(**{name: row[name] for name in Point._fields}) for row in points]
    names = list(dict.fromkeys(point.quantity for point in found))
    canvas, axes = figure.canvas(2, len(names), width=11.0, height=5.4)
    courses = over_temperature(found)
    for column, name in enumerate(names):
        mine = [point for point in found if point.quantity == name]
        factor, unit = FACTOR[mine[0].unit]
        _over_soc(axes[0, column], mine, factor)
        axes[0, column].set(xlabel="SoC [%]", ylabel=f"{name} [{unit}]", title=f"{name} over SoC")
        _over_temperature(axes[1, column], *courses[name], _laws(laws, name), factor)
        axes[1, column].set(xlabel="temperature [°C]", ylabel=f"{name} [{unit}]")
        axes[1, column].set_title(f"{name}, median over SoC")
    figure.legend_once(axes[0, 0])
    figure.legend_once(axes[1, 0])
    return canvas


def _over_soc(axes, points, factor):
    for celsius in sorted({point.temperature_celsius for point in points}):
        mine = sorted(p for p in points if p.temperature_celsius == celsius)
        axes.errorbar(
            [100 * point.soc for point in mine],
            [factor * point.value for point in mine],
            yerr=[factor * np.nan_to_num(point.std) for point in mine],
            fmt="o-",
            linewidth=0.5,
            markersize=3,
            color=figure.temperature_colour(celsius),
            label=figure.temperature_label(celsius),
        )
    values = [point.value for point in points]
    if min(values) > 0 and max(values) > 8 * min(values):
        axes.set_yscale("log")


def _laws(laws, name):
    mine = [row for row in laws if row["quantity"] == f"polarisation {name}, median over SoC"]
    return {law: [row for row in mine if row["law"] == law] for law in ("linear", "arrhenius")}


def _over_temperature(axes, celsius, value, laws, factor):
    axes.plot(celsius, factor * value, "o", color=figure.MEASURED, label="median")
    if len(celsius) < 2:
        return
    grid = np.linspace(celsius.min() - 3, celsius.max() + 3, 100)
    for colour, (law, rows) in zip(figure.SERIES, laws.items(), strict=False):
        if not rows:
            continue
        first, second = rows[0]["value"], rows[1]["value"]
        line = (
            first * (grid - 25.0) + second
            if law == "linear"
            else arrhenius_law(grid, first, second)
        )
        chosen = " (chosen)" if rows[0]["chosen"] else ""
        axes.plot(grid, factor * line, color=colour, label=f"{law}{chosen}")
    axes.set_ylim(bottom=0)
