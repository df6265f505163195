"""Layout: no text leaves the canvas, and no two texts around the panels overlap."""

import numpy as np
import pytest
from figure_panels import sound
from hypothesis import example, given, settings
from hypothesis import strategies as st

from figures import measures, style

WORDS = st.text("abc mW_°é", min_size=1, max_size=90).map(str.strip).filter(bool)


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@example("W", "WWWW WWWWWWWWWWWWW", 0.0)
@given(WORDS, WORDS, st.floats(-6, 9))
def test_texts_of_any_length_stay_on_the_canvas_and_apart(title, label, power):
    figure, axes = style.subplots(2, 3, height=5.0)
    for panel in axes.flat:
        panel.plot([0, 1], [0, 10**power])
        panel.set(title=title, xlabel=label, ylabel=label[:40])
    boxes = sound(figure)
    written = "".join(boxes).replace(" ", "")
    assert title.replace(" ", "") in written


@pytest.mark.parametrize("length", [5, 40, 120])
def test_names_of_bars_stay_on_the_canvas_with_their_numbers(length):
    figure, axes = style.subplots(1, 2)
    panel = axes[0, 1]
    for k in range(6):
        panel.barh(k, 100 - k)
        panel.annotate(" 12345 ", (100 - k, k), va="center")
    style.name_bars(panel, [f"{k}" * length for k in range(6)], fontsize=8)
    panel.set_xlim(0, 100)
    sound(figure)


def test_a_logarithmic_axis_of_less_than_a_decade_has_labels_apart_and_in_plain_signs():
    figure, axes = style.subplots(2, 2, height=4.0)
    for panel in axes.flat:
        panel.plot([2e-3, 9e-3], [2e-3, 9e-3])
        panel.set(xscale="log", yscale="log")
    boxes = sound(figure)
    assert not any("$" in text for text in boxes)
    assert any("×10⁻³" in text for text in boxes)


def test_colour_bars_and_legends_outside_keep_their_room():
    figure, axes = style.subplots(1, 2, sharey=True)
    for panel in axes.flat:
        shown = panel.pcolormesh(np.arange(4), np.arange(4), np.eye(3))
    axes[0, 0].set(ylabel="temperature [°C]", title="A")
    style.colour_bar(figure, shown, list(axes[0]), label="what the colours tell [mV]")
    handles = [axes[0, 0].plot([], [], label=f"name {k}")[0] for k in range(4)]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    sound(figure)
    (legend,) = figure.legends
    box = legend.get_window_extent()
    lowest = min(panel.bbox.y0 for panel in axes.flat)
    assert 0 <= box.y0 < box.y1 < lowest
    assert figure.axes[-1].bbox.x0 > axes[0, 1].bbox.x1


@given(st.text("ab c_Ω", max_size=60), st.floats(20, 200))
def test_broken_lines_fit_and_lose_nothing_but_spaces(text, most):
    lines = measures.wrapped(text, 9.0, most)
    assert lines.replace("\n", "").replace(" ", "") == text.replace(" ", "")
    assert all(measures.width(line, 9.0) <= most or len(line) == 1 for line in lines.split("\n"))
