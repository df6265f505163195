"""Tests for proof with models before and after the search for a missing effect."""

import numpy as np

from cellwright.numerics.statistics import rms
from figures import style
from figures.columns import rows_where

MOST_TESTS = 3
POINTS = 1200  # of a line
COLOURS = {"before": style.SERIES[1], "after": style.SERIES[0]}

OF_CELL = {"before": "plain model", "after": "with what was missing"}
CLOSE_HOUR = 0.1  # length of the close look
GAP_HOUR = 0.2  # without a row, at which a line stays open

OF_GROUP = {"before": "healthy cells within the declared spread", "after": "with what was found"}


def _models(verdict):
    """Models that are drawn: the one after the search only where it found something."""
    return ["before", "after"] if verdict["effects"] or verdict["partial"] else ["before"]


def _tests_for_proof(series):
    return list(dict.fromkeys(series["test"][series["role"] == "validation"].tolist()))


def draw_effect_validation(verdict, series):
    """Measured voltage of a cell, and models without and with the effects found, on proof tests.

    `verdict` and `series` are verdict.json and series.parquet of `missing_effect/<cell>`.
    """
    tests = _tests_for_proof(series)
    shown = tests[:MOST_TESTS]
    figure, axes = style.subplots(
        2 * len(shown),
        2,
        height=4.2 * len(shown),
        height_ratios=[3, 2] * len(shown),
        width_ratios=[2.2, 1],
    )
    for upper, lower, test in zip(axes[::2], axes[1::2], shown, strict=True):
        rows = (series["test"] == test) & (series["role"] == "validation") & series["used"]
        one = rows_where(series, rows)
        _whole_and_worst(upper, lower, test, one, _models(verdict), verdict["floor_volt"])
    if len(tests) > len(shown):
        figure.suptitle(f"{len(shown)} of {len(tests)} tests", x=0.01, ha="left", fontsize=8)
    return figure


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
    sizes = [1e3 * rms(series["voltage_volt"] - series[f"{model}_volt"]) for model in models]
    told = [f"{OF_CELL[model]} {size:.2f} mV" for model, size in zip(models, sizes, strict=True)]
    title = f"What is left, RMS: {', '.join(told)} (grey: noise floor {1e3 * floor:.2f} mV)"
    lower[0].set(ylabel="measured − model [mV]", title=title)
    style.legend_once(upper[0], loc="best")


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
    whole = hours + CLOSE_HOUR <= hours[-1]
    first = int(np.argmax(np.where(whole, mean, -1.0)))
    return (hours >= hours[first]) & (hours <= hours[first] + CLOSE_HOUR)


def _line(axes, hours, values, **look):
    """A line that stays open where nothing was recorded, or the rows are not shown."""
    late = np.concatenate([[False], np.diff(hours) > GAP_HOUR])
    style.plot_thinned(axes, hours, np.where(late, np.nan, values), points=POINTS, **look)


def draw_effect_branches(verdict, series):
    """Each branch's current (the group's voltage, where none was logged) over what models say.

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
        one = rows_where(series, (series["role"] == "validation") & (series["test"] == test))
        for upper, lower, panel in zip(column[::2], column[1::2], panels, strict=True):
            _branch(upper, lower, one, panel, _models(verdict))
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
