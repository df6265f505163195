"""Rests of a cell with the exponentials through them, and what those leave."""

import figure

PANELS = 6
MIDDLE_SOC = 0.5


def draw(tests):
    """Figure of a cell; `tests` are (columns, about) of stage `relaxation_curve`."""
    tests = [(columns, about) for columns, about in tests if len(columns["time_second"])]
    if not tests:
        return figure.message("No rest was long enough to fit its depolarisation.")
    shown = _of_each_temperature(tests)
    canvas, axes = figure.canvas(
        2, len(shown), width=11.0, height=4.4, sharex="col", height_ratios=[2, 1]
    )
    for panels, (columns, about) in zip(axes.T, shown, strict=True):
        _rest(panels, columns, about)
    axes[0, 0].set_ylabel("voltage [V]")
    axes[1, 0].set_ylabel("residual [mV]")
    figure.legend_once(axes[0, 0])
    return canvas


def _of_each_temperature(tests):
    """Of each temperature the rest nearest 50 % SoC, coldest first, of at most so many."""
    seen = {}
    for columns, about in sorted(tests, key=lambda test: abs(test[0]["soc"][0] - MIDDLE_SOC)):
        celsius = about["params"]["test"]["ambient_temperature_celsius"]
        seen.setdefault(celsius, (columns, about))
    order = sorted(seen, key=lambda celsius: (celsius is None, celsius or 0.0))
    return [seen[celsius] for celsius in order[:: -(-len(order) // PANELS)]]


def _rest(panels, columns, about):
    celsius = about["params"]["test"]["ambient_temperature_celsius"]
    time, volts, fitted = (columns[n] for n in ("time_second", "voltage_volt", "fitted_volt"))
    panels[0].plot(time + 1, volts, ".", markersize=2, color=figure.MEASURED, label="measured")
    panels[0].plot(time + 1, fitted, color=figure.SERIES[1], label="exponentials")
    title = f"{figure.temperature_label(celsius)}, SoC {100 * columns['soc'][0]:.0f} %"
    panels[0].set(title=title, xscale="log")
    panels[1].plot(time + 1, 1e3 * (volts - fitted), ".", markersize=2, color=figure.ERROR)
    panels[1].set(xlabel="time in rest + 1 s [s]", xscale="log")
