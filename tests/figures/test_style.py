"""Style of figures: the same bytes for the same data, and thinned lines that hide no extreme."""

import subprocess
import sys
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from figures import style
from figures.style import thinned
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


def test_a_name_is_no_formula(snakemake):
    """Matplotlib takes what stands between two dollars for one, and fails at a broken one."""
    name = r"$\int_{$"
    figure, axes = style.subplots(1, 2)
    axes[0, 0].plot([1e-3, 1], [1e-5, 2], label=name)
    axes[0, 0].set(title=name, xlabel=name, xscale="log")
    axes[0, 0].text(0.5, 0.5, name)
    axes[0, 1].bar([name, "$b$"], [1, 2])
    style.legend_once(axes[0, 0])
    with artefact.Job(snakemake("results/figures/A/x.svg")) as job:
        style.save(figure, job)
    drawn = Path("results/figures/A/x.svg").read_text(encoding="utf-8")
    assert drawn.count(name) == 7, "five texts; a title and a series by which data are read"
    assert ">$b$<" in drawn
    assert "10⁻²" in drawn
    assert "mathdefault" not in drawn


def test_figures_are_made_without_pyplot_so_that_none_piles_up():
    """In a process of its own, for other tests may have imported it."""
    told = "import sys; from figures import style; sys.exit('matplotlib.pyplot' in sys.modules)"
    scripts = Path(__file__).resolve().parents[2] / "scripts"
    done = subprocess.run([sys.executable, "-c", told], cwd=scripts, check=False)
    assert done.returncode == 0
