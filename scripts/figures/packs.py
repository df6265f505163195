"""Figures of packs: branch currents, how they part, capacity lost, weakest cell, four ways."""

import numpy as np

from cellwright.packs.uncertainty.bands import WITHIN_90_PERCENT
from figures import style

NAMED_BRANCHES = 6  # more are drawn as a band, with the worst of them by name
NAMED_CELLS = 12  # of those that were lowest, by their time
APART_VOLT = 0.005  # highest less lowest cell: where they are nearer, none is told to be the lowest
WAYS = {
    "reference": "the reference's model as it is",
    "scaled": "the reference's, scaled by capacity",
    "bias": "bias-corrected",
    "own": "own pulses",
}
LOOKS = dict(zip(WAYS, ("s", "^", "o", "."), strict=True))


def draw_pack(series, scores, test):
    """Branch currents of parallel cells: those of the models over the measured ones.

    `series` are columns of stage `pack_series`, `scores` rows of `pack`.
    """
    figure, axes = style.subplots(3, 1, height=5.4, sharex=True, height_ratios=[3, 2, 2])
    current, residual, voltage = axes[:, 0]
    hours = series["test_time_second"] / 3600
    # More lines than this cannot be told apart; the worst ones are what a reader asks for.
    shown = sorted(scores, key=lambda row: -row["current_rmse_ampere"])[:NAMED_BRANCHES]
    if len(scores) > len(shown):
        shown = shown[:3]
        _band(current, hours, [_branch(series, row["branch"]) for row in scores])
    for row in sorted(shown, key=lambda row: row["branch"]):
        colour = style.SERIES[shown.index(row) % len(style.SERIES)]
        measured, simulated = _branch(series, row["branch"])
        label = f"{row['cell']}: RMSE {1e3 * row['current_rmse_ampere']:.0f} mA"
        style.plot_thinned(current, hours, measured, color=colour, linewidth=0.6, alpha=0.6)
        style.plot_thinned(current, hours, simulated, color=colour, linewidth=1.2, label=label)
        error = 1e3 * (measured - simulated)
        style.plot_thinned(residual, hours, error, color=colour, linewidth=0.7)
        _interval(residual, hours, series, row["branch"], colour)
    style.shade_unscored(residual, hours, series["scored"])
    measured, simulated = series["voltage_volt"], series["simulated_voltage_volt"]
    label = f"simulated: RMSE {1e3 * scores[0]['voltage_rmse_volt']:.0f} mV"
    style.plot_thinned(voltage, hours, measured, color=style.MEASURED, label="measured")
    style.plot_thinned(voltage, hours, simulated, color=style.ERROR, linewidth=0.8, label=label)
    current.set(ylabel="current [A]", title=f"{test}: branch currents (pale: measured)")
    dotted = "dotted: 90 %; " if "voltage_std_volt" in series else ""
    title = f"Measured − simulated ({dotted}grey: fitted, not scored)"
    residual.set(ylabel="residual [mA]", title=title)
    voltage.set(ylabel="voltage [V]", xlabel="time [h]")
    style.legend_once(current)
    style.legend_once(voltage)
    return figure


def _branch(series, branch):
    """Measured and simulated current of a branch (n,) [A]."""
    name = f"branch_{branch}_current_ampere"
    return series[name], series[f"simulated_{name}"]


def _interval(axes, hours, series, branch, colour):
    """Limits of 90 % about the simulated current, dotted, where it is known how sure it is."""
    std = series.get(f"branch_{branch}_current_std_ampere")
    if std is None:
        return
    for sign in (-1.0, 1.0):
        edge = 1e3 * sign * WITHIN_90_PERCENT * std
        style.plot_thinned(axes, hours, edge, color=colour, linewidth=0.6, linestyle=":")


def _band(axes, hours, pairs):
    """All branches as bands: measured grey, simulated outlined."""
    measured, simulated = (np.array(part) for part in zip(*pairs, strict=True))
    for edge in (np.min, np.max):
        look = {"color": style.QUIET, "lw": 0.5}
        style.plot_thinned(axes, hours, edge(measured, axis=0), label="all, measured", **look)
        look = {"color": style.INK, "lw": 0.5, "ls": ":"}
        style.plot_thinned(axes, hours, edge(simulated, axis=0), label="all, simulated", **look)


