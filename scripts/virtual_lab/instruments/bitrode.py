"""Bitrode: csv whose ampere-hours and watt-hours begin again with each step of current.

Of the real files (Nissan Leaf, ORNL) the resolution is coarser (0.1 s, 10 mA, 1 mV); short pulses
need what is written here.
"""

import numpy as np

from virtual_lab.instruments.text import (
    Written,
    cycles,
    energy_watt_hour,
    labels_of,
    packed,
    rows_of,
    same,
    signed,
    step_begins,
)
from virtual_lab.measurement import Columns

IDLE_AMPERE = 0.02


def bitrode_csv(
    columns: Columns, *, discharge_positive: bool = False, header: bool = True
) -> bytes:
    """A Bitrode record, gzipped, with or without the line of names."""
    time, step, rows = columns["time_second"], columns["step"], columns["step"].size
    current = signed(columns["current_ampere"], discharge_positive)
    one, begin = same(1, rows), step_begins(step)
    mode = _modes(columns["current_ampere"], begin)
    charge = columns["charged_ampere_hour"] - columns["discharged_ampere_hour"]
    loaded = mode != "REST"
    sheet = [
        Written("Exclude", same("No", rows)),
        Written("Time(s)", time, 3),
        Written("Cycle", cycles(columns)),
        Written("Loop", one),
        Written("Loop", one),
        Written("Loop", one),
        Written("Step", step),
        Written("StepTime(s)", time - time[begin], 3),
        Written("Current(A)", current, 3),
        Written("Voltage(V)", columns["voltage_volt"], 4),
        Written("Power(W)", np.nan_to_num(columns["voltage_volt"]) * current, 3),
        Written("Capacity(Ah)", _within_step(charge, begin, loaded), 4),
        Written("Energy(Wh)", _within_step(energy_watt_hour(columns), begin, loaded), 4),
        Written("Mode", mode),
        Written("Data", _ends(begin)),
    ]
    return packed((labels_of(sheet) if header else b"") + rows_of(sheet))


def _modes(current, begin):
    """What the cycler was doing: by the sign of the step's whole charge.

    REST where the mean is no more than what the ammeter shows of nothing.
    """
    first = np.unique(begin)
    flowed = np.add.reduceat(np.nan_to_num(current), first)
    size = np.add.reduceat(np.abs(np.nan_to_num(current)), first)
    idle = size <= IDLE_AMPERE * np.diff(np.append(first, current.size))
    named = np.where(idle, "REST", np.where(flowed > 0, "CHRG", "DCHG"))
    return named[np.searchsorted(first, begin)]


def _within_step(counter, begin, loaded):
    """Counted since the row before the step; a rest goes on showing the last of the step before."""
    before = counter[np.maximum(begin - 1, 0)]
    within = counter - np.where(begin > 0, before, 0.0)
    last = np.maximum.accumulate(np.where(loaded, np.arange(loaded.size), -1))
    return np.where(last < 0, 0.0, within[np.maximum(last, 0)]) + 0.0


def _ends(begin):
    """S marks the last row of a step."""
    last = np.append(np.diff(begin) > 0, True)
    return np.where(last, "S", " ")
