"""What stands around a panel: its ticks, their labels, axis labels and title, each measured once.

Matplotlib keeps an object of four drawn parts for every tick; here the ticks of an axis are arrays.
"""

import re
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import XAxis, YAxis
from matplotlib.font_manager import FontProperties
from matplotlib.text import Text
from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator

from figures import measures

TICK, MINOR_TICK = 3.5, 2.0  # length, point
PAD = 3.5  # point, from tick to label
LABEL_PAD, TITLE_PAD = 4.0, 6.0  # point
LEAST_GAP = 3.0  # point, between labels side by side
DIGIT_HEIGHT = 0.8  # of a line: what labels one above the other take of it
LARGEST_SHARE = 0.35  # of the width of the canvas, for names beside a panel
LEAST_LINE = 40.0  # point, into which a title or an axis label is broken at the least
RAISED = str.maketrans("0123456789-−", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁻")


class _WithoutTicks:
    """An axis that makes none of Matplotlib's ticks until labels are given for them.

    Matplotlib makes the first tick of each kind as soon as a panel is cleared: an eighth of the
    time of a figure, for what is never drawn.
    """

    written = None  # font size [point] and rotation [degree] of labels that were given

    def reset_ticks(self):
        """Forget all ticks."""
        self.majorTicks, self.minorTicks = [], []

    def set_ticks(self, ticks, labels=None, **look):
        """Ticks at places (n,) within the panel's limits, with labels (n,) and how they look.

        `look` are properties of a text: `fontsize` [point], `rotation` [degree], `ha`.
        """
        self.get_view_interval()  # what the data ask for, before it is widened
        for axis in self._get_shared_axis() if len(ticks) else ():
            axis.set_view_interval(min(ticks), max(ticks))
        self.set_major_locator(FixedLocator(ticks))
        if labels is not None:
            self.set_major_formatter(FixedFormatter([str(label) for label in labels]))
        text = Text(**look)
        size = self.get_tick_params().get("labelsize", "medium") if "fontsize" not in look else None
        if size is not None:
            text.set_size(size)
        self.written = text.get_size(), text.get_rotation()


class _HorizontalAxis(_WithoutTicks, XAxis):
    pass


class _VerticalAxis(_WithoutTicks, YAxis):
    pass


class Panel(Axes):
    """A panel whose ticks are those of `ticks_of` alone."""

    def _init_axis(self):
        self.xaxis = _HorizontalAxis(self, clear=False)
        self.yaxis = _VerticalAxis(self, clear=False)
        for axis, sides in ((self.xaxis, ("bottom", "top")), (self.yaxis, ("left", "right"))):
            for side in sides:
                self.spines[side].register_axis(axis)


class Ticks(NamedTuple):
    """Ticks of one axis: places in its own unit, labels, and how these are written."""

    major: np.ndarray
    minor: np.ndarray
    labelled: np.ndarray
    labels: list
    size: float
    rotation: float
    at_end: bool  # on the right of the panel, as of a colour bar
    shown: bool
    grid: bool


class Label(NamedTuple):
    """A title or the label of an axis, in the lines in which it is written."""

    text: str
    size: float
    bold: bool
    colour: object


class Decoration(NamedTuple):
    """All that stands around a panel, with its room [point] at each side."""

    x: Ticks
    y: Ticks
    title: Label
    x_label: Label
    y_label: Label
    below: float  # room of ticks and their labels alone, point
    beside: float
    room: tuple  # left, right, bottom, top


def of_panel(axes, found, *, title_width) -> Decoration:
    """Ticks and texts around a panel of its present size at 72 dots per inch.

    `title_width` [point] is what the title may take before it is broken into lines. `found` keeps
    the ticks of axes whose limits and room for ticks are as before.
    """
    x, y = ticks_of(axes.xaxis, found), ticks_of(axes.yaxis, found)
    title = _broken(_title(axes), title_width)
    x_label, y_label = (
        _broken(_axis_label(axis), length)
        for axis, length in ((axes.xaxis, axes.bbox.width), (axes.yaxis, axes.bbox.height))
    )
    below, beside = _across(x), _across(y, level=False)
    first, last = _overhang(axes, x)
    wide = beside + _with_pad(y_label, LABEL_PAD)
    left, right = (0.0, wide) if y.at_end else (wide, 0.0)
    bottom, top = below + _with_pad(x_label, LABEL_PAD), _with_pad(title, TITLE_PAD)
    room = (max(left, first), max(right, last), bottom, top) if axes.axison else (0.0,) * 4
    return Decoration(x, y, title, x_label, y_label, below, beside, room)


def settings_of(name) -> dict:
    """Colours of grid, ticks and tick labels of axis `x` or `y`, as the style sets them."""
    colour = matplotlib.rcParams[f"{name}tick.color"]
    return {"grid": matplotlib.rcParams["grid.color"], "tick": colour, "label": colour}


def title_texts(axes):
    """Texts of the panel that are its titles (left, middle, right)."""
    inside = set(axes.texts)
    return [t for t in axes.get_children() if isinstance(t, Text) and t not in inside]


def ticks_of(axis, found) -> Ticks:
    """Ticks of an axis within its limits, with the labels that its formatters give them.

    `found` is as of `of_panel`.
    """
    if axis not in found:
        params = axis.get_tick_params()
        found[axis] = params, _look(axis, params)
    params, (size, rotation) = found[axis]
    at_end = bool(params.get("labelright"))
    shown = at_end or bool(params.get("labelleft", params.get("labelbottom", True)))
    key = (axis, *axis.get_view_interval(), axis.get_tick_space())
    if key not in found:
        found[key] = (
            _located(axis, axis.get_major_locator(), axis.get_majorticklocs, axis.major),
            _located(axis, axis.get_minor_locator(), axis.get_minorticklocs, axis.minor),
        )
    (major, labels), (minor, minor_labels) = found[key]
    labels = [(place, plain(label)) for place, label in zip(major, labels, strict=True) if label]
    minor_labels = [
        (place, plain(label)) for place, label in zip(minor, minor_labels, strict=True) if label
    ]
    if axis.axis_name == "y":
        size = _size_that_fits(axis, labels, size)
    if not rotation:
        labels = _spread(axis, labels, minor_labels, size)
    return Ticks(
        major,
        minor,
        np.array([place for place, _ in labels]),
        [label for _, label in labels] if shown else [],
        size,
        rotation,
        at_end,
        shown,
        bool(params.get("gridOn")),
    )


def _size_that_fits(axis, labels, size):
    """Font size [point], smaller where names would take more than their share of the canvas."""
    most = LARGEST_SHARE * axis.get_figure().bbox.width
    widest = max((measures.width(label, size) for _, label in labels), default=0.0)
    return size * most / widest if widest > most else size


def _spread(axis, labels, minor_labels, size):
    """Labels that do not touch: names broken into lines, else those left out that have no room."""
    number = 0 if axis.axis_name == "x" else 1
    if isinstance(axis.get_major_locator(), FixedLocator) and number == 0 and len(labels) > 1:
        at = places(axis.axes, np.array([place for place, _ in labels]), axis=0)
        most = np.min(np.abs(np.diff(at))) - LEAST_GAP
        return [(place, measures.wrapped(label, size, most)) for place, label in labels]
    kept, taken = [], []
    candidates = labels + minor_labels
    at = places(axis.axes, np.array([place for place, _ in candidates]), axis=number)
    for middle, (place, label) in zip(at, candidates, strict=True):
        half = _length(label, size, number) / 2
        if all(abs(middle - other) >= half + other_half for other, other_half in taken):
            kept.append((place, label))
            taken.append((middle, half))
    return kept


def _length(label, size, number):
    """Room [point] of a label along its axis, 0 for x and 1 for y."""
    if number == 0:
        return measures.width(label, size) + LEAST_GAP
    return measures.height(label, DIGIT_HEIGHT * size)


def _located(axis, locator, places_of, group):
    if isinstance(locator, NullLocator):
        return np.empty(0), []
    places = np.asarray(places_of(), float)
    labels = group.formatter.format_ticks(places)
    low, high = sorted(axis.get_view_interval())
    ends = axis.get_transform().transform(np.array([low, high]))
    with np.errstate(invalid="ignore", divide="ignore"):
        at = axis.get_transform().transform(places)
    margin = 1e-6 * abs(ends[1] - ends[0])
    inside = (at >= min(ends) - margin) & (at <= max(ends) + margin)
    return places[inside], [label for label, kept in zip(labels, inside, strict=True) if kept]


def _look(axis, params):
    """Font size [point] and rotation [degree] of the tick labels."""
    size = params.get("labelsize", "medium")
    if getattr(axis, "written", None):
        return axis.written
    if isinstance(axis.get_major_locator(), FixedLocator) and len(axis.get_majorticklocs()):
        label = axis.get_major_ticks(1)[0].label1
        return label.get_size(), label.get_rotation()
    return FontProperties(size=size).get_size_in_points(), 0.0


def plain(label: str) -> str:
    """A tick's label without mathematical markup: `$\\mathdefault{10^{-2}}$` is 10⁻²."""
    if not label.startswith("$\\mathdefault{"):  # a name may have any sign in it
        return label
    text = re.sub(r"\\mathdefault\{(.*)\}", r"\1", label.replace("$", ""))
    text = text.replace(r"\times", "×").replace(" ", "").replace("-", "−")
    return re.sub(r"\^\{([^}]*)\}", lambda power: power[1].translate(RAISED), text)


def _title(axes):
    given = [text for text in title_texts(axes) if text.get_text()]
    if not given or not axes.axison:
        return Label("", 0.0, False, None)
    return _label_of(given[0], bold=True)


def _axis_label(axis):
    offset = axis.major.formatter.get_offset()
    label = _label_of(axis.label, bold=False)
    return label._replace(text=f"{label.text}, ×{plain(offset)}") if offset else label


def _label_of(text, *, bold):
    shown = text.get_text() if text.get_visible() else ""
    return Label(shown, text.get_size(), bold, text.get_color())


def _broken(label, most):
    if not label.text:
        return label
    lines = measures.wrapped(label.text, label.size, max(most, LEAST_LINE), bold=label.bold)
    return label._replace(text=lines)


def _with_pad(label, pad):
    return measures.height(label.text, label.size) + pad if label.text else 0.0


def _across(ticks, *, level=True):
    """Room [point] of ticks and their labels away from the panel."""
    if not ticks.labels:
        return TICK if ticks.shown else 0.0
    angle = np.deg2rad(ticks.rotation)
    widest = max(measures.width(label, ticks.size) for label in ticks.labels)
    tallest = max(measures.height(label, ticks.size) for label in ticks.labels)
    turned = widest * np.sin(angle) + tallest * np.cos(angle)
    return TICK + PAD + (turned if level else widest)


def _overhang(axes, ticks):
    """Room [point] that tick labels below the panel need beyond its left and right end."""
    if not ticks.labels:
        return 0.0, 0.0
    half = 1.0 if ticks.rotation else 0.5
    at = places(axes, ticks.labelled, axis=0)
    widths = np.array([measures.width(label, ticks.size) for label in ticks.labels])
    widths = widths * np.cos(np.deg2rad(ticks.rotation))
    first = np.max(axes.bbox.x0 - (at - half * widths))
    last = np.max(at + 0.5 * widths - axes.bbox.x1) if not ticks.rotation else 0.0
    return max(first, 0.0), max(last, 0.0)


def places(axes, values, *, axis):
    """Where values of the x (`axis` 0) or y (1) axis are on the canvas [point], (n,)."""
    transform = axes.get_xaxis_transform() if axis == 0 else axes.get_yaxis_transform()
    pairs = np.zeros((len(values), 2))
    pairs[:, axis] = values
    return transform.transform(pairs)[:, axis]
