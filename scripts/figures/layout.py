"""Places of panels: a grid whose columns and rows leave each other the room that texts need."""

import numpy as np
from matplotlib.layout_engine import LayoutEngine

from figures import decoration, legends, measures

PAD = 4.0  # point, at the edge of the canvas, and at each side between two panels
BAR_GAP, BAR_WIDTH = 8.0, 10.0  # point, of a colour bar
PASSES = 4  # the labels of ticks depend on the size of the panel, which depends on the labels
LEAST_SHARE = 0.25  # of the canvas, that panels keep where texts would leave them less
LEFT, RIGHT, BOTTOM, TOP = range(4)


class GridLayout(LayoutEngine):
    """Layout of figures made by `style.subplots`.

    Attributes
    ----------
    bars : (axes of a colour bar, panels beside which it stands).
    decorations : axes → `decoration.Decoration`, as measured last.
    found : ticks that were located, as of `decoration.of_panel`.
    """

    _adjust_compatible = True
    _colorbar_gridspec = False

    def __init__(self, renderer):
        super().__init__()
        self.renderer = renderer
        self.bars = []
        self.decorations = {}
        self.found = {}
        self.rooms = {}  # at the right of each panel [point], as given last
        self.most = ()  # room at the sides of each column and row [point], as given last

    def execute(self, fig):
        """Place all panels, measured at 72 dots per inch, whatever the figure is drawn at."""
        dots_per_inch = fig.dpi
        fig.dpi = 72
        self._place_all(fig)
        # Panels may share a scale: room above one moves what another legend must avoid.
        for _ in range(2):
            moved = [legends.clear(axes, self.renderer) for axes in fig.axes]
            if not any(moved):
                break
            self._place_all(fig)
        fig.dpi = dots_per_inch

    def _place_all(self, fig):
        """Place all panels, over and over until nothing moves."""
        for number in range(PASSES):
            before = _places(fig)
            # A label that takes a line more in a lower panel, and makes it higher by that, would
            # go to and fro: from half of the passes on no room shrinks any more.
            self._place(fig, shrinking=number < PASSES // 2)
            if _places(fig) == before:
                self._shape(fig)
                break
        else:
            self._measure(fig)

    def _shape(self, figure):
        """Give all panels the shape that they ask for within their place."""
        for axes in figure.axes:
            locator = axes.get_axes_locator()
            axes.apply_aspect(locator(axes, self.renderer) if locator else None)

    def _measure(self, figure):
        bars = {bar for bar, _ in self.bars}
        panels = [axes for axes in figure.axes if axes not in bars]
        self._shape(figure)
        for axes in figure.axes:
            self.decorations[axes] = decoration.of_panel(
                axes, self.found, title_width=_title_width(axes, figure)
            )
        return panels

    def _place(self, figure, *, shrinking):
        panels = self._measure(figure)
        grid = panels[0].get_subplotspec().get_gridspec()
        rows, columns = grid.nrows, grid.ncols
        across = np.zeros((2, columns))  # left and right room of each column
        along = np.zeros((2, rows))  # top and bottom room of each row
        for axes in panels:
            room = self._room(axes)
            spec = axes.get_subplotspec()
            first, last = spec.colspan.start, spec.colspan.stop - 1
            across[0, first] = max(across[0, first], room[LEFT])
            across[1, last] = max(across[1, last], room[RIGHT])
            row = spec.rowspan.start
            along[:, row] = np.maximum(along[:, row], [room[TOP], room[BOTTOM]])
        if not shrinking:
            across, along = map(np.maximum, (across, along), self.most)
        self.most = across, along
        below, above = self._of_figure(figure)
        size = figure.bbox.size
        x = _divided(size[0], across + PAD, grid.get_width_ratios())
        y = _divided(size[1] - below - above, along + PAD, grid.get_height_ratios())
        for axes in panels:
            spec = axes.get_subplotspec()
            left, right = x[0, spec.colspan.start], x[1, spec.colspan.stop - 1]
            top, bottom = y[:, spec.rowspan.start] + above
            _set_place(axes, (left, size[1] - bottom, right - left, bottom - top), size)
            self.rooms[axes] = across[1, spec.colspan.stop - 1]
        for bar, beside in self.bars:
            _place_bar(bar, beside, size, max(self._room_alone(axes)[RIGHT] for axes in beside))

    def _room(self, axes):
        """Room [point] that a panel needs at each side, with its colour bar."""
        room = self._room_alone(axes)
        for bar, beside in self.bars:
            if axes is beside[-1]:
                room[RIGHT] += BAR_GAP + BAR_WIDTH + self.decorations[bar].room[RIGHT]
        return room

    def _room_alone(self, axes):
        room = list(self.decorations[axes].room)
        legend = axes.get_legend()
        outside = [legend] if legend and legend.get_bbox_to_anchor() is not axes.bbox else []
        texts = [text for text in axes.texts if text.get_in_layout()]
        for artist in outside + texts:
            box, inner = artist.get_window_extent(self.renderer), axes.bbox
            room[LEFT] = max(room[LEFT], inner.x0 - box.x0)
            room[RIGHT] = max(room[RIGHT], self._room_right(axes, artist, box.x1))
            room[BOTTOM] = max(room[BOTTOM], inner.y0 - box.y0)
            room[TOP] = max(room[TOP], box.y1 - inner.y1)
        return room

    def _room_right(self, axes, artist, end):
        """Room that a text or legend ending at `end` [point] needs on the right of its panel.

        A text at a point of the data moves with it as the panel becomes narrower.
        """
        inner = axes.bbox
        if getattr(artist, "xycoords", "") != "data":
            return end - inner.x1
        x = artist.axes.transData.transform(artist.xy)[0]
        share = (x - inner.x0) / inner.width
        whole = inner.width + self.rooms.get(axes, 0.0)
        return (end - x - (1 - share) * whole) / share if share > 0 else 0.0

    def _of_figure(self, figure):
        """Room [point] below and above all panels: legends below, a heading above."""
        legends = [legend.get_window_extent(self.renderer).height for legend in figure.legends]
        texts = [t for t in figure.texts if t.get_text()]
        for text in texts:
            most = (
                figure.bbox.width
                * (1 - text.get_position()[0])
                * (2 if text.get_ha() == "center" else 1)
            )
            text.set_text(measures.wrapped(text.get_text(), text.get_size(), most - 2 * PAD))
            text.set(va="top", y=1 - PAD / figure.bbox.height)
        heights = [measures.height(t.get_text(), t.get_size()) + PAD for t in texts]
        return sum(legends) + PAD * bool(legends), max(heights, default=0.0)


def _title_width(axes, figure):
    """Room [point] of a title: from the left of its panel to the next one or the canvas' end."""
    spec = axes.get_subplotspec()
    if spec is None:
        return axes.bbox.width
    start = spec.colspan.stop
    neighbours = [
        other.bbox.x0
        for other in figure.axes
        if other.get_subplotspec() is not None
        and other.get_subplotspec().rowspan.start == spec.rowspan.start
        and other.get_subplotspec().colspan.start >= start
    ]
    return min(neighbours, default=figure.bbox.x1) - axes.bbox.x0 - 2 * PAD


def _places(figure):
    return [axes.get_position(original=True).bounds for axes in figure.axes]


def _divided(length, room, ratios):
    """Begin and end (2, n) of n panels [point] that share what their rooms (2, n) leave them."""
    ratios = np.asarray(ratios if ratios is not None else np.ones(room.shape[1]), float)
    inner = max(length - room.sum(), LEAST_SHARE * length) * ratios / ratios.sum()
    ends = np.cumsum(room.sum(axis=0) + inner) - room[1]
    return np.array([ends - inner, ends])


def _place_bar(bar, beside, size, room):
    boxes = [axes.bbox for axes in beside]
    low, high = min(box.y0 for box in boxes), max(box.y1 for box in boxes)
    left = max(box.x1 for box in boxes) + room + BAR_GAP
    _set_place(bar, (left, low, BAR_WIDTH, high - low), size)


def _set_place(axes, place, size):
    """Set the place (left, bottom, width, height) [point] on a canvas of this size."""
    axes.set_position(np.asarray(place) / np.tile(size, 2))
