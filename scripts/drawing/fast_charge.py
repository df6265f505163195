"""Fast charge: what went in over time, and what was in after the minutes asked for."""

import numpy as np

import figure


def draw(tests):
    """Figure of a cell; `tests` are (series, steps, numbers of stage `fast_charge`, about)."""
    canvas, axes = figure.canvas(1, 2, height=3.2)
    rows = sorted((_row(*test) for test in tests), key=lambda row: row["celsius"])
    for row in rows:
        minute, share = figure.thin(row["minute"], row["share_over_time"])
        colour = figure.temperature_colour(row["celsius"])
        axes[0, 0].plot(
            minute, 100 * share, color=colour, label=figure.temperature_label(row["celsius"])
        )
        axes[0, 0].plot(row["end_of_constant"], 100 * row["constant"], "o", color=colour)
    minutes = rows[0]["minutes"]
    axes[0, 0].axvline(minutes, color=figure.QUIET, lw=0.8, ls=":")
    axes[0, 0].set(
        xlabel="time [min]",
        ylabel="charged [% of the capacity]",
        title="Charge over time (● voltage limit met)",
        xlim=(0, 1.15 * minutes),
    )
    figure.legend_once(axes[0, 0])
    _bars(axes[0, 1], rows, minutes)
    return canvas


def _bars(axes, rows, minutes):
    place = np.arange(len(rows))
    constant = np.array([100 * row["constant"] for row in rows])
    whole = np.array([100 * row["share"] for row in rows])
    axes.bar(place, constant, color=figure.SERIES[0], label="at constant current")
    axes.bar(place, whole - constant, bottom=constant, color="#f2c14e", label="at held voltage")
    for x, value in zip(place, whole, strict=True):
        axes.annotate(f"{value:.0f} %", (x, value), (0, 2), textcoords="offset points", ha="center")
    labels = [f"{figure.temperature_label(row['celsius'])}\n{row['rate']:.2g}C" for row in rows]
    axes.set_xticks(place, labels, fontsize=7)
    axes.set(title=f"Charged within {minutes:g} min", ylim=(0, 110))
    axes.grid(False, axis="x")
    figure.legend_once(axes, loc="upper left")


def _row(series, steps, numbers, about):
    """What one charge draws: its course from the step of the largest charge on."""
    number = {name: values[0] for name, values in numbers.items()}
    main = int(np.argmax(steps["charge_ampere_hour"]))
    first = max(int(steps["first_row"][main]) - 1, 0)
    minute = (series["test_time_second"][first:] - series["test_time_second"][first]) / 60
    charge = series["charge_ampere_hour"][first:] - series["charge_ampere_hour"][first]
    inside = minute <= number["duration_minutes"]
    celsius = about["params"]["test"]["ambient_temperature_celsius"]
    return {
        "celsius": np.nan if celsius is None else celsius,
        "minute": minute[inside],
        "share_over_time": charge[inside] / number["capacity_ampere_hour"],
        "share": number["share"],
        "constant": number["share"] * number["constant_current_share"],
        "end_of_constant": min(number["minutes_constant_current"], number["minutes"]),
        "minutes": number["minutes"],
        "rate": number["c_rate"],
    }
