"""Resistance over inverse temperature, with what both laws leave."""

import matplotlib
import numpy as np

import figure
from cellwright.laws.temperature import LAWS, stretches
from cellwright.numerics.arrhenius import ZERO_CELSIUS_KELVIN

ACROSS = 3  # families beside each other
MOST_LEVELS = 5  # states of charge drawn of each, evenly chosen
ROOM = 1.35  # above the highest and below the lowest point
DOTTED = {"linestyle": ":"}
STYLES = {"arrhenius": ("-", "o"), "quadratic": ("--", "x")}


def draw(points, laws):
    """Figure of a cell: `points` rows of `temperature_points`, `laws` rows of `temperature`."""
    mine = [row for row in points if np.isfinite(row["soc"])]
    families = list(dict.fromkeys(row["family"] for row in mine))
    if not families:
        return figure.message("No resistance is known at three temperatures.")
    rows = -(-len(families) // ACROSS)
    columns = min(len(families), ACROSS)
    canvas, axes = figure.canvas(
        2 * rows, columns, width=3.2 * columns + 1, height=4.2 * rows, height_ratios=[2.2, 1] * rows
    )
    for k in range(rows * columns):
        pair = axes[2 * (k // columns) : 2 * (k // columns) + 2, k % columns]
        if k >= len(families):
            [panel.axis("off") for panel in pair]
            continue
        _family(*pair, [row for row in mine if row["family"] == families[k]], laws)
    return canvas


def _family(upper, lower, points, laws):
    levels = sorted({row["soc"] for row in points})
    shown = np.unique(np.linspace(0, len(levels) - 1, MOST_LEVELS).round().astype(int))
    for k in shown:
        mine = [row for row in points if row["soc"] == levels[k]]
        colour = matplotlib.colormaps["viridis_r"](0.1 + 0.85 * levels[k])
        _level(upper, lower, mine, laws, colour)
    temperatures = sorted({row["temperature_celsius"] for row in points})
    for panel in (upper, lower):
        panel.set_xticks(_axis(temperatures), [f"{celsius:g}" for celsius in temperatures])
        panel.minorticks_off()
    some = f"\n{len(shown)} of {len(levels)} states of charge" if len(shown) < len(levels) else ""
    values = 1e3 * np.array([row["value"] for row in points])
    limits = values.min() / ROOM, values.max() * ROOM
    upper.set(yscale="log", ylim=limits, ylabel="[mΩ]", title=points[0]["family"] + some)
    _plain_ticks(upper)
    _limit(lower)
    lower.set_xlim(upper.get_xlim())
    lower.axhline(0, color=figure.QUIET, linewidth=0.8)
    lower.set(xlabel="temperature [°C], spaced as 1/T", ylabel="point over law [%]")
    figure.legend_once(upper, ncols=2)


def _limit(axes):
    """Residuals of Arrhenius fill the panel; a quadratic that is off by far more leaves it."""
    drawn = [line for line in axes.get_lines() if line.get_marker() == STYLES["arrhenius"][1]]
    largest = max((np.abs(line.get_ydata()).max() for line in drawn), default=1.0)
    axes.set_ylim(-1.5 * largest, 1.5 * largest)


def _plain_ticks(axes):
    axes.yaxis.set_major_locator(matplotlib.ticker.LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter(matplotlib.ticker.FormatStrFormatter("%g"))
    axes.yaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())


def _level(upper, lower, points, laws, colour):
    """Points and laws of one state of charge."""
    celsius = np.array([row["temperature_celsius"] for row in points])
    value, std = (np.array([row[name] for row in points]) for name in ("value", "std"))
    label = f"{100 * points[0]['soc']:.0f} % SoC"
    upper.errorbar(
        _axis(celsius), 1e3 * value, 1e3 * np.nan_to_num(std), fmt="o", color=colour, label=label
    )
    for law, (line, marker) in STYLES.items():
        rows = [r for r in laws if r["quantity"] == points[0]["quantity"] and r["law"] == law]
        if not rows:
            continue
        values = [row["value"] for row in rows]
        valid = rows[0]["valid_from_celsius"], rows[0]["valid_to_celsius"]
        style = {"color": colour, "linestyle": line}
        for start, stop, sound in stretches((celsius.min(), celsius.max()), valid):
            grid = np.linspace(start, stop, 30)
            _course(upper, grid, LAWS[law](grid, *values), style if sound else style | DOTTED)
        left = 100 * (value / LAWS[law](celsius, *values) - 1)
        lower.plot(_axis(celsius), left, marker, color=colour)


def _course(axes, celsius, ohm, style):
    """A law as a line, without what the logarithm cannot show."""
    axes.plot(_axis(celsius), np.where(ohm > 0, 1e3 * ohm, np.nan), linewidth=1, **style)


def _axis(celsius):
    """Minus 1000/T [1/K]: linear for Arrhenius, and the warm side on the right."""
    return -1000 / (np.asarray(celsius, float) + ZERO_CELSIUS_KELVIN)
