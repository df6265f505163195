"""Figures of impedance spectra: Nyquist plots, errors of the fit, relaxation times."""

import matplotlib
import numpy as np

from figures import style
from figures.style import evenly_spread

MOST_PANELS = 6
ACROSS = 3
MOST_OF_FIT = 3  # panels of the figure of the fit


class Layout:
    """Spectra of a cell on panels: one panel a SoC, or one in all where the temperature is one.

    Parameters
    ----------
    tests : (columns, about) of each spectrum.

    Attributes
    ----------
    panels : SoC (or temperature) → list of (columns, facts of the sheet).
    not_drawn : how many more SoC there are.
    """

    def __init__(self, tests):
        facts = [about["params"]["test"] for _, about in tests]
        self.by_soc = len({fact["ambient_temperature_celsius"] for fact in facts}) > 1
        key = "soc" if self.by_soc else "ambient_temperature_celsius"
        spectra = {}
        for (columns, _), fact in zip(tests, facts, strict=True):
            spectra.setdefault(fact[key], []).append((columns, fact))
        drawn = self._chosen(spectra)
        self.panels = {value: spectra[value] for value in drawn}
        self.not_drawn = len(spectra) - len(drawn)

    @staticmethod
    def _chosen(spectra):
        """Panels that are drawn: all, or evenly spread ones among those with the most spectra."""
        values = sorted(spectra, key=lambda value: (value is None, value or 0))
        # Panels with the most temperatures first: a comparison is what the figure is for.
        if len(values) > MOST_PANELS:
            most = max(map(len, spectra.values()))
            fullest = [value for value in values if len(spectra[value]) == most]
            values = fullest if len(fullest) >= MOST_PANELS else values
        return [values[k] for k in evenly_spread(len(values), MOST_PANELS)]

    def title(self, value):
        """Title of the panel of a SoC or temperature."""
        return _soc_label(value) if self.by_soc else style.temperature_label(value)

    def style(self, fact) -> dict:
        """Colour and label of one spectrum in its panel: by temperature, else by SoC."""
        if self.by_soc:
            return style.temperature_style(fact["ambient_temperature_celsius"])
        soc = fact["soc"]
        colour = style.QUIET if soc is None else matplotlib.colormaps["viridis"](0.9 * soc)
        return {"color": colour, "label": _soc_label(soc)}

    def subplots(self, *, height=2.9):
        """A figure and its axes (n,), one a panel; `height` [inch] of a row."""
        figure, axes = style.panels(len(self.panels), across=ACROSS, height=height)
        if self.not_drawn:
            note = f"{self.not_drawn} other states not drawn"
            figure.suptitle(note, fontsize=8, color=style.QUIET)
        return figure, axes


def _soc_label(value):
    return "SoC not stated" if value is None else f"SoC {100 * value:.0f} %"


def draw_nyquist(tests):
    """Nyquist plots with the fitted circuit as a line; `tests` are (columns, about) of `eis_curve`.

    One panel per SoC, coloured by temperature; of one temperature only, coloured by SoC.
    """
    layout = Layout(tests)
    figure, axes = layout.subplots()
    for panel, (value, spectra) in zip(axes, layout.panels.items(), strict=True):
        for columns, fact in spectra:
            _nyquist(panel, columns, layout.style(fact))
        panel.set(xlabel="Re Z [mΩ]", ylabel="−Im Z [mΩ]", title=layout.title(value))
        # A semicircle must look like one: depressed arcs are seen by eye.
        panel.set_aspect("equal", adjustable="datalim")
    style.legend_once(axes[0], fontsize=7)
    return figure


def _nyquist(axes, columns, look):
    real, imaginary = 1e3 * columns["impedance_real_ohm"], -1e3 * columns["impedance_imaginary_ohm"]
    used = columns["in_fit"].astype(bool)
    crosses = {"markersize": 3, "color": look["color"], "linestyle": "none"}
    axes.plot(real[used], imaginary[used], ".", markersize=3, **look)
    axes.plot(real[~used], imaginary[~used], "x", **crosses)
    fitted = 1e3 * columns["fitted_real_ohm"], -1e3 * columns["fitted_imaginary_ohm"]
    axes.plot(*[part[used] for part in fitted], color=look["color"], linewidth=0.8)


