"""Resistance over SoC and temperature: the chosen form, and each form's error left out."""

import numpy as np

import figure
from cellwright.laws.surface import FORMS


def draw(points, laws):
    """Figure of a cell: `points` columns of `resistance_surface_points`, `laws` its rows."""
    quantities = list(dict.fromkeys(points["quantity"]))
    canvas, axes = figure.canvas(
        len(quantities), 2 + len(FORMS), width=14, height=2.9 * len(quantities)
    )
    for panels, quantity in zip(axes, quantities, strict=True):
        mine = points["quantity"] == quantity
        here = {name: values[mine] for name, values in points.items()}
        what, when = quantity.split(", ")
        rows = [row for row in laws if row["quantity"].startswith(what + " over")]
        rows = [row for row in rows if row["quantity"].endswith(", " + when)]
        chosen = next(row["law"] for row in rows if row["chosen"])
        _fitted(panels[0], here, chosen, quantity)
        _surface(canvas, panels[1], here, chosen)
        shares = [
            _left_out(panel, here, form, form == chosen)
            for panel, form in zip(panels[2:], FORMS, strict=True)
        ]
        reach = 1.1 * np.nanmax([*shares, 1.0])
        for panel in panels[2:]:
            panel.set_ylim(-reach, reach)
    return canvas


def _fitted(axes, points, chosen, title):
    """Pulses and the chosen form over SoC, one colour a temperature."""
    for celsius, here in _by_temperature(points):
        colour, soc = figure.temperature_colour(celsius), 100 * points["soc"][here]
        axes.plot(
            soc,
            1e3 * points["resistance_ohm"][here],
            "o",
            color=colour,
            label=figure.temperature_label(celsius),
        )
        # A table runs through every pulse: the line shows what it reads between them.
        axes.plot(soc, 1e3 * points[f"{chosen}_ohm"][here], "-", color=colour)
    axes.set(xlabel="SoC [%]", ylabel="[mΩ]", title=title)
    figure.legend_once(axes, fontsize=7)


def _surface(canvas, axes, points, chosen):
    """The chosen form between the pulses: resistance over SoC and temperature."""
    soc, celsius = 100 * points["soc"], points["temperature_celsius"]
    ohm = 1e3 * points[f"{chosen}_ohm"]
    filled = axes.tricontourf(soc, celsius, ohm, levels=12, cmap="viridis_r")
    axes.plot(soc, celsius, ".", color=figure.INK, markersize=2)
    canvas.colorbar(filled, ax=axes, label="[mΩ]")
    axes.set(xlabel="SoC [%]", ylabel="temperature [°C]", title=f"surface: {chosen}")


def _left_out(axes, points, form, chosen):
    """Error where the temperature was left out; returns the largest share [%]."""
    shares = 100 * (points[f"{form}_left_out_ohm"] / points["resistance_ohm"] - 1)
    for celsius, here in _by_temperature(points):
        axes.plot(
            100 * points["soc"][here], shares[here], "o-", color=figure.temperature_colour(celsius)
        )
    axes.axhline(0, color=figure.QUIET, linewidth=0.8)
    axes.set(
        xlim=(-3, 103),
        xlabel="SoC [%]",
        ylabel="error [%]",
        title=f"left out: {form}" + (" ★" if chosen else ""),
    )
    known = shares[np.isfinite(shares)]
    if not len(known):
        axes.text(
            0.5,
            0.6,
            "too few temperatures\nto leave one out",
            ha="center",
            transform=axes.transAxes,
        )
    return np.quantile(np.abs(known), 0.98) if len(known) else 0.0


def _by_temperature(points):
    for celsius in np.unique(points["temperature_celsius"]):
        here = np.flatnonzero(points["temperature_celsius"] == celsius)
        yield celsius, here[np.argsort(points["soc"][here])]
