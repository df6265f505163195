"""Nyquist plots, one panel per temperature, with the fitted circuit as a line."""

import matplotlib

import figure


def draw(tests):
    """Figure of a cell's spectra; `tests` are (columns, about) of stage `eis_curve`."""
    found = {_celsius(about) for _, about in tests}
    panels = sorted(found, key=lambda celsius: (celsius is None, celsius or 0))
    canvas, axes = figure.canvas(1, len(panels), height=3.2)
    for panel, celsius in zip(axes[0], panels, strict=True):
        for columns, about in (test for test in tests if _celsius(test[1]) == celsius):
            _spectrum(panel, columns, about)
        panel.set(xlabel="Re Z [mΩ]", ylabel="−Im Z [mΩ]", title=figure.temperature_label(celsius))
        panel.set_aspect("equal", adjustable="datalim")
    figure.legend_once(axes[0, -1], fontsize=7, loc="upper left", bbox_to_anchor=(1, 1))
    return canvas


def _celsius(about):
    return about["params"]["test"]["ambient_temperature_celsius"]


def _spectrum(axes, columns, about):
    soc = about["params"]["test"]["soc"]
    colour = figure.QUIET if soc is None else matplotlib.colormaps["viridis"](0.9 * soc)
    label = "SoC not stated" if soc is None else f"SoC {100 * soc:.0f} %"
    axes.plot(
        1e3 * columns["impedance_real_ohm"],
        -1e3 * columns["impedance_imaginary_ohm"],
        ".",
        markersize=2.5,
        color=colour,
        label=label,
    )
    axes.plot(
        1e3 * columns["fitted_real_ohm"],
        -1e3 * columns["fitted_imaginary_ohm"],
        color=colour,
        linewidth=0.7,
    )
