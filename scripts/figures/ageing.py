"""Figures of ageing records and fast charges: fade, temperature, periods, charge over time."""

import numpy as np

from figures import style
from figures.style import ambient_celsius, thinned

PERIOD_TICKS_HOUR = (6, 12, 24, 48, 96, 192)


def draw_ageing(cycles, periods, summary):
    """Capacities of one ageing record over cycles and over temperature, and their periods.

    `cycles` and `periods` are columns of stages `ageing_temperature_cycles` and
    `ageing_temperature_periods`, `summary` the row of `ageing_temperature`.
    """
    # Two panels where there is no temperature: an empty one would look like a fault.
    recorded = np.isfinite(cycles["temperature_celsius"][cycles["used"].astype(bool)]).all()
    widths = [1.5, 1, 1.1] if recorded else [1.5, 1.1]
    figure, axes = style.subplots(1, len(widths), width=10.5, height=3.2, width_ratios=widths)
    _over_cycles(axes[0, 0], cycles)
    if recorded:
        _over_temperature(axes[0, 1], cycles, summary)
    _periods(axes[0, -1], periods, summary)
    return figure


def _over_cycles(axes, cycles):
    used = cycles["used"].astype(bool)
    x, measured = cycles["cycle"], cycles["capacity_ampere_hour"]
    axes.plot(x[used], measured[used], "o", color=style.MEASURED, label="measured")
    axes.plot(x[~used], measured[~used], "x", color=style.QUIET, label="set aside")
    at_reference = cycles["capacity_at_reference_ampere_hour"]
    if not np.allclose(at_reference, measured):
        axes.plot(x[used], at_reference[used], ".", color=style.SERIES[1], label="temperature out")
    axes.plot(x, cycles["fade_ampere_hour"], color=style.SERIES[1], label="fade")
    title = "Over cycles"
    if not np.isfinite(cycles["temperature_celsius"][used]).all():
        title += ", temperature not recorded"
    axes.set(xlabel="cycle", ylabel="discharge capacity [Ah]", title=title)
    style.legend_once(axes, ncols=4, fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.22))


def _over_temperature(axes, cycles, summary):
    """Capacities about the fade, with the slope over temperature and its interval."""
    used = cycles["used"].astype(bool)
    celsius = cycles["temperature_celsius"][used]
    axes.set(xlabel=f"temperature [°C]: {summary['temperature_source']}", title="About the fade")
    about_fade = (cycles["capacity_ampere_hour"] - cycles["fade_ampere_hour"])[used]
    scale = 100 / summary["capacity_start_ampere_hour"]
    axes.plot(celsius, scale * about_fade, "o", color=style.MEASURED)
    axes.set_ylabel("capacity about the fade [%]")
    grid = np.array([celsius.min(), celsius.max()]) - summary["reference_celsius"]
    names = ("slope", "slope_lower", "slope_upper")
    slope, low, high = (summary[f"{name}_percent_per_kelvin"] for name in names)
    # A room that kept its temperature tells no slope: points without a line.
    if not np.isfinite(slope):
        axes.set_title("Temperature not excited")
        return
    at = grid + summary["reference_celsius"]
    axes.fill_between(at, low * grid, high * grid, color=style.SERIES[1], alpha=0.2, lw=0)
    label = f"{slope:.3g} %/K\n({low:.3g} to {high:.3g})"
    axes.plot(at, slope * grid, color=style.SERIES[1], label=label)
    style.legend_once(axes)


def _periods(axes, periods, summary):
    axes.set(xlabel="period [h]", title="Periods")
    if not len(periods["period_hour"]):
        axes.set_title("Periods: not knowable")
        return
    axes.plot(periods["period_hour"], periods["power"], color=style.SERIES[0])
    axes.axvline(24, color=style.QUIET, ls=":", lw=0.8)
    chance = summary["daily_false_alarm"]
    text = f"24 h: ±{summary['daily_percent']:.2g} %\nby chance in {100 * chance:.2g} %"
    axes.annotate(text, (0.98, 0.95), xycoords="axes fraction", ha="right", va="top", fontsize=8)
    axes.set(xscale="log", ylabel="2 × gain of log-likelihood")
    axes.set_ylim(top=1.3 * max(periods["power"].max(), 1.0))
    ticks = [t for t in PERIOD_TICKS_HOUR if t <= periods["period_hour"].max()]
    axes.set_xticks(ticks, ticks)
    axes.minorticks_off()


def draw_fast_charge(tests):
    """Charge over time, and the share that was charged after the minutes asked for.

    `tests` are (columns of `clean`, columns of `segment`, columns of `fast_charge`, about).
    """
    figure, axes = style.subplots(1, 2, height=3.2)
    charges = sorted((_charge(*test) for test in tests), key=lambda charge: charge["celsius"])
    for charge in charges:
        minute, share = thinned(charge["minute"], charge["share_over_time"])
        look = style.temperature_style(charge["celsius"])
        axes[0, 0].plot(minute, 100 * share, **look)
        limit_met = charge["end_of_constant_current"], 100 * charge["constant_current"]
        axes[0, 0].plot(*limit_met, "o", color=look["color"])
    minutes = charges[0]["minutes"]
    axes[0, 0].axvline(minutes, color=style.QUIET, lw=0.8, ls=":")
    axes[0, 0].set(
        xlabel="time [min]",
        ylabel="charged [% of the capacity]",
        title="Charge over time (● voltage limit met)",
        xlim=(0, 1.15 * minutes),
    )
    style.legend_once(axes[0, 0])
    _shares(axes[0, 1], charges, minutes)
    return figure


def _shares(axes, charges, minutes):
    position = np.arange(len(charges))
    constant = np.array([100 * charge["constant_current"] for charge in charges])
    whole = np.array([100 * charge["share"] for charge in charges])
    axes.bar(position, constant, color=style.SERIES[0], label="at constant current")
    axes.bar(
        position, whole - constant, bottom=constant, color=style.YELLOW, label="at held voltage"
    )
    for x, value in zip(position, whole, strict=True):
        axes.annotate(f"{value:.0f} %", (x, value), (0, 2), textcoords="offset points", ha="center")
    labels = [f"{style.temperature_label(c['celsius'])}\n{c['rate']:.2g}C" for c in charges]
    axes.set_xticks(position, labels, fontsize=7)
    axes.set(title=f"Charged within {minutes:g} min", ylim=(0, 110))
    axes.grid(False, axis="x")
    style.legend_once(axes, loc="upper left")


def _charge(series, steps, numbers, about):
    """Values drawn of one charge: charged share over time from the start of its largest step."""
    number = {name: values[0] for name, values in numbers.items()}
    largest = int(np.argmax(steps["charge_ampere_hour"]))
    # From the row before the step: its first row is already under current.
    first = max(int(steps["first_row"][largest]) - 1, 0)
    minute = (series["test_time_second"][first:] - series["test_time_second"][first]) / 60
    charge = series["charge_ampere_hour"][first:] - series["charge_ampere_hour"][first]
    # What follows, such as a discharge, is no part of the charge.
    inside = minute <= number["duration_minutes"]
    celsius = ambient_celsius(about)
    return {
        "celsius": np.nan if celsius is None else celsius,
        "minute": minute[inside],
        "share_over_time": charge[inside] / number["capacity_ampere_hour"],
        "share": number["share"],
        "constant_current": number["share"] * number["constant_current_share"],
        "end_of_constant_current": min(number["minutes_constant_current"], number["minutes"]),
        "minutes": number["minutes"],
        "rate": number["c_rate"],
    }
