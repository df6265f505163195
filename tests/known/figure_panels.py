"""What tests read off a figure: its panels, and their titles, labels and lines."""

import io
import itertools
import re
from xml.etree import ElementTree

import numpy as np

from figures import canvas, measures

SOC = np.linspace(0, 1, 11)
TIME = np.arange(0.0, 7200.0, 60.0)
WITHOUT_UNIT = ("all tests", "10 s into a pulse, SoC 44–56 %", "validation tests, chosen model")
WITHOUT_UNIT += ("cycle", "R", "capacity at 1C")


def about(test="t", celsius=25.0, **facts):
    """What an artefact of a test says of itself, as far as figures read it."""
    facts = {"ambient_temperature_celsius": celsius, "cycle": None, "soc": None} | facts
    return {"wildcards": {"cell": "A", "test": test}, "params": {"test": facts}}


def rendered(figure):
    """Panels of a figure that can be written as SVG."""
    figure.savefig(io.BytesIO(), format="svg")
    return figure.get_axes()


def panels(figure):
    """The same where each axis that has a label must say its unit."""
    for panel in figure.get_axes():
        for label in (panel.get_xlabel(), panel.get_ylabel()):
            assert not label or "[" in label or label in WITHOUT_UNIT, label
    return rendered(figure)


def drawn(axes):
    """Data of the lines of a panel that hold any."""
    lines = [line.get_xydata() for line in axes.get_lines()]
    return [data for data in lines if len(data)]


def labels(axes):
    """Labels of a panel's legend."""
    return [text.get_text() for text in axes.get_legend().get_texts()]


def title(axes):
    """Title of a panel."""
    return axes.get_title(loc="left")


def columns(rows):
    """Columns of rows."""
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def law(quantity, name, *values, chosen=False, valid=(-np.inf, np.inf)):
    """Rows of a law over temperature: one a parameter."""
    limits = {"valid_from_celsius": valid[0], "valid_to_celsius": valid[1]}
    return [
        {"quantity": quantity, "law": name, "value": value, "chosen": chosen} | limits
        for value in values
    ]


def text_boxes(figure):
    """All texts of a figure's SVG: (text, box, angle [degree]).

    A box is (left, low, right, high) [point], counted from the top of the canvas.
    """
    root = ElementTree.fromstring(canvas.drawn(figure, metadata={"Date": None}))
    texts = root.iter("{http://www.w3.org/2000/svg}text")
    return [(element.text, _box(element), _angle(element)) for element in texts]


def _angle(element):
    return float(re.match(r"rotate\((\S+) ", element.get("transform", "rotate(0 "))[1])


def _box(element):
    look = dict(part.split(": ") for part in element.get("style").split("; "))
    size = float(look["font-size"].removesuffix("px"))
    wide = measures.width(element.text, size, bold=look.get("font-weight") == "bold")
    start = {"start": 0.0, "middle": -wide / 2, "end": -wide}[look["text-anchor"]]
    x, y = float(element.get("x")), float(element.get("y"))
    angle = np.deg2rad(_angle(element))
    corners = [(start + share * wide, up) for share in (0, 1) for up in (-0.72 * size, 0.2 * size)]
    at = np.array(
        [
            (a * np.cos(angle) - b * np.sin(angle), a * np.sin(angle) + b * np.cos(angle))
            for a, b in corners
        ]
    )
    return *(at.min(axis=0) + [x, y]), *(at.max(axis=0) + [x, y])


def sound(figure):
    """Texts of a figure, none of which leaves the canvas or overlaps another around a panel."""
    boxes = text_boxes(figure)
    assert outside(figure, boxes) == []
    assert touching(figure, boxes) == []
    return [text for text, *_ in boxes]


def outside(figure, boxes):
    """Texts that leave the canvas by more than half a point."""
    wide, high = figure.bbox.size
    return [
        text
        for text, (left, low, right, top), _ in boxes
        if min(left, low) < -0.5 or right > wide + 0.5 or top > high + 0.5
    ]


def touching(figure, boxes):
    """Pairs of texts around panels (titles, labels of axes and ticks) that overlap."""
    panels = [axes.bbox.extents for axes in figure.axes if axes.axison]
    panels += [legend.get_window_extent(canvas.MEASURING).extents for legend in figure.legends]
    high = figure.bbox.height
    around = [
        (text, box)
        for text, box, angle in boxes
        if angle in (0, -90) and not any(_within(box, panel, high) for panel in panels)
    ]
    return [
        (first[0], second[0])
        for first, second in itertools.combinations(around, 2)
        if _overlap(first[1], second[1])
    ]


def _within(box, panel, high):
    x, y = (box[0] + box[2]) / 2, high - (box[1] + box[3]) / 2
    return panel[0] <= x <= panel[2] and panel[1] <= y <= panel[3]


def _overlap(a, b):
    across = min(a[2], b[2]) - max(a[0], b[0])
    along = min(a[3], b[3]) - max(a[1], b[1])
    return across > 0.5 and along > 0.5
