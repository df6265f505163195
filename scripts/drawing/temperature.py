"""Resistance and capacity over temperature, with the laws and what lies beyond the tests."""

import numpy as np

import figure
from cellwright.laws.temperature import LAWS, stretches, turn_of

ACROSS = 3


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
    """A law over the tested temperatures, dotted beyond them and where a resistance's rises."""
    if not rows:
        return
    values, tested = [row["value"] for row in rows], (celsius.min(), celsius.max())
    valid = rows[0]["valid_from_celsius"], rows[0]["valid_to_celsius"]
    said = turn_of(values, valid, tested) or ("chosen" if rows[0]["chosen"] else "")
    label = f"{law} ({said})" if said else law
    for start, stop, sound in stretches(tested, valid):
        grid, style = np.linspace(start, stop, 60), "-" if sound else ":"
        shown = label if start == tested[0] else None
        axes.plot(grid, LAWS[law](grid, *values), style, color=colour, label=shown)
