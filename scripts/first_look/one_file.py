"""What one file holds: its decoded columns, and what a campaign would make of them."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

import cellwright as cw
from cellwright import formats, gate
from cellwright.records.kinds import likely_kinds
from cellwright.refusal import Refusal
from cellwright.series.joining import assemble

PROBES = ("ambient_temperature_celsius", "surface_temperature_celsius")


class Look(NamedTuple):
    """One file. `series` and `steps` are columns of the record that a campaign would use, empty
    where it would refuse it, for the reason in `refused`; `kinds` are (kind, reason)."""

    name: str
    reading: formats.Reading
    series: dict
    steps: dict
    kinds: list
    refused: str
    notes: tuple


def look(path, within=None) -> Look:
    """Read a file as a campaign would, as far as that goes.

    `path` is that of a file in the folder `within`, such as a campaign; None: of any file.

    Raises
    ------
    Refusal
        Nothing can be read from it.
    """
    path = Path(path)
    reading = formats.read(gate.content_at(path, within=within), name=path.name)
    if reading.kind == "impedance":
        return Look(path.name, reading, {}, {}, [("eis", "a spectrum")], "", reading.notes)
    try:
        joined = assemble([reading])
        series = cw.clean(joined.columns)
        steps = dict(cw.segment(series.columns).rows._asdict())
    except Refusal as reason:
        return Look(path.name, reading, {}, {}, [], str(reason), reading.notes)
    kinds = likely_kinds(steps, celsius_span=_celsius_span(series.columns))
    notes = tuple(dict.fromkeys((*joined.notes, *series.notes)))
    return Look(path.name, reading, dict(series.columns), steps, kinds, "", notes)


def celsius(columns) -> float | None:
    """Temperature around a cell [°C]; None where nothing shows it.

    The chamber's median, or else the coolest twentieth of the cell's own, which loads warm.
    """
    for name, share in zip(PROBES, (0.5, 0.05), strict=True):
        values = columns.get(name)
        if values is not None and np.isfinite(values).any():
            return float(np.nanquantile(values, share))
    return None


def _celsius_span(columns):
    spans = [np.nanmax(columns[n]) - np.nanmin(columns[n]) for n in PROBES if n in columns]
    return float(max(spans, default=0.0))
