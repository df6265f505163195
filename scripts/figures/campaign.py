"""Figures of the whole campaign, and of all records of a cell."""

import numpy as np

from cellwright.laws.points import level_means
from cellwright.records.conditions import SAME_CELSIUS
from figures import style

STEP_COLOURS = {
    "rest": style.QUIET,
    "CC": style.SERIES[0],
    "CV": style.SERIES[2],
    "CCCV": style.SERIES[2],
    "pulse": style.ERROR,
    "dynamic": style.SERIES[1],
}
THUMBNAILS_ACROSS = 4
NAMED_CELLS = 40  # of a type whose names fit beside a panel that fits a screen
SPOTS_ACROSS = 400  # of a panel: dots nearer to each other than this cannot be told apart


def draw_overview(cells, capacity, resistance, validation):
    """Capacity, resistance and model error of every cell, a row of panels for each type.

    `cells` is dict cell → name of its type; the others are rows of the tables so named. Types lie
    on axes of their own: what is small for one is large for another.
    """
    types = {}
    for cell, kind in cells.items():
        types.setdefault(kind, []).append(cell)
    types = types or {"": []}
    half = [r for r in resistance if abs(_number(r["soc"]) - 0.5) < 0.06]
    after_10_s = [r for r in half if _number(r["delay_second"]) == 10]
    chosen_rows = [row for row in validation if row["chosen"] == "True"]
    levels = _temperatures([*capacity, *after_10_s, *validation])
    heights = [0.95 + 0.2 * min(len(members), NAMED_CELLS) for members in types.values()]
    height = max(sum(heights), 0.4 + 0.16 * len(levels))  # a legend has a line a temperature
    figure, axes = style.subplots(len(types), 3, height=height, height_ratios=heights)
    for row, (kind, members) in zip(axes, types.items(), strict=True):
        height_of = {cell: len(members) - index for index, cell in enumerate(members)}
        for panel, (rows, name, scale, marked_by) in zip(
            row,
            (
                (capacity, "capacity_ampere_hour", 1, "direction"),
                (after_10_s, "resistance_ohm", 1e3, "direction"),
                (chosen_rows, "rmse_volt", 1e3, None),
            ),
            strict=True,
        ):
            own = [one for one in rows if one["cell"] in height_of]
            _dots(panel, height_of, own, name, scale, marked_by)
            named = members if len(members) <= NAMED_CELLS and panel is row[0] else []
            panel.set_yticks([height_of[cell] for cell in named], named)
            panel.set_ylim(0.4, len(members) + 0.6)
            panel.tick_params(labelsize=8)
        row[0].set(title=": ".join(filter(None, (kind, "capacity [Ah]"))))
        row[1].set(title="Resistance [mΩ]")
        row[2].set(title="Model error [mV]")
    for celsius in levels:
        axes[0, 2].plot([], [], "o", **style.temperature_style(celsius))
    style.legend_once(axes[0, 2], fontsize=7, loc="upper left", bbox_to_anchor=(1, 1))
    return figure


def _dots(axes, height_of, rows, name, scale, marker_by):
    """One dot a row; of those that would fall on the same spot of the picture only the first."""
    values = scale * np.array([_number(row[name]) for row in rows])
    spot = np.nanmax(values, initial=0.0) / SPOTS_ACROSS or 1.0
    drawn = {}
    for row, value in zip(rows, values, strict=True):
        marker = style.MARKERS.get(row.get(marker_by), "o") if marker_by else "o"
        colour = style.temperature_colour(_number(row["ambient_temperature_celsius"]))
        if np.isfinite(value):
            at = drawn.setdefault((marker, colour), {})
            at.setdefault((round(value / spot), height_of[row["cell"]]), value)
    for (marker, colour), at in drawn.items():
        heights = [height for _, height in at]
        axes.plot(list(at.values()), heights, marker, color=colour, alpha=0.8)
    axes.set_xlim(0, 1.04 * np.nanmax(values, initial=0.0) or None)  # no dot at the frame
    if not drawn:  # a scale without a point on it would be no cell's
        axes.set_xticks([], [])
        axes.annotate("none known", (0.5, 0.5), xycoords="axes fraction", ha="center", fontsize=8)


def _temperatures(rows):
    """Temperatures [°C] that differ by more than chambers do, coldest first; not stated last."""
    celsius = [_number(row["ambient_temperature_celsius"]) for row in rows]
    stated = [one for one in celsius if np.isfinite(one)]
    levels = {round(one) for one in level_means(stated, apart=SAME_CELSIUS).values()}
    return [*sorted(levels), *([None] if len(stated) < len(celsius) else [])]


def _number(text) -> float:
    return float(text) if text not in ("", None) else np.nan


def draw_records(tests, total):
    """Voltage of a cell's records over time, coloured by the kind of step.

    `tests` are (columns of `clean`, columns of `segment`, about), `total` is how many there are.
    """
    rows = -(-len(tests) // THUMBNAILS_ACROSS)
    figure, axes = style.subplots(rows, THUMBNAILS_ACROSS, height=1.75 * rows + 0.3)
    for panel, (series, steps, about) in zip(axes.flat, tests, strict=False):
        _thumbnail(panel, series, steps)
        panel.set_title(about["wildcards"]["test"], fontsize=7)
        panel.tick_params(labelsize=7)
    style.hide(axes.flat[len(tests) :])
    kinds = " · ".join(STEP_COLOURS)
    more = f" ({len(tests)} of {total} records)" if total > len(tests) else ""
    figure.suptitle(f"Voltage [V] over time [h], coloured by step: {kinds}{more}", fontsize=8)
    for kind, colour in STEP_COLOURS.items():
        axes[0, 0].plot([], [], color=colour, label=kind)
    axes[0, 0].legend(fontsize=6, ncols=2)
    return figure


def _thumbnail(axes, series, steps):
    hours, volt = series["test_time_second"] / 3600, series["voltage_volt"]
    for kind, colour in STEP_COLOURS.items():
        drawn = np.full(len(volt), np.nan)
        of_kind = steps["kind"] == kind
        for first, last in zip(
            steps["first_row"][of_kind], steps["last_row"][of_kind], strict=True
        ):
            drawn[max(first - 1, 0) : last + 1] = volt[max(first - 1, 0) : last + 1]
        style.plot_thinned(axes, hours, drawn, points=400, color=colour, linewidth=0.8)
