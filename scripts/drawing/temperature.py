"""Resistance and capacity over temperature, with the laws and what lies beyond the tests."""

from itertools import pairwise

import numpy as np

import figure
from cellwright.laws.temperature import LAWS

ACROSS = 3
BEYOND = 5.0  # K that a law is drawn beyond what was tested, dotted


def draw(points, laws):
    """Figure of a cell: `points` of stage `temperature_points`, `laws` rows of `temperature`."""
    quantities = _shown(points)
    rows, columns = -(-len(quantities) // ACROSS), min(len(quantities), ACROSS)
    canvas, axes = figure.canvas(rows, columns, width=3.4 * columns + 0.4, height=2.8 * rows)
    for panel, quantity in zip(axes.flat, quantities, strict=False):
        mine = points["quantity"] == quantity
        celsius, value = points["temperature_celsius"][mine], points["value"][mine]
        panel.plot(celsius, value, "o", color=figure.MEASURED, label="measured")
        for colour, law in zip(figure.SERIES, LAWS, strict=False):
            found = [r for r in laws if r["quantity"] == quantity and r["law"] == law]
            _course(panel, celsius, found, law, colour)
        unit = points["unit"][mine][0]
        panel.set(xlabel="temperature [°C]", ylabel=f"[{unit}]", title=_in_two_lines(quantity))
        figure.legend_once(panel)
    for panel in axes.flat[len(quantities) :]:
        panel.axis("off")
    return canvas


def _shown(points):
    """Of each family of quantities the one nearest half charge; all that have no SoC."""
    best = {}
    for quantity, family, soc in zip(
        points["quantity"], points["family"], points["soc"], strict=True
    ):
        key = family if np.isfinite(soc) else quantity
        off = abs(soc - 0.5) if np.isfinite(soc) else 0.0
        if key not in best or off < best[key][0]:
            best[key] = off, quantity
    return [quantity for _, quantity in best.values()]


def _in_two_lines(quantity):
    return quantity.replace(", ", "\n", 1)


def _course(axes, celsius, rows, law, colour):
    """A law over the tested temperatures, dotted beyond them."""
    if not rows:
        return
    values, low, high = [row["value"] for row in rows], celsius.min(), celsius.max()
    for k, (start, stop) in enumerate(pairwise([low - BEYOND, low, high, high + BEYOND])):
        grid = np.linspace(start, stop, 60)
        label = f"{law}{' (chosen)' if rows[0]['chosen'] else ''}" if k == 1 else None
        style = "-" if k == 1 else ":"
        axes.plot(grid, LAWS[law](grid, *values), style, color=colour, label=label)