def draw_pack_spread(spread, findings, test):
    """How branch currents part over SoC, their error there, and the capacity that they cost.

    `spread` are columns of stage `pack_spread`, `findings` the row of `pack_findings`.
    """
    whole = np.isfinite(findings["group_capacity_ampere_hour"])
    figure, axes = style.subplots(1, 3 if whole else 2, width=10.5, height=3.3)
    share, error = axes[0, :2]
    soc = 50 * (spread["soc_low"] + spread["soc_high"])
    for name, label, colour in (
        ("largest_share", "largest branch", style.SERIES[1]),
        ("spread", "largest less smallest", style.SERIES[0]),
    ):
        share.plot(soc, 100 * spread[name], "o", ms=3, color=colour, label=f"{label}, measured")
        simulated = 100 * spread[f"simulated_{name}"]
        share.plot(soc, simulated, lw=1.0, color=colour, label=f"{label}, simulated")
    error.plot(soc, 100 * spread["relative_current_rmse"], "o-", ms=3, color=style.ERROR)
    for panel in (share, error):
        panel.set(xlabel="SoC of the group [%]", xlim=(102, -2), ylim=(0, None))
    share.set(ylabel="[% of the mean branch current]", title=f"{test}: how currents part")
    error.set(ylabel="[% of the mean branch current]", title="RMS error of all branches")
    style.legend_once(share, fontsize=7)
    if whole:
        _capacity_of_group(axes[0, 2], findings)
    return figure


def _capacity_of_group(axes, findings):
    """From the sum of the cells to what the group gave, and what of it lies above 15 % SoC."""
    group = findings["group_capacity_ampere_hour"]
    used = group * (1.0 - findings["last_15_soc_charge_share"])
    names = ["sum of the cells", "the group gives", "above 15 % SoC"]
    values = [findings["cells_capacity_ampere_hour"], group, used]
    _falling(axes, names, values)
    simulated = findings["simulated_group_capacity_ampere_hour"]
    axes.plot([simulated], [1], "D", ms=4, color=style.INK)
    axes.set_title(f"At {findings['current_c_rate']:.2g}C (◆ simulated: {simulated:.2f} Ah)")


def _falling(axes, names, values):
    """Bars from above downwards, each with what is lost from the one before."""
    for place, (value, before) in enumerate(zip(values, [values[0], *values[:-1]], strict=True)):
        axes.barh(place, value, height=0.62, color=style.SERIES[0], alpha=0.75)
        less = max(before - value, 0.0)
        axes.barh(place, less, left=value, height=0.62, color=style.ERROR, alpha=0.35)
        lost = f" ({100 * (value / values[0] - 1):+.1f} %)" if place else ""
        axes.text(0.02 * values[0], place, f"{value:.2f} Ah{lost}", va="center", fontsize=7.5)
    style.name_bars(axes, names, fontsize=8)
    axes.set(xlabel="charge [Ah]", xlim=(0, 1.02 * max(values)))


def draw_series_pack(waterfall, cells, test):
    """From the cells' capacities to what a string gives, and when each cell is empty.

    `waterfall` are rows of stage `series_pack_waterfall`, `cells` of `series_pack_cells`.
    """
    height = max(3.0, 0.8 + 0.33 * len(waterfall))
    figure, axes = style.subplots(1, 2, width=10.5, height=height, width_ratios=[1.2, 1.0])
    known = [row for row in waterfall if np.isfinite(row["ampere_hour"])]
    _falling(axes[0, 0], [row["stage"] for row in known], [row["ampere_hour"] for row in known])
    axes[0, 0].set_title(f"{test}: from the cells to the pack")
    _ends(axes[0, 1], cells)
    return figure


def _ends(axes, cells):
    """Charge of the string at which each cell is empty, sorted; the first ones by name."""
    known = sorted(
        (row for row in cells if np.isfinite(row["margin_ampere_hour"])),
        key=lambda row: row["margin_ampere_hour"],
    )
    margins = [row["margin_ampere_hour"] for row in known]
    axes.plot(margins, range(len(known)), "o", ms=3, color=style.SERIES[0])
    if len(known) <= NAMED_CELLS:
        style.name_bars(axes, [row["cell"] for row in known], fontsize=8)
    else:
        first = ", ".join(row["cell"] for row in known[:5])
        axes.text(0.97, 0.95, f"first: {first}", transform=axes.transAxes, ha="right", va="top")
        axes.set(ylabel="cells, the first to be empty on top [1]")
    axes.set(xlabel="charge beyond the string's end [Ah]")
    axes.set_title("When each cell is empty")
    axes.set_ylim(len(known) - 0.5, -0.5)


