"""Model over measurement, what is left between them, and how all members compare."""

import figure


def draw(series, scores, test):
    """Figure of one validation test from stages `simulation` (series) and `validation` (scores)."""
    height = 5.2 + 0.16 * len(scores)
    ratios = [3, 2, 1, 0.6 + 0.25 * len(scores)]
    canvas, axes = figure.canvas(4, 1, height=height, height_ratios=ratios)
    voltage, residual, current, members = axes[:, 0]
    chosen = next(row for row in scores if row["chosen"])
    hours, measured = series["test_time_second"] / 3600, series["voltage_volt"]
    simulated = series[f"simulated_{chosen['model']}_volt"]
    label = f"{chosen['model']}: RMSE {1e3 * chosen['rmse_volt']:.1f} mV"
    lines = ((measured, figure.MEASURED, "measured"), (simulated, figure.SERIES[0], label))
    for values, colour, name in lines:
        voltage.plot(*figure.thin(hours, values), color=colour, linewidth=0.8, label=name)
    error = 1e3 * (measured - simulated)
    residual.axhline(0.0, color=figure.QUIET, linewidth=0.6)
    residual.plot(*figure.thin(hours, error), color=figure.SERIES[0], linewidth=0.7)
    figure.shade_unscored(residual, hours, series["scored"])
    current.plot(*figure.thin(hours, series["current_ampere"]), color=figure.QUIET, linewidth=0.6)
    voltage.set(ylabel="voltage [V]", title=f"{test}: model over measurement")
    residual.set(ylabel="residual [mV]", title="Measured − simulated (grey: not scored)")
    current.set(ylabel="current [A]", xlabel="time [h]")
    for panel in (residual, current):
        panel.sharex(voltage)
    for panel in (voltage, residual):
        panel.tick_params(labelbottom=False)
    figure.legend_once(voltage, loc="lower left")
    _members(members, scores)
    return canvas


def _members(axes, scores):
    """RMS error of every member, the chosen one in colour."""
    for place, row in enumerate(scores):
        colour = figure.SERIES[0] if row["chosen"] else figure.QUIET
        size = 1e3 * row["rmse_volt"]
        axes.barh(place, size, height=0.7, color=colour)
        axes.annotate(f" {size:.1f}", (size, place), va="center", fontsize=8)
    names = [row["model"] + (" (chosen)" if row["chosen"] else "") for row in scores]
    axes.set_yticks(range(len(scores)), names, fontsize=8)
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")
    axes.set(xlabel="RMS error of every member [mV]")
