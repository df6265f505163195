"""Figures of the search for a missing effect: residuals, effects tried, evidence, proof tests."""

from itertools import cycle, product

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from cellwright.effects.case import Gates
from cellwright.effects.groups.known import GroupGates
from cellwright.effects.story.words import name_of_effect
from cellwright.numerics.statistics import rms
from figures import style
from figures.style import rows_where

GATES, GROUP_GATES = Gates(), GroupGates()
RATES = {
    "rest": "rest",
    "discharge_low": "discharge, slow",
    "discharge_high": "discharge, fast",
    "charge_low": "charge, slow",
    "charge_high": "charge, fast",
}
ROLES = {"fit": "fitted", "validation": "validation"}
MODELS = {"before": "Plain model", "after": "With what was found missing"}
MOST_BINS = 12  # of SoC into which a number fits
DIGITS = 6  # to which edges of bins are the same
TOP_PERCENTILE = 97  # of the residuals, at which the colours end

NO_TRIAL = "No effect was fitted: there was nothing left to explain, or none that these data show."
CHOSEN, TIED, OTHER, OUT_OF_RANGE = style.SERIES[0], style.SERIES[7], "#c9d6e2", "#d5d8dc"
LABELS = {
    CHOSEN: "in the last model",
    TIED: "as good as a name",
    OTHER: "not in it",
    OUT_OF_RANGE: "a parameter at the end of its physical range",
}
HATCH = "////"

NO_EFFECT = "No effect was added to the model of this cell, so there is none to show evidence for."
LEGEND_COLUMNS = 5  # of a legend below all panels
FAR = 5.0  # times the change that 95 % of the parts stay below: farther ones are not drawn
MARKERS = "os^"  # of records, where they are more than colours


def draw_residual_map(columns):
    """RMS residual [mV] of each test and current over SoC, before and after, on one colour scale.

    `columns` are those of `missing_effect/<cell>/map`.
    """
    names = dict(sorted(_lines(columns).items()))
    edges = np.unique(np.round([*columns["soc_low"], *columns["soc_high"]], DIGITS))
    sizes = {
        model: 1e3 * _rms_of_bins(columns, names, edges, f"{model}_rms_volt") for model in MODELS
    }
    # One bad bin at the edge of SoC would else turn all others pale.
    top = max(np.nanpercentile(np.concatenate(list(sizes.values())), TOP_PERCENTILE), 1e-3)
    # Where nothing was found both are one and the same.
    found = not np.array_equal(sizes["before"], sizes["after"], equal_nan=True)
    shown_models = list(sizes.items())[: 1 + found]
    figure, axes = style.subplots(1, len(shown_models), height=1.4 + 0.2 * len(names), sharey=True)
    look = {"vmin": 0, "vmax": top, "cmap": "YlOrRd", "linewidth": 0}
    for panel, (model, left) in zip(axes[0], shown_models, strict=True):
        shown = panel.pcolormesh(100 * edges, np.arange(len(names) + 1), left, **look)
        panel.set(title=MODELS[model], xlabel="state of charge [%]")
        panel.grid(visible=False)
        if len(edges) - 1 <= MOST_BINS:
            _write_numbers(panel, edges, left, top)
        _separate_tests(panel, [test for _, test, _ in names])
    axes[0, 0].set_yticks(np.arange(len(names)) + 0.5, list(names.values()), fontsize=7.5)
    axes[0, 0].invert_yaxis()
    label = "RMS of measured − model [mV]"
    style.colour_bar(figure, shown, list(axes[0]), label=label, extend="max")
    return figure


def _lines(columns):
    """Lines of the map: (validation?, test, number of the rate) → label."""
    order = list(RATES)
    rows = zip(columns["role"], columns["test"], columns["rate"], strict=True)
    return {
        (role != "fit", f"{test}", order.index(rate)): f"{test} ({ROLES[role]}): {RATES[rate]}"
        for role, test, rate in rows
    }


