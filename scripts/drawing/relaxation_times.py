"""Distributions of relaxation times over frequency, with their peaks."""

import numpy as np

import figure
from drawing.spectra import Layout


def draw(tests):
    """Figure of a cell; `tests` are (columns of `drt`, columns of `drt_peaks`, about)."""
    layout = Layout([((curve, found), about) for curve, found, about in tests])
    canvas, axes = layout.canvas(height=2.6)
    for panel, (value, spectra) in zip(axes, layout.panels.items(), strict=True):
        for (curve, found), _, fact in spectra:
            _distribution(panel, curve, found, *layout.style(fact))
        panel.set(xlabel="1/(2πτ) [Hz]", ylabel="γ [mΩ]", title=layout.title(value), xscale="log")
    figure.legend_once(axes[0], fontsize=7)
    return canvas


def _distribution(axes, curve, found, colour, label):
    frequency, gamma = 1 / (2 * np.pi * curve["tau_second"]), 1e3 * curve["gamma_ohm"]
    axes.plot(frequency, gamma, color=colour, label=label)
    inside = np.asarray(found.get("in_range", []), bool)
    tops = np.asarray(found.get("frequency_hertz", []), float)[inside]
    height = np.interp(np.log(tops), np.log(frequency[::-1]), gamma[::-1])
    axes.plot(tops, height, "o", markersize=2.5, color=colour)
