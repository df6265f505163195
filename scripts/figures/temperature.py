"""Laws of resistance and capacity over temperature, and over inverse temperature."""

import matplotlib
import numpy as np

from cellwright.laws.law import value_of
from cellwright.laws.temperature import FORMS, drawn_pieces, turn_in_words
from cellwright.numerics.lines import ZERO_CELSIUS_KELVIN
from figures import style
from figures.style import evenly_spread

ACROSS = 3  # panels beside each other
MOST_LEVELS = 5  # states of charge drawn of each family, evenly chosen
MARGIN = 1.35  # factor above the highest and below the lowest point
SHOWN = {"Ohm": ("mΩ", 1e3)}  # unit of a panel, and how many of it are one of the table's
NAMES = {"quadratic": "quadratic", "arrhenius": "Arrhenius", "arrhenius_t": "Arrhenius, factor T"}
NAMES |= {"linear": "linear"}
COLOURS = dict(zip(NAMES, style.SERIES, strict=False))
ARRHENIUS_FIGURE = {"arrhenius": ("-", "o"), "quadratic": ("--", "x")}  # line, marker


def draw_temperature_laws(points, laws):
    """Resistance and capacity over temperature with their laws, dotted beyond the tests.

    `points` are columns of stage `temperature_points`, `laws` rows of `temperature`.
    """
    quantities = _shown(points)
    figure, axes = style.panels(len(quantities), across=ACROSS, wide=3.4, height=2.8)
    for panel, quantity in zip(axes, quantities, strict=True):
        of_quantity = points["quantity"] == quantity
        celsius, value = points["temperature_celsius"][of_quantity], points["value"][of_quantity]
        unit, title = points["unit"][of_quantity][0], quantity.replace(", ", "\n", 1)
        unit, scale = SHOWN.get(unit, (unit, 1.0))
        panel.plot(celsius, scale * value, "o", color=style.MEASURED, label="measured")
        for law, colour in COLOURS.items():
            law_rows = [r for r in laws if r["quantity"] == quantity and r["law"] == law]
            if note := _law(panel, celsius, law_rows, law, colour, scale):
                title += f"\n{NAMES[law]}: {note}"
        panel.set(xlabel="temperature [°C]", ylabel=f"[{unit}]", title=title)
    named = {}
    for panel in axes:
        named |= dict(zip(*panel.get_legend_handles_labels()[::-1], strict=True))
    look = {"loc": "outside lower center", "ncols": len(named), "fontsize": 7.5}
    figure.legend(named.values(), named.keys(), **look)
    return figure


def _shown(points):
    """Of each family of quantities the one nearest half charge; all that have no SoC."""
    nearest = {}
    names = points["quantity"], points["family"], points["soc"]
    for quantity, family, soc in zip(*names, strict=True):
        # A panel for each SoC would be dozens; half charge is where resistance is flattest.
        key = family if np.isfinite(soc) else quantity
        off = abs(soc - 0.5) if np.isfinite(soc) else 0.0
        if key not in nearest or off < nearest[key][0]:
            nearest[key] = off, quantity
    return [quantity for _, quantity in nearest.values()]


def _law(axes, celsius, rows, law, colour, scale):
    """A law over the tested temperatures, dotted beyond them and where a resistance's rises.

    What is to be said of it, "" where nothing is.
    """
    if not rows:
        return ""
    values, tested = [row["value"] for row in rows], (celsius.min(), celsius.max())
    valid = rows[0]["valid_from_celsius"], rows[0]["valid_to_celsius"]
    note = turn_in_words(values, valid, tested) or ("chosen" if rows[0]["chosen"] else "")
    for start, stop, sound in drawn_pieces(tested, valid):
        grid, line = np.linspace(start, stop, 60), "-" if sound else ":"
        shown = NAMES[law] if start == tested[0] else None
        axes.plot(grid, scale * value_of(FORMS[law], grid, values), line, color=colour, label=shown)
    return note


