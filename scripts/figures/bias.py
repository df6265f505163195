"""Figure: four ways to the models of cells, and what more calibrating cells bring."""

import numpy as np
from matplotlib.ticker import MaxNLocator

from cellwright.numerics.statistics import rms
from figures import style

WAYS = {"reference": "x", "scaled": "s", "bias": "o", "own": "D"}
WORDS = {
    "reference": "reference",
    "scaled": "scaled",
    "bias": "corrected",
    "own": "own pulses",
}


def draw_bias(types):
    """Error of each cell by four ways, and over the number of calibrating cells, a row a type.

    `types` : (name of the type, rows of its stage `bias_ways`) each.
    """
    figure, axes = style.subplots(len(types), 2, width=10.5, height=3.6 * len(types))
    for (left, right), (name, rows) in zip(axes, types, strict=True):
        _by_cell(left, rows, name)
        _by_count(right, rows, name)
    return figure


def errors_of(rows, way, count=None):
    """Root mean square error [mV] over the tests of each cell, by a way and a number of cells."""
    by_cell = {}
    for row in rows:
        if row["way"] == way and count in (None, row["calibrating_cells"]):
            by_cell.setdefault(row["cell"], []).append(row["rmse_volt"])
    return {cell: 1e3 * rms(own) for cell, own in by_cell.items()}


def _by_cell(axes, rows, name):
    found = {way: errors_of(rows, way) for way in WAYS}
    # By the way that is judged here, so that its worst cells are on the right.
    order = sorted(found["bias"], key=found["bias"].get)
    for (way, marker), colour in zip(WAYS.items(), style.SERIES, strict=False):
        values = [found[way][cell] for cell in order]
        label = f"{WORDS[way]}: mean {np.mean(values):.3g} mV"
        axes.plot(range(len(order)), values, marker, ms=4, ls="", color=colour, label=label)
    step = -(-len(order) // 20)
    axes.set_xticks(range(0, len(order), step), order[::step], rotation=60, fontsize=7)
    axes.set(ylabel="RMS error of the voltage [mV]", yscale="log")
    axes.set_ylim(top=axes.get_ylim()[1] * 5)  # room for the legend
    style.plain_numbers(axes.yaxis)
    axes.set_title(f"{name}: tests that no fit has seen")
    axes.legend(fontsize=7, ncols=2, loc="upper left")


def _by_count(axes, rows, name):
    counts = sorted({row["calibrating_cells"] for row in rows if row["way"] == "bias_of_few"})
    groups = [(count, errors_of(rows, "bias_of_few", count)) for count in counts]
    most = max(row["calibrating_cells"] for row in rows if row["way"] == "bias")
    groups += [(most, errors_of(rows, "bias"))] if most not in counts else []
    # Quantiles: a single cell with a bad test would make all bars as long.
    limits = np.array([np.quantile(list(e.values()), [0.05, 0.5, 0.95]) for _, e in groups])
    at = [count for count, _ in groups]
    bars = [limits[:, 1] - limits[:, 0], limits[:, 2] - limits[:, 1]]
    colours = dict(zip(WAYS, style.SERIES, strict=False))
    look = {"fmt": "o-", "color": colours["bias"], "capsize": 3}
    axes.errorbar(
        at, limits[:, 1], yerr=bars, label="corrected: median, 5 to 95 % of cells", **look
    )
    for way in ("scaled", "own"):
        level = np.median(list(errors_of(rows, way).values()))
        axes.axhline(level, ls="--", lw=1, color=colours[way], label=f"{WORDS[way]}, median")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set(xlabel="calibrating cells", ylabel="RMS error of the voltage [mV]", ylim=(0, None))
    axes.set_ylim(top=axes.get_ylim()[1] * 1.35)
    axes.set_title(f"{name}: calibrating cells drawn at random")
    axes.legend(fontsize=7, loc="upper right")
