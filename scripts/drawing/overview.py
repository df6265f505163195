"""The campaign at a glance: capacity, resistance and model error of every cell."""

import numpy as np

import figure


def draw(cells, capacity, resistance, validation):
    """Figure of the whole campaign from rows of the tables of the same names."""
    canvas, axes = figure.canvas(1, 3, height=1.2 + 0.22 * len(cells), sharey=True)
    place = {cell: len(cells) - index for index, cell in enumerate(cells)}
    near = [r for r in resistance if abs(_number(r["soc"]) - 0.5) < 0.06]
    late = [r for r in near if _number(r["delay_second"]) == 10]
    _dots(axes[0, 0], place, capacity, "capacity_ampere_hour", 1, "direction")
    _dots(axes[0, 1], place, late, "resistance_ohm", 1e3, "direction")
    chosen = [row for row in validation if row["chosen"] == "True"]
    _dots(axes[0, 2], place, chosen, "rmse_volt", 1e3, None)
    axes[0, 0].set(title="Capacity [Ah]", xlabel="all tests")
    axes[0, 1].set(title="Resistance [mΩ]", xlabel="10 s into a pulse, SoC 44–56 %")
    axes[0, 2].set(title="Model error [mV RMS]", xlabel="validation tests, chosen model")
    axes[0, 0].set_yticks(list(place.values()), list(place), fontsize=8)
    axes[0, 0].set_ylim(0.4, len(cells) + 0.6)
    _temperature_legend(axes[0, 2], [*capacity, *late, *validation])
    return canvas


def _dots(axes, place, rows, name, scale, marker_by):
    for row in rows:
        marker = figure.MARKERS.get(row.get(marker_by), "o") if marker_by else "o"
        celsius = _number(row["ambient_temperature_celsius"])
        colour = figure.temperature_colour(celsius)
        axes.plot(scale * _number(row[name]), place[row["cell"]], marker, color=colour, alpha=0.8)
    axes.set_xlim(left=0)


def _temperature_legend(axes, rows):
    for celsius in sorted({_number(row["ambient_temperature_celsius"]) for row in rows}):
        known = None if np.isnan(celsius) else celsius
        colour = figure.temperature_colour(known)
        axes.plot([], [], "o", color=colour, label=figure.temperature_label(known))
    figure.legend_once(axes, fontsize=7, loc="upper left", bbox_to_anchor=(1, 1))


def _number(text) -> float:
    return float(text) if text not in ("", None) else np.nan
