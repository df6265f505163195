"""Ageing records: the complete discharges and charges of many cycles in one test."""

from typing import NamedTuple

import numpy as np

from cellwright.protocols.capacity import FULL_SHARE, NAMES, NEAR_VOLT, TURN_SHARE, turns
from cellwright.refusal import Refusal
from cellwright.series.steps import assumed_rating

REST_ROWS = 5  # rows before a load whose temperature is the cell's before it warms
HELD = ("CV", "CCCV")
EFFICIENCY = (0.8, 1.05)  # outside, the record lacks a half cycle between the two


class AgeingCycles(NamedTuple):
    """One entry a complete discharge or charge, in time order, arrays of shape (rows,).

    cycle counts discharges: that of the sheet plus 1 for the first one in the record; a charge
    has the number of the discharge that it prepares. room_temperature_celsius is the recorded
    temperature of the surroundings over the half cycle, temperature_start_celsius the cell's as
    it begins, temperature_mean_celsius the cell's over it; NaN where not recorded.
    """

    cycle: np.ndarray
    direction: np.ndarray
    start_time_second: np.ndarray
    duration_second: np.ndarray
    c_rate: np.ndarray
    capacity_ampere_hour: np.ndarray
    energy_watt_hour: np.ndarray
    coulombic_efficiency: np.ndarray
    room_temperature_celsius: np.ndarray
    temperature_start_celsius: np.ndarray
    temperature_mean_celsius: np.ndarray


class Ageing(NamedTuple):
    """Complete half cycles, and a sentence for every half cycle that is not complete."""

    rows: AgeingCycles
    left_out: tuple


class _Half(NamedTuple):
    """A half cycle: sign (+1 charge), rows (inclusive), cycle number in the record, fault or ""."""

    sign: int
    first: int
    last: int
    number: int
    fault: str


# ASSUME: A half cycle that reaches its cut-off under load is complete, whatever its load's shape;
# so cycles of pulsed discharges count too.
def ageing_cycles(
    series,
    steps,
    *,
    rated_capacity_ampere_hour,
    lower_cutoff_volt,
    upper_cutoff_volt,
    first_cycle=0.0,
):
    """Capacity, energy and temperature of every complete half cycle of an ageing record.

    1. The record is cut where its counted charge turns (a return of less than 2 % of the rating
    is no turn). 2. A half cycle is complete where it reaches its cut-off within 10 mV (what is
    held there afterwards is part of it) and the one before it reached the other; the first of the
    record where it begins at a rest within 5 % of the voltage window of the other cut-off. What
    was cut short is left out, and so is what follows it. 3. Coulombic efficiency is a discharge
    over the charge before it; NaN outside 0.8 … 1.05, where the record lacks what happened
    between.

    Parameters
    ----------
    series : dict of (n,) columns of stage `clean`: test_time_second, current_ampere,
        voltage_volt, charge_ampere_hour; surface_ and ambient_temperature_celsius where recorded.
    steps : Steps of the record.
    rated_capacity_ampere_hour : [Ah] or None.
    lower_cutoff_volt, upper_cutoff_volt : [V].
    first_cycle : cycles before the record [1].

    Returns
    -------
    Ageing

    Raises
    ------
    Refusal : a cut-off is not stated, or no half cycle is complete; the reasons are named.
    """
    if lower_cutoff_volt is None or upper_cutoff_volt is None:
        raise Refusal("a cut-off is not stated, so which cycles are complete cannot be told")
    rated = rated_capacity_ampere_hour or assumed_rating(
        series["current_ampere"], series["charge_ampere_hour"]
    )
    halves = _halves(series, steps, rated, (lower_cutoff_volt, upper_cutoff_volt))
    left_out = tuple(
        f"cycle {first_cycle + half.number:g}, {NAMES[half.sign]}: {half.fault}"
        for half in halves
        if half.fault
    )
    rows = [
        (first_cycle + half.number, *_numbers(half, before, series, rated))
        for before, half in zip([None, *halves], halves, strict=False)
        if not half.fault
    ]
    if not rows:
        raise Refusal(f"no complete cycle: {'; '.join(left_out) or 'no half cycle is in it'}")
    return Ageing(AgeingCycles(*[np.array(column) for column in zip(*rows, strict=True)]), left_out)


