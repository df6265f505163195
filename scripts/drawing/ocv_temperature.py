"""Open-circuit voltage over temperature: bias map, entropic coefficient, curves, functions."""

import numpy as np

import figure


def draw(bias, entropic, surface, functions):
    """Figure of a cell.

    `bias`, `entropic`, `surface` are columns of stages `ocv_temperature`, `ocv_entropic` and
    `ocv_surface`; `functions` rows of `ocv_functions_temperature`.
    """
    canvas, axes = figure.canvas(2, 2, height=6.2, width_ratios=[3, 2])
    _bias(axes[0, 0], bias, surface["reference_celsius"][0])
    _map(axes[0, 1], bias)
    _entropic(axes[1, 0], entropic)
    _functions(axes[1, 1], functions)
    return canvas


def _at(columns, celsius):
    here = columns["temperature_celsius"] == celsius
    return {name: values[here] for name, values in columns.items()}


def _bias(axes, columns, reference):
    for celsius in np.unique(columns["temperature_celsius"]):
        here = _at(columns, celsius)
        colour, soc = figure.temperature_colour(celsius), 100 * here["soc"]
        inside = np.where(here["tested"], 1e3 * here["bias_volt"], np.nan)
        axes.plot(soc, 1e3 * here["bias_volt"], color=colour, linewidth=0.8, linestyle=":")
        axes.plot(soc, inside, color=colour, label=f"{celsius:.0f} °C")
        axes.plot(soc, 1e3 * here["measured_bias_volt"], ".", color=colour, markersize=2)
    known = np.append(1e3 * columns["bias_volt"][columns["tested"]], 0.0)
    room = 0.3 * np.ptp(known) + 1
    axes.axhline(0, color=figure.INK, linewidth=0.6)
    axes.set(
        xlabel="SoC [%]",
        ylabel="bias [mV]",
        title=f"OCV minus that at {reference:.0f} °C (dots: read)",
        ylim=(known.min() - room, known.max() + room),
    )
    figure.legend_once(axes, ncols=2)


def _map(axes, columns):
    levels = np.unique(columns["temperature_celsius"])
    soc = 100 * _at(columns, levels[0])["soc"]
    bias = 1e3 * np.stack([_at(columns, celsius)["bias_volt"] for celsius in levels])
    tested = columns["tested"].reshape(len(levels), -1) if len(soc) else None
    shown = np.where(tested, bias, np.nan)
    reach = max(np.nanmax(np.abs(shown)), 1.0) if np.isfinite(shown).any() else 1.0
    reach = 5 * np.ceil(reach / 5)
    steps = np.linspace(-reach, reach, 21)
    filled = axes.contourf(soc, levels, shown, levels=steps, cmap="RdBu_r")
    base = np.argmin(np.nansum(np.abs(shown), axis=1))
    away = np.where(np.arange(len(levels))[:, None] == base, np.nan, shown)
    axes.contour(soc, levels, away, levels=[0.0], colors=figure.INK, linewidths=1.0)
    axes.figure.colorbar(filled, ax=axes, label="bias [mV]", ticks=np.linspace(-reach, reach, 5))
    axes.set(xlabel="SoC [%]", ylabel="temperature [°C]", title="Bias map (line: no bias)")


def _entropic(axes, columns):
    for colour, source in zip(figure.SERIES, np.unique(columns["source"]), strict=False):
        mine = columns["source"] == source
        soc = 100 * columns["soc"][mine]
        value, low, high = (
            columns[f"{name}_millivolt_per_kelvin"][mine] for name in ("entropic", "lower", "upper")
        )
        style = "o-" if len(soc) < 40 else "-"
        used = " (used)" if columns["used"][mine][0] else ""
        axes.plot(soc, value, style, color=colour, label=f"{source}{used}")
        axes.fill_between(soc, low, high, color=colour, alpha=0.2, linewidth=0)
    value = np.append(columns["entropic_millivolt_per_kelvin"], 0.0)
    middle = np.append((columns["soc"] > 0.2) & (columns["soc"] < 0.9), True)
    low, high = np.min(value[middle]), np.max(value[middle])
    room = 0.8 * (high - low) + 0.05
    axes.axhline(0, color=figure.INK, linewidth=0.6)
    axes.set(
        xlabel="SoC [%]",
        ylabel="dOCV/dT [mV/K]",
        title="Entropic coefficient and its 95 % interval",
        ylim=(low - room, high + room),
    )
    figure.legend_once(axes)


def _functions(axes, rows):
    rows = [row for row in rows if np.isfinite(row["rmse_volt"])]
    place = np.arange(len(rows))
    for offset, name, colour in (
        (-0.2, "rmse_volt", figure.QUIET),
        (0.2, "cross_validation_rmse_volt", figure.SERIES[0]),
    ):
        label = {"rmse_volt": "fitted"}.get(name, "temperature left out")
        values = [1e3 * row[name] for row in rows]
        axes.barh(place + offset, values, height=0.38, color=colour, label=label)
    names = [row["function"].removesuffix("(T)") + " ★" * row["chosen"] for row in rows]
    axes.set_yticks(place, names)
    axes.set(xlabel="RMSE [mV]", title="Functions (★ chosen)")
    figure.legend_once(axes, loc="upper center", bbox_to_anchor=(0.4, -0.15), ncols=2)
