"""Style of figures: the same bytes for the same data, and thinned lines that hide no extreme."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from figures import style, svg
from figures.style import evenly_spread, rows_where, thinned
from runtime import artefact


@given(st.integers(2, 5000), st.integers(0, 99))
def test_thinned_line_keeps_ends_and_extremes(length, seed):
    x, y = np.arange(length), np.random.default_rng(seed).normal(size=length)
    thin_x, thin_y = thinned(x, y, points=100)
    assert len(thin_x) <= max(104, 0) or length <= 100
    assert (thin_y.min(), thin_y.max()) == (y.min(), y.max())
    assert (thin_x[0], thin_x[-1]) == (0, length - 1)
    assert np.all(np.diff(thin_x) > 0)


def test_figure_has_the_same_bytes_twice(snakemake):
    found = []
    for _ in range(2):
        figure, axes = style.subplots()
        axes[0, 0].plot([0, 1], [1, 2], label="a")
        style.legend_once(axes[0, 0])
        with artefact.Job(snakemake("results/figures/A/x.svg")) as job:
            style.save(figure, job)
        found.append(Path("results/figures/A/x.svg").read_bytes())
    assert found[0] == found[1]
    assert b"<dc:date>" not in found[0]


@pytest.mark.parametrize("celsius", [None, np.nan])
def test_unknown_temperature_is_grey(celsius):
    assert style.temperature_colour(celsius) == style.QUIET


def test_figures_are_made_without_pyplot_so_that_none_piles_up():
    """In a process of its own, for other tests may have imported it."""
    told = "import sys; from figures import style; sys.exit('matplotlib.pyplot' in sys.modules)"
    scripts = Path(__file__).resolve().parents[2] / "scripts"
    done = subprocess.run([sys.executable, "-c", told], cwd=scripts, check=False)
    assert done.returncode == 0


@given(st.integers(1, 100), st.integers(2, 12))
def test_items_are_spread_evenly_from_the_first_to_the_last(count, most):
    places = evenly_spread(count, most)
    assert (places[0], places[-1]) == (0, count - 1)
    assert len(places) == min(count, most)
    assert np.ptp(np.diff(places)) <= 1 if len(places) > 1 else count == 1


def test_rows_are_chosen_by_mask_and_by_number():
    columns = {"a": np.array([1, 2, 3]), "b": np.array(["x", "y", "z"])}
    assert rows_where(columns, columns["a"] > 1)["b"].tolist() == ["y", "z"]
    assert rows_where(columns, [2, 0])["a"].tolist() == [3, 1]


def test_a_panel_makes_none_of_matplotlib_s_ticks_and_writes_the_labels_given():
    figure, axes = style.subplots(1, 2)
    axes[0, 0].plot([0, 1], [2, 3])
    axes[0, 1].plot([0, 1], [2, 3])
    axes[0, 1].set_xticks([0, 2], ["cold", "warm"], fontsize=7)
    drawn = svg.text_of(figure, description="test")
    made = [len(axis.majorTicks) for panel in axes[0] for axis in (panel.xaxis, panel.yaxis)]
    assert made == [0, 0, 0, 0]
    written = re.findall(r"<text[^>]*>([^<]*)</text>", drawn)
    assert {"cold", "warm"} <= set(written)
    assert axes[0, 1].get_xlim()[1] == 2.0
    assert axes[0, 1].xaxis.written == (7.0, 0.0)
    numbers = [float(label) for label in written if label not in ("cold", "warm")]
    assert min(numbers) == 0.0
    assert max(numbers) == 3.0


def test_marks_are_drawn_where_there_are_values_and_their_look_is_written_once():
    figure, axes = style.subplots()
    axes[0, 0].plot([0, 1, 2, 3], [1, np.nan, 2, 5000], "o", color="#123456")
    axes[0, 0].set_ylim(0, 3)
    drawn = svg.text_of(figure, description="test")
    marks = re.findall(r"<use ([^>]*)/>", drawn)
    assert len(marks) == 2
    assert not any("class" in mark for mark in marks)
    assert drawn.count("fill:#123456") == 1
    low, high = axes[0, 0].transData.transform([(0, 1), (2, 2)]) * (1, -1) + (0, 3.2 * 72)
    places = [re.search(r'x="([^"]*)" y="([^"]*)"', mark).groups() for mark in marks]
    np.testing.assert_allclose(np.array(places, float), [low, high], atol=0.06)
