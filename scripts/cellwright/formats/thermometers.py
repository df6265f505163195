"""Thermometers on a cell: each by its name, and none that measures nothing in another's place."""

import re

import numpy as np

from cellwright.formats.fields import probe_column
from cellwright.formats.pieces import any_where

PROBE = re.compile(r"surface_temperature(?:_(\d+))?_celsius")
# ASSUME: A thermometer that shows one value throughout is dead where another one on the cell moves
# by more than the coarsest least digit (K), or, if that value is 0 °C, is this far from it.
MOVED_KELVIN, FROM_ZERO_KELVIN = 2.0, 10.0


def without_blank(columns: dict) -> tuple[dict, list[str]]:
    """Columns without thermometers, also of the chamber, that show no number; a note on each."""
    blank = [n for n in columns if n.endswith("temperature_celsius") or PROBE.fullmatch(n)]
    blank = [name for name in blank if not any_where(np.isfinite, columns[name])]
    kept = {name: values for name, values in columns.items() if name not in blank}
    return kept, [f"{name} shows no number in any row: left out" for name in blank]


def living(columns: dict) -> tuple[dict, list[str]]:
    """Columns without dead thermometers on the cell, and notes.

    Where the one that stands for the cell's temperature is missing, the next one does.

    columns : of a series; surface_temperature_celsius (n,), surface_temperature_2_celsius and so on
        [degC], each with a number.
    """
    probes = sorted(filter(PROBE.fullmatch, columns), key=_number)
    kept, notes = dict(columns), []
    for name in probes:
        others = [columns[other] for other in probes if other != name]
        if _is_dead(columns[name], others):
            shown = columns[name][np.isfinite(columns[name])][0]
            notes.append(
                f"{name} shows {shown:.4g} °C in all rows, while another thermometer on the cell "
                "shows otherwise: taken as not connected, and left out"
            )
            del kept[name]
    left = [name for name in probes if name in kept]
    if left and probe_column(1) not in kept:
        kept[probe_column(1)] = kept.pop(left[0])
        notes.append(f"the temperature on the cell is that of its thermometer {_number(left[0])}")
    return kept, notes


def _number(name):
    return int(PROBE.fullmatch(name)[1] or 0)


def _is_dead(shown, others):
    """Whether a thermometer stands still that cannot, as others on the same cell show."""
    if np.nanmin(shown) < np.nanmax(shown):
        return False
    moved = max((np.nanmax(other) - np.nanmin(other) for other in others), default=0.0)
    away = max((abs(np.nanmedian(other)) for other in others), default=0.0)
    zero = np.nanmax(shown) == 0
    return bool(moved > MOVED_KELVIN or (zero and away > FROM_ZERO_KELVIN))