def draw_weakest(series, test):
    """The weakest cell over time: the lowest and highest cell, which it is, the spread of SoC.

    `series` are columns of stage `series_pack_series`.
    """
    figure, axes = style.subplots(3, 1, height=6.0, sharex=True, height_ratios=[2, 2.2, 1.6])
    volt, which, soc = axes[:, 0]
    hours = series["test_time_second"] / 3600
    for name, label, look in (
        ("measured_lowest_cell_volt", "measured", {"color": style.MEASURED, "alpha": 0.6}),
        ("measured_highest_cell_volt", "measured", {"color": style.MEASURED, "alpha": 0.6}),
        ("lowest_cell_volt", "lowest, simulated", {"color": style.ERROR, "lw": 0.8}),
        ("highest_cell_volt", "highest, simulated", {"color": style.SERIES[0], "lw": 0.8}),
    ):
        if name in series:
            style.plot_thinned(volt, hours, series[name], label=label, **look)
    _lowest(which, hours, series)
    for name, label, colour in (
        ("highest_soc", "fullest", style.SERIES[0]),
        ("mean_soc", "mean", style.INK),
        ("least_soc", "emptiest", style.ERROR),
    ):
        style.plot_thinned(soc, hours, 100 * series[name], color=colour, lw=0.9, label=label)
    volt.set(ylabel="cell voltage [V]", title=f"{test}: lowest and highest cell")
    soc.set(ylabel="SoC [%]", xlabel="time [h]", title="Spread of SoC")
    style.legend_once(volt, ncols=3)
    style.legend_once(soc, ncols=3)
    return figure


def _lowest(axes, hours, series):
    """Which cell has the lowest voltage, a row a cell, the most frequent on top."""
    simulated = np.asarray(series["lowest_cell"], str)
    measured = np.asarray(series.get("measured_lowest_cell", simulated), str)
    # Which of cells that are alike is lowest is chance, from sample to sample.
    apart = series["highest_cell_volt"] - series["lowest_cell_volt"] > APART_VOLT
    told = np.concatenate([simulated[apart], measured[apart]])
    names, counts = np.unique(told, return_counts=True)
    order = names[np.argsort(-counts)]
    shown = order[:NAMED_CELLS].tolist()
    rows = {name: place for place, name in enumerate(shown)}
    others = len(order) > len(shown)
    for seen, shift, colour, label in (
        (measured, -0.16, style.MEASURED, "measured"),
        (simulated, 0.16, style.ERROR, "simulated"),
    ):
        if label == "measured" and "measured_lowest_cell" not in series:
            continue
        places = np.array([rows.get(name, len(shown)) for name in seen], float)
        places[~apart] = np.nan
        for start, stop in _runs(places):
            at, end = places[start] + shift, hours[min(stop, len(hours) - 1)]
            axes.plot([hours[start], end], [at, at], color=colour, lw=2.2, label=label)
    style.name_bars(axes, [*shown, *(["others"] if others else [])], fontsize=7)
    axes.set_title("Which cell is lowest")
    style.legend_once(axes, ncols=2, loc="lower right")


def _runs(places):
    """First and last + 1 of stretches of one value, no NaN; of very many the 600 longest ones."""
    edges = np.flatnonzero(np.diff(np.nan_to_num(places, nan=-1.0))) + 1
    starts, stops = np.append(0, edges), np.append(edges, len(places))
    told = np.isfinite(places[starts])
    starts, stops = starts[told], stops[told]
    # Thousands of short stretches are a grey bar and a file of megabytes.
    longest = np.sort(np.argsort(starts - stops)[:600])
    return list(zip(starts[longest], stops[longest], strict=True))


