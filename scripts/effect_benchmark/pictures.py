"""Figures of a scored benchmark: hidden against answered, and power against strength."""

import numpy as np

from effect_benchmark import tables
from figures import style

STRENGTHS = (1.0, 2.5, 6.0)
WORDS = {"right": "named right", "content": "named right, or rightly silent"}
ACROSS = 5  # panels beside each other


def confusion(table):
    """Counts of cells: hidden class (rows) against the first answer (columns)."""
    counts = tables.confusion(table)
    rows, columns = counts.shape
    drawn, axes = style.subplots(width=2.6 + 0.31 * columns, height=2.3 + 0.27 * rows)
    axes = axes[0, 0]
    shares = counts.to_numpy(float) / counts.sum(axis=1).to_numpy(float)[:, None]
    axes.imshow(shares, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for (row, column), number in np.ndenumerate(counts.to_numpy()):
        if number:
            ink = "white" if shares[row, column] > 0.6 else style.INK
            look = {"ha": "center", "va": "center", "fontsize": 7.5, "color": ink}
            axes.text(column, row, str(number), **look)
    axes.set_xticks(range(columns), _plain(counts.columns), rotation=90)
    axes.set_yticks(range(rows), _plain(counts.index))
    axes.grid(False)
    axes.set(xlabel="first answer", ylabel="hidden", title="Cells by what was hidden and said")
    return drawn


def power(table):
    """Share of cells named right over the strength, one panel an effect, 95 % Wilson bars."""
    rows = tables.power(table)
    names = list(dict.fromkeys(row["effect"] for row in rows))
    down = max(-(-len(names) // ACROSS), 1)
    drawn, axes = style.subplots(
        down, ACROSS, width=10.5, height=1.9 * down, sharex=True, sharey=True
    )
    for panel, name in zip(axes.flat, names, strict=False):
        _panel(panel, name, [row for row in rows if row["effect"] == name])
    for panel in axes.flat[len(names) :]:
        panel.set_visible(False)
    known = drawn.axes[0].get_legend_handles_labels()
    drawn.legend(*known, loc="outside upper right", ncols=2)
    for panel in axes[:, 0]:
        panel.set_ylabel("share [%]")
    for panel in axes[-1]:
        panel.set_xlabel("strength [mV]")
    return drawn


def _panel(axes, name, rows):
    """All cells, and the open marks: right or rightly silent."""
    for key, colour, mark, shift in (
        ("content", style.QUIET, "o", 1.06),
        ("right", "#0b6fb8", "s", 1),
    ):
        shares = [row[key] for row in rows]
        at = np.array([row["strength_millivolt"] for row in rows]) * shift
        value = np.array([100 * one.share for one in shares])
        low, high = 100 * np.array([one.interval for one in shares]).T
        reach = [np.maximum(value - low, 0), np.maximum(high - value, 0)]
        open_mark = {"markerfacecolor": "white"} if key == "content" else {}
        look = {"color": colour, "capsize": 2, "label": WORDS[key]} | open_mark
        axes.errorbar(at, value, yerr=reach, fmt=mark, **look)
    dynamic = rows[0]["dynamic"]
    axes.set_title(
        name.replace("_", " "), fontsize=7.5, color=style.INK if dynamic else style.QUIET
    )
    axes.set_xscale("log")
    axes.set_xticks(STRENGTHS, [f"{s:g}" for s in STRENGTHS])
    axes.minorticks_off()
    axes.set(ylim=(-4, 104), xlim=(0.7, 9))


def _plain(names):
    return [str(name).replace("_", " ") for name in names]
