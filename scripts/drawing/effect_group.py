"""The figures of the search in a parallel group: its branches on tests for proof, and ranking."""

import numpy as np

import figure
from drawing import effect_ranking

SHOWN = 3  # tests
POINTS = 1200  # of a line
LABELS = {"before": "healthy cells within the declared spread", "after": "with what was found"}
COLOURS = {"before": figure.SERIES[1], "after": figure.SERIES[0]}


def draw(name, parts, gates):
    """Figure `name` of one group; parts: content of its artefacts, gates: of the search."""
    if name == "ranking":
        return effect_ranking.draw(_placed(parts["ranking"]), gates)
    return branches(parts["verdict"], parts["series"])


def _placed(ranking):
    """The ranking with each effect named together with its branch."""
    if not ranking:
        return ranking
    pairs = zip(ranking["effect"], ranking["branch"], strict=True)
    names = [f"{effect.removeprefix('branch_')} of branch {branch}" for effect, branch in pairs]
    return ranking | {"effect": np.array(names, object)}


def branches(verdict, series):
    """Each branch's current (the group's voltage, where none was logged) over what models say."""
    proof = series["role"] == "validation"
    tests = list(dict.fromkeys(series["test"][proof].tolist()))
    shown = tests[:SHOWN]
    panels = _panels(series)
    found = verdict["effects"] or verdict["partial"]
    models = ["before", "after"] if found else ["before"]
    canvas, axes = figure.canvas(
        2 * len(panels), len(shown), width=7.6 if len(shown) == 1 else 3.8 * len(shown),
        height=2.6 * len(panels) + 0.6, height_ratios=[3, 2] * len(panels),
    )  # fmt: skip
    for column, test in enumerate(shown):
        rows = proof & (series["test"] == test)
        one = {key: values[rows] for key, values in series.items()}
        for place, panel in enumerate(panels):
            title = f"{test}: {panel[0]}" if place == 0 else panel[0]
            _panel(axes[2 * place : 2 * place + 2, column], one, (title, *panel[1:]), models)
        axes[-1, column].set(xlabel="time [h]")
    canvas.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return canvas


def _panels(series):
    """(name, measured column, column of each model, factor, unit) of what was logged."""
    count = sum(name.startswith("soc_branch_") for name in series)
    own = [
        (f"branch {k}", f"branch_{k}_current_ampere", f"{{}}_branch_{k}_current_ampere", "A", "mA")
        for k in range(1, count + 1)
    ]
    whole = [("the group", "voltage_volt", "{}_volt", "V", "mV")]
    return own if own[0][1] in series else whole


def _panel(axes, one, panel, models):
    name, measured, modelled, unit, small = panel
    value, error = axes
    hours = one["test_time_second"] / 3600
    quantity = "current" if unit == "A" else "voltage"
    drawn = figure.thin(hours, one[measured], points=POINTS)
    value.plot(*drawn, color=figure.MEASURED, label="measured")
    sizes = []
    for model in models:
        said = one[modelled.format(model)]
        left = 1e3 * (one[measured] - said)
        style = {"color": COLOURS[model], "lw": 0.9}
        value.plot(*figure.thin(hours, said, points=POINTS), **style, label=LABELS[model])
        error.plot(*figure.thin(hours, left, points=POINTS), **style)
        sizes.append(f"{np.sqrt(np.mean(left**2)):.3g}")
    value.set(ylabel=f"{quantity} [{unit}]", title=name)
    error.set(ylabel=f"left [{small}]", title=f"RMS left: {' → '.join(sizes)} {small}")
    value.tick_params(labelbottom=False)