def draw_arrhenius(points, laws):
    """Resistance over inverse temperature with the laws, and below the residuals of the laws.

    `points` and `laws` are rows of stages `temperature_points` and `temperature`.
    """
    points = [row for row in points if np.isfinite(row["soc"])]
    families = list(dict.fromkeys(row["family"] for row in points))
    if not families:
        return style.message("No resistance is known at three temperatures.")
    rows, _ = style.grid_of(len(families), across=ACROSS)
    figure, axes = style.subplots(
        2 * rows, ACROSS, width=3.2 * ACROSS + 1, height=4.2 * rows, height_ratios=[2.2, 1] * rows
    )
    uppers, lowers = axes[::2].ravel(), axes[1::2].ravel()
    for upper, lower, family in zip(uppers, lowers, families, strict=False):
        _family(upper, lower, [row for row in points if row["family"] == family], laws)
    style.hide([*uppers[len(families) :], *lowers[len(families) :]])
    return figure


def _family(upper, lower, points, laws):
    """Resistances of one kind at several states of charge."""
    levels = sorted({row["soc"] for row in points})
    shown = evenly_spread(len(levels), MOST_LEVELS)
    for k in shown:
        at_level = [row for row in points if row["soc"] == levels[k]]
        colour = matplotlib.colormaps["viridis_r"](0.1 + 0.85 * levels[k])
        _level(upper, lower, at_level, laws, colour)
    temperatures = sorted({row["temperature_celsius"] for row in points})
    for panel in (upper, lower):
        panel.set_xticks(_inverse(temperatures), [f"{celsius:g}" for celsius in temperatures])
        panel.minorticks_off()
    note = f"\n{len(shown)} of {len(levels)} states of charge" if len(shown) < len(levels) else ""
    values = 1e3 * np.array([row["value"] for row in points])
    limits = values.min() / MARGIN, values.max() * MARGIN
    upper.set(yscale="log", ylim=limits, ylabel="[mΩ]", title=points[0]["family"] + note)
    upper.yaxis.set_major_locator(matplotlib.ticker.LogLocator(subs=(1, 2, 5)))
    style.plain_numbers(upper.yaxis)
    _limit_to_arrhenius(lower)
    lower.set_xlim(upper.get_xlim())
    lower.axhline(0, color=style.QUIET, linewidth=0.8)
    lower.set(xlabel="temperature [°C], spaced as 1/T", ylabel="point over law [%]")
    style.legend_once(upper, ncols=2)


def _limit_to_arrhenius(axes):
    """Residuals of Arrhenius fill the panel; a quadratic that is off by far more leaves it."""
    # The scale is that of Arrhenius: a quadratic off by far would flatten it to a line.
    marker = ARRHENIUS_FIGURE["arrhenius"][1]
    drawn = [line for line in axes.get_lines() if line.get_marker() == marker]
    largest = max((np.abs(line.get_ydata()).max() for line in drawn), default=1.0)
    axes.set_ylim(-1.5 * largest, 1.5 * largest)


def _level(upper, lower, points, laws, colour):
    """Points and laws of one state of charge, and the points over the laws below."""
    celsius, value, std = (
        np.array([row[name] for row in points]) for name in ("temperature_celsius", "value", "std")
    )
    label = f"{100 * points[0]['soc']:.0f} % SoC"
    upper.errorbar(
        _inverse(celsius), 1e3 * value, 1e3 * np.nan_to_num(std), fmt="o", color=colour, label=label
    )
    for law, (line, marker) in ARRHENIUS_FIGURE.items():
        rows = [r for r in laws if r["quantity"] == points[0]["quantity"] and r["law"] == law]
        if not rows:
            continue
        values = [row["value"] for row in rows]
        valid = rows[0]["valid_from_celsius"], rows[0]["valid_to_celsius"]
        for start, stop, sound in drawn_pieces((celsius.min(), celsius.max()), valid):
            grid = np.linspace(start, stop, 30)
            ohm = value_of(FORMS[law], grid, values)
            shown = np.where(ohm > 0, 1e3 * ohm, np.nan)  # a logarithm shows nothing else
            look = {"color": colour, "linestyle": line if sound else ":"}
            upper.plot(_inverse(grid), shown, linewidth=1, **look)
        percent = 100 * (value / value_of(FORMS[law], celsius, values) - 1)
        lower.plot(_inverse(celsius), percent, marker, color=colour)


def _inverse(celsius):
    """Minus 1000/T [1/K]: linear for Arrhenius, and the warm side on the right."""
    return -1000 / (np.asarray(celsius, float) + ZERO_CELSIUS_KELVIN)
