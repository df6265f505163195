"""Figure of identification methods compared on the same pulses."""

import numpy as np

from figures import style

NAMES = ("r0_ohm", "r1_ohm", "r2_ohm", "tau1_second", "tau2_second")
LABELS = {
    "genetic": "genetic algorithm",
    "autoregressive": "autoregressive form",
    "rest_exponentials": "exponentials of the rest",
    "lmfit": "lmfit",
    "separable": "separable least squares",
}
METHODS = tuple(LABELS)
IN_LEGEND = "rmse_volt"  # of which panel the legend shows the marks
UNITS = {"ohm": (1e3, "mΩ"), "second": (1.0, "s")}
MARKS = dict(zip(METHODS, ("s", "x", "^", "o", "."), strict=True))
COLOURS = dict(zip(METHODS, (style.SERIES[k] for k in (1, 2, 3, 0, 4)), strict=True))
SIZES = dict(zip(METHODS, (4, 4, 4, 6, 4), strict=True))


def draw_identification_methods(rows):
    """Figure of a cell: rows of `comparison.MethodRows`."""
    identified = [row for row in rows if np.isfinite(row["r0_ohm"])]
    if not identified:
        return style.message("No pulse was identified by any method.")
    figure, axes = style.subplots(2, 4, width=12.0, height=5.6)
    celsius = _shown_temperature(identified)
    at_celsius = [row for row in identified if _celsius(row) == celsius]
    panels = axes.flat
    for name in NAMES:
        _method_over_soc(next(panels), at_celsius, name)
    error = next(panels)
    _method_over_soc(error, at_celsius, IN_LEGEND)
    _spread(next(panels), identified)
    _work(next(panels), identified)
    axes[0, 0].set_title(f"R0 at {style.temperature_label(celsius)}")
    handles, labels = error.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(METHODS))
    return figure


def _celsius(row):
    celsius = row["ambient_temperature_celsius"]
    return celsius if np.isfinite(celsius) else None


def _shown_temperature(rows):
    """The temperature nearest 25 °C, at which the courses over SoC are drawn."""
    # All temperatures in one panel would hide how methods differ.
    stated = [_celsius(row) for row in rows if _celsius(row) is not None]
    return min(stated, key=lambda celsius: abs(celsius - 25.0), default=None)


def _method_over_soc(axes, rows, name):
    """A column of the table over SoC, one mark a method, with its deviations where it has some."""
    quantity, unit = name.rsplit("_", 1)
    factor, short = UNITS.get(unit, (1e3, "mV"))
    for method in METHODS:
        of_method = [r for r in rows if r["method"] == method]
        std = [factor * np.nan_to_num(r.get(f"{quantity}_std_{unit}", 0.0)) for r in of_method]
        # Bars of no length take as long as others: only the marks of the legend need theirs.
        with_bars = any(std) or name == IN_LEGEND
        axes.errorbar(
            [100 * r["soc"] for r in of_method],
            [factor * r[name] for r in of_method],
            yerr=std if with_bars else None,
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
    # Nearly equal values on a logarithmic axis have no readable tick.
    positive = [value for value in values if value > 0]
    if positive and max(positive) > 8 * min(positive):
        axes.set_yscale("log")


def _spread(axes, rows):
    """Median of each parameter's scatter about its neighbours, as a share of the parameter."""
    for index, method in enumerate(METHODS):
        of_method = [row for row in rows if row["method"] == method]
        shares = [_median_share(of_method, name) for name in NAMES]
        at = np.arange(len(NAMES)) + 0.16 * (index - 2)
        axes.plot(at, shares, MARKS[method], color=COLOURS[method], markersize=4)
    axes.set(ylabel="[% of the value]", title="scatter about the neighbours in SoC", yscale="log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("{x:g}")
    axes.set_xticks(range(len(NAMES)), ["R0", "R1", "R2", "τ1", "τ2"])


def _median_share(rows, name):
    quantity, unit = name.split("_")
    shares = [row[f"{quantity}_spread_{unit}"] / row[name] for row in rows if row[name] > 0]
    finite = [share for share in shares if np.isfinite(share)]
    return 100 * float(np.median(finite)) if finite else np.nan


def _work(axes, rows):
    """Median of the passes over the samples, a bar a method."""
    methods = [method for method in METHODS if any(row["method"] == method for row in rows)]
    medians = [
        np.median([row["evaluations"] for row in rows if row["method"] == method])
        for method in methods
    ]
    axes.barh(
        range(len(methods)), medians, color=[COLOURS[method] for method in methods], height=0.6
    )
    axes.set_yticks(range(len(methods)), [LABELS[method] for method in methods])
    axes.set(xscale="log", xlabel="passes over the samples", title="work for one pulse")
    axes.invert_yaxis()
