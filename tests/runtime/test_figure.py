"""Figures: the same for the same data, and thinned lines that hide no extreme."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import figure
from runtime import artefact


@given(st.integers(2, 5000), st.integers(0, 99))
def test_thinned_line_keeps_ends_and_extremes(length, seed):
    x, y = np.arange(length), np.random.default_rng(seed).normal(size=length)
    thin_x, thin_y = figure.thin(x, y, points=100)
    assert len(thin_x) <= max(104, 0) or length <= 100
    assert (thin_y.min(), thin_y.max()) == (y.min(), y.max())
    assert (thin_x[0], thin_x[-1]) == (0, length - 1)
    assert np.all(np.diff(thin_x) > 0)


def test_figure_has_the_same_bytes_twice(snakemake):
    found = []
    for _ in range(2):
        canvas, axes = figure.canvas()
        axes[0, 0].plot([0, 1], [1, 2], label="a")
        figure.legend_once(axes[0, 0])
        with artefact.Job(snakemake("results/figures/A/x.svg")) as job:
            figure.save(canvas, job)
        found.append(Path("results/figures/A/x.svg").read_bytes())
    assert found[0] == found[1]
    assert b"<dc:date>" not in found[0]


@pytest.mark.parametrize("celsius", [None, np.nan])
def test_unknown_temperature_is_grey(celsius):
    assert figure.temperature_colour(celsius) == figure.QUIET
