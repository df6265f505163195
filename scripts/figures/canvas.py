"""A figure as SVG: ticks and texts from arrays, what is inside the panels by Matplotlib."""

import io
import json

import numpy as np
from matplotlib.artist import Artist, allow_rasterization
from matplotlib.backends.backend_mixed import MixedModeRenderer
from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.collections import Collection
from matplotlib.colors import to_hex
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.path import Path
from matplotlib.transforms import Affine2D, IdentityTransform

from figures import decoration, measures

GRID_WIDTH, TICK_WIDTH, MINOR_WIDTH = 0.8, 0.8, 0.6  # point
CENTRE_OF_DIGIT = 0.36  # of the font size, above the line on which it stands
AXIS_ORDER = 0.5  # drawn above what has a lower `zorder`
SIDES = {"left": (0, 0, 0, 1), "right": (1, 0, 1, 1), "bottom": (0, 0, 1, 0), "top": (0, 1, 1, 1)}
FLIPPED = Affine2D().scale(1.0, -1.0)  # SVG counts y from above
NAMELESS = "_"  # a panel or series without a name: an empty one would not be written
SCALE_POINTS = 17  # of a scale that is neither straight nor logarithmic
BEYOND = 10.0  # point beyond the canvas, from where a mark may still reach into it
WRITTEN_AT = {"left": "start", "center": "middle", "right": "end"}


class Canvas(RendererSVG):
    """Matplotlib's writer of SVG, with texts measured and written in fewer steps."""

    def get_text_width_height_descent(self, s, prop, ismath):
        """Width, height and descent [point] of one line of text."""
        if ismath:
            return super().get_text_width_height_descent(s, prop, ismath)
        size = prop.get_size_in_points()
        bold = prop.get_weight() == "bold"
        descent = measures.DESCENT * size
        return measures.width(s, size, bold=bold), size, descent

    def draw_text(self, gc, x, y, s, prop, angle, ismath=False, mtext=None):
        """One line of text whose first character begins at (x, y) [point, from above]."""
        if ismath:
            return super().draw_text(gc, x, y, s, prop, angle, ismath, mtext)
        anchor = "start"
        if mtext is not None and angle == 0:
            x = mtext.get_transform().transform(mtext.get_unitless_position())[0]
            anchor = WRITTEN_AT[mtext.get_ha()]
        look = {"anchor": anchor, "bold": prop.get_weight() == "bold", "angle": angle}
        self.write(x, self.height - y, s, prop.get_size_in_points(), gc.get_rgb(), **look)
        return None

    def draw_markers(self, gc, marker_path, marker_trans, path, trans, rgbFace=None):
        """The same mark at each point of a path, its look written once for all."""
        if not len(path.vertices):
            return
        look = self._get_style(gc, rgbFace)
        drawn = self._convert_path(marker_path, marker_trans + FLIPPED, simplify=False)
        if (drawn, look) not in self._markers:
            self._markers[drawn, look] = self._make_id("m", (drawn, look))
            stroke = "; ".join(part for part in look.split("; ") if part.startswith("stroke"))
            self.writer.start("defs")
            self.writer.element("path", id=self._markers[drawn, look], d=drawn, style=stroke)
            self.writer.end("defs")
        name = f"#{self._markers[drawn, look]}"
        self.writer.start("g", **self._get_clip_attrs(gc), style=look)
        at = trans.transform(path.vertices) * (1.0, -1.0) + (0.0, self.height)
        size = np.array([self.width, self.height])
        seen = np.all((at >= -BEYOND) & (at <= size + BEYOND), axis=1)
        for x, y in at[seen]:
            self.writer.element("use", attrib={"xlink:href": name, "x": f"{x:f}", "y": f"{y:f}"})
        self.writer.end("g")

    def write(self, x, y, text, size, colour, *, anchor="start", bold=False, angle=0.0):
        """A line of text at (x, y) [point, from below], turned by an angle [degree]."""
        look = {"font-size": f"{size:g}px", "fill": to_hex(colour), "text-anchor": anchor}
        look |= {"font-weight": "bold"} if bold else {}
        place = {"x": f"{x:.2f}", "y": f"{self.height - y:.2f}"}
        if angle:
            place["transform"] = f"rotate({-angle:g} {place['x']} {place['y']})"
        style = "; ".join(f"{name}: {value}" for name, value in look.items())
        self.writer.element("text", text, attrib={**place, "style": style})

    def strokes(self, ends, colour, width):
        """Lines from (x, y) to (x, y) [point, from below], rows of `ends` (n, 4), as one path."""
        if not len(ends):
            return
        gc = self.new_gc()
        gc.set_foreground(colour)
        gc.set_linewidth(width)
        codes = np.tile([Path.MOVETO, Path.LINETO], len(ends))
        self.draw_path(gc, Path(np.reshape(ends, (-1, 2)), codes), IdentityTransform())


