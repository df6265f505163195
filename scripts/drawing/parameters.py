"""The identified parameters of a model over SoC, one colour per temperature."""

import numpy as np

import figure

TIMES = {"after 10 s": 10.0, "after 100 s": 100.0, "settled": np.inf}  # of a small step of current
MIDDLE = 0.5  # SoC at which resistances are drawn over their time constants


def draw(model):
    """Figure of the parameters of a model's chosen member.

    Charge transfer is not among the resistances over time constants: the part of it that no sample
    resolves has none, and would dwarf the rest.
    """
    member = next(m for m in model["members"] if m["model"] == model["chosen"])
    kinds = {branch.get("kind", "RC") for branch in member["conditions"][0]["branches"]}
    draws = {"R0": _r0}
    draws |= {"Charge transfer": _transfer} if "kinetic" in kinds else {}
    draws |= {f"Resistance {name}": _after(second) for name, second in TIMES.items()}
    draws |= {f"RC pairs at {100 * MIDDLE:g} % SoC": _pairs, "Correction of the OCV": _shift}
    draws |= {"Hysteresis, either way": _hysteresis} if "hysteresis" in kinds else {}
    canvas, axes = figure.canvas(2, (len(draws) + 1) // 2, height=4.8)
    canvas.suptitle(f"Member {model['chosen']}, resistance at small currents", x=0.01, ha="left")
    for panel, (title, one) in zip(axes.flat, draws.items(), strict=False):
        panel.set(xlabel="SoC [%]", ylabel="[mΩ]", title=title)
        for condition in member["conditions"]:
            one(panel, condition, _style(condition))
    for panel in axes.flat[len(draws) :]:
        panel.axis("off")
    figure.legend_once(axes[0, 0], fontsize=7)
    return canvas


def _style(condition):
    celsius = condition["ambient_temperature_celsius"]
    label = figure.temperature_label(celsius)
    return {"color": figure.temperature_colour(celsius), "label": label}


def _r0(panel, condition, style):
    _line(
        panel, 100 * _numbers(condition["soc"]), condition["r0_ohm"], condition["r0_std_ohm"], style
    )
    panel.set_ylim(bottom=0)


def _transfer(panel, condition, style):
    total = sum(_numbers(b["r_ohm"]) for b in _of_kind(condition, "kinetic"))
    _dots(panel, condition, total, style)
    panel.set_ylim(bottom=0)


def _after(second):
    """Voltage over current at a time after a small step of the current."""

    def one(panel, condition, style):
        found = _numbers(condition["r0_ohm"])
        found = sum((_numbers(b["r_ohm"]) for b in _of_kind(condition, "charge_transfer")), found)
        for branch in _of_kind(condition, "RC", "kinetic"):
            share = -np.expm1(-second / _numbers(branch["tau_second"]))
            found = found + share * _numbers(branch["r_ohm"])
        _dots(panel, condition, found, style)
        panel.set_ylim(bottom=0)

    return one


def _pairs(panel, condition, style):
    pairs = _of_kind(condition, "RC")
    tau, r, std = (
        [np.interp(MIDDLE, condition["soc"], _numbers(pair[name])) for pair in pairs]
        for name in ("tau_second", "r_ohm", "r_std_ohm")
    )
    _line(panel, tau, r, std, style)
    panel.set(xlabel="time constant [s]", xscale="log")


def _shift(panel, condition, style):
    nothing = np.zeros(len(condition["soc"]))
    _dots(panel, condition, _numbers(condition.get("ocv_shift_volt", nothing)), style)
    panel.set_ylabel("[mV]")


def _hysteresis(panel, condition, style):
    (branch,) = _of_kind(condition, "hysteresis")
    soc = 100 * _numbers(condition["soc"])
    _line(panel, soc, branch["m_volt"], branch["m_std_volt"], style)
    panel.set_ylabel("[mV]")


def _of_kind(condition, *kinds):
    return [branch for branch in condition["branches"] if branch.get("kind", "RC") in kinds]


def _numbers(values):
    return np.array(values, dtype=float)


def _dots(panel, condition, values, style):
    panel.plot(100 * _numbers(condition["soc"]), 1e3 * values, ".-", **style)


def _line(panel, x, values, spreads, style):
    spreads = 1e3 * np.nan_to_num(_numbers(spreads))
    shape = {"fmt": "o-", "markersize": 3, "capsize": 2}
    panel.errorbar(x, 1e3 * _numbers(values), yerr=spreads, **shape, **style)
