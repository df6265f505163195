"""Found against true, errors cell by cell, and how often the intervals hold, as SVG texts."""

import io

import numpy as np

from figures import style
from virtual_lab.score import words

MOST_CELLS = 40
MOST_VECTORS = 1500
WIDTH = 10.5
INSIDE, OUTSIDE, NO_INTERVAL = "#0b6fb8", "#c0392b", "#5d6d7e"


def of_table(compared) -> str | None:
    """One row of two panels for each quantity of a table; None where nothing was compared."""
    kinds = [
        (name, part)
        for name, part in compared.groupby("quantity", sort=False)
        if (part["status"] == "compared").any()
    ]
    if not kinds:
        return None
    canvas, axes = style.subplots(
        len(kinds), 2, width=WIDTH, height=2.7 * len(kinds), width_ratios=[2, 3]
    )
    for (name, part), (against, cells) in zip(kinds, axes, strict=True):
        _against(against, name, part)
        _cells(cells, part)
    return _svg(canvas)


def _against(axes, name, part):
    rows = part[part["status"] == "compared"]
    unit = rows["unit"].iloc[0]
    true, found = rows["true"].to_numpy(float), rows["found"].to_numpy(float)
    low, high = min(true.min(), found.min()), max(true.max(), found.max())
    room = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    line = [low - room, high + room]
    axes.plot(line, line, color=style.QUIET, linewidth=0.8, zorder=1)
    look = {"s": 11, "linewidths": 0, "alpha": 0.7, "rasterized": len(rows) > MOST_VECTORS}
    axes.scatter(true, found, c=_colours(rows), **look)
    shown = f" [{unit}]" if unit not in ("", "1") else ""
    axes.set(xlabel=f"true{shown}", ylabel=f"found{shown}", title=words.plain(name))
    axes.set(xlim=line, ylim=line)
    axes.locator_params(nbins=5)


def _colours(rows):
    inside = rows["inside_95"]
    known = [inside.isna(), inside.isin([True])]
    return np.select(known, [NO_INTERVAL, INSIDE], default=OUTSIDE)


def _cells(axes, part):
    """Errors of each cell, its missing rows as a cross below."""
    sizes = part.assign(size=part["error"].abs()).groupby("cell")["size"].max()
    names = sorted(sizes.sort_values(ascending=False, na_position="first").index[:MOST_CELLS])
    place = {name: number for number, name in enumerate(names)}
    factor, unit = words.scaled(part["unit"].iloc[0])
    rows = part[(part["status"] == "compared") & part["cell"].isin(names)]
    at = rows["cell"].map(place).to_numpy(float) + _spread(rows)
    axes.axhline(0, color=style.QUIET, linewidth=0.8)
    look = {"s": 11, "linewidths": 0, "alpha": 0.7, "rasterized": len(rows) > MOST_VECTORS}
    axes.scatter(at, factor * rows["error"], c=_colours(rows), **look)
    lost = part[(part["status"] == "missing") & part["cell"].isin(names)]["cell"].map(place)
    below = {"transform": axes.get_xaxis_transform(), "clip_on": False, "linewidth": 0}
    if len(lost):
        axes.plot(sorted(set(lost)), np.full(lost.nunique(), 0.03), "x", color=OUTSIDE, **below)
    worst = f", the {MOST_CELLS} worst cells" if len(sizes) > MOST_CELLS else ""
    axes.set(ylabel=f"found − true{f' [{unit}]' if unit else ''}", title=f"Error{worst}")
    turn = {"rotation": 90, "fontsize": 7} if len(names) > 12 else {}
    axes.set_xticks(range(len(names)), names, **turn)
    axes.set_xlim(-0.6, len(names) - 0.4)


def _spread(rows):
    """Points of one cell beside each other, in the order of the rows."""
    number = rows.groupby("cell").cumcount()
    of = rows.groupby("cell")["cell"].transform("size")
    return (0.6 * ((number + 0.5) / of - 0.5)).to_numpy(float)


def coverage(summary) -> str | None:
    """Share of 95 % intervals that hold the truth, each with its own interval."""
    rows = summary[summary["coverage_95"].notna()]
    if not len(rows):
        return None
    rows = rows.iloc[::-1]
    canvas, axes = style.subplots(width=WIDTH, height=0.7 + 0.26 * len(rows))
    axes = axes[0, 0]
    share = 100 * rows["coverage_95"].to_numpy(float)
    low, high = (100 * rows[f"coverage_{side}"].to_numpy(float) for side in ("low", "high"))
    holds = (low <= 95) & (high >= 95)
    for good, colour in ((True, INSIDE), (False, OUTSIDE)):
        mine = np.flatnonzero(holds == good)
        reach = [np.maximum(share - low, 0)[mine], np.maximum(high - share, 0)[mine]]
        axes.errorbar(share[mine], mine, xerr=reach, fmt="o", color=colour, capsize=2)
    axes.axvline(95, color=style.INK, linewidth=0.8, linestyle="--")
    names = rows["table"] + ": " + rows["quantity"].map(words.plain)
    counts = rows["n_interval"].map("{:.0f}".format)
    axes.set_yticks(range(len(rows)), names + "  (" + counts + ")")
    axes.set(xlim=(-2, 102), xlabel="95 % intervals that hold the truth [%]")
    return _svg(canvas)


def _svg(canvas) -> str:
    text = io.StringIO()
    canvas.savefig(text, format="svg", dpi=150, metadata={"Date": None, "Creator": "Cellwright"})
    return text.getvalue()