def _rms_of_bins(columns, lines, edges, name):
    """Residual of each line and bin of SoC (lines, bins), NaN where nothing was measured."""
    index = {line: k for k, line in enumerate(lines)}
    order, squares = list(RATES), np.zeros((len(lines), len(edges) - 1))
    counts = np.zeros_like(squares)
    for k, rows in enumerate(columns["rows"]):
        line = columns["role"][k] != "fit", f"{columns['test'][k]}", order.index(columns["rate"][k])
        soc_bin = int(np.searchsorted(edges, np.round(columns["soc_low"][k], DIGITS)))
        squares[index[line], soc_bin] += rows * columns[name][k] ** 2
        counts[index[line], soc_bin] += rows
    with np.errstate(invalid="ignore"):
        return np.sqrt(squares / counts)


def _write_numbers(panel, edges, left, top):
    rows, columns = np.nonzero(np.isfinite(left))
    sizes = left[rows, columns]
    middles = 50 * (edges[1:] + edges[:-1])[columns]
    colours = np.where(sizes > 0.6 * top, "white", style.INK).tolist()
    texts = [f"{size:.1f}" for size in sizes]
    style.write_numbers(panel, middles, rows + 0.5, texts, colours=colours, size=6)


def _separate_tests(panel, tests):
    """A line between one test and the next."""
    for k in range(1, len(tests)):
        if tests[k] != tests[k - 1]:
            panel.axhline(k, color=style.QUIET, linewidth=0.6)


def draw_ranking(columns, gates=GATES):
    """Effects that were tried: how surely the model predicts better with each.

    `columns` are those of `missing_effect/<cell>/ranking`; gates : what an effect has to reach.
    """
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    if not rows:
        return style.message(NO_TRIAL)
    # Where nothing reached what is needed, all of it says so.
    drawn = [row for row in rows if _matters(row, gates)] or rows
    rounds = sorted({row["round"] for row in drawn})
    shown = {
        number: sorted((row for row in drawn if row["round"] == number), key=lambda r: -r["gain"])
        for number in rounds
    }
    sizes = [len(shown[number]) for number in rounds]
    height = 1.3 + 0.24 * sum(sizes) + 0.9 * len(rounds)
    ratios = [size + 1.0 for size in sizes]
    figure, axes = style.subplots(len(rounds), 1, height=height, height_ratios=ratios, sharex=True)
    for panel, number in zip(axes[:, 0], rounds, strict=True):
        _round(panel, shown[number], gates)
        tried = sum(row["round"] == number for row in rows)
        panel.set(title=_panel_title(number, shown[number], tried - len(shown[number])))
    ends = [row["z"] for row in rows]
    axes[0, 0].set_xlim(min(0.0, *ends) - 1.0, 1.3 * max(*ends, gates.joins) + 1.0)
    axes[-1, 0].set(xlabel="gain in predictive density over its standard error [1]")
    _ranking_legend(figure, gates)
    return figure


def draw_group_ranking(ranking):
    """As `draw_ranking` for a group: each effect named together with its branch."""
    if not ranking:
        return draw_ranking(ranking)
    pairs = zip(ranking["effect"], ranking["branch"], strict=True)
    names = [f"{name_of_effect(effect)} of branch {branch}" for effect, branch in pairs]
    return draw_ranking(ranking | {"effect": np.array(names, object)}, GROUP_GATES)


def _matters(row, gates):
    """Whether a trial is drawn: in the model, as good as it, or beyond the error that it needs."""
    return row["chosen"] or row["tied"] or row["z"] >= gates.joins


def _panel_title(number, rows, below):
    many = sum(row["chosen"] for row in rows)
    beside = "Each beside the plain model"
    if number > 1:
        beside = f"Each beside the other effects of the last model ({many} in it)"
    return f"{beside}; {below} below what is needed are not drawn" if below else beside


def _in_words(effect):
    """Short name of an effect; of a group's that stands with its branch in words already, that."""
    return effect if " " in effect else name_of_effect(effect)


