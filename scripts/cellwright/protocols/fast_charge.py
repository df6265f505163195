"""Fast charge: how much goes in within a given time, and what limits it."""

from typing import NamedTuple

import numpy as np

from cellwright.protocols.capacity import TURN_SHARE, turns
from cellwright.protocols.start import NEAR_VOLT, Before, Swing, starts_of
from cellwright.records.anchor import first_rest_second
from cellwright.refusal import Refusal
from cellwright.settings import FastCharge

FAST_CHARGE = FastCharge()


class FastCharge(NamedTuple):
    """One fast charge: charge [Ah], shares [1], times [min], temperatures; NaN where not known.

    c_rate : of the constant current. minutes : that were asked for. charge_ampere_hour, share :
    put in within them, and that over the cell's capacity. constant_current_share,
    constant_voltage_share : of it, before and after the upper cut-off was met.
    minutes_constant_current : until then. minutes_to_80 : until 80 % of the capacity is in, from
    empty. duration_minutes : of the charge. warming_kelvin : highest minus first temperature
    on the cell, temperature_start_celsius the first. energy_watt_hour : put in within the minutes.
    from_empty : whether it began at the lower cut-off.
    """

    c_rate: float
    minutes: float
    charge_ampere_hour: float
    share: float
    constant_current_share: float
    constant_voltage_share: float
    minutes_constant_current: float
    minutes_to_80: float
    duration_minutes: float
    energy_watt_hour: float
    temperature_start_celsius: float
    warming_kelvin: float
    capacity_ampere_hour: float
    from_empty: bool


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
    charge that ended before counts as it ended. 4. Whether it began empty, `start.starts_of` tells.

    Parameters
    ----------
    series : dict of (n,) columns of stage `clean`. steps : Steps of the record.
    capacity_ampere_hour : that the share refers to [Ah].
    rated_capacity_ampere_hour : that the rate refers to [Ah]; None: the same.
    lower_cutoff_volt, upper_cutoff_volt : [V]. minutes : [min].
    soc_at_start : state of charge of the first row as the sheet states it [1], or None.

    Returns
    -------
    charged : FastCharge.
    notes : list of sentences.

    Raises
    ------
    Refusal : the upper cut-off is not stated, or the record holds no charge.

    Source: thesis 3.3 (figure 3.21: 2C, 30 min; more than 90 % at 25 °C, 63 % at the coldest).
    """
    if upper_cutoff_volt is None:
        raise Refusal("the upper cut-off is not stated, so constant current and voltage are one")
    capacity = float(capacity_ampere_hour)
    steps_of_charge, steps_before = _main_charge(series["charge_ampere_hour"], steps, capacity)
    rows = slice(
        max(int(steps.first_row[steps_of_charge[0]]) - 1, 0),
        int(steps.last_row[steps_of_charge[1]]) + 1,
    )
    minute = (series["test_time_second"][rows] - series["test_time_second"][rows][0]) / 60
    charge = series["charge_ampere_hour"][rows] - series["charge_ampere_hour"][rows][0]
    voltage, current = series["voltage_volt"][rows], series["current_ampere"][rows]
    met = np.flatnonzero(voltage[1:] >= upper_cutoff_volt - NEAR_VOLT) + 1
    held = int(met[0]) if len(met) else len(voltage) - 1
    limits = lower_cutoff_volt, upper_cutoff_volt
    known = Before(soc_at_start=soc_at_start, rest_second=first_rest_second(steps))
    empty = _from_empty((rows.start, rows.stop - 1), steps_before, series, steps, limits, known)
    within = float(np.interp(minutes, minute, charge))
    constant = float(np.interp(min(minute[held], minutes), minute, charge))
    energy = np.concatenate([[0.0], np.cumsum((voltage[1:] + voltage[:-1]) / 2 * np.diff(charge))])
    surface = series.get("surface_temperature_celsius", np.empty(0))[rows]
    surface = surface[np.isfinite(surface)]
    first, highest = (float(surface[0]), float(surface.max())) if len(surface) else (np.nan, np.nan)
    charged = FastCharge(
        c_rate=float(current[: held + 2].max() / (rated_capacity_ampere_hour or capacity)),
        minutes=float(minutes),
        charge_ampere_hour=within,
        share=within / capacity,
        constant_current_share=constant / within,
        constant_voltage_share=1 - constant / within,
        minutes_constant_current=float(minute[held]),
        minutes_to_80=_time_to(0.8 * capacity, minute, charge) if empty else np.nan,
        duration_minutes=float(minute[-1]),
        energy_watt_hour=float(np.interp(minutes, minute, energy)),
        temperature_start_celsius=first,
        warming_kelvin=highest - first,
        capacity_ampere_hour=capacity,
        from_empty=empty,
    )
    return charged, _notes(charged, voltage[0])


def _main_charge(charge, steps, capacity):
    """First and last step of the largest charge, and of the half cycle before it (or None)."""
    spans = turns(charge, steps, least_ampere_hour=TURN_SHARE * capacity)
    sizes = [
        (charge[steps.last_row[last]] - charge[steps.first_row[first]]) if sign > 0 else 0.0
        for sign, first, last in spans
    ]
    if not sizes or max(sizes) <= 0:
        raise Refusal("no charge of at least 2 % of the capacity is in the record")
    best = int(np.argmax(sizes))
    loads = [k for k in range(spans[best][1], spans[best][2] + 1) if steps.kind[k] != "rest"]
    return (loads[0], loads[-1]), spans[best - 1][1:] if best else None


def _from_empty(rows, steps_before, series, steps, limits, known):
    """Whether the cell was at its lower cut-off when the charge over these rows began."""
    if limits[0] is None:
        return False
    names = ("current_ampere", "voltage_volt", "charge_ampere_hour")
    columns, swings = tuple(series[name] for name in names), []
    if steps_before:
        first, last = int(steps.first_row[steps_before[0]]), int(steps.last_row[steps_before[1]])
        reached = columns[1][first : last + 1].min() <= limits[0] + NEAR_VOLT
        swings.append(_swing(-1, first, last, columns, reached=bool(reached)))
    swings.append(_swing(1, *rows, columns, reached=True))
    return not starts_of(swings, columns, limits, known)[-1].fault


def _swing(sign, first, last, columns, *, reached):
    """Swing over these rows; under load from its first one on where the record begins so."""
    current, voltage, charge = columns
    moved = abs(float(charge[last] - charge[first]))
    loaded = first == 0 and abs(current[0]) > abs(np.median(current[: last + 1])) / 2
    return Swing(sign, first, last, moved, reached, float(voltage[last]), bool(loaded))


def _time_to(wanted, minute, charge):
    """Time at which the wanted charge [Ah] is in [min]; NaN where it never is."""
    reached = np.flatnonzero(charge >= wanted)
    if not len(reached) or reached[0] == 0:
        return np.nan
    k = int(reached[0])
    return float(np.interp(wanted, charge[k - 1 : k + 1], minute[k - 1 : k + 1]))


def _notes(charged, volt):
    """Sentences on what the record does not tell of the charge that begins at `volt` [V]."""
    notes, ended = [], charged.duration_minutes
    if not charged.from_empty:
        notes.append(f"the charge begins at {volt:.3f} V, not known to be empty: no time to 80 %")
    if ended < charged.minutes:
        notes.append(f"the charge ends after {ended:.1f} min, before {charged.minutes:g} min")
    if charged.from_empty and not np.isfinite(charged.minutes_to_80):
        notes.append(f"80 % is not reached in {ended:.1f} min")
    return notes
