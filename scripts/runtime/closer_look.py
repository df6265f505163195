"""What a reader of the report may zoom into: a predicted test as lines of one time axis.

Beside the picture of a test its numbers stand in the report as JSON, gzip in base64; a script of
the report draws them (workflow/report/closer.js, with uPlot) when the reader asks for it.
"""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cellwright.numerics.extremes import rows_of_extremes
from runtime import artefact
from runtime.page_tables import packed

# Rows of all tests of a report together, 20 bytes each in the file, and of one test: twice the
# columns of pixels of a wide screen are all that an eye can tell apart before it zooms in.
ROWS_OF_REPORT, MOST_ROWS, LEAST_ROWS = 400_000, 4_000, 400
DIGITS = {"hour": 6, "volt": 5, "millivolt": 2, "ampere": 5, "celsius": 2}


class Line(NamedTuple):
    """A line of a panel: values by the label that a reader sees, and what unit they have."""

    panel: str
    label: str
    unit: str
    values: np.ndarray


def looks_of(simulated, series, chosen) -> dict[tuple, str]:
    """Packed lines of each predicted test, by (cell, test).

    Parameters
    ----------
    simulated : paths of the simulations of tests; those without content are left out.
    series : paths of clean series, which have temperatures.
    chosen : the model in use, by (cell, test).
    """
    clean = {_key(path): path for path in series}
    known = [path for path in simulated if artefact.read_about(path)["reason"] is None]
    share = int(np.clip(ROWS_OF_REPORT / max(len(known), 1), LEAST_ROWS, MOST_ROWS))
    looks = {}
    for path in known:
        key, columns = _key(path), artefact.load(path)
        temperature = _temperature(clean.get(key), columns["test_time_second"])
        lines = lines_of(columns, chosen.get(key), temperature)
        looks[key] = packed(document_of(lines, share))
    return looks


def lines_of(columns, chosen, temperature_celsius=None) -> list[Line]:
    """Voltage, residual, current and temperature of a test, over its time."""
    measured = columns["voltage_volt"]
    model = columns.get(f"simulated_{chosen}_volt")
    lines = [
        Line("", "time", "hour", columns["test_time_second"] / 3600),
        Line("voltage [V]", "measured", "volt", measured),
    ]
    if model is not None:
        lines.append(Line("voltage [V]", f"model {chosen}", "volt", model))
        error = Line("residual [mV]", "measured − model", "millivolt", 1e3 * (measured - model))
        lines.append(error)
    lines.append(Line("current [A]", "current", "ampere", columns["current_ampere"]))
    if temperature_celsius is not None:
        lines.append(Line("temperature [°C]", "cell", "celsius", temperature_celsius))
    return lines


def document_of(lines, rows) -> str:
    """Lines as JSON, thinned to about so many rows that each still looks the same."""
    drawn = lines[1:]
    each = [rows_of_extremes(line.values, max(rows // len(drawn), 2)) for line in drawn]
    kept = np.unique(np.concatenate(each))
    document = [
        {"panel": line.panel, "label": line.label, "values": _plain(line.values[kept], line.unit)}
        for line in lines
    ]
    return json.dumps(document, ensure_ascii=False, separators=(",", ":"))


def _plain(values, unit):
    rounded = np.round(np.asarray(values, float), DIGITS[unit])
    return [float(value) if np.isfinite(value) else None for value in rounded]


def _temperature(path, time):
    """Temperature of the cell at these times; None where the test has none."""
    if path is None or artefact.read_about(path)["reason"] is not None:
        return None
    columns = artefact.load(path)
    at = ("surface_temperature_celsius", "ambient_temperature_celsius")
    known = next((columns[name] for name in at if name in columns), None)
    if known is None or not np.isfinite(known).any():
        return None
    return np.interp(time, columns["test_time_second"], known, left=np.nan, right=np.nan)


def _key(path) -> tuple:
    """Cell and test of an artefact `…/<cell>/<test>.parquet`."""
    return Path(path).parent.name, Path(path).stem