def _round(panel, rows, gates):
    for position, row in enumerate(rows):
        hatch = None if row["in_range"] else HATCH
        panel.barh(
            position, row["z"], height=0.7, color=_colour(row), hatch=hatch, edgecolor="white"
        )
        where = {"xytext": (3, 0), "textcoords": "offset points", "va": "center"}
        spot = max(row["z"], gates.joins), position
        text = f"gain {row['gain']:.1f}, by ranks {row['rank_z']:.1f}".replace("-", "−")
        panel.annotate(text, spot, **where, fontsize=7)
    panel.axvline(gates.joins, color=style.ERROR, lw=0.9, ls="--")
    panel.axvline(0.0, color=style.QUIET, lw=0.8)
    style.name_bars(panel, [name_of_effect(row["effect"]) for row in rows], fontsize=8)


def _colour(row):
    if row["chosen"]:
        return CHOSEN
    if not row["in_range"]:
        return OUT_OF_RANGE
    return TIED if row["tied"] else OTHER


def _ranking_legend(figure, gates):
    keys = [Patch(facecolor=c, edgecolor="white", label=text) for c, text in LABELS.items()]
    keys[-1].set_hatch(HATCH)
    label = f"needed: {gates.joins:g} standard errors; for a name {gates.counts:g} by ranks"
    gate = Line2D([], [], color=style.ERROR, lw=0.9, ls="--", label=label)
    figure.legend(handles=[*keys, gate], loc="outside lower center", ncols=2, fontsize=7.5)


def draw_evidence(columns):
    """What was left of each part of the records that follows an effect, over what it changes [mV].

    One panel an effect, in order of addition; `columns` are those of
    `missing_effect/<cell>/evidence`: the parts by which the search chose it.
    """
    effects = list(dict.fromkeys(np.asarray(columns.get("effect", [])).tolist()))
    if not effects:
        return style.message(NO_EFFECT)
    figure, axes = style.panels(len(effects), across=2, height=4.2)
    tests = dict.fromkeys(columns["test"])
    looks = dict(zip(tests, cycle(product(MARKERS, style.SERIES)), strict=False))
    for panel, effect in zip(axes, effects, strict=True):
        own = rows_where(columns, columns["effect"] == effect)
        _residual_over_change(panel, effect, own, looks)
    # One legend for all panels, below them: a record has the same mark wherever it is part.
    named = {}
    for panel in axes:
        handles, labels = panel.get_legend_handles_labels()
        named |= dict(zip(labels, handles, strict=True))
    look = {"loc": "outside lower center", "ncols": LEGEND_COLUMNS, "fontsize": 7}
    figure.legend(named.values(), named.keys(), **look)
    return figure


def _residual_over_change(panel, effect, columns, looks):
    change, missing = 1e3 * columns["sensitivity_volt"], 1e3 * columns["residual_volt"]
    # Where a model without the effect runs empty it errs by volts, which would hide all else.
    near = change <= FAR * np.percentile(change, 95)
    far = np.count_nonzero(~near)
    beyond = f"; {far} not drawn, at up to {change.max() / 1e3:.2g} V" if far else ""
    change, missing, columns = change[near], missing[near], rows_where(columns, near)
    rows = columns["rows"]
    ends = np.array([0.0, 1.05 * change.max()])
    panel.plot(ends, ends, color=style.INK, lw=1.2, label="all of it was missing")
    panel.plot(ends, ends / 2, color=style.INK, lw=0.9, ls=":", label="below: worse with it")
    panel.axhline(0.0, color=style.QUIET, lw=1.0, ls="--", label="none of it was")
    for test in dict.fromkeys(columns["test"]):
        (marker, colour), mine = looks[test], columns["test"] == test
        area = 90 * rows[mine] / rows.max() + 4
        look = {"color": colour, "marker": marker, "alpha": 0.75, "label": test}
        panel.scatter(change[mine], missing[mine], area, **look)
    helped = np.count_nonzero(missing > change / 2)
    share = np.sum(rows * missing) / np.sum(rows * change)
    panel.set(
        title=f"{name_of_effect(effect)}: {100 * share:.0f} % of it was missing\n"
        f"better with it: {helped} of {len(change)} parts{beyond}",
        xlabel="its change in a part of a record, RMS [mV]",
        ylabel="what was left there that follows it [mV]",
    )


MOST_TESTS = 3
POINTS = 1200  # of a line
COLOURS = {"before": style.SERIES[1], "after": style.SERIES[0]}

