"""Layout: no text leaves the canvas, and no two texts around the panels overlap."""

import pytest
from figure_panels import sound
from hypothesis import example, given, settings
from hypothesis import strategies as st

from figures import style

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
