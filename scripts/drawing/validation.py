"""Model over measurement, and what is left between them."""

import figure


def draw(series, scores, test):
    """Figure of one validation test from stages `simulation` (series) and `validation` (scores)."""
    canvas, axes = figure.canvas(3, 1, height=5.0, sharex=True, height_ratios=[3, 2, 1])
    voltage, residual, current = axes[:, 0]
    hours = series["test_time_second"] / 3600
    voltage.plot(
        *figure.thin(hours, series["voltage_volt"]),
        color=figure.MEASURED,
        linewidth=0.8,
        label="measured",
    )
    for index, row in enumerate(scores):
        simulated = series[f"simulated_{row['model']}_volt"]
        colour = figure.SERIES[index]
        chosen = " (chosen)" if row["chosen"] else ""
        label = f"{row['model']}{chosen}: RMSE {1e3 * row['rmse_volt']:.1f} mV"
        voltage.plot(*figure.thin(hours, simulated), color=colour, linewidth=0.8, label=label)
        error = 1e3 * (series["voltage_volt"] - simulated)
        residual.plot(*figure.thin(hours, error), color=colour, linewidth=0.7)
    figure.shade_unscored(residual, hours, series["scored"])
    current.plot(*figure.thin(hours, series["current_ampere"]), color=figure.QUIET, linewidth=0.6)
    voltage.set(ylabel="voltage [V]", title=f"{test}: model over measurement")
    residual.set(ylabel="residual [mV]", title="Measured − simulated (grey: not scored)")
    current.set(ylabel="current [A]", xlabel="time [h]")
    figure.legend_once(voltage, loc="lower left")
    return canvas
