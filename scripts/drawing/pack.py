"""Parallel cells: branch currents from the models over the measured ones."""

import figure


def draw(series, scores, test):
    """Figure of one group test from stages `pack_series` (series) and `pack` (scores)."""
    canvas, axes = figure.canvas(3, 1, height=5.4, sharex=True, height_ratios=[3, 2, 2])
    current, residual, voltage = axes[:, 0]
    hours = series["test_time_second"] / 3600
    for index, row in enumerate(scores):
        colour, branch = figure.SERIES[index % len(figure.SERIES)], row["branch"]
        measured = series[f"branch_{branch}_current_ampere"]
        simulated = series[f"simulated_branch_{branch}_current_ampere"]
        label = f"branch {branch}: RMSE {1e3 * row['current_rmse_ampere']:.0f} mA"
        current.plot(*figure.thin(hours, measured), color=colour, linewidth=0.6, alpha=0.6)
        current.plot(*figure.thin(hours, simulated), color=colour, linewidth=1.2, label=label)
        error = 1e3 * (measured - simulated)
        residual.plot(*figure.thin(hours, error), color=colour, linewidth=0.7)
    figure.shade_unscored(residual, hours, series["scored"])
    voltage.plot(
        *figure.thin(hours, series["voltage_volt"]), color=figure.MEASURED, label="measured"
    )
    voltage.plot(
        *figure.thin(hours, series["simulated_voltage_volt"]),
        color=figure.ERROR,
        linewidth=0.8,
        label=f"simulated: RMSE {1e3 * scores[0]['voltage_rmse_volt']:.0f} mV",
    )
    current.set(ylabel="current [A]", title=f"{test}: branch currents (pale: measured)")
    residual.set(ylabel="residual [mA]", title="Measured − simulated (grey: fitted, not scored)")
    voltage.set(ylabel="voltage [V]", xlabel="time [h]")
    figure.legend_once(current)
    figure.legend_once(voltage)
    return canvas
