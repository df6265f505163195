"""Where model and measurement disagree: tests and currents over SoC, before and after."""

import numpy as np

import figure

RATES = {
    "rest": "rest",
    "discharge_low": "discharge, slow",
    "discharge_high": "discharge, fast",
    "charge_low": "charge, slow",
    "charge_high": "charge, fast",
}
WIDE = 12  # most bins of SoC into which a number fits
DIGITS = 6  # to which edges of bins are the same
COMMON = 97  # percentile at which the colours end
COLOURS = "YlOrRd"
ROLES = {"fit": "fitted", "validation": "proof"}
SIDES = {"before": "Plain model", "after": "With what was found missing"}


def draw(columns):
    """Figure of stage `missing_effect/map`: RMS residual [mV], one colour scale for both sides."""
    found = dict(sorted(_lines(columns).items()))
    edges = np.unique(np.round([*columns["soc_low"], *columns["soc_high"]], DIGITS))
    sides = {side: 1e3 * _matrix(columns, found, edges, f"{side}_rms_volt") for side in SIDES}
    top = max(np.nanpercentile(np.concatenate(list(sides.values())), COMMON), 1e-3)
    canvas, axes = figure.canvas(1, 2, height=1.4 + 0.2 * len(found), sharey=True)
    for panel, (side, matrix) in zip(axes[0], sides.items(), strict=True):
        shown = panel.pcolormesh(100 * edges, np.arange(len(found) + 1), matrix, vmin=0, vmax=top,
                                 cmap=COLOURS, linewidth=0)  # fmt: skip
        panel.set(title=SIDES[side], xlabel="state of charge [%]")
        panel.grid(visible=False)
        _numbers(panel, edges, matrix, top)
        _between(panel, [name[1] for name in found])
    axes[0, 0].set_yticks(np.arange(len(found)) + 0.5, list(found.values()), fontsize=7.5)
    axes[0, 0].invert_yaxis()
    label = "RMS of measured − model [mV]"
    canvas.colorbar(shown, ax=list(axes[0]), label=label, pad=0.01, extend="max")
    return canvas


def _lines(columns):
    """Rows of the map: (validation?, test, number of the rate) → label."""
    order = list(RATES)
    rows = zip(columns["role"], columns["test"], columns["rate"], strict=True)
    return {
        (role != "fit", f"{test}", order.index(rate)): f"{test} ({ROLES[role]}): {RATES[rate]}"
        for role, test, rate in rows
    }


def _matrix(columns, found, edges, name):
    """Residual of each line and bin of SoC (lines, bins), NaN where nothing was measured."""
    place = {line: k for k, line in enumerate(found)}
    order, squares = list(RATES), np.zeros((len(found), len(edges) - 1))
    counts = np.zeros_like(squares)
    for k, rows in enumerate(columns["rows"]):
        line = columns["role"][k] != "fit", f"{columns['test'][k]}", order.index(columns["rate"][k])
        bin_ = int(np.searchsorted(edges, np.round(columns["soc_low"][k], DIGITS)))
        squares[place[line], bin_] += rows * columns[name][k] ** 2
        counts[place[line], bin_] += rows
    with np.errstate(invalid="ignore"):
        return np.sqrt(squares / counts)


def _numbers(panel, edges, matrix, top):
    if len(edges) - 1 > WIDE:
        return
    middles = 50 * (edges[1:] + edges[:-1])
    for row, column in np.argwhere(np.isfinite(matrix)):
        size = matrix[row, column]
        colour = "white" if size > 0.6 * top else figure.INK
        panel.annotate(f"{size:.1f}", (middles[column], row + 0.5), ha="center", va="center",
                       fontsize=6, color=colour)  # fmt: skip


def _between(panel, tests):
    """A line between one test and the next."""
    for k in range(1, len(tests)):
        if tests[k] != tests[k - 1]:
            panel.axhline(k, color=figure.QUIET, linewidth=0.6)
