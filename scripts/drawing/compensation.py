"""Errors at temperatures left out of the fit, beside those of the model that knows them."""

import numpy as np

import figure

WIDTH = 0.38


def draw(laws, proof):
    """Figure of a cell from rows of stages `compensation` and `temperature_prediction`."""
    canvas, axes = figure.canvas(1, 2, height=1.6 + 0.3 * max(len(proof), 5), width=10.0)
    _laws(axes[0, 0], laws)
    _proof(axes[0, 1], sorted(proof, key=lambda row: row["left_out_celsius"]))
    return canvas


def _laws(axes, rows):
    """Error of each law at each temperature left out, root mean square over its tests."""
    names = list(dict.fromkeys(row["law"] for row in rows))
    for colour, name in zip(figure.SERIES, names, strict=False):
        mine = [row for row in rows if row["law"] == name]
        celsius = sorted({row["left_out_celsius"] for row in mine})
        volts = [[r["rmse_volt"] for r in mine if r["left_out_celsius"] == t] for t in celsius]
        error = [1e3 * np.sqrt(np.mean(np.square(v))) for v in volts]
        places = {"beyond" if row["beyond"] else "between" for row in mine if row["chosen"]}
        label = f"{name} (chosen {' and '.join(sorted(places)[::-1])})" if places else name
        axes.plot(celsius, error, "o-", color=colour, label=label)
    known = {row["left_out_celsius"]: 1e3 * row["own_rmse_volt"] for row in rows}
    axes.plot(
        *zip(*sorted(known.items()), strict=True), "_", color=figure.QUIET, label="told of it"
    )
    axes.set(xlabel="temperature left out [°C]", ylabel="RMS error [mV]", yscale="log")
    axes.set_title("Tests of the fit: which law")
    figure.legend_once(axes)


def _proof(axes, rows):
    """One pair of bars a test: told of its temperature, and not."""
    for place, row in enumerate(rows):
        told, untold = 1e3 * row["own_rmse_volt_soc_5_95"], 1e3 * row["rmse_volt_soc_5_95"]
        axes.barh(place - WIDTH / 2, told, height=WIDTH, color=figure.QUIET)
        colour = figure.temperature_colour(row["left_out_celsius"])
        hatch = "////" if row["beyond"] else None
        axes.barh(place + WIDTH / 2, untold, height=WIDTH, color=colour, hatch=hatch)
        axes.annotate(f" ×{row['ratio']:.2f}", (untold, place + WIDTH / 2), va="center", fontsize=7)
    names = [f"{row['predicted_test']}, {row['left_out_celsius']:g} °C" for row in rows]
    axes.set_yticks(range(len(rows)), names, fontsize=7)
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")
    axes.set(xlabel="RMS error, SoC 5–95 % [mV]", title="Tests for proof: not told of it, and told")
