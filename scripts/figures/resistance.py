"""Pulse resistance of a cell over SoC, and its surface over SoC and temperature."""

import numpy as np

from cellwright.laws.surface import FORMS
from cellwright.protocols.resistance import PROMPT_SECOND
from figures import style
from figures.style import ambient_celsius, rows_where

WANTED_DELAY_SECOND = 10  # the second panel shows the delay nearest to this one
TOO_FEW = "too few temperatures\nto leave one out"


def draw_resistance(tests):
    """Pulse resistance over SoC at the first sample and later in the pulse.

    `tests` are (columns, about) of stage `resistance`.
    """
    delays = sorted({delay for columns, _ in tests for delay in columns["delay_second"]})
    # Data sheets state resistance at 10 s; the first sample is near the ohmic part.
    later = sorted(delays[1:], key=lambda delay: abs(delay - WANTED_DELAY_SECOND))
    shown = [delays[0], *later[:1]]
    prompt = any(
        ((c["delay_second"] == 0) & (c["actual_delay_second"] <= PROMPT_SECOND)).any()
        for c, _ in tests
    )
    figure, axes = style.subplots(1, len(shown), height=3.2, sharex=True)
    for panel, delay in zip(axes[0], shown, strict=True):
        for columns, about in tests:
            rows = columns["delay_second"] == delay
            if delay == 0 and prompt:  # what polarises for seconds is no first sample beside it
                rows &= columns["actual_delay_second"] <= PROMPT_SECOND
            at_delay = rows_where(columns, rows)
            _pulses(panel, at_delay, style.temperature_style(ambient_celsius(about)))
        name = "first sample" if delay == 0 else f"{delay:g} s into the pulse"
        panel.set(xlabel="SoC [%]", ylabel="resistance [mΩ]", title=f"Resistance, {name}")
        panel.set_ylim(0, 1.04 * panel.get_ylim()[1])  # no marker at the frame
    style.legend_once(axes[0, 0])
    return figure


def _pulses(axes, columns, look):
    """One line a direction and rate, over SoC."""
    rates = np.round(columns["c_rate"], 1)
    for direction, marker in style.MARKERS.items():
        in_direction = columns["direction"] == direction
        for rate in np.unique(rates[in_direction]):
            same = np.flatnonzero(in_direction & (rates == rate))
            order = same[np.argsort(columns["soc"][same])]
            axes.errorbar(
                100 * columns["soc"][order],
                1e3 * columns["resistance_ohm"][order],
                yerr=1e3 * np.nan_to_num(columns["resistance_std_ohm"][order]),
                fmt=f"{marker}-",
                linewidth=0.5,
                **look,
            )


def draw_resistance_surface(points, laws):
    """Resistance over SoC and temperature: the chosen form, and each form's error left out.

    `points` are columns of stage `resistance_surface_points`, `laws` rows of `resistance_surface`.
    """
    quantities = list(dict.fromkeys(points["quantity"]))
    figure, axes = style.subplots(
        len(quantities), 2 + len(FORMS), width=14, height=2.9 * len(quantities)
    )
    for panels, quantity in zip(axes, quantities, strict=True):
        of_quantity = rows_where(points, points["quantity"] == quantity)
        resistance, when = quantity.split(", ")
        rows = [row for row in laws if row["quantity"].startswith(resistance + " over")]
        rows = [row for row in rows if row["quantity"].endswith(", " + when)]
        chosen = next(row["law"] for row in rows if row["chosen"])
        _fitted(panels[0], of_quantity, chosen, quantity)
        _surface(figure, panels[1], of_quantity, chosen)
        largest = [
            _error_left_out(panel, of_quantity, form, form == chosen)
            for panel, form in zip(panels[2:], FORMS, strict=True)
        ]
        # One scale for all forms: the eye compares heights.
        limit = 1.1 * np.nanmax([*largest, 1.0])
        for panel in panels[2:]:
            panel.set_ylim(-limit, limit)
    return figure


def _fitted(axes, points, chosen, title):
    """Pulses and the chosen form over SoC, one colour a temperature."""
    for celsius, pulses in _by_temperature(points):
        look = style.temperature_style(celsius)
        soc = 100 * pulses["soc"]
        axes.plot(soc, 1e3 * pulses["resistance_ohm"], "o", **look)
        # A table runs through every pulse: the line shows what it reads between them.
        axes.plot(soc, 1e3 * pulses[f"{chosen}_ohm"], "-", color=look["color"])
    axes.set(xlabel="SoC [%]", ylabel="[mΩ]", title=title)
    style.legend_once(axes, fontsize=7)


def _surface(figure, axes, points, chosen):
    """The chosen form between the pulses: resistance over SoC and temperature."""
    soc, celsius = 100 * points["soc"], points["temperature_celsius"]
    ohm = 1e3 * points[f"{chosen}_ohm"]
    filled = axes.tricontourf(soc, celsius, ohm, levels=12, cmap="viridis_r")
    axes.plot(soc, celsius, ".", color=style.INK, markersize=2)
    style.colour_bar(figure, filled, [axes], label="[mΩ]")
    axes.set(xlabel="SoC [%]", ylabel="temperature [°C]", title=f"surface: {chosen}")


def _error_left_out(axes, points, form, chosen):
    """Error of a form at temperatures left out of its fit; returns the largest one [%]."""
    percent = 100 * (points[f"{form}_left_out_ohm"] / points["resistance_ohm"] - 1)
    for celsius, pulses in _by_temperature(points | {"percent": percent}):
        colour = style.temperature_colour(celsius)
        axes.plot(100 * pulses["soc"], pulses["percent"], "o-", color=colour)
    axes.axhline(0, color=style.QUIET, linewidth=0.8)
    star = " ★" if chosen else ""
    axes.set(xlim=(-3, 103), xlabel="SoC [%]", ylabel="error [%]", title=f"left out: {form}{star}")
    finite = percent[np.isfinite(percent)]
    if not len(finite):
        axes.text(0.5, 0.6, TOO_FEW, ha="center", transform=axes.transAxes)
    return np.quantile(np.abs(finite), 0.98) if len(finite) else 0.0


def _by_temperature(points):
    """(temperature, its points in the order of SoC), coldest first."""
    for celsius in np.unique(points["temperature_celsius"]):
        rows = np.flatnonzero(points["temperature_celsius"] == celsius)
        yield celsius, rows_where(points, rows[np.argsort(points["soc"][rows])])
