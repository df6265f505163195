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
from cellwright.records.anchor import first_rest
from cellwright.refusal import Refusal
from cellwright.settings import FastCharge

FAST_CHARGE = FastCharge()


def fast_charge(
    series,
    steps,
    *,
    capacity_ampere_hour,
    rated_capacity_ampere_hour,
    lower_cutoff_volt,
    upper_cutoff_volt,
    soc_at_start=None,
    minutes=FAST_CHARGE.minutes,
):
    """Charge put in within a given time at the limits of current and voltage.

    1. The charge of the record that moves the most. 2. Constant current ends where the upper
    cut-off is met within 10 mV. 3. What is in after `minutes` is read off the counted charge; a
    charge that ended before counts as it ended. 4. Whether it began empty, `starts_of` says.

    series : dict of (n,) columns of stage `clean`. steps : Steps of the record.
    capacity_ampere_hour : that the share refers to [Ah].
    rated_capacity_ampere_hour : that the rate refers to [Ah]; None: the same.
    lower_cutoff_volt, upper_cutoff_volt : [V]. minutes : [min].
    soc_at_start : state of charge of the first row as the sheet states it [1], or None.

    Returns charged: dict, a row of stage `fast_charge`: of the charge c_rate [1/h] of its constant
    current, what is in after `minutes` [Ah, Wh, and share of the capacity, 1], the parts of that
    before and after the cut-off was met, times [min]; minutes_to_80 from empty only, and
    temperatures: NaN where not known; notes : list of sentences. Raises Refusal: the upper cut-off
    is not stated, or the record holds no charge.

    Source: thesis 3.3 (figure 3.21: 2C, 30 min; more than 90 % at 25 °C, 63 % at the coldest).
    """
    if upper_cutoff_volt is None:
        raise Refusal("the upper cut-off is not stated, so constant current and voltage are one")
    capacity, columns = float(capacity_ampere_hour), columns_of(series)
    limits = lower_cutoff_volt, upper_cutoff_volt
    halves = half_cycles(columns, steps, limits, least_ampere_hour=TURN_SHARE * capacity)
    halves = [half for half in halves if half.loads]
    sizes = [half.moved_ampere_hour * (half.sign > 0) for half in halves]
    if not any(sizes):
        raise Refusal("no charge of at least 2 % of the capacity is in the record")
    best = int(np.argmax(sizes))
    rest = first_rest(steps, series["test_time_second"], columns[1])
    known = Before(soc_at_start=soc_at_start, rest=rest)
    empty = not starts_of(halves, columns, limits, known)[best].fault
    rows = slice(halves[best].first_row, halves[best].turn_row + 1)
    minute = (series["test_time_second"][rows] - series["test_time_second"][rows][0]) / 60
    current, voltage, charge = (column[rows] for column in columns)
    charge = charge - charge[0]
    met = np.flatnonzero(voltage[1:] >= upper_cutoff_volt - NEAR_VOLT) + 1
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
        "c_rate": float(current[: at_cutoff + 2].max() / (rated_capacity_ampere_hour or capacity)),
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
    return charged, _notes(charged, voltage[0])


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
