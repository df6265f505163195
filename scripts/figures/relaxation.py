"""Figures of rests: fitted exponentials, and polarisation over SoC and temperature."""

import numpy as np

from cellwright.laws.law import value_of
from cellwright.laws.polarisation import over_temperature
from cellwright.laws.temperature import FORMS
from figures import style
from figures.style import ambient_celsius

MOST_RESTS = 6
MIDDLE_SOC = 0.5
FACTOR = {"V": (1e3, "mV"), "s": (1.0, "s")}


def draw_relaxation(tests):
    """One rest of each temperature with its fitted exponentials and their residuals.

    `tests` are (columns, about) of stage `relaxation_curve`.
    """
    tests = [(columns, about) for columns, about in tests if len(columns["time_second"])]
    if not tests:
        return style.message("No rest was long enough to fit its depolarisation.")
    shown = _of_each_temperature(tests)
    figure, axes = style.subplots(
        2, len(shown), width=11.0, height=4.4, sharex="col", height_ratios=[2, 1]
    )
    for panels, (columns, about) in zip(axes.T, shown, strict=True):
        _rest(panels, columns, about)
    axes[0, 0].set_ylabel("voltage [V]")
    axes[1, 0].set_ylabel("residual [mV]")
    style.legend_once(axes[0, 0])
    return figure


def _of_each_temperature(tests):
    """The rest nearest 50 % SoC of each temperature, coldest first, at most `MOST_RESTS`."""
    nearest = {}
    for columns, about in sorted(tests, key=lambda test: abs(test[0]["soc"][0] - MIDDLE_SOC)):
        nearest.setdefault(ambient_celsius(about), (columns, about))
    order = sorted(nearest, key=lambda celsius: (celsius is None, celsius or 0.0))
    return [nearest[celsius] for celsius in order[:: -(-len(order) // MOST_RESTS)]]


def _rest(panels, columns, about):
    time, volts, fitted = (columns[n] for n in ("time_second", "voltage_volt", "fitted_volt"))
    panels[0].plot(time + 1, volts, ".", markersize=2, color=style.MEASURED, label="measured")
    panels[0].plot(time + 1, fitted, color=style.SERIES[1], label="exponentials")
    # Time from one second on: a logarithm has no place for the first sample.
    temperature = style.temperature_label(ambient_celsius(about))
    panels[0].set(title=f"{temperature}, SoC {100 * columns['soc'][0]:.0f} %", xscale="log")
    panels[1].plot(time + 1, 1e3 * (volts - fitted), ".", markersize=2, color=style.ERROR)
    panels[1].set(xlabel="time in rest + 1 s [s]", xscale="log")


def draw_polarisation(points, laws):
    """Amplitudes and time constants of rests over SoC, and their medians over temperature.

    `points` and `laws` are rows of stages `polarisation_points` and `polarisation`.
    """
    if not points:
        return style.message("No rests compare, so polarisation has no course.")
    names = list(dict.fromkeys(point["quantity"] for point in points))
    figure, axes = style.subplots(2, len(names), width=11.0, height=5.4)
    courses = over_temperature(points)
    for (upper, lower), name in zip(axes.T, names, strict=True):
        of_quantity = [point for point in points if point["quantity"] == name]
        factor, unit = FACTOR[of_quantity[0]["unit"]]
        _over_soc(upper, of_quantity, factor)
        upper.set(xlabel="SoC [%]", ylabel=f"{name} [{unit}]", title=f"{name} over SoC")
        own_laws = [r for r in laws if r["quantity"] == f"polarisation {name}, median over SoC"]
        _over_temperature(lower, *courses[name], own_laws, factor)
        lower.set(xlabel="temperature [°C]", ylabel=f"{name} [{unit}]")
        lower.set_title(f"{name}, median over SoC")
    style.legend_once(axes[0, 0])
    style.legend_once(axes[1, 0])
    return figure


def _over_soc(axes, points, factor):
    for celsius in sorted({point["temperature_celsius"] for point in points}):
        at_celsius = [p for p in points if p["temperature_celsius"] == celsius]
        at_celsius.sort(key=lambda point: (point["soc"], point["value"]))
        axes.errorbar(
            [100 * point["soc"] for point in at_celsius],
            [factor * point["value"] for point in at_celsius],
            yerr=[factor * np.nan_to_num(point["std"]) for point in at_celsius],
            fmt="o-",
            linewidth=0.5,
            markersize=3,
            **style.temperature_style(celsius),
        )
    values = [point["value"] for point in points]
    if min(values) > 0 and max(values) > 8 * min(values):
        axes.set_yscale("log")


def _over_temperature(axes, celsius, value, laws, factor):
    """Medians over SoC with the linear and the Arrhenius law through them."""
    axes.plot(celsius, factor * value, "o", color=style.MEASURED, label="median")
    if len(celsius) < 2:
        return
    grid = np.linspace(celsius.min() - 3, celsius.max() + 3, 100)
    for colour, law in zip(style.SERIES, ("linear", "arrhenius"), strict=False):
        rows = [row for row in laws if row["law"] == law]
        if not rows:
            continue
        line = value_of(FORMS[law], grid, [row["value"] for row in rows[:2]])
        chosen = " (chosen)" if rows[0]["chosen"] else ""
        axes.plot(grid, factor * line, color=colour, label=f"{law}{chosen}")
    axes.set_ylim(bottom=0)