class Numbers(Artist):
    """Small texts centred at (x, y) of the panel's own units: one artist for all cells of a map.

    `colours` are those of each text, `size` is the font size [point].
    """

    def __init__(self, x, y, texts, colours, size):
        super().__init__()
        self.x, self.y, self.texts, self.colours, self.size = x, y, texts, colours, size
        self.set_zorder(3)

    @allow_rasterization
    def draw(self, renderer):
        """Write all texts."""
        if not self.texts:
            return
        prop = FontProperties(size=self.size)
        at = self.axes.transData.transform(np.stack([self.x, self.y], axis=1))
        shift = np.array([0.0, -CENTRE_OF_DIGIT * renderer.points_to_pixels(self.size)])
        height = renderer.get_canvas_width_height()[1]
        for (x, y), text, colour in zip(at + shift, self.texts, self.colours, strict=True):
            gc = renderer.new_gc()
            gc.set_foreground(colour)
            half = renderer.get_text_width_height_descent(text, prop, False)[0] / 2
            renderer.draw_text(gc, x - half, height - y, text, prop, 0.0)


# Texts are measured by one renderer for all figures.
MEASURING = Canvas(1, 1, io.StringIO())


def drawn(figure, *, metadata) -> str:
    """SVG of a figure, laid out and drawn once; its colours and sizes are Matplotlib's settings."""
    text = io.StringIO()
    figure.dpi = 72
    engine = figure.get_layout_engine()
    engine.execute(figure)
    # The steps of a continuous colour bar become one small picture, as Matplotlib asks for.
    vectors = Canvas(*figure.bbox.size, text, metadata=metadata)
    canvas = MixedModeRenderer(figure, *figure.get_size_inches(), 72, vectors)
    figure.patch.draw(canvas)
    parts = [*figure.axes, *figure.texts, *figure.legends]
    for part in sorted(parts, key=lambda part: part.zorder):
        if part in engine.decorations:
            _draw_panel(canvas, part, engine.decorations[part])
        else:
            part.draw(canvas)
    canvas.finalize()
    return text.getvalue()


def _draw_panel(canvas, axes, around):
    """A panel: what lies below its grid, the grid and ticks, its artists, spines and titles."""
    canvas.writer.start("g", attrib=_scales(axes, around, canvas.get_canvas_width_height()[1]))
    apart = {axes.xaxis, axes.yaxis, axes.patch, *decoration.title_texts(axes)}
    sides = {axes.spines[name] for name in SIDES if name in axes.spines}
    artists = [a for a in axes.get_children() if a not in apart | sides]
    artists.sort(key=lambda artist: artist.zorder)
    if axes.axison:
        axes.patch.draw(canvas)
        for artist in (a for a in artists if a.zorder < AXIS_ORDER):
            _draw_series(canvas, artist)
        _draw_axis(canvas, axes, around.x, 0)
        _draw_axis(canvas, axes, around.y, 1)
        _draw_labels(canvas, axes, around)
        artists = [a for a in artists if a.zorder >= AXIS_ORDER]
    for artist in artists:
        _draw_series(canvas, artist)
    if axes.axison:
        _draw_sides(canvas, axes)
    canvas.writer.end("g")


def _scales(axes, around, height) -> dict:
    """Title of a panel, and of each axis its label and (value, place) pairs of its scale.

    The report's reader gets the numbers of a figure back from its drawing by them; places are in
    points of the drawing, from above.
    """
    about = {"data-panel": around.title.text.replace("\n", " ") or NAMELESS}
    for axis, name in enumerate("xy"):
        one = getattr(axes, f"{name}axis")
        place = decoration.places(axes, ends := _scale_points(one), axis=axis)
        at = np.stack([ends, height - place if axis else place], axis=1).round(9).tolist()
        label = getattr(around, f"{name}_label").text.replace("\n", " ")
        scale = {"label": label, "log": one.get_scale() == "log", "at": at}
        about[f"data-{name}-scale"] = json.dumps(scale, ensure_ascii=False)
    return about


def _scale_points(axis):
    """Values of an axis between which its scale is straight, or straight in their logarithm."""
    low, high = sorted(axis.get_view_interval())
    if axis.get_scale() in ("linear", "log"):
        return np.array([low, high])
    return np.linspace(low, high, SCALE_POINTS)


def _draw_series(canvas, artist):
    """Draw an artist of a panel; lines, points and bars in a group with the name of the series."""
    if not isinstance(artist, (Line2D, Patch, Collection)):
        artist.draw(canvas)
        return
    label = str(artist.get_label()) or NAMELESS
    canvas.writer.start("g", attrib={"data-s": NAMELESS if label.startswith("_") else label})
    artist.draw(canvas)
    if artist.get_rasterized():
        # Matplotlib ends a picture only before the next artist that is none.
        Line2D([], [], visible=False).draw(canvas)
    canvas.writer.end("g")


