"""Which effects the tests of a cell tell apart, and which they do not."""

import numpy as np

import figure

LEAST = 0.1  # correlation that is written out
NO_PAIR = "These tests show fewer than two effects: there is nothing to tell apart."


def draw(columns):
    """Figure of stage `missing_effect/confounding`: correlation of every pair of effects."""
    effects = list(dict.fromkeys([*columns.get("effect_a", []), *columns.get("effect_b", [])]))
    if not effects:
        return figure.message(NO_PAIR)
    matrix, same = _matrices(columns, effects)
    canvas, axes = figure.canvas(width=9.0, height=1.9 + 0.27 * len(effects))
    panel = axes[0, 0]
    edges = np.arange(len(effects) + 1)
    shown = panel.pcolormesh(edges, edges, matrix, vmin=0, vmax=1, cmap="Blues")
    for row, column in np.argwhere(matrix > LEAST):
        _cell(panel, row, column, matrix[row, column], same[row, column])
    names = [effect.replace("_", " ") for effect in effects]
    panel.set_xticks(edges[:-1] + 0.5, names, rotation=55, ha="right", fontsize=7.5)
    panel.set_yticks(edges[:-1] + 0.5, names, fontsize=7.5)
    panel.invert_yaxis()
    panel.grid(visible=False)
    panel.set(title="How alike two effects look in the tests that were fitted (framed: the same)")
    canvas.colorbar(shown, ax=panel, label="correlation [1]: 0 different, 1 the same", pad=0.01)
    return canvas


def _matrices(columns, effects):
    """Correlation of each pair (n, n), NaN above the diagonal, and whether they are one class."""
    matrix = np.full((len(effects),) * 2, np.nan)
    same = np.zeros(matrix.shape, bool)
    pairs = zip(columns["effect_a"], columns["effect_b"], strict=True)
    for k, pair in enumerate(pairs):
        first, second = sorted(effects.index(name) for name in pair)
        matrix[second, first] = columns["correlation"][k]
        same[second, first] = columns["same_class"][k]
    return matrix, same


def _cell(panel, row, column, value, same):
    """The number of a pair, and a frame where the two cannot be told apart."""
    colour = "white" if value > 0.6 else figure.INK
    spot = column + 0.5, row + 0.5
    panel.annotate(f"{value:.2f}", spot, ha="center", va="center", fontsize=5.5, color=colour)
    if same:
        frame = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) + [column, row]
        panel.plot(*frame.T, color=figure.ERROR, lw=1.3)
