"""Resistance and capacity over temperature, with both laws and their errors."""

import numpy as np

import figure
from cellwright.laws.temperature import arrhenius_law, quadratic_law

LAWS = {"quadratic": quadratic_law, "arrhenius": arrhenius_law}


def draw(points, laws):
    """Figure of a cell: `points` of stage `temperature_points`, `laws` rows of `temperature`."""
    quantities = list(dict.fromkeys(points["quantity"]))
    canvas, axes = figure.canvas(1, len(quantities), height=3.0)
    for panel, quantity in zip(axes[0], quantities, strict=True):
        mine = points["quantity"] == quantity
        celsius, value = points["temperature_celsius"][mine], points["value"][mine]
        panel.plot(celsius, value, "o", color=figure.MEASURED, label="measured")
        grid = np.linspace(celsius.min() - 3, celsius.max() + 3, 100)
        for colour, law in zip(figure.SERIES, LAWS, strict=False):
            rows = [r for r in laws if r["quantity"] == quantity and r["law"] == law]
            _course(panel, grid, rows, law, colour)
        unit = points["unit"][mine][0]
        panel.set(xlabel="temperature [°C]", ylabel=f"[{unit}]", title=quantity)
        figure.legend_once(panel)
    return canvas


def _course(axes, grid, rows, law, colour):
    if rows:
        values = LAWS[law](grid, *[row["value"] for row in rows])
        chosen = " (chosen)" if rows[0]["chosen"] else ""
        axes.plot(grid, values, color=colour, label=f"{law}{chosen}")
