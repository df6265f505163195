"""The identified parameters of a model over SoC, one colour per temperature."""

import numpy as np

import figure


def draw(model):
    """Figure of the parameters of a model's chosen member."""
    member = next(m for m in model["members"] if m["model"] == model["chosen"])
    branches = len(member["conditions"][0]["branches"])
    canvas, axes = figure.canvas(1, 2 + branches, height=2.8)
    for condition in member["conditions"]:
        celsius = condition["ambient_temperature_celsius"]
        style = {
            "color": figure.temperature_colour(celsius),
            "label": figure.temperature_label(celsius),
        }
        soc = 100 * np.array(condition["soc"])
        _line(axes[0, 0], soc, 1e3, condition["r0_ohm"], condition["r0_std_ohm"], style)
        for index, branch in enumerate(condition["branches"]):
            _line(axes[0, 1 + index], soc, 1e3, branch["r_ohm"], branch["r_std_ohm"], style)
            tau, tau_std = branch["tau_second"], branch["tau_std_second"]
            _line(axes[0, -1], soc, 1, tau, tau_std, style)
    for index, panel in enumerate(axes[0, :-1]):
        panel.set(xlabel="SoC [%]", ylabel=f"R{index} [mΩ]", title=f"R{index}")
        panel.set_ylim(bottom=0)
    axes[0, -1].set(xlabel="SoC [%]", ylabel="τ [s]", yscale="log", title="Time constants")
    figure.legend_once(axes[0, 0])
    return canvas


def _line(axes, soc, scale, values, spreads, style):
    values = scale * np.array(values, dtype=float)
    spreads = scale * np.nan_to_num(np.array(spreads, dtype=float))
    axes.errorbar(soc, values, yerr=spreads, fmt="o-", capsize=2, **style)
