"""Circuits of pulses over SoC by identification method, their error, spread and evaluations."""

import numpy as np

from cellwright.identification.methods.comparison import METHODS, NAMES
from figures import style

LABELS = {
    "genetic": "genetic algorithm",
    "autoregressive": "autoregressive form",
    "rest_exponentials": "exponentials of the rest",
    "lmfit": "lmfit",
    "separable": "separable least squares",
}
UNITS = {"ohm": (1e3, "mΩ"), "second": (1.0, "s")}
MARKS = dict(zip(METHODS, ("s", "x", "^", "o", "."), strict=True))
COLOURS = dict(zip(METHODS, (style.SERIES[k] for k in (1, 2, 3, 0, 4)), strict=True))
SIZES = dict(zip(METHODS, (4, 4, 4, 6, 4), strict=True))


def draw_identification_methods(rows):
    """Figure of a cell: rows of stage `identification_methods`."""
    known = [row for row in rows if np.isfinite(row["r0_ohm"])]
    if not known:
        return style.message("No pulse was identified by any method.")
    figure, axes = style.subplots(2, 4, width=12.0, height=5.6)
    celsius = _shown_temperature(known)
    mine = [row for row in known if _celsius(row) == celsius]
    panels = axes.flat
    for name in NAMES:
        _over_soc(next(panels), mine, name)
    error = next(panels)
    _over_soc(error, mine, "rmse_volt")
    _spread(next(panels), known)
    _work(next(panels), known)
    axes[0, 0].set_title(f"R0 at {style.temperature_label(celsius)}")
    handles, labels = error.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(METHODS))
    return figure


def _celsius(row):
    celsius = row["ambient_temperature_celsius"]
    return celsius if np.isfinite(celsius) else None


def _shown_temperature(rows):
    """The temperature nearest 25 °C, at which the courses over SoC are drawn."""
    stated = [_celsius(row) for row in rows if _celsius(row) is not None]
    return min(stated, key=lambda one: abs(one - 25.0), default=None)


def _over_soc(axes, rows, name):
    """A column of the table over SoC, one mark a method, with its deviations where it has some."""
    quantity, unit = name.rsplit("_", 1)
    factor, short = UNITS.get(unit, (1e3, "mV"))
    for method in METHODS:
        mine = [r for r in rows if r["method"] == method]
        std = [factor * np.nan_to_num(r.get(f"{quantity}_std_{unit}", 0.0)) for r in mine]
        axes.errorbar(
            [100 * r["soc"] for r in mine],
            [factor * r[name] for r in mine],
            yerr=std,
            fmt=MARKS[method],
            markersize=SIZES[method],
            markerfacecolor="none" if method in ("lmfit", "genetic") else COLOURS[method],
            elinewidth=0.7,
            color=COLOURS[method],
            label=LABELS[method],
        )
    title = {"rmse": "error over pulse and rest"}.get(quantity, quantity.replace("r", "R"))
    axes.set(xlabel="SoC [%]", ylabel=f"[{short}]", title=title.replace("tau", "τ"))
    _log_where_wide(axes, [row[name] for row in rows])


def _log_where_wide(axes, values):
    positive = [value for value in values if value > 0]
    if positive and max(positive) > 8 * min(positive):
        axes.set_yscale("log")


def _spread(axes, rows):
    """Median of each parameter's scatter about its neighbours, as a share of the parameter."""
    for place, method in enumerate(METHODS):
        mine = [row for row in rows if row["method"] == method]
        shares = [_median_share(mine, name) for name in NAMES]
        at = np.arange(len(NAMES)) + 0.16 * (place - 2)
        axes.plot(at, shares, MARKS[method], color=COLOURS[method], markersize=4)
    axes.set(ylabel="[% of the value]", title="scatter about the neighbours in SoC", yscale="log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("{x:g}")
    axes.set_xticks(range(len(NAMES)), ["R0", "R1", "R2", "τ1", "τ2"])


def _median_share(rows, name):
    quantity, unit = name.split("_")
    shares = [row[f"{quantity}_spread_{unit}"] / row[name] for row in rows if row[name] > 0]
    known = [share for share in shares if np.isfinite(share)]
    return 100 * float(np.median(known)) if known else np.nan


def _work(axes, rows):
    """Median of the passes over the samples, a bar a method."""
    methods = [one for one in METHODS if any(row["method"] == one for row in rows)]
    medians = [
        np.median([row["evaluations"] for row in rows if row["method"] == one]) for one in methods
    ]
    axes.barh(range(len(methods)), medians, color=[COLOURS[one] for one in methods], height=0.6)
    axes.set_yticks(range(len(methods)), [LABELS[one] for one in methods])
    axes.set(xscale="log", xlabel="passes over the samples", title="work for one pulse")
    axes.invert_yaxis()