def draw_impedance_fit(tests):
    """Imaginary part with the fit, and the relative error of the fit, over frequency.

    `tests` are (columns, about) of stage `eis_curve`.
    """
    layout = Layout(tests)
    panels = list(layout.panels.items())
    panels = [panels[k] for k in evenly_spread(len(panels), MOST_OF_FIT)]
    figure, axes = style.subplots(2, len(panels), height=5.2, sharex=True)
    for (value, spectra), upper, lower in zip(panels, *axes, strict=True):
        for columns, fact in spectra:
            look = layout.style(fact)
            _imaginary(upper, columns, look)
            _fit_error(lower, columns, look["color"])
        upper.set(ylabel="−Im Z [mΩ]", title=layout.title(value), xscale="log")
        lower.set(xlabel="frequency [Hz]", ylabel="error over |Z| [%]", yscale="log")
    style.legend_once(axes[0, 0], fontsize=7)
    style.legend_once(axes[1, 0], fontsize=7)
    return figure


def _imaginary(axes, columns, look):
    used = columns["in_fit"].astype(bool)
    frequency, imaginary = columns["frequency_hertz"], -1e3 * columns["impedance_imaginary_ohm"]
    axes.plot(frequency[used], imaginary[used], ".", markersize=3, **look)
    axes.plot(frequency[~used], imaginary[~used], "x", markersize=3, color=look["color"])
    fitted = -1e3 * columns["fitted_imaginary_ohm"]
    axes.plot(frequency[used], fitted[used], color=look["color"], linewidth=0.8)


def _fit_error(axes, columns, colour):
    used = columns["in_fit"].astype(bool)
    measured = columns["impedance_real_ohm"] + 1j * columns["impedance_imaginary_ohm"]
    fitted = columns["fitted_real_ohm"] + 1j * columns["fitted_imaginary_ohm"]
    frequency, error = columns["frequency_hertz"], 100 * np.abs(fitted / measured - 1)
    test = 100 * np.hypot(columns["kramers_kronig_real"], columns["kramers_kronig_imaginary"])
    axes.plot(frequency[used], error[used], color=colour)
    axes.plot(frequency[used], test[used], ":", color=colour)
    axes.plot([], [], color=style.INK, label="circuit")
    axes.plot([], [], ":", color=style.INK, label="Kramers–Kronig")


def draw_relaxation_times(tests):
    """Distributions of relaxation times over frequency, with their peaks.

    `tests` are (columns of `drt`, columns of `drt_peaks`, about).
    """
    layout = Layout([((curve, peaks), about) for curve, peaks, about in tests])
    figure, axes = layout.subplots(height=2.6)
    for panel, (value, spectra) in zip(axes, layout.panels.items(), strict=True):
        for (curve, peaks), fact in spectra:
            _distribution(panel, curve, peaks, layout.style(fact))
        panel.set(xlabel="1/(2πτ) [Hz]", ylabel="γ [mΩ]", title=layout.title(value), xscale="log")
    style.legend_once(axes[0], fontsize=7)
    return figure


def _distribution(axes, curve, peaks, look):
    frequency, gamma = 1 / (2 * np.pi * curve["tau_second"]), 1e3 * curve["gamma_ohm"]
    axes.plot(frequency, gamma, **look)
    # Peaks beyond the measured frequencies are extrapolated, and are not marked.
    inside = np.asarray(peaks.get("in_range", []), bool)
    tops = np.asarray(peaks.get("frequency_hertz", []), float)[inside]
    height = np.interp(np.log(tops), np.log(frequency[::-1]), gamma[::-1])
    axes.plot(tops, height, "o", markersize=2.5, color=look["color"])
