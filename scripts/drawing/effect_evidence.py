"""What each effect explains: the residual before it was added, over what it changes."""

import numpy as np

import figure

NO_EFFECT = "No effect was added to the model of this cell, so there is none to show evidence for."


def draw(columns):
    """Figure of stage `missing_effect/evidence`: one panel an effect, in order of addition."""
    effects = list(dict.fromkeys(np.asarray(columns.get("effect", [])).tolist()))
    if not effects:
        return figure.message(NO_EFFECT)
    rows = -(-len(effects) // 2)
    canvas, axes = figure.canvas(rows, min(len(effects), 2), height=4.2 * rows)
    for panel, effect in zip(axes.flat, effects, strict=False):
        mine = columns["effect"] == effect
        _panel(panel, effect, {name: values[mine] for name, values in columns.items()})
    for panel in axes.flat[len(effects) :]:
        panel.axis("off")
    return canvas


def _panel(panel, effect, columns):
    x, y = 1e3 * columns["sensitivity_volt"], 1e3 * columns["residual_volt"]
    ends = np.array([x.min(), x.max()])
    panel.plot(ends, ends, color=figure.INK, lw=1.2, label="all of it is this effect")
    panel.axhline(0.0, color=figure.QUIET, lw=1.0, ls="--", label="none of it is")
    label = f"samples, in bins of about {np.median(columns['rows']):.0f}"
    panel.plot(x, y, "o", color=figure.SERIES[0], ms=4, alpha=0.75, label=label)
    panel.set(
        title=f"{effect.replace('_', ' ')}: {_share(x, y)} of what was left",
        xlabel="what the effect changes [mV]",
        ylabel="measured − model without it [mV]",
    )
    figure.legend_once(panel, loc="best")


def _share(x, y):
    """How much of the scatter the line explains, in words."""
    scatter = np.sum(y**2)
    share = 1.0 - np.sum((y - x) ** 2) / scatter if scatter > 0 else 0.0
    return f"{100 * max(share, 0.0):.0f} %"