def draw_nested_pack(series, scores, test):
    """A pack of groups in groups: its voltage, and the channels with the largest errors.

    `series` are columns of stage `nested_pack_series`, `scores` rows of `nested_pack`.
    """
    kinds = [kind for kind in ERRORS if any(row["channel"] == kind for row in scores)]
    figure, axes = style.subplots(1, 1 + len(kinds), width=11.0, height=3.4)
    hours = series["test_time_second"] / 3600
    style.plot_thinned(axes[0, 0], hours, series["voltage_volt"], color=style.MEASURED)
    look = {"color": style.ERROR, "lw": 0.8}
    style.plot_thinned(axes[0, 0], hours, series["simulated_voltage_volt"], **look)
    whole = next(row for row in scores if row["channel"] == "pack voltage")
    axes[0, 0].set(xlabel="time [h]", ylabel="voltage of the pack [V]")
    axes[0, 0].set_title(f"{test}: RMSE {1e3 * whole['rmse']:.3g} mV (red: simulated)")
    for panel, kind in zip(axes[0, 1:], kinds, strict=True):
        _worst_channels(panel, [row for row in scores if row["channel"] == kind], kind)
    return figure


ERRORS = {"branch current": "mA", "cell voltage": "mV"}


def _worst_channels(axes, rows, kind):
    """Bars of the largest errors of one kind of channel."""
    worst = sorted(rows, key=lambda row: -row["rmse"])[:NAMED_CELLS]
    axes.barh(range(len(worst)), [1e3 * row["rmse"] for row in worst], color=style.SERIES[0])
    style.name_bars(axes, [row["of"] for row in worst], fontsize=8)
    said = "the largest " if len(rows) > len(worst) else ""
    axes.set(xlabel=f"RMS error [{ERRORS[kind]}]", title=f"{kind}s: {said}errors")


def draw_ways(rows, cells):
    """Errors of the four ways to a model on tests that no fit has seen, by cell and over all.

    `rows` are those of stage `bias_ways`, `cells` the names of a group's cells in their order.
    """
    found = {way: _errors(rows, way, cells) for way in WAYS}
    found = {way: errors for way, errors in found.items() if errors}
    if not found:
        return style.message("No cell of this group has a test on which ways can be compared.")
    cells = [cell for cell in cells if any(cell in errors for errors in found.values())]
    figure, axes = style.subplots(1, 2, width=10.5, height=3.8, width_ratios=[3.0, 1.0])
    single, whole = axes[0]
    for index, (way, errors) in enumerate(found.items()):
        colour = style.SERIES[index]
        at = np.array([cells.index(cell) for cell in errors]) + 0.17 * (index - 1.5)
        mean, most = 1e3 * np.array(list(errors.values())).T
        single.vlines(at, mean, most, color=colour, lw=0.9, alpha=0.5)
        single.plot(at, mean, LOOKS[way], ms=4, color=colour, label=WAYS[way])
        limits = np.quantile(mean, [0.05, 0.5, 0.95])
        bars = [[limits[1] - limits[0]], [limits[2] - limits[1]]]
        look = {"fmt": LOOKS[way], "color": colour, "capsize": 3}
        whole.errorbar([index], [limits[1]], yerr=bars, **look)
        text = {"textcoords": "offset points", "xytext": (6, 0), "va": "center", "fontsize": 7}
        whole.annotate(f"{limits[1]:.1f}", (index, limits[1]), **text)
    step = -(-len(cells) // 25)
    single.set_xticks(range(0, len(cells), step), cells[::step], fontsize=7, rotation=60)
    single.set(ylabel="error of the voltage [mV]", yscale="log")
    style.plain_numbers(single.yaxis)
    single.set_title("Mean absolute error, bar up to the largest")
    whole.set_xticks(range(len(found)), list(found), fontsize=7, rotation=30)
    whole.set(ylabel="mean absolute error [mV]", ylim=(0, None), xlim=(-0.5, len(found) - 0.2))
    whole.set_title("Median and 5 to 95 % of cells")
    # Room for the legend above the points of a logarithmic axis.
    single.set_ylim(top=8 * single.get_ylim()[1])
    single.legend(fontsize=7, ncols=2, loc="upper left")
    return figure


def _errors(rows, way, cells):
    """Mean absolute and largest error [V] of each cell by a way, over its tests."""
    of_cell = {}
    for row in rows:
        if row["way"] == way and row["cell"] in cells and np.isfinite(row["mean_abs_volt"]):
            of_cell.setdefault(row["cell"], []).append((row["mean_abs_volt"], row["max_abs_volt"]))
    pairs = {cell: np.array(errors) for cell, errors in of_cell.items()}
    return {
        cell: (pairs[cell][:, 0].mean(), pairs[cell][:, 1].max()) for cell in cells if cell in pairs
    }
