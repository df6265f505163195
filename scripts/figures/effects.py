"""What the search for a missing effect found: residuals, effects tried, evidence, look-alikes."""

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from cellwright.effects.story.words import explained
from figures import style
from figures.columns import rows_where

RATES = {
    "rest": "rest",
    "discharge_low": "discharge, slow",
    "discharge_high": "discharge, fast",
    "charge_low": "charge, slow",
    "charge_high": "charge, fast",
}
ROLES = {"fit": "fitted", "validation": "proof"}
MODELS = {"before": "Plain model", "after": "With what was found missing"}
MOST_BINS = 12  # of SoC into which a number fits
DIGITS = 6  # to which edges of bins are the same
TOP_PERCENTILE = 97  # of the residuals, at which the colours end

NO_TRIAL = "No effect was fitted: there was nothing left to explain, or none that these data show."
CHOSEN, TIED, OTHER, OUT_OF_RANGE = style.SERIES[0], style.SERIES[7], "#c9d6e2", "#d5d8dc"
LABELS = {
    CHOSEN: "added to the model",
    TIED: "as good as that one",
    OTHER: "not added",
    OUT_OF_RANGE: "a parameter at the end of its physical range",
}
LINEAR = 100.0  # of the axis, around zero
HATCH = "////"

NO_EFFECT = "No effect was added to the model of this cell, so there is none to show evidence for."
NO_PAIR = "These tests show fewer than two effects: there is nothing to tell apart."
LEAST_WRITTEN = 0.1  # correlation that is written out


def draw_residual_map(columns):
    """RMS residual [mV] of each test and current over SoC, before and after, on one colour scale.

    `columns` are those of `missing_effect/<cell>/map`.
    """
    names = dict(sorted(_lines(columns).items()))
    edges = np.unique(np.round([*columns["soc_low"], *columns["soc_high"]], DIGITS))
    sizes = {model: 1e3 * _rms(columns, names, edges, f"{model}_rms_volt") for model in MODELS}
    top = max(np.nanpercentile(np.concatenate(list(sizes.values())), TOP_PERCENTILE), 1e-3)
    figure, axes = style.subplots(1, 2, height=1.4 + 0.2 * len(names), sharey=True)
    look = {"vmin": 0, "vmax": top, "cmap": "YlOrRd", "linewidth": 0}
    for panel, (model, rms) in zip(axes[0], sizes.items(), strict=True):
        shown = panel.pcolormesh(100 * edges, np.arange(len(names) + 1), rms, **look)
        panel.set(title=MODELS[model], xlabel="state of charge [%]")
        panel.grid(visible=False)
        if len(edges) - 1 <= MOST_BINS:
            _write_numbers(panel, edges, rms, top)
        _separate_tests(panel, [test for _, test, _ in names])
    axes[0, 0].set_yticks(np.arange(len(names)) + 0.5, list(names.values()), fontsize=7.5)
    axes[0, 0].invert_yaxis()
    label = "RMS of measured − model [mV]"
    figure.colorbar(shown, ax=list(axes[0]), label=label, pad=0.01, extend="max")
    return figure


def _lines(columns):
    """Lines of the map: (validation?, test, number of the rate) → label."""
    order = list(RATES)
    rows = zip(columns["role"], columns["test"], columns["rate"], strict=True)
    return {
        (role != "fit", f"{test}", order.index(rate)): f"{test} ({ROLES[role]}): {RATES[rate]}"
        for role, test, rate in rows
    }


def _rms(columns, lines, edges, name):
    """Residual of each line and bin of SoC (lines, bins), NaN where nothing was measured."""
    place = {line: k for k, line in enumerate(lines)}
    order, squares = list(RATES), np.zeros((len(lines), len(edges) - 1))
    counts = np.zeros_like(squares)
    for k, rows in enumerate(columns["rows"]):
        line = columns["role"][k] != "fit", f"{columns['test'][k]}", order.index(columns["rate"][k])
        soc_bin = int(np.searchsorted(edges, np.round(columns["soc_low"][k], DIGITS)))
        squares[place[line], soc_bin] += rows * columns[name][k] ** 2
        counts[place[line], soc_bin] += rows
    with np.errstate(invalid="ignore"):
        return np.sqrt(squares / counts)


