"""What was found in a cell's files: voltage over time, coloured by the kind of step."""

import numpy as np

import figure

COLOURS = {
    "rest": figure.QUIET,
    "CC": "#0b6fb8",
    "CV": "#2a9d5c",
    "CCCV": "#2a9d5c",
    "pulse": "#c0392b",
    "dynamic": "#e07b00",
}


def draw(tests, total):
    """Thumbnails of records; `tests` are (series, steps, about), `total` is how many there are."""
    rows = -(-len(tests) // 4)
    canvas, axes = figure.canvas(rows, 4, height=1.75 * rows + 0.3)
    for panel, (series, steps, about) in zip(axes.flat, tests, strict=False):
        _thumbnail(panel, series, steps)
        panel.set_title(about["wildcards"]["test"], fontsize=7)
        panel.tick_params(labelsize=7)
    for panel in axes.flat[len(tests) :]:
        panel.set_axis_off()
    names = " · ".join(f"{kind}" for kind in COLOURS)
    more = f" ({len(tests)} of {total} records)" if total > len(tests) else ""
    canvas.suptitle(f"Voltage [V] over time [h], coloured by step: {names}{more}", fontsize=8)
    for kind, colour in COLOURS.items():
        axes[0, 0].plot([], [], color=colour, label=kind)
    axes[0, 0].legend(fontsize=6, ncols=2)
    return canvas


def _thumbnail(axes, series, steps):
    hours = series["test_time_second"] / 3600
    volt = series["voltage_volt"]
    for kind, colour in COLOURS.items():
        drawn = np.full(len(volt), np.nan)
        for first, last in zip(
            steps["first_row"][steps["kind"] == kind],
            steps["last_row"][steps["kind"] == kind],
            strict=True,
        ):
            drawn[max(first - 1, 0) : last + 1] = volt[max(first - 1, 0) : last + 1]
        axes.plot(*figure.thin(hours, drawn, points=400), color=colour, linewidth=0.8)