def _halves(series, steps, rated, limits):
    """Half cycles in time order, each with its cycle's number and why it is not complete."""
    halves, reached_before, number = [], None, 0
    charge, voltage = series["charge_ampere_hour"], series["voltage_volt"]
    for sign, first, last in turns(charge, steps, least_ampere_hour=TURN_SHARE * rated):
        loads = [k for k in range(first, last + 1) if steps.kind[k] != "rest"]
        begin = max(int(steps.first_row[loads[0]]) - 1, 0)
        reached, last_load = _end(voltage, steps, sign, loads, limits)
        end = int(steps.last_row[last_load])
        number += sign < 0
        fault = _start_fault(voltage[begin], sign, limits, reached_before)
        if not reached:
            cut_off = f"before the cut-off of {limits[sign > 0]:g} V"
            fault = f"it ends at {voltage[end]:.3f} V, {cut_off}"
        halves.append(_Half(sign, begin, end, number + (sign > 0), fault))
        reached_before = reached
    return halves


def _end(voltage, steps, sign, loads, limits):
    """Whether the cut-off is reached, and the last load of the half cycle.

    That is the first one that reaches it, or the last of those that hold it there afterwards, a
    rest between or not.
    """
    limit = sign * limits[sign > 0] - NEAR_VOLT
    spans = [slice(int(steps.first_row[k]), int(steps.last_row[k]) + 1) for k in loads]
    reaching = [n for n, rows in enumerate(spans) if _farthest(voltage[rows], sign) >= limit]
    if not reaching:
        return False, loads[-1]
    last = reaching[0]
    while last + 1 < len(loads) and steps.kind[loads[last + 1]] in HELD:
        last += 1
    return True, loads[last]


def _farthest(voltage, sign):
    """Highest voltage of a charge, lowest of a discharge times -1 [V].

    Read off a line through the last samples where that is further: the cut-off may lie between two.
    """
    ahead = voltage[-1] + (voltage[-1] - voltage[max(len(voltage) - 6, 0)]) / 5
    return max(np.max(sign * voltage), sign * ahead)


def _start_fault(volt, sign, limits, reached_before):
    """Why the cell was not full (discharge) or empty (charge) at the start; "" where it was."""
    end = "full" if sign < 0 else "empty"
    if reached_before is not None:
        return "" if reached_before else f"it does not start {end}: what came before was cut short"
    start_limit = limits[sign < 0]
    near = sign * (volt - start_limit) <= FULL_SHARE * (limits[1] - limits[0])
    return "" if near else f"it does not start {end}: the record begins with it at {volt:.3f} V"


def _numbers(half, before, series, rated):
    """Columns of AgeingCycles after `cycle` for one complete half cycle."""
    rows = slice(half.first, half.last + 1)
    time, charge = series["test_time_second"][rows], series["charge_ampere_hour"][rows]
    moved, voltage = np.diff(charge), series["voltage_volt"][rows]
    capacity = abs(float(charge[-1] - charge[0]))
    surface = series.get("surface_temperature_celsius")
    ambient = series.get("ambient_temperature_celsius")
    before_load = slice(max(half.first - REST_ROWS, 0), half.first + 1)
    return (
        NAMES[half.sign],
        float(time[0]),
        float(time[-1] - time[0]),
        _middle_current(series["current_ampere"][rows], moved) / rated,
        capacity,
        abs(float(np.sum((voltage[1:] + voltage[:-1]) / 2 * moved))),
        _efficiency(half, before, series["charge_ampere_hour"], capacity),
        _time_mean(ambient, rows, time),
        _median(surface, before_load),
        _time_mean(surface, rows, time),
    )


def _middle_current(current, moved):
    """Median size of the current [A], weighted by the charge that it moves."""
    # Where a pulse ends between two samples the charge belongs to the larger of both.
    size = np.maximum(np.abs(current[1:]), np.abs(current[:-1]))
    order = np.argsort(size)
    total = np.cumsum(np.abs(moved[order]))
    return float(size[order][np.searchsorted(total, total[-1] / 2)])


def _efficiency(half, before, charge, capacity):
    """Capacity of a discharge over that of the charge before it [1]; NaN outside EFFICIENCY."""
    if half.sign > 0 or before is None or before.fault:
        return np.nan
    efficiency = capacity / abs(charge[before.last] - charge[before.first])
    return float(efficiency) if EFFICIENCY[0] <= efficiency <= EFFICIENCY[1] else np.nan


def _time_mean(values, rows, time):
    """Mean over time of the finite values of some rows; NaN where fewer than two are."""
    if values is None:
        return np.nan
    measured = np.isfinite(values[rows])
    values, time = values[rows][measured], time[measured]
    if len(time) < 2 or time[-1] <= time[0]:
        return np.nan
    return float(np.trapezoid(values, time) / (time[-1] - time[0]))


def _median(values, rows):
    """Median of the finite values of some rows; NaN where there are none."""
    measured = np.empty(0) if values is None else values[rows][np.isfinite(values[rows])]
    return float(np.median(measured)) if len(measured) else np.nan
