"""Legends: where nothing is drawn, or in room that their panel makes for them."""

import numpy as np
import pytest

from figures import canvas, legends, style


def laid_out(figure):
    figure.dpi = 72
    figure.get_layout_engine().execute(figure)
    return figure.axes


def is_free(axes):
    shapes = [shape for one in axes for shape in legends._drawn(one, canvas.MEASURING)]
    boxes = [one.get_legend().get_window_extent(canvas.MEASURING) for one in axes]
    return [not legends._hidden(shapes, box) for box in boxes]


def noisy(axes, **look):
    x = np.linspace(0, 1, 4000)
    axes.plot(x, np.sin(900 * x) + 2.0, label="everywhere", **look)


def test_a_legend_goes_to_a_corner_without_data_and_the_panel_stays_as_it_is():
    figure, axes = style.subplots()
    axes[0, 0].plot([0, 1], [0, 1], label="rising")
    axes[0, 0].legend(loc="upper right")
    before = axes[0, 0].get_ylim()
    assert is_free(laid_out(figure)) == [True]
    assert axes[0, 0].get_ylim() == before


@pytest.mark.parametrize("scale", ["linear", "log"])
@pytest.mark.parametrize("inverted", [False, True])
def test_a_panel_full_of_data_makes_room_above_it(scale, inverted):
    figure, axes = style.subplots()
    noisy(axes[0, 0])
    axes[0, 0].set_yscale(scale)
    if inverted:
        axes[0, 0].invert_yaxis()
    style.legend_once(axes[0, 0])
    low, high = sorted(axes[0, 0].get_ylim())
    assert is_free(laid_out(figure)) == [True]
    now = sorted(axes[0, 0].get_ylim())
    assert now[0] <= low
    assert now[1] >= high
    assert axes[0, 0].yaxis_inverted() == inverted


def test_a_legend_is_off_bars_bands_points_texts_and_a_second_scale():
    figure, axes = style.subplots(2, 2, height=6.0)
    x = np.linspace(0, 1, 60)
    axes[0, 0].bar(np.arange(9), 1.0, width=1.0, label="bars")
    axes[0, 1].fill_between([0, 1], [0, 0], [1, 1], label="band")
    axes[1, 0].scatter(*np.meshgrid(x, x), label="points")
    axes[1, 1].plot([0, 1], [0, 0], label="flat")
    noisy(axes[1, 1].twinx())
    for panel in axes.flat:
        style.legend_once(panel)
    with_legend = [one for one in laid_out(figure) if one.get_legend()]
    shapes = [s for one in figure.axes for s in legends._drawn(one, canvas.MEASURING)]
    for one in with_legend:
        box = one.get_legend().get_window_extent(canvas.MEASURING)
        assert not legends._hidden(shapes, box), one.get_legend_handles_labels()[1]


def test_where_a_scale_must_stay_the_legend_stands_beside_the_panel():
    figure, axes = style.subplots()
    noisy(axes[0, 0])
    axes[0, 0].set_aspect("equal")
    style.legend_once(axes[0, 0])
    (panel,) = laid_out(figure)
    assert panel.get_legend().get_window_extent(canvas.MEASURING).x0 >= panel.bbox.x1
