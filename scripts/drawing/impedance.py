"""Nyquist plots with the fitted circuit as a line, and what the fit leaves over frequency."""

import numpy as np

import figure
from drawing.spectra import Layout


def draw(tests):
    """Nyquist plots of a cell; `tests` are (columns, about) of stage `eis_curve`.

    One panel per SoC, coloured by temperature; of one temperature only, coloured by SoC.
    """
    layout = Layout(tests)
    canvas, axes = layout.canvas()
    for panel, (value, spectra) in zip(axes, layout.panels.items(), strict=True):
        for columns, _, fact in spectra:
            _nyquist(panel, columns, *layout.style(fact))
        panel.set(xlabel="Re Z [mΩ]", ylabel="−Im Z [mΩ]", title=layout.title(value))
        panel.set_aspect("equal", adjustable="datalim")
    figure.legend_once(axes[0], fontsize=7)
    return canvas


def draw_fit(tests):
    """Imaginary part with the fit, and the relative error of the fit, over frequency."""
    layout = Layout(tests)
    places = np.unique(np.linspace(0, len(layout.panels) - 1, 3).round().astype(int))
    panels = [list(layout.panels.items())[k] for k in places]
    canvas, axes = figure.canvas(2, len(panels), height=5.2, sharex=True)
    for (value, spectra), upper, lower in zip(panels, *axes, strict=True):
        for columns, _, fact in spectra:
            _imaginary(upper, columns, *layout.style(fact))
            _error(lower, columns, layout.style(fact)[0])
        upper.set(ylabel="−Im Z [mΩ]", title=layout.title(value), xscale="log")
        lower.set(xlabel="frequency [Hz]", ylabel="error over |Z| [%]", yscale="log")
    figure.legend_once(axes[0, 0], fontsize=7)
    figure.legend_once(axes[1, 0], fontsize=7)
    return canvas


def _nyquist(axes, columns, colour, label):
    real, imaginary = 1e3 * columns["impedance_real_ohm"], -1e3 * columns["impedance_imaginary_ohm"]
    used = columns["in_fit"].astype(bool)
    axes.plot(real[used], imaginary[used], ".", markersize=3, color=colour, label=label)
    axes.plot(real[~used], imaginary[~used], "x", markersize=3, color=colour, linestyle="none")
    fitted = 1e3 * columns["fitted_real_ohm"], -1e3 * columns["fitted_imaginary_ohm"]
    axes.plot(*[part[used] for part in fitted], color=colour, linewidth=0.8)


def _imaginary(axes, columns, colour, label):
    used = columns["in_fit"].astype(bool)
    frequency, imaginary = columns["frequency_hertz"], -1e3 * columns["impedance_imaginary_ohm"]
    axes.plot(frequency[used], imaginary[used], ".", markersize=3, color=colour, label=label)
    axes.plot(frequency[~used], imaginary[~used], "x", markersize=3, color=colour)
    fitted = -1e3 * columns["fitted_imaginary_ohm"]
    axes.plot(frequency[used], fitted[used], color=colour, linewidth=0.8)


def _error(axes, columns, colour):
    used = columns["in_fit"].astype(bool)
    measured = columns["impedance_real_ohm"] + 1j * columns["impedance_imaginary_ohm"]
    fitted = columns["fitted_real_ohm"] + 1j * columns["fitted_imaginary_ohm"]
    frequency, error = columns["frequency_hertz"], 100 * np.abs(fitted / measured - 1)
    test = 100 * np.hypot(columns["kramers_kronig_real"], columns["kramers_kronig_imaginary"])
    axes.plot(frequency[used], error[used], color=colour)
    axes.plot(frequency[used], test[used], ":", color=colour)
    axes.plot([], [], color=figure.INK, label="circuit")
    axes.plot([], [], ":", color=figure.INK, label="Kramers–Kronig")
