"""Incremental capacity over voltage with the peaks that were found."""

import figure


def draw(tests):
    """Figure of a cell's dQ/dV; `tests` are (curve columns, peak columns, about)."""
    canvas, axes = figure.canvas(1, 1, height=3.0)
    panel = axes[0, 0]
    for index, (curve, peaks, about) in enumerate(tests):
        colour = figure.SERIES[index % len(figure.SERIES)]
        panel.plot(
            curve["voltage_volt"],
            curve["dq_dv_ampere_hour_per_volt"],
            color=colour,
            label=about["wildcards"]["test"],
        )
        heights = peaks.get("height_ampere_hour_per_volt", [])
        for volt, height in zip(peaks.get("voltage_volt", []), heights, strict=True):
            panel.plot(volt, height, "o", color=colour)
            panel.annotate(f"{volt:.3f} V", (volt, height), (0, 5), textcoords="offset points")
    panel.set(xlabel="voltage [V]", ylabel="dQ/dV [Ah/V]", title="Incremental capacity on charge")
    figure.legend_once(panel)
    return canvas
