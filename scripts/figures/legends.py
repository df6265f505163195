"""Legends off the data: where nothing is drawn, else in room that their panel is given above it."""

import numpy as np
from matplotlib.collections import PathCollection, QuadMesh
from matplotlib.text import Text
from matplotlib.transforms import Bbox

# Tried in this order after the one that was asked for: a reader looks at corners first.
PLACES = ("upper right", "upper left", "lower right", "lower left", "upper center", "lower center")
PLACES += ("center right", "center left")
MARGIN = 3.0  # point, between a legend and the nearest line
BORDER = 5.0  # point, between a legend and the edge of its panel
MOST_ROOM = 0.4  # of a panel, that a legend may take above the data; a taller one stands beside it
SHADES = 0.5  # what is drawn below this is a background


def clear(axes, renderer) -> bool:
    """Move a panel's legend off its data; whether the panel has to be laid out again for that."""
    legend = axes.get_legend()
    if legend is None or legend.get_bbox_to_anchor() is not axes.bbox:
        return False
    here = axes.bbox.bounds  # a second scale draws in the same place
    layers = [one for one in axes.figure.axes if one.bbox.bounds == here]
    shapes = [shape for one in layers for shape in _drawn(one, renderer)]
    asked = legend._get_loc()  # 0 is Matplotlib's "best", which may be on the data
    for place in [*([asked] if asked else []), *PLACES]:
        legend.set_loc(place)
        if not _hidden(shapes, legend.get_window_extent(renderer).padded(MARGIN)):
            return False
    legend = _flat(axes, legend, renderer)
    share = (legend.get_window_extent(renderer).height + BORDER + 2 * MARGIN) / axes.bbox.height
    scales = {one.get_yscale() for one in layers}
    if axes.get_aspect() != "auto" or not scales <= {"linear", "log"} or share > MOST_ROOM:
        legend.set_bbox_to_anchor((1.0, 1.0), axes.transAxes)
        legend.set_loc("upper left")
    else:
        for one in layers:
            _raise_top(one, share)
    return True


def _flat(axes, legend, renderer):
    """The legend in as few rows as the panel is wide enough for, in its upper right corner."""
    size = legend.get_texts()[0].get_fontsize()
    labels = [text.get_text() for text in legend.get_texts()]
    drawn = dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
    pairs = zip(labels, legend.legend_handles, strict=True)
    handles = [drawn.get(label, proxy) for label, proxy in pairs]
    for columns in range(len(labels), 0, -1):
        look = {"loc": "upper right", "ncols": columns, "fontsize": size, "columnspacing": 1.0}
        flat = axes.legend(handles, labels, **look)
        if flat.get_window_extent(renderer).width + 2 * BORDER <= axes.bbox.width:
            break
    return flat


def _raise_top(axes, share):
    """Widen the scale of y at its upper end, so that a share of the panel's height is free."""
    scale = axes.yaxis.get_transform()
    low, high = scale.transform(np.array(axes.get_ylim()))
    axes.set_ylim(top=float(scale.inverted().transform(low + (high - low) / (1.0 - share))))


def _drawn(axes, renderer):
    """What a panel shows: (path or box [point], whether its inside counts)."""
    shapes = []
    for line in axes.get_lines():
        if line.get_visible() and line.get_zorder() >= SHADES and len(line.get_xdata()):
            path = line.get_transform().transform_path(line.get_path())
            points = line.get_linestyle() in ("None", "none", " ", "")
            shapes.append((path.vertices if points else path, False))
    for patch in axes.patches:
        if patch.get_visible() and patch.get_zorder() >= SHADES:
            shapes.append((patch.get_transform().transform_path(patch.get_path()), True))
    for one in axes.collections:
        if not one.get_visible() or one.get_zorder() < SHADES:
            continue
        if isinstance(one, PathCollection):
            shapes.append((one.get_offset_transform().transform(one.get_offsets()), False))
        elif isinstance(one, QuadMesh):
            shapes.append((axes.bbox, True))
        else:
            filled = bool(len(one.get_facecolor()))
            shapes += [(one.get_transform().transform_path(p), filled) for p in one.get_paths()]
    texts = [text for text in axes.texts if isinstance(text, Text) and text.get_text()]
    return shapes + [(text.get_window_extent(renderer), True) for text in texts]


def _hidden(shapes, box):
    """Whether a box covers anything of shapes."""
    for shape, filled in shapes:
        if isinstance(shape, np.ndarray):
            if box.count_contains(shape):
                return True
        elif isinstance(shape, Bbox) or hasattr(shape, "x0"):
            if box.overlaps(shape):
                return True
        elif shape.intersects_bbox(box, filled=filled):
            return True
    return False
