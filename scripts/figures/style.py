"""Style of all figures, SVG with the same bytes on any machine, and selection of what is drawn."""

import json
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from cellwright.numerics.extremes import rows_of_extremes
from figures import canvas, svg
from figures.decoration import Panel
from figures.layout import GridLayout

INK, QUIET, GRID = "#1d2733", "#8a94a0", "#e6e9ed"
MEASURED, ERROR = "#1d2733", "#c0392b"
SERIES = ("#0b6fb8", "#e07b00", "#2a9d5c", "#8e4ec6", "#c0392b", "#5d6d7e", "#b8860b", "#00868b")
YELLOW = "#f2c14e"  # the part of a bar that a slower test or a held voltage adds
MOST_INSIDE = 6  # entries of a legend that stand inside a panel, more would hide its data
MARKERS = {"discharge": "v", "charge": "^"}
STYLE = {
    "svg.hashsalt": "cellwright",
    "svg.fonttype": "none",
    "font.family": ["sans-serif"],
    "font.size": 9,
    "axes.edgecolor": QUIET,
    "axes.labelcolor": INK,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titley": 1.0,  # fixed, or each layout measures all ticks again to place it
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "grid.color": GRID,
    "text.color": INK,
    "text.parse_math": False,  # names of a user's are no formulas
    "xtick.color": INK,
    "ytick.color": INK,
    "lines.linewidth": 1.2,
    "lines.markersize": 4,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "path.simplify": True,
    "path.simplify_threshold": 0.1,  # [point]; at 0.5 smooth curves show corners on a screen
}
matplotlib.rcParams.update(STYLE)


def subplots(rows=1, columns=1, *, width=9.0, height=3.2, **settings):
    """A new figure and its axes (2-d array), `width` × `height` [inch]."""
    figure = Figure(figsize=(width, height), layout=GridLayout(canvas.MEASURING))
    panels = {"axes_class": Panel}
    return figure, figure.subplots(rows, columns, squeeze=False, subplot_kw=panels, **settings)


def grid_of(panels: int, *, across: int) -> tuple[int, int]:
    """Rows and columns of a grid for so many panels, at most `across` beside each other."""
    return -(-panels // across), min(panels, across)


def panels(count, *, across, height, wide=None, **settings):
    """A figure and the first `count` panels of its grid, the others switched off.

    `height` [inch] is that of a row, `wide` [inch] that of a column, of which there are then always
    `across`: a report shows each figure as wide as its page. None: a page in all.
    """
    rows, columns = grid_of(count, across=across)
    columns, width = (columns, {}) if wide is None else (across, {"width": wide * across + 0.4})
    figure, axes = subplots(rows, columns, height=height * rows, **width, **settings)
    hide(axes.flat[count:])
    return figure, axes.ravel()[:count]


def hide(panels):
    """Switch off empty panels of a grid."""
    for panel in panels:
        panel.axis("off")


def message(text):
    """A figure that says in a sentence why there is nothing to draw."""
    figure, axes = subplots(height=0.5)
    axes[0, 0].axis("off")
    axes[0, 0].text(0.0, 0.5, text, va="center", transform=axes[0, 0].transAxes)
    figure.not_drawn = text
    return figure


def temperature_colour(celsius):
    """Blue in the cold, red in the heat, −25 … 50 °C; grey where not known."""
    # Without its ends: the darkest blue and red of the map look alike on a line.
    if celsius is None or not np.isfinite(celsius):
        return QUIET
    return matplotlib.colormaps["turbo"](0.08 + 0.84 * np.clip((celsius + 25) / 75, 0, 1))


def temperature_label(celsius) -> str:
    """`25 °C`, or that it is not known."""
    return "temperature not stated" if celsius is None else f"{celsius:g} °C"


def temperature_style(celsius) -> dict:
    """Colour and label of a line or of points at one temperature."""
    return {"color": temperature_colour(celsius), "label": temperature_label(celsius)}


def plot_thinned(axes, x, y, *, points=2000, **style):
    """Plot a line thinned to about `points` points, with all its extremes."""
    axes.plot(*thinned(x, y, points=points), **style)


def legend_once(axes, **settings):
    """A legend without repeated labels, beside its panel where it is long; none without labels."""
    handles, labels = axes.get_legend_handles_labels()
    if labels:
        # Lines of one name are one thing, such as all discharges at 25 °C.
        unique = dict(zip(labels, handles, strict=True))
        if len(unique) > MOST_INSIDE and "bbox_to_anchor" not in settings:
            settings |= {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0), "ncols": 1}
        axes.legend(unique.values(), unique.keys(), **settings)


def colour_bar(figure, shown, panels, **settings):
    """A colour bar of `shown` at the right of panels, the rightmost of them last."""
    axes = figure.add_axes((0.9, 0.1, 0.02, 0.8))
    figure.colorbar(shown, cax=axes, **settings)
    figure.get_layout_engine().bars.append((axes, panels))


def write_numbers(axes, x, y, texts, *, colours, size):
    """Write a text into each cell of a map, centred at `x`, `y` (n,); `size` [point]."""
    axes.add_artist(canvas.Numbers(x, y, texts, colours, size))


def shade_unscored(axes, hours, scored):
    """Grey where samples do not count: `hours`, `scored` are (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[1], scored.astype(int), [1]])))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        axes.axvspan(hours[start], hours[min(stop, len(hours) - 1)], color=GRID, zorder=0)


def name_bars(axes, names, *, fontsize):
    """Names beside horizontal bars, the first on top, no lines between them."""
    axes.set_yticks(range(len(names)), names, fontsize=fontsize)
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")


def plain_numbers(axis):
    """Labels of a logarithmic axis as 0.1 and 30, not as powers of ten; none between them."""
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter("")


def save(figure, job, path=None):
    """Write a figure as one of the job's outputs, its provenance in the SVG's metadata."""
    path = path or job.snakemake.output[0]
    about = json.dumps(job.about(getattr(figure, "not_drawn", None)), sort_keys=True)
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(svg.text_of(figure, description=about), encoding="utf-8")
    job.saved.add(path)


def rows_where(columns: dict, selection) -> dict:
    """The same columns with some of their rows: `selection` (n,) is a mask, or row numbers."""
    return {name: values[selection] for name, values in columns.items()}


def ambient_celsius(about: dict):
    """Temperature [°C] that the sheet states for the test of an artefact; None where it does not.

    `about` : provenance of the artefact.
    """
    return about["params"]["test"]["ambient_temperature_celsius"]


def evenly_spread(count: int, most: int) -> np.ndarray:
    """Places of at most `most` of `count` items, first and last among them."""
    return np.unique(np.linspace(0, count - 1, most).round().astype(int))


def thinned(x, y, *, points=2000):
    """Fewer points (x, y) that draw the same line.

    A figure of full width in the report has about a thousand columns of pixels; a stretch of the
    default is at most one of them, so no spike is lost.
    """
    keep = rows_of_extremes(y, points)
    return x[keep], y[keep]