def _write_numbers(panel, edges, rms, top):
    middles = 50 * (edges[1:] + edges[:-1])
    for row, column in np.argwhere(np.isfinite(rms)):
        size, spot = rms[row, column], (middles[column], row + 0.5)
        colour = "white" if size > 0.6 * top else style.INK
        look = {"ha": "center", "va": "center", "fontsize": 6, "color": colour}
        panel.annotate(f"{size:.1f}", spot, **look)


def _separate_tests(panel, tests):
    """A line between one test and the next."""
    for k in range(1, len(tests)):
        if tests[k] != tests[k - 1]:
            panel.axhline(k, color=style.QUIET, linewidth=0.6)


def draw_ranking(columns, gates):
    """Which effects were tried, how much better each makes the model, and which passed.

    `columns` are those of `missing_effect/<cell>/ranking`, `gates` the limits of the search.
    """
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    if not rows:
        return style.message(NO_TRIAL)
    rounds = sorted({row["round"] for row in rows})
    sizes = [sum(row["round"] == number for row in rows) for number in rounds]
    height = 1.3 + 0.24 * sum(sizes) + 0.9 * len(rounds)
    ratios = [size + 1.0 for size in sizes]
    figure, axes = style.subplots(len(rounds), 1, height=height, height_ratios=ratios, sharex=True)
    gate = gates["bic"] + gates["validation_chi_square"]
    for panel, number in zip(axes[:, 0], rounds, strict=True):
        mine = sorted((r for r in rows if r["round"] == number), key=lambda r: -r["j"])
        _round(panel, mine, gate)
        panel.set(title=_round_title(number, mine))
    largest = max(abs(row["j"]) for row in rows)
    axes[0, 0].set_xscale("symlog", linthresh=LINEAR)
    low = min(0.0, *(row["j"] for row in rows))
    axes[0, 0].set_xlim(2 * low - 40 if low < 0 else 0.0, 40 * max(largest, LINEAR))
    axes[-1, 0].set(xlabel="J: how much better with the effect, fit and proof together [1]")
    _ranking_legend(figure, gates)
    return figure


def draw_group_ranking(ranking, gates):
    """As `draw_ranking` for a group: each effect named together with its branch."""
    if not ranking:
        return draw_ranking(ranking, gates)
    pairs = zip(ranking["effect"], ranking["branch"], strict=True)
    names = [f"{effect.removeprefix('branch_')} of branch {branch}" for effect, branch in pairs]
    return draw_ranking(ranking | {"effect": np.array(names, object)}, gates)


def _round_title(number, rows):
    added = next((_in_words(row["effect"]) for row in rows if row["chosen"]), None)
    nothing = "nothing more to add" if number > 1 else "nothing to add"
    return f"Round {number}: " + (f"added “{added}”" if added else nothing)


def _in_words(effect):
    return effect.replace("_", " ")


def _round(panel, rows, gate):
    for place, row in enumerate(rows):
        hatch = None if row["in_range"] else HATCH
        panel.barh(place, row["j"], height=0.7, color=_colour(row), hatch=hatch, edgecolor="white")
        fit, proof = _signed(row["delta_bic"]), _signed(row["delta_validation_chi_square"])
        where = {"xytext": (3, 0), "textcoords": "offset points", "va": "center"}
        spot = max(row["j"], gate), place
        panel.annotate(f"fit {fit}, proof {proof}", spot, **where, fontsize=7)
    panel.axvline(gate, color=style.ERROR, lw=0.9, ls="--")
    panel.axvline(0.0, color=style.QUIET, lw=0.8)
    style.name_bars(panel, [_in_words(row["effect"]) for row in rows], fontsize=8)


def _signed(value):
    return f"{round(value):+,}".replace("-", "−").replace(",", "\u2009")


def _colour(row):
    if row["chosen"]:
        return CHOSEN
    if not row["in_range"]:
        return OUT_OF_RANGE
    return TIED if row["tied"] else OTHER


def _ranking_legend(figure, gates):
    keys = [Patch(facecolor=c, edgecolor="white", label=text) for c, text in LABELS.items()]
    keys[-1].set_hatch(HATCH)
    fit, proof = gates["bic"], gates["validation_chi_square"]
    label = f"gates: fit above {fit:g}, proof above {proof:g}; the line is their sum"
    gate = Line2D([], [], color=style.ERROR, lw=0.9, ls="--", label=label)
    figure.legend(handles=[*keys, gate], loc="outside lower center", ncols=2, fontsize=7.5)