OF_CELL = {"before": "plain model", "after": "with what was missing"}
CLOSE_HOUR = 0.1  # length of the close look
GAP_HOUR = 0.2  # without a row, at which a line stays open

OF_GROUP = {"before": "healthy cells within the declared spread", "after": "with what was found"}


def _models(verdict):
    """Names of the drawn models: the one after the search only where it found an effect."""
    return ["before", "after"] if verdict["effects"] or verdict["partial"] else ["before"]


def _tests_for_proof(series):
    return list(dict.fromkeys(series["test"][series["role"] == "validation"].tolist()))


def draw_effect_validation(verdict, series):
    """Measured voltage of a cell, and models without and with the effects found, on proof tests.

    Of many tests those are shown that the model without effects fails most. Errors count the rows
    that the verdict's count; its own, over all these tests together, stand on top.

    `verdict` and `series` are verdict.json and series.parquet of `missing_effect/<cell>`.
    """
    tests = _tests_for_proof(series)
    judging = (series["role"] == "validation") & series["used"]
    counted = judging & np.asarray(series.get("counted", series["used"]), bool)
    error = np.where(judging, series["voltage_volt"] - series["before_volt"], np.nan)
    errors = {test: rms(error[counted & (series["test"] == test)]) for test in tests}
    # The largest errors of the plain model: there an effect has something to explain.
    worst = sorted(tests, key=errors.get, reverse=True)[:MOST_TESTS]
    shown = [test for test in tests if test in worst]
    figure, axes = style.subplots(
        2 * len(shown),
        2,
        height=4.2 * len(shown),
        height_ratios=[3, 2] * len(shown),
        width_ratios=[2.2, 1],
    )
    floors = {row["test"]: row["volt"] for row in verdict.get("floors", ())}
    for upper, lower, test in zip(axes[::2], axes[1::2], shown, strict=True):
        samples = rows_where(series | {"counted": counted}, judging & (series["test"] == test))
        floor = floors.get(test, verdict["floor_volt"])
        _whole_and_worst(upper, lower, test, samples, _models(verdict), floor)
    style.legend_once(axes[0, 0])  # colours are the same in all panels
    parts = _together(verdict, tests)
    if len(tests) > len(shown):
        parts.append(f"{len(shown)} of {len(tests)} tests, with the largest error")
    if parts:
        figure.suptitle("; ".join(parts), x=0.01, ha="left", fontsize=8)
    return figure


def _together(verdict, tests):
    """The verdict's own errors, over all its tests for proof, in words; none where it has none."""
    errors = verdict.get("validation_rmse_volt")
    if not errors:
        return []
    sizes = [f"{OF_CELL[model]} {1e3 * errors[model]:.3g} mV" for model in _models(verdict)]
    over = f"over all {len(tests)} tests together" if len(tests) > 1 else "over the test"
    return [f"RMS {over}, as in the text: {', '.join(sizes)}"]


def _whole_and_worst(upper, lower, test, series, models, floor):
    """One test, voltage over residual: all of it, and the minutes where it is worst."""
    series = series | {"hours": series["test_time_second"] / 3600}
    worst = _worst(series["hours"], series["voltage_volt"] - series["before_volt"])
    for voltage, residual, part in zip(
        upper, lower, (series, rows_where(series, worst)), strict=True
    ):
        _voltage(voltage, part, models)
        _residual(residual, part, models, floor)
        voltage.sharex(residual)
        voltage.tick_params(labelbottom=False)
        residual.set(xlabel="time [h]")
    title = f"{test}: voltage of a test that took no part in the fit"
    upper[0].set(ylabel="voltage [V]", title=title)
    upper[1].set(title="Its worst six minutes")
    own = rows_where(series, series["counted"])
    sizes = [1e3 * rms(own["voltage_volt"] - own[f"{model}_volt"]) for model in models]
    errors = [f"{OF_CELL[model]} {size:.3g} mV" for model, size in zip(models, sizes, strict=True)]
    title = f"Residual, RMS of this test: {', '.join(errors)} (grey: floor {1e3 * floor:.2g} mV)"
    lower[0].set(ylabel="measured − model [mV]", title=title)


