"""Measured voltage, and models without and with the effects found, on tests kept for proof."""

import numpy as np

import figure

SHOWN = 3  # tests
CLOSE_HOUR = 0.1  # length of the close look
POINTS = 1200  # of a line
GAP_HOUR = 0.2
PLAIN, FULL = figure.SERIES[1], figure.SERIES[0]
LABELS = {"before_volt": "plain model", "after_volt": "with what was missing"}
COLOURS = {"before_volt": PLAIN, "after_volt": FULL}


def draw(verdict, series):
    """Figure of the validation tests of stage `missing_effect/series`, verdict.json beside it."""
    tests = list(dict.fromkeys(series["test"][series["role"] == "validation"].tolist()))
    shown = tests[:SHOWN]
    canvas, axes = figure.canvas(
        *(2 * len(shown), 2), height=4.2 * len(shown), height_ratios=[3, 2] * len(shown),
        width_ratios=[2.2, 1],
    )  # fmt: skip
    found = verdict["effects"] or verdict["partial"]
    names = ["before_volt", "after_volt"] if found else ["before_volt"]
    for place, test in enumerate(shown):
        rows = (series["test"] == test) & (series["role"] == "validation") & series["used"]
        one = {name: values[rows] for name, values in series.items()}
        _test(axes[2 * place : 2 * place + 2], test, one, names, verdict["floor_volt"])
    if len(tests) > len(shown):
        canvas.suptitle(f"{len(shown)} of {len(tests)} tests", x=0.01, ha="left", fontsize=8)
    return canvas


def _test(axes, test, series, names, floor):
    """One test: voltage over residual; on the left all of it, on the right where it is worst."""
    hours = series["test_time_second"] / 3600
    window = _worst(hours, series["voltage_volt"] - series["before_volt"])
    for column, rows in enumerate((np.ones(len(hours), bool), window)):
        part = {name: series[name][rows] for name in ("voltage_volt", *names)}
        _voltage(axes[0, column], hours[rows], part)
        _residual(axes[1, column], hours[rows], part, floor)
        axes[0, column].sharex(axes[1, column])
        axes[0, column].tick_params(labelbottom=False)
        axes[1, column].set(xlabel="time [h]")
    axes[0, 0].set(
        ylabel="voltage [V]", title=f"{test}: voltage of a test that took no part in the fit"
    )
    axes[0, 1].set(title="Its worst six minutes")
    axes[1, 0].set(ylabel="measured − model [mV]", title=_sizes(series, names, floor))
    figure.legend_once(axes[0, 0], loc="best")


def _voltage(axes, hours, part):
    axes.plot(*_line(hours, part["voltage_volt"]), color=figure.MEASURED, label="measured")
    for name in list(part)[1:]:
        axes.plot(*_line(hours, part[name]), color=COLOURS[name], lw=0.9, label=LABELS[name])


def _residual(axes, hours, part, floor):
    axes.axhspan(-1e3 * floor, 1e3 * floor, color=figure.GRID, zorder=0)
    for name in list(part)[1:]:
        error = 1e3 * (part["voltage_volt"] - part[name])
        axes.plot(*_line(hours, error), color=COLOURS[name], lw=0.7, alpha=0.85)


def _sizes(series, names, floor):
    """RMS of what is left, in words."""
    sizes = [1e3 * np.sqrt(np.mean((series["voltage_volt"] - series[n]) ** 2)) for n in names]
    words = [f"{LABELS[n]} {size:.2f} mV" for n, size in zip(names, sizes, strict=True)]
    return f"What is left, RMS: {', '.join(words)} (grey: noise floor {1e3 * floor:.2f} mV)"


def _worst(hours, error):
    """Rows of the stretch in which the mean square of the error is largest."""
    stop = np.searchsorted(hours, hours + CLOSE_HOUR)
    total = np.concatenate([[0.0], np.cumsum(error**2)])
    mean = (total[stop] - total[:-1]) / np.maximum(stop - np.arange(len(hours)), 1)
    whole = hours + CLOSE_HOUR <= hours[-1]
    first = int(np.argmax(np.where(whole, mean, -1.0)))
    return (hours >= hours[first]) & (hours <= hours[first] + CLOSE_HOUR)


def _line(hours, values):
    """Points of a line that stays open where nothing was recorded, or the rows are not shown."""
    late = np.concatenate([[False], np.diff(hours) > GAP_HOUR])
    return figure.thin(hours, np.where(late, np.nan, values), points=POINTS)
