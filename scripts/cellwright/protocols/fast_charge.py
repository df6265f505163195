"""Fast charge: how much goes in within a given time, and what limits it."""

import numpy as np

from cellwright.protocols.half_cycles import (
    NEAR_VOLT,
    TURN_SHARE,
    Before,
    columns_of,
    energy_counted,
    half_cycles,
    starts_of,
)
from cellwright.records import inputs
from cellwright.records.anchor import first_rest
from cellwright.records.basis import at_cycle
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.settings import FastCharge


def fast_charge(series, steps, basis, cell, settings=None, *, cycle=None, soc=None, **changes):
    """Share of the capacity [1] that a fast charge reaches in its minutes, and what limits it.

    1. The charge of the record that moves the most. 2. Constant current ends where the upper
    cut-off is met within 10 mV. 3. What is in after `minutes` is read off the counted charge; a
    charge that ended before counts as it ended. 4. Whether it began empty, `starts_of` says.

    cycle : of the test: the share is of the capacity of that check-up.
    soc : stated at its start [1], or None.
    settings : `settings.FastCharge`, its key minutes [min].

    Returns one row, as of stage `fast_charge`: of the charge c_rate [1/h] of its constant current,
    what is in after `minutes` [Ah, Wh, and share of the capacity, 1], the parts of that before and
    after the cut-off was met, times [min]; minutes_to_80 from empty only, and temperatures: NaN
    where not known. Raises Refusal: no upper cut-off, or no charge of at least 2 % of the capacity.
    Source: thesis 3.3 (figure 3.21: 2C, 30 min; more than 90 % at 25 °C, 63 % at the coldest);
    docs/charge-temperature.md.
    """
    series, steps = inputs.columns(series, *inputs.COUNTED), inputs.steps(steps)
    minutes = inputs.settings_of(FastCharge, settings, changes).minutes
    limits = tuple(inputs.cutoffs(cell).values())
    upper = limits[1]
    if upper is None:
        raise Refusal("the upper cut-off is not stated, so constant current and voltage are one")
    # An aged cell is full with less charge: its share is of what it holds then.
    capacity = float(at_cycle(inputs.basis(basis), cycle)["capacity_ampere_hour"])
    columns, rated = columns_of(series), inputs.rating(cell) or capacity
    halves = half_cycles(columns, steps, limits, least_ampere_hour=TURN_SHARE * capacity)
    halves = [half for half in halves if half.loads]
    sizes = [half.moved_ampere_hour * (half.sign > 0) for half in halves]
    if not any(sizes):
        raise Refusal("no charge of at least 2 % of the capacity is in the record")
    best = int(np.argmax(sizes))
    rest = first_rest(steps, series["test_time_second"], columns[1])
    known = Before(soc_at_start=soc, rest=rest)
    empty = not starts_of(halves, columns, limits, known)[best].fault
    rows = slice(halves[best].first_row, halves[best].turn_row + 1)
    minute = (series["test_time_second"][rows] - series["test_time_second"][rows][0]) / 60
    current, voltage, charge = (column[rows] for column in columns)
    charge = charge - charge[0]
    met = np.flatnonzero(voltage[1:] >= upper - NEAR_VOLT) + 1
    at_cutoff = int(met[0]) if len(met) else len(voltage) - 1
    within = float(np.interp(minutes, minute, charge))
    constant = float(np.interp(min(minute[at_cutoff], minutes), minute, charge))
    energy = energy_counted(voltage, charge)
    surface = series.get("surface_temperature_celsius", np.empty(0))[rows]
    surface = surface[np.isfinite(surface)]
    first, highest = (float(surface[0]), float(surface.max())) if len(surface) else (np.nan, np.nan)
    # Between the samples around it; not known of a charge that ends before.
    k = int(np.argmax(charge >= 0.8 * capacity))
    to_80 = (
        float(np.interp(0.8 * capacity, charge[k - 1 : k + 1], minute[k - 1 : k + 1]))
        if k
        else np.nan
    )
    charged = {
        # The highest: in the cold the cut-off is met before the current has settled.
        "c_rate": float(current[: at_cutoff + 2].max() / rated),
        "minutes": float(minutes),
        "charge_ampere_hour": within,
        "share": within / capacity,
        "constant_current_share": constant / within,
        "constant_voltage_share": 1 - constant / within,
        "minutes_constant_current": float(minute[at_cutoff]),
        "minutes_to_80": to_80 if empty else np.nan,
        "duration_minutes": float(minute[-1]),
        "energy_watt_hour": float(np.interp(minutes, minute, energy)),
        "temperature_start_celsius": first,
        "warming_kelvin": highest - first,
        "capacity_ampere_hour": capacity,
        "from_empty": empty,
    }
    return Result({"rows": [charged]}, notes=tuple(_notes(charged, voltage[0])))


def _notes(charged, volt):
    """Sentences on what the record does not tell of the charge that begins at `volt` [V]."""
    notes, ended, minutes = [], charged["duration_minutes"], charged["minutes"]
    if not charged["from_empty"]:
        notes.append(f"the charge begins at {volt:.3f} V, not known to be empty: no time to 80 %")
    if ended < minutes:
        notes.append(f"the charge ends after {ended:.1f} min, before {minutes:g} min")
    if charged["from_empty"] and not np.isfinite(charged["minutes_to_80"]):
        notes.append(f"80 % is not reached in {ended:.1f} min")
    return notes