def _voltage(axes, series, models):
    hours, measured = series["hours"], series["voltage_volt"]
    _line(axes, hours, measured, color=style.MEASURED, label="measured")
    for model in models:
        look = {"color": COLOURS[model], "lw": 0.9, "label": OF_CELL[model]}
        _line(axes, hours, series[f"{model}_volt"], **look)


def _residual(axes, series, models, floor):
    axes.axhspan(-1e3 * floor, 1e3 * floor, color=style.GRID, zorder=0)
    for model in models:
        error = 1e3 * (series["voltage_volt"] - series[f"{model}_volt"])
        _line(axes, series["hours"], error, color=COLOURS[model], lw=0.7, alpha=0.85)


def _worst(hours, error):
    """Rows of the stretch in which the mean square of the error is largest."""
    stop = np.searchsorted(hours, hours + CLOSE_HOUR)
    total = np.concatenate([[0.0], np.cumsum(error**2)])
    mean = (total[stop] - total[:-1]) / np.maximum(stop - np.arange(len(hours)), 1)
    # A stretch that the record's end cuts short would win with a few bad samples.
    whole = hours + CLOSE_HOUR <= hours[-1]
    first = int(np.argmax(np.where(whole, mean, -1.0)))
    return (hours >= hours[first]) & (hours <= hours[first] + CLOSE_HOUR)


def _line(axes, hours, values, **look):
    """A line that stays open where nothing was recorded, or the rows are not shown."""
    # A line across a gap would look as if something had been measured there.
    late = np.concatenate([[False], np.diff(hours) > GAP_HOUR])
    style.plot_thinned(axes, hours, np.where(late, np.nan, values), points=POINTS, **look)


def draw_effect_branches(verdict, series):
    """Measured and simulated current of each branch; the group's voltage where none was logged.

    `verdict` and `series` are verdict.json and series.parquet of `missing_effect/<group>`.
    """
    shown = _tests_for_proof(series)[:MOST_TESTS]
    panels = _panels_of_group(series)
    figure, axes = style.subplots(
        2 * len(panels),
        len(shown),
        width=7.6 if len(shown) == 1 else 3.8 * len(shown),
        height=2.6 * len(panels) + 0.6,
        height_ratios=[3, 2] * len(panels),
    )
    for column, test in zip(axes.T, shown, strict=True):
        samples = rows_where(series, (series["role"] == "validation") & (series["test"] == test))
        for upper, lower, panel in zip(column[::2], column[1::2], panels, strict=True):
            _branch(upper, lower, samples, panel, _models(verdict))
        column[0].set(title=f"{test}: {panels[0][0]}")
        column[-1].set(xlabel="time [h]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _panels_of_group(series):
    """(name, measured column, column of each model, quantity, unit, its thousandth)."""
    count = sum(name.startswith("soc_branch_") for name in series)
    currents = [f"branch_{k}_current_ampere" for k in range(1, count + 1)]
    if currents[0] in series:
        return [
            (f"branch {k}", name, f"{{}}_{name}", "current", "A", "mA")
            for k, name in enumerate(currents, 1)
        ]
    return [("the group", "voltage_volt", "{}_volt", "voltage", "V", "mV")]


def _branch(upper, lower, series, panel, models):
    name, measured, modelled, quantity, unit, thousandth = panel
    hours, values = series["test_time_second"] / 3600, series[measured]
    style.plot_thinned(upper, hours, values, points=POINTS, color=style.MEASURED, label="measured")
    sizes = []
    for model in models:
        expected = series[modelled.format(model)]
        error = 1e3 * (values - expected)
        look = {"points": POINTS, "color": COLOURS[model], "lw": 0.9}
        style.plot_thinned(upper, hours, expected, **look, label=OF_GROUP[model])
        style.plot_thinned(lower, hours, error, **look)
        sizes.append(f"{rms(error):.3g}")
    upper.set(ylabel=f"{quantity} [{unit}]", title=name)
    title = f"RMS left: {' → '.join(sizes)} {thousandth}"
    lower.set(ylabel=f"left [{thousandth}]", title=title)
    upper.tick_params(labelbottom=False)