def draw_evidence(columns):
    """What each effect explains: the residual before it was added, over what it changes.

    One panel an effect, in order of addition; `columns` are those of
    `missing_effect/<cell>/evidence`.
    """
    effects = list(dict.fromkeys(np.asarray(columns.get("effect", [])).tolist()))
    if not effects:
        return style.message(NO_EFFECT)
    rows, across = style.grid_of(len(effects), across=2)
    figure, axes = style.subplots(rows, across, height=4.2 * rows)
    for panel, effect in zip(axes.flat, effects, strict=False):
        _residual_over_change(panel, effect, rows_where(columns, columns["effect"] == effect))
    style.hide(axes.flat[len(effects) :])
    return figure


def _residual_over_change(panel, effect, columns):
    x, y = 1e3 * columns["sensitivity_volt"], 1e3 * columns["residual_volt"]
    ends = np.array([x.min(), x.max()])
    panel.plot(ends, ends, color=style.INK, lw=1.2, label="all of it is this effect")
    panel.axhline(0.0, color=style.QUIET, lw=1.0, ls="--", label="none of it is")
    label = f"samples, in bins of about {np.median(columns['rows']):.0f}"
    panel.plot(x, y, "o", color=style.SERIES[0], ms=4, alpha=0.75, label=label)
    share = explained(columns)[effect]
    # Below zero the verdict calls it unsure, for the same reason (`story.words.doubts`).
    alone = f"{100 * share:.0f} %" if share > 0 else "nothing"
    panel.set(
        title=f"{_in_words(effect)}:\nby itself it explains {alone} of what was left",
        xlabel="what the effect changes [mV]",
        ylabel="measured − model without it [mV]",
    )
    style.legend_once(panel, loc="best")


def draw_confounding(columns):
    """How alike any two effects look in the tests of a cell: correlation of every pair.

    `columns` are those of `missing_effect/<cell>/confounding`.
    """
    effects = list(dict.fromkeys([*columns.get("effect_a", []), *columns.get("effect_b", [])]))
    if not effects:
        return style.message(NO_PAIR)
    correlation, same = _pairs(columns, effects)
    figure, axes = style.subplots(width=9.0, height=1.9 + 0.27 * len(effects))
    panel = axes[0, 0]
    edges = np.arange(len(effects) + 1)
    shown = panel.pcolormesh(edges, edges, correlation, vmin=0, vmax=1, cmap="Blues")
    for row, column in np.argwhere(correlation > LEAST_WRITTEN):
        _pair(panel, row, column, correlation[row, column], same[row, column])
    names = [_in_words(effect) for effect in effects]
    panel.set_xticks(edges[:-1] + 0.5, names, rotation=55, ha="right", fontsize=7.5)
    panel.set_yticks(edges[:-1] + 0.5, names, fontsize=7.5)
    panel.invert_yaxis()
    panel.grid(visible=False)
    panel.set(title="How alike two effects look in the tests that were fitted (framed: the same)")
    figure.colorbar(shown, ax=panel, label="correlation [1]: 0 different, 1 the same", pad=0.01)
    return figure


def _pairs(columns, effects):
    """Correlation of each pair (n, n), NaN above the diagonal, and whether they are one class."""
    correlation = np.full((len(effects),) * 2, np.nan)
    same = np.zeros(correlation.shape, bool)
    for k, pair in enumerate(zip(columns["effect_a"], columns["effect_b"], strict=True)):
        first, second = sorted(effects.index(name) for name in pair)
        correlation[second, first] = columns["correlation"][k]
        same[second, first] = columns["same_class"][k]
    return correlation, same


def _pair(panel, row, column, value, same):
    """The number of a pair, and a frame where the two cannot be told apart."""
    colour = "white" if value > 0.6 else style.INK
    spot = column + 0.5, row + 0.5
    panel.annotate(f"{value:.2f}", spot, ha="center", va="center", fontsize=5.5, color=colour)
    if same:
        frame = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) + [column, row]
        panel.plot(*frame.T, color=style.ERROR, lw=1.3)