def _draw_sides(canvas, axes):
    box = np.array([*axes.bbox.min, *axes.bbox.min])
    size = np.tile(axes.bbox.size, 2)
    shown = [name for name in SIDES if name in axes.spines and axes.spines[name].get_visible()]
    if shown:
        look = axes.spines[shown[0]]
        ends = np.array([box + np.array(SIDES[name]) * size for name in shown])
        canvas.strokes(ends, look.get_edgecolor(), look.get_linewidth())


def _draw_axis(canvas, axes, ticks, axis):
    """Grid lines, ticks and tick labels of the x (`axis` 0) or the y axis (1)."""
    settings = decoration.settings_of("xy"[axis])
    low, high = axes.bbox.min, axes.bbox.max
    edge = high[0] if ticks.at_end else low[1 - axis]
    outward = 1 if ticks.at_end else -1
    major, minor = (
        decoration.places(axes, values, axis=axis) for values in (ticks.major, ticks.minor)
    )
    if ticks.grid:
        lines = _ends(major, low[1 - axis], high[1 - axis], axis)
        canvas.strokes(lines, settings["grid"], GRID_WIDTH)
    for at, length, width in (
        (major, decoration.TICK, TICK_WIDTH),
        (minor, decoration.MINOR_TICK, MINOR_WIDTH),
    ):
        canvas.strokes(_ends(at, edge, edge + outward * length, axis), settings["tick"], width)
    away = edge + outward * (decoration.TICK + decoration.PAD)
    at = decoration.places(axes, ticks.labelled, axis=axis)
    write = _write_below if axis == 0 else _write_beside
    for place, label in zip(at, ticks.labels, strict=False):
        write(canvas, place, away, label, ticks, settings["label"])


def _ends(at, start, stop, axis):
    """Lines across an axis at places (n,) as (x, y, x, y) (n, 4)."""
    first, last = np.full(len(at), start), np.full(len(at), stop)
    rows = [at, first, at, last] if axis == 0 else [first, at, last, at]
    return np.stack(rows, axis=1)


def _write_below(canvas, x, top, label, ticks, colour):
    """A label whose highest line ends at `top`, centred at `x` or, if turned, ending there."""
    if ticks.rotation:
        angle = np.deg2rad(ticks.rotation)
        tall, low = (share * ticks.size for share in (measures.LINE_HEIGHT, measures.DESCENT))
        end = x - low * np.sin(angle), top - tall * np.cos(angle) + low * np.cos(angle)
        canvas.write(*end, label, ticks.size, colour, anchor="end", angle=ticks.rotation)
        return
    _write_lines(canvas, x, top, label, ticks.size, colour, anchor="middle")


def _write_beside(canvas, y, edge, label, ticks, colour):
    """A label that ends at `edge`, or begins there on the right of a panel, its middle at `y`."""
    anchor = "start" if ticks.at_end else "end"
    top = y + measures.height(label, ticks.size) / 2
    _write_lines(canvas, edge, top, label, ticks.size, colour, anchor=anchor)


def _write_lines(canvas, x, top, text, size, colour, *, anchor, bold=False):
    """Lines of text one below the other, the highest with its upper end at `top`."""
    for k, line in enumerate(text.split("\n")):
        y = top - size * (measures.LINE_HEIGHT * (k + 1) - measures.DESCENT)
        canvas.write(x, y, line, size, colour, anchor=anchor, bold=bold)


def _draw_labels(canvas, axes, around):
    """Title and axis labels of a panel."""
    low, high = axes.bbox.min, axes.bbox.max
    middle = (low + high) / 2
    title, below, beside = around.title, around.x_label, around.y_label
    top = high[1] + decoration.TITLE_PAD + measures.height(title.text, title.size)
    if title.text:
        look = {"anchor": "start", "bold": True}
        _write_lines(canvas, low[0], top, title.text, title.size, title.colour, **look)
    if below.text:
        top = low[1] - around.below - decoration.LABEL_PAD
        _write_lines(canvas, middle[0], top, below.text, below.size, below.colour, anchor="middle")
    if beside.text:
        _write_upright(canvas, axes, around, middle[1])


def _write_upright(canvas, axes, around, y):
    """The label of the y axis, read upwards, beside the tick labels."""
    label, away = around.y_label, around.beside + decoration.LABEL_PAD
    tall = measures.height(label.text, label.size)
    left = axes.bbox.x1 + away if around.y.at_end else axes.bbox.x0 - away - tall
    for k, line in enumerate(label.text.split("\n")):
        x = left + label.size * (measures.LINE_HEIGHT * (k + 1) - measures.DESCENT)
        canvas.write(x, y, line, label.size, label.colour, anchor="middle", angle=90.0)
