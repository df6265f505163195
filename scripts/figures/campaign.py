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
MARGIN = 0.06  # of the width of the values of a panel, on either side
SPOTS_ACROSS = 400  # of a panel: dots nearer to each other than this cannot be told apart


def draw_overview(cells, capacity, resistance, validation):
    """Capacity, resistance and model error of every cell, a row of panels for each type.

    `cells` is dict cell → name of its type; the others are rows of the tables so named. Types lie
    on axes of their own: what is small for one is large for another.
    """
    half = [r for r in resistance if abs(_number(r["soc"]) - 0.5) < 0.06]
    after_10_s = [r for r in half if _number(r["delay_second"]) == 10]
    chosen_rows = [row for row in validation if row["chosen"] == "True"]
    quantities = [
        (capacity, "capacity [Ah]", "capacity_ampere_hour", 1, "direction"),
        (after_10_s, "resistance [mΩ]", "resistance_ohm", 1e3, "direction"),
        (chosen_rows, "model error [mV]", "rmse_volt", 1e3, None),
    ]
    # What nothing is known of has no panels: neither a quantity nor a type.
    quantities = [one for one in quantities if any(row[one[2]] for row in one[0])]
    seen = {row["cell"] for rows, *_ in quantities for row in rows}
    types = {}
    for cell, kind in cells.items():
        types.setdefault(kind, []).append(cell)
    types = {kind: members for kind, members in types.items() if seen & {*members}}
    if not types:
        return style.message("No capacity, resistance or model error is known.")
    levels = _temperatures([*capacity, *after_10_s, *validation])
    heights = [0.95 + 0.2 * min(len(members), NAMED_CELLS) for members in types.values()]
    height = max(sum(heights), 0.4 + 0.16 * len(levels))  # a legend has a line a temperature
    shape = len(types), len(quantities)
    figure, axes = style.subplots(*shape, height=height, height_ratios=heights)
    for row, (kind, members) in zip(axes, types.items(), strict=True):
        height_of = {cell: len(members) - index for index, cell in enumerate(members)}
        for panel, (rows, title, name, scale, marked_by) in zip(row, quantities, strict=True):
            own = [one for one in rows if one["cell"] in height_of and one[name]]
            if not own:
                style.hide([panel])
                continue
            _dots(panel, height_of, own, name, scale, marked_by)
            named = members if len(members) <= NAMED_CELLS and panel is row[0] else []
            panel.set_yticks([height_of[cell] for cell in named], named)
            panel.set_ylim(0.4, len(members) + 0.6)
            panel.tick_params(labelsize=8)
            title = title[0].upper() + title[1:]
            panel.set(title=": ".join(filter(None, (kind if panel is row[0] else "", title))))
    for celsius in levels:
        axes[0, -1].plot([], [], "o", **style.temperature_style(celsius))
    style.legend_once(axes[0, -1], fontsize=7, loc="upper left", bbox_to_anchor=(1, 1))
    return figure


def _dots(axes, height_of, rows, name, scale, marker_by):
    """One dot a row; of those that would fall on the same spot of the picture only the first."""
    values = scale * np.array([_number(row[name]) for row in rows])
    low, high = np.nanmin(values), np.nanmax(values)
    # From the least: five cells that differ by some percent lie apart.
    margin = MARGIN * (high - low or abs(high) or 1.0)
    spot = (high - low + 2 * margin) / SPOTS_ACROSS
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
    axes.set_xlim(low - margin, high + margin)  # no dot at the frame


def _temperatures(rows):
    """Temperatures [°C] that differ by more than chambers do, coldest first; not stated last."""
    celsius = [_number(row["ambient_temperature_celsius"]) for row in rows]
    stated = [one for one in celsius if np.isfinite(one)]
    members = {}
    for one, level in level_means(stated, apart=SAME_CELSIUS).items():
        members.setdefault(level, []).append(one)
    # As most rows state it: 25 °C with one test in a room of 24 °C is no 24.6 °C.
    levels = {max(sorted(own), key=stated.count) for own in members.values()}
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
    handles, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=len(names), fontsize=7)
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
