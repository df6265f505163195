"""Figures of models: parameters, validation, SoC."""

from itertools import cycle

import numpy as np

from cellwright.circuits.model_file import std_of_r0
from cellwright.numerics.statistics import rms
from figures import style
from figures.style import thinned

TIMES = {"after 10 s": 10.0, "after 100 s": 100.0, "settled": np.inf}  # of a small step of current
HYSTERESIS = {"hysteresis", "preisach"}  # kinds of branch
MIDDLE_SOC = 0.5  # at which resistances are drawn over their time constants
BAR = 0.38  # height


def draw_parameters(model):
    """Parameters of a model's chosen member over SoC, one colour a temperature.

    `model` is the content of a model file. Charge transfer is not among the resistances over time
    constants: the part of it that no sample resolves has none, and would dwarf the rest.
    """
    member = next(m for m in model["members"] if m["model"] == model["chosen"])
    kinds = {branch.get("kind", "RC") for branch in member["conditions"][0]["branches"]}
    panels = {"R0": _r0}
    panels |= {"Charge transfer": _charge_transfer} if "kinetic" in kinds else {}
    # Single RC pairs trade resistance for time constant between fits; their sum after a time is
    # what a user sees, and what stays the same.
    panels |= {f"Resistance {name}": _resistance_after(second) for name, second in TIMES.items()}
    panels |= {f"RC pairs at {100 * MIDDLE_SOC:g} % SoC": _rc_pairs}
    corrected = any(np.any(one.get("ocv_shift_volt", ())) for one in member["conditions"])
    panels |= {"Correction of the OCV": _ocv_shift} if corrected else {}
    panels |= {"Hysteresis, either way": _hysteresis} if kinds & HYSTERESIS else {}
    figure, axes = style.subplots(2, (len(panels) + 1) // 2, height=4.8)
    figure.suptitle(f"Member {model['chosen']}, resistance at small currents", x=0.01, ha="left")
    for panel, (title, plot) in zip(axes.flat, panels.items(), strict=False):
        panel.set(xlabel="SoC [%]", ylabel="[mΩ]", title=title)
        for condition in member["conditions"]:
            plot(
                panel, condition, style.temperature_style(condition["ambient_temperature_celsius"])
            )
    style.hide(axes.flat[len(panels) :])
    style.legend_once(axes[0, 0], fontsize=7)
    return figure


def _r0(panel, condition, look):
    soc = 100 * _numbers(condition["soc"])
    _with_spread(panel, soc, condition["r0_ohm"], std_of_r0(condition), look)
    panel.set_ylim(bottom=0)


def _charge_transfer(panel, condition, look):
    total = sum(_numbers(b["r_ohm"]) for b in _of_kind(condition, "kinetic"))
    _over_soc(panel, condition, total, look)
    panel.set_ylim(bottom=0)


def resistance_after(condition, second):
    """Voltage over current at a time after a small step of the current [Ω], over the SoC knots."""
    ohm = _numbers(condition["r0_ohm"])
    ohm = sum((_numbers(b["r_ohm"]) for b in _of_kind(condition, "charge_transfer")), ohm)
    for branch in _of_kind(condition, "RC", "kinetic"):
        share = -np.expm1(-second / _numbers(branch["tau_second"]))
        ohm = ohm + share * _numbers(branch["r_ohm"])
    return ohm


def _resistance_after(second):
    """A panel of it over SoC."""

    def plot(panel, condition, look):
        _over_soc(panel, condition, resistance_after(condition, second), look)
        panel.set_ylim(bottom=0)

    return plot


def _rc_pairs(panel, condition, look):
    pairs = _of_kind(condition, "RC")
    tau, r, std = (
        [np.interp(MIDDLE_SOC, condition["soc"], _numbers(pair[name])) for pair in pairs]
        for name in ("tau_second", "r_ohm", "r_std_ohm")
    )
    _with_spread(panel, tau, r, std, look)
    panel.set(xlabel="time constant [s]", xscale="log")


def _ocv_shift(panel, condition, look):
    none = np.zeros(len(condition["soc"]))
    _over_soc(panel, condition, _numbers(condition.get("ocv_shift_volt", none)), look)
    panel.set_ylabel("[mV]")


def _hysteresis(panel, condition, look):
    (branch,) = _of_kind(condition, *HYSTERESIS)
    soc = 100 * _numbers(condition["soc"])
    _with_spread(panel, soc, branch["m_volt"], branch["m_std_volt"], look)
    panel.set_ylabel("[mV]")


def _of_kind(condition, *kinds):
    return [branch for branch in condition["branches"] if branch.get("kind", "RC") in kinds]


def _numbers(values):
    return np.array(values, dtype=float)


def _over_soc(panel, condition, values, look):
    panel.plot(100 * _numbers(condition["soc"]), 1e3 * values, ".-", **look)


def _with_spread(panel, x, values, std, look):
    spread = 1e3 * np.nan_to_num(_numbers(std))
    points = {"fmt": "o-", "markersize": 3, "capsize": 2}
    panel.errorbar(x, 1e3 * _numbers(values), yerr=spread, **points, **look)


def draw_compensation(fitted, proof):
    """Errors at temperatures left out of the fit, beside those of the model fitted with them.

    `fitted` and `proof` are rows of stages `compensation` and `temperature_prediction`.
    """
    height = 1.6 + 0.3 * max(len(proof), 5)
    figure, axes = style.subplots(1, 2, height=height, width=10.0)
    _error_at_temperatures(axes[0, 0], fitted)
    if proof:
        _error_of_tests(axes[0, 1], sorted(proof, key=lambda row: row["left_out_celsius"]))
    else:
        style.hide(axes[:, 1])
    return figure


def _error_at_temperatures(axes, rows):
    """Error at each temperature, fitted without it and with it, root mean square over its tests."""
    celsius = sorted({row["left_out_celsius"] for row in rows})
    for name, label, colour in (
        ("rmse_volt_soc_5_95", "left out", style.SERIES[0]),
        ("own_rmse_volt_soc_5_95", "fitted with it", style.QUIET),
    ):
        volts = [[r[name] for r in rows if r["left_out_celsius"] == t] for t in celsius]
        axes.plot(celsius, [1e3 * rms(v) for v in volts], "o-", color=colour, label=label)
    axes.set(xlabel="temperature [°C]", ylabel="RMS error, SoC 5–95 % [mV]")
    axes.set_ylim(bottom=0.0)
    axes.set_title("Tests of the fit")
    style.legend_once(axes)


def _error_of_tests(axes, rows):
    """One pair of bars a test: error of the model fitted with its temperature, and without."""
    for position, row in enumerate(rows):
        fitted, left_out = 1e3 * row["own_rmse_volt_soc_5_95"], 1e3 * row["rmse_volt_soc_5_95"]
        axes.barh(position - BAR / 2, fitted, height=BAR, color=style.QUIET)
        colour = style.temperature_colour(row["left_out_celsius"])
        hatch = "////" if row["beyond"] else None
        axes.barh(position + BAR / 2, left_out, height=BAR, color=colour, hatch=hatch)
        ratio = f" ×{row['ratio']:.2f}"
        axes.annotate(ratio, (left_out, position + BAR / 2), va="center", fontsize=7)
    names = [f"{row['predicted_test']}, {row['left_out_celsius']:g} °C" for row in rows]
    style.name_bars(axes, names, fontsize=7)
    axes.set(
        xlabel="RMS error, SoC 5–95 % [mV]",
        title="Validation tests (grey: fitted with the temperature)",
    )


NORMAL_95 = 1.96
FILTERS_WITH_INTERVAL = ("ekf", "aekf", "dual")


def draw_validation(series, scores, test):
    """Measured and simulated voltage, their residual, and the errors of all members.

    `series` are columns of stage `simulation`, `scores` rows of `validation`.
    """
    height = 5.2 + 0.16 * len(scores)
    ratios = [3, 2, 1, 0.6 + 0.25 * len(scores)]
    figure, axes = style.subplots(4, 1, height=height, height_ratios=ratios)
    voltage, residual, current, members = axes[:, 0]
    chosen = next(row for row in scores if row["chosen"])
    hours, measured = series["test_time_second"] / 3600, series["voltage_volt"]
    simulated = series[f"simulated_{chosen['model']}_volt"]
    label = f"{chosen['model']}: RMSE {1e3 * chosen['rmse_volt']:.1f} mV"
    lines = ((measured, style.MEASURED, "measured"), (simulated, style.SERIES[0], label))
    for values, colour, name in lines:
        style.plot_thinned(voltage, hours, values, color=colour, linewidth=0.8, label=name)
    error = 1e3 * (measured - simulated)
    residual.axhline(0.0, color=style.QUIET, linewidth=0.6)
    style.plot_thinned(residual, hours, error, color=style.SERIES[0], linewidth=0.7)
    title = "Measured − simulated (grey: not scored)"
    if "half_width_90_volt" in series:
        half_width = 1e3 * series["half_width_90_volt"]
        _interval(residual, hours, np.zeros(len(hours)), half_width, style.SERIES[0])
        title = "Measured − simulated, stated 90 % interval shaded (grey: not scored)"
    style.shade_unscored(residual, hours, series["scored"])
    style.plot_thinned(current, hours, series["current_ampere"], color=style.QUIET, linewidth=0.6)
    voltage.set(ylabel="voltage [V]", title=f"{test}: model over measurement")
    residual.set(ylabel="residual [mV]", title=title)
    current.set(ylabel="current [A]", xlabel="time [h]")
    # Shared by hand: the panel of errors below has an axis of its own.
    for panel in (residual, current):
        panel.sharex(voltage)
    for panel in (voltage, residual):
        panel.tick_params(labelbottom=False)
    style.legend_once(voltage, loc="lower left")
    _members(members, scores)
    return figure


def _members(axes, scores):
    """RMS error of every member, the chosen one in colour."""
    for position, row in enumerate(scores):
        colour = style.SERIES[0] if row["chosen"] else style.QUIET
        size = 1e3 * row["rmse_volt"]
        axes.barh(position, size, height=0.7, color=colour)
        axes.annotate(f" {size:.1f}", (size, position), va="center", fontsize=8)
    names = [row["model"] + (" (chosen)" if row["chosen"] else "") for row in scores]
    style.name_bars(axes, names, fontsize=8)
    axes.set(xlabel="RMS error of every member [mV]")


def draw_soc(series, scores, test):
    """Estimated state of charge over the counted one, with the filters' own intervals.

    `series` are columns of stage `soc_series`, `scores` rows of `soc`.
    """
    figure, axes = style.subplots(2, 1, height=4.6, sharex=True, height_ratios=[3, 2])
    level, error = axes[:, 0]
    hours, counted = series["test_time_second"] / 3600, 100 * series["soc"]
    style.plot_thinned(level, hours, counted, color=style.MEASURED, linewidth=1, label="counted")
    # The series is kept of the first start alone; scores of the others follow it.
    first_run = {}  # of each filter: the series that is kept
    for row in scores:
        first_run.setdefault(row["filter"], row)
    for (name, row), colour in zip(first_run.items(), cycle(style.SERIES), strict=False):
        estimated = 100 * series[f"estimated_{name}_soc"]
        look = {"color": colour, "linewidth": 0.8}
        style.plot_thinned(level, hours, estimated, **look, label=_filter_label(row))
        if name in FILTERS_WITH_INTERVAL:
            style.plot_thinned(error, hours, estimated - counted, **look)
            half_width = NORMAL_95 * (100 * series[f"std_{name}_soc"])
            _interval(error, hours, estimated - counted, half_width, colour)
    style.shade_unscored(error, hours, series["scored"])
    level.set(ylabel="SoC [%]", title=f"{test}: state of charge by filters", ylim=(-5, 105))
    error.set(ylabel="error [%]", xlabel="time [h]", ylim=(-15, 15))
    error.set_title("Estimated − counted, with 95 % intervals (grey: not scored)")
    style.legend_once(level, loc="lower left")
    return figure


def _interval(axes, hours, middle, half_width, colour):
    # A band needs both edges at the same points, which thinning chooses for each alone.
    grid = np.linspace(hours[0], hours[-1], 500)
    edges = [thinned(hours, middle + side * half_width) for side in (-1, 1)]
    low, high = (np.interp(grid, *edge) for edge in edges)
    axes.fill_between(grid, low, high, color=colour, alpha=0.15, linewidth=0)


def _filter_label(row):
    after = row["convergence_second"]
    when = "does not converge" if np.isnan(after) else f"{after:.0f} s, then"
    return f"{row['filter']}: {when} RMSE {100 * row['rmse_soc']:.1f} %"
