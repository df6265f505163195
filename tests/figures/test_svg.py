"""SVG of figures: the same drawing in fewer characters."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from figures import style, svg

STEP = re.compile(r"-?(?:\d+\.?\d*|\.\d+)")


def points(path):
    """Points of a path of relative lines [tenths of a point]."""
    start, _, steps = path.rstrip("z").removesuffix("h0").removeprefix("M").partition("l")
    numbers = [[round(10 * float(n)) for n in STEP.findall(part)] for part in (start, steps)]
    return np.cumsum(np.reshape(numbers[0] + numbers[1], (-1, 2)), axis=0)


COORDINATE = st.floats(-50, 2000, allow_nan=False).map(lambda x: round(x, 6))


@given(st.lists(st.tuples(COORDINATE, COORDINATE), min_size=1, max_size=60))
def test_every_point_of_a_line_is_within_half_a_tenth_of_its_place(line):
    """However long the line: each step begins at the rounded point before."""
    long = "L".join(f" {x} {y} \n" for x, y in line)
    match = re.fullmatch(r' d="([^"]*)"', f' d="M{long}"')
    found = points(svg._short_path(match)[4:-1])
    wanted = np.rint(10 * np.array(line)).astype(int)
    kept = np.concatenate([[True], np.diff(wanted, axis=0).any(axis=1)])
    assert found.tolist() == wanted[kept].tolist()


def test_a_figure_keeps_its_texts_its_provenance_and_what_is_referred_to():
    figure, axes = style.subplots()
    x = np.linspace(0.01, 9, 300)
    axes[0, 0].plot(x, np.sin(9 * x), "o-", label="a < b & c")
    axes[0, 0].set(xlabel="time [s]", xscale="log", title="Sine")
    style.legend_once(axes[0, 0])
    text = svg.text_of(figure, description='{"cell": "A"}')
    assert "a &lt; b &amp; c" in text
    assert '{"cell": "A"}' in text
    assert text == svg.text_of(figure, description='{"cell": "A"}')
    ids, named = set(re.findall(r' id="([^"]+)"', text)), set(re.findall(r"#(\w+)[\")]", text))
    assert named == ids
    assert not re.search(r" style=", text)
    classes = set(re.findall(r'class="(\w+)"', text))
    assert classes <= set(re.findall(r"\.(s\d+)\{", text))
    assert text.count("sans-serif") == 1
    placed = " ".join(re.findall(r' (?:d|x|y|transform)="([^"]*)"', text.partition("</style>")[2]))
    assert max(len(number.partition(".")[2]) for number in STEP.findall(placed)) == 1


def test_a_colour_bar_of_a_map_is_a_picture_in_its_own_group_where_the_bar_is():
    """Matplotlib draws a bar of many colours as a picture, and ends it with the next artist."""
    figure, axes = style.subplots(1, 2)
    for panel, top in zip(axes[0], (3.0, 9.0), strict=True):
        shown = panel.pcolormesh(np.arange(4), np.arange(3), np.linspace(0, top, 6).reshape(2, 3))
        panel.set(title=f"to {top:g}")
    style.colour_bar(figure, shown, list(axes[0]), label="RMS [mV]")
    text = svg.text_of(figure, description="")
    root = ElementTree.fromstring(text)  # groups that a picture cut would not be well-formed
    parents = {child: parent for parent in root.iter() for child in parent}
    (picture,) = (one for one in root.iter() if one.tag.endswith("}image"))
    around = []
    while picture in parents:
        around.append(picture := parents[picture])
    series = [one for one in around if "data-s" in one.attrib]
    assert len(series) == 1, "a picture of one series, in no other's group"
    panels = [one.get("data-panel") for one in root.iter() if "data-panel" in one.attrib]
    assert panels[:2] == ["to 3", "to 9"]
    (look,) = re.findall(r"<image [^>]*>", text)
    bar = figure.axes[-1].bbox
    x, width = (float(re.search(rf' {name}="([^"]*)"', look)[1]) for name in ("x", "width"))
    assert x == pytest.approx(bar.x0, abs=2.0)
    assert width == pytest.approx(bar.width, abs=2.0)
    assert "RMS [mV]" in text


def test_a_spike_of_one_sample_is_drawn_as_high_as_it_is():
    figure, axes = style.subplots(height=3.0)
    y = np.zeros(200_000)
    y[123_457], y[150_001] = 1.0, -1.0
    style.plot_thinned(axes[0, 0], np.arange(200_000.0), y)
    (line,) = axes[0, 0].get_lines()
    assert (line.get_ydata().max(), line.get_ydata().min()) == (1.0, -1.0)
    assert len(line.get_xdata()) < 2100
    drawn = svg.text_of(figure, description="")
    low, high = axes[0, 0].transData.transform([(0, -1), (0, 1)])[:, 1]
    paths = re.findall(r' d="(M[^"zhCM]*)"', drawn.partition("</defs>")[2])
    reach = max(np.ptp(points(path)[:, 1]) for path in paths if len(points(path)) > 4)
    assert reach == pytest.approx(10 * (high - low), abs=1.1)
