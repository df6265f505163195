"""The report's page Compare: curves of all cells and tests, of which a reader lays some together.

They stand in the report as JSON, gzip in base64, thinned to what an eye can tell apart; a script
(workflow/report/compare.js, with uPlot) draws those that are chosen.
"""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cellwright.numerics.extremes import rows_of_extremes
from runtime import artefact
from runtime.page_tables import packed

# Points of all curves of one quantity together, some ten bytes each in the file, and of one curve.
POINTS, MOST_POINTS, LEAST_POINTS = 60_000, 300, 40
DIGITS = 5  # of a value: a tenth of a pixel of a wide screen


class Quantity(NamedTuple):
    """What is compared: axes as a reader sees them, and whether its points are joined."""

    title: str
    x: str
    y: str
    joined: bool = True


QUANTITIES = {
    "capacity": Quantity("Capacity over rate", "rate [C]", "capacity [Ah]"),
    "ocv": Quantity("Open-circuit voltage", "SoC [%]", "voltage [V]"),
    "dqdv": Quantity("dQ/dV of charges", "voltage [V]", "dQ/dV [Ah/V]"),
    "resistance": Quantity("Resistance over SoC", "SoC [%]", "resistance [mΩ]"),
    "residual": Quantity("Residual of the model in use", "time [h]", "measured − model [mV]"),
}
# Stage, columns of x and y with their factors, of curves that are read as they are.
STAGES = {
    "ocv": ("ocv", ("soc", 100.0), ("ocv_volt", 1.0)),
    "dqdv": ("ica_curve", ("voltage_volt", 1.0), ("dq_dv_ampere_hour_per_volt", 1.0)),
}


def section(paths, simulated, capacity, resistance, chosen) -> dict:
    """What the template shows: quantities with their curves as packed JSON; {} without a curve.

    Parameters
    ----------
    paths : paths of artefacts of the stages `ocv` and `ica_curve`.
    simulated : paths of the simulations of tests.
    capacity, resistance : frames of text, the tables so named; None where there is none.
    chosen : the model in use, by (cell, test).
    """
    curves = {
        "capacity": _of_table(
            capacity,
            ["cell", "ambient_temperature_celsius", "direction"],
            ("c_rate", 1.0, "capacity_ampere_hour", 1.0),
        ),
        **{name: _of_stage(paths, *about) for name, about in STAGES.items()},
        "resistance": _of_table(
            resistance,
            ["cell", "test", "direction", "delay_second"],
            ("soc", 100.0, "resistance_ohm", 1e3),
        ),
        "residual": _residuals(simulated, chosen),
    }
    document = [
        {"id": name, **QUANTITIES[name]._asdict(), "curves": _thinned(found)}
        for name, found in curves.items()
        if found
    ]
    text = json.dumps(document, ensure_ascii=False, separators=(",", ":"))
    return {"quantities": document, "packed": packed(text)} if document else {}


def _of_stage(paths, stage, x, y):
    """Curves of the artefacts of a stage with content: [cell, label, x, y]."""
    found = []
    for path in map(Path, paths):
        if path.parts[-3:-2] != (stage,) or artefact.read_about(path)["reason"] is not None:
            continue
        columns = artefact.load(path)
        about = path.parent.name, path.stem
        values = [factor * columns[name] for name, factor in (x, y)]
        if "c_rate" in columns:  # of several charges each is a curve
            for rate in np.unique(columns["c_rate"]):
                own = columns["c_rate"] == rate
                label = f"{about[1]}, {rate:.2g}C"
                found.append([about[0], label, *(one[own] for one in values)])
        else:
            found.append([*about, *values])
    return found


def _of_table(frame, names, about):
    """Curves of rows that agree in some columns, sorted along x: [cell, label, x, y]."""
    x, x_factor, y, y_factor = about
    if frame is None or not {*names, x, y} <= set(frame.columns):
        return []
    found = []
    for key, rows in frame[(frame[x] != "") & (frame[y] != "")].groupby(names, sort=False):
        values = np.array(rows[[x, y]], float)
        values = values[np.argsort(values[:, 0], kind="stable")]
        label = ", ".join(
            _in_words(name, one) for name, one in zip(names[1:], key[1:], strict=True) if one
        )
        found.append([key[0], label, x_factor * values[:, 0], y_factor * values[:, 1]])
    return found


def _in_words(name, text):
    units = {"ambient_temperature_celsius": " °C", "delay_second": " s"}
    return f"{text}{units[name]}" if name in units else text


def _residuals(simulated, chosen):
    found = []
    for path in map(Path, simulated):
        key = path.parent.name, path.stem
        if artefact.read_about(path)["reason"] is not None:
            continue
        columns = artefact.load(path)
        model = columns.get(f"simulated_{chosen.get(key)}_volt")
        if model is not None:
            error = 1e3 * (columns["voltage_volt"] - model)
            found.append([*key, columns["test_time_second"] / 3600.0, error])
    return found


def _thinned(curves):
    share = int(np.clip(POINTS / len(curves), LEAST_POINTS, MOST_POINTS))
    found = []
    for cell, label, x, y in curves:
        known = np.isfinite(x) & np.isfinite(y)
        x, y = x[known], y[known]
        rows = rows_of_extremes(y, share) if len(y) > share else np.arange(len(y))
        found.append({"cell": cell, "label": label, "x": _plain(x[rows]), "y": _plain(y[rows])})
    return found


def _plain(values):
    return [float(f"{one:.{DIGITS}g}") for one in values]
