"""Capacities over the cycles of one ageing record, against temperature, and their periods."""

import numpy as np

import figure


def draw(cycles, periods, summary):
    """Figure of a record from the columns of `ageing_temperature_cycles` and `_periods` and the
    row of `ageing_temperature`."""
    canvas, axes = figure.canvas(1, 3, width=10.5, height=3.2, width_ratios=[1.5, 1, 1.1])
    _course(axes[0, 0], cycles)
    _against(axes[0, 1], cycles, summary)
    _periods(axes[0, 2], periods, summary)
    return canvas


def _course(axes, cycles):
    used = cycles["used"].astype(bool)
    x, measured = cycles["cycle"], cycles["capacity_ampere_hour"]
    axes.plot(x[used], measured[used], "o", color=figure.MEASURED, label="measured")
    axes.plot(x[~used], measured[~used], "x", color=figure.QUIET, label="set aside")
    carried = cycles["capacity_at_reference_ampere_hour"]
    if not np.allclose(carried, measured):
        axes.plot(x[used], carried[used], ".", color=figure.SERIES[1], label="temperature out")
    axes.plot(x, cycles["fade_ampere_hour"], color=figure.SERIES[1], label="fade")
    axes.set(xlabel="cycle", ylabel="discharge capacity [Ah]", title="Over cycles")
    figure.legend_once(axes, ncols=4, fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.18))


def _against(axes, cycles, summary):
    used = cycles["used"].astype(bool)
    celsius = cycles["temperature_celsius"][used]
    axes.set(xlabel=f"temperature [°C]: {summary['temperature_source']}", title="About the fade")
    if not np.isfinite(celsius).all():
        axes.set_xlabel("temperature not recorded")
        return
    beside = (cycles["capacity_ampere_hour"] - cycles["fade_ampere_hour"])[used]
    scale = 100 / summary["capacity_start_ampere_hour"]
    axes.plot(celsius, scale * beside, "o", color=figure.MEASURED)
    axes.set_ylabel("capacity about the fade [%]")
    grid = np.array([celsius.min(), celsius.max()]) - summary["reference_celsius"]
    names = ("slope", "slope_lower", "slope_upper")
    slope, low, high = (summary[f"{name}_percent_per_kelvin"] for name in names)
    if not np.isfinite(slope):
        axes.set_title("Temperature not excited")
        return
    at = grid + summary["reference_celsius"]
    axes.fill_between(at, low * grid, high * grid, color=figure.SERIES[1], alpha=0.2, lw=0)
    label = f"{slope:.3g} %/K\n({low:.3g} to {high:.3g})"
    axes.plot(at, slope * grid, color=figure.SERIES[1], label=label)
    figure.legend_once(axes)


def _periods(axes, periods, summary):
    axes.set(xlabel="period [h]", title="Periods")
    if not len(periods["period_hour"]):
        axes.set_title("Periods: not knowable")
        return
    axes.plot(periods["period_hour"], periods["power"], color=figure.SERIES[0])
    axes.axvline(24, color=figure.QUIET, ls=":", lw=0.8)
    chance = summary["daily_false_alarm"]
    text = f"24 h: ±{summary['daily_percent']:.2g} %\nby chance in {100 * chance:.2g} %"
    axes.annotate(text, (0.98, 0.95), xycoords="axes fraction", ha="right", va="top", fontsize=8)
    axes.set(xscale="log", ylabel="2 × gain of log-likelihood")
    axes.set_ylim(top=1.3 * max(periods["power"].max(), 1.0))
    ticks = [t for t in (6, 12, 24, 48, 96, 192) if t <= periods["period_hour"].max()]
    axes.set_xticks(ticks, [str(t) for t in ticks], minor=False)
    axes.minorticks_off()
