"""Ageing records: the complete discharges and charges of many cycles in one test."""

import re
from collections import Counter
from typing import NamedTuple

import numpy as np

from cellwright.protocols.capacity import NAMES, TURN_SHARE, turns
from cellwright.protocols.start import (
    NEAR_VOLT,
    Before,
    Start,
    Swing,
    spans_with_lost_charges,
    starts_of,
)
from cellwright.records.anchor import first_rest_second
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
    capacity_std_ampere_hour: np.ndarray | None = None


class Ageing(NamedTuple):
    """Complete half cycles; for each reason to leave some out a sentence with their number and
    cycles; the same for each reason to count some by their rest."""

    rows: AgeingCycles
    left_out: tuple
    by_rest: tuple


class _Half(NamedTuple):
    """A half cycle: sign (+1 charge), rows (inclusive), cycle number in the record, how it starts,
    and why its end is not complete, or ""."""

    sign: int
    first: int
    last: int
    number: int
    start: Start
    end_fault: str

    @property
    def fault(self):
        """Why it is not complete, or ""."""
        return self.end_fault or self.start.fault


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
    state_before="",
    soc_at_start=None,
):
    """Capacity, energy and temperature of every complete half cycle of an ageing record.

    1. The record is cut where its counted charge turns (a return of less than 2 % of the rating
    is no turn), and where a charge between two discharges was not logged. 2. A half cycle is
    complete where it reaches its cut-off within 10 mV (what is held there afterwards is part of it)
    and begins at the other (`start.starts_of`); what it may lack at its start is its standard
    deviation. What was cut short is left out, and so is what follows it. 3. Coulombic efficiency is
    a discharge over the charge before it; NaN outside 0.8 … 1.05, where the record lacks what
    happened between.

    Parameters
    ----------
    series : dict of (n,) columns of stage `clean`: test_time_second, current_ampere,
        voltage_volt, charge_ampere_hour; surface_ and ambient_temperature_celsius where recorded.
    steps : Steps of the record.
    rated_capacity_ampere_hour : [Ah] or None.
    lower_cutoff_volt, upper_cutoff_volt : [V].
    first_cycle : cycles before the record [1].
    state_before : "full" or "empty", as the test before this one in time left the cell; "": not
        known.
    soc_at_start : of the first row, as the sheet states it [1], or None.

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
    known = Before(state_before, soc_at_start, rest_second=first_rest_second(steps))
    halves = _halves(series, steps, rated, (lower_cutoff_volt, upper_cutoff_volt), known)
    left_out, by_rest = (_by_reason(halves, first_cycle, faulty=faulty) for faulty in (True, False))
    rows = [
        (first_cycle + half.number, *_numbers(half, before, series, rated))
        for before, half in zip([None, *halves], halves, strict=False)
        if not half.fault
    ]
    if not rows:
        raise Refusal(f"no complete cycle: {'; '.join(left_out) or 'no half cycle is in it'}")
    table = AgeingCycles(*[np.array(column) for column in zip(*rows, strict=True)])
    return Ageing(table, left_out, by_rest)


def _halves(series, steps, rated, limits, known):
    """Half cycles in time order, each with its cycle's number and why it is not complete."""
    names = ("current_ampere", "voltage_volt", "charge_ampere_hour")
    columns, halves, swings, number = tuple(series[name] for name in names), [], [], 0
    spans = turns(columns[2], steps, least_ampere_hour=TURN_SHARE * rated)
    for sign, first, last in spans_with_lost_charges(spans, columns, steps, limits):
        loads = [k for k in range(first, last + 1) if steps.kind[k] != "rest"]
        begin = max(int(steps.first_row[loads[0]]) - 1, 0)
        reached, last_load = _end(columns[1], steps, sign, loads, limits)
        end, turn = int(steps.last_row[last_load]), int(steps.last_row[loads[-1]])
        number += sign < 0
        cut_off = f"before the cut-off of {limits[sign > 0]:g} V"
        fault = "" if reached else f"it ends at {columns[1][end]:.3f} V, {cut_off}"
        halves.append(_Half(sign, begin, end, number + (sign > 0), None, fault))
        moved, volt = abs(float(columns[2][turn] - columns[2][begin])), float(columns[1][end])
        swings.append(Swing(sign, begin, end, moved, reached, volt, loads[0] == 0))
    starts = starts_of(swings, columns, limits, known)
    return [half._replace(start=start) for half, start in zip(halves, starts, strict=True)]


EXAMPLES = 5


def _by_reason(halves, first_cycle, *, faulty):
    """A sentence for each reason and direction: how many half cycles, of how many, and which."""
    reasons, numbered = {}, Counter(half.sign for half in halves)
    for half in halves:
        words = half.fault if faulty else not half.fault and half.start.words
        kind = (half.sign, re.sub(r"-?\d[\d.]*", "#", words or ""))
        if words:
            reasons.setdefault(kind, []).append((first_cycle + half.number, words))
    done = "left out" if faulty else "counted by their rest"
    return tuple(
        _sentence(f"of {numbered[sign]} {NAMES[sign]}s {done}", members)
        for (sign, _), members in reasons.items()
    )


def _sentence(of_all, members):
    """One reason in words, from the (cycle, words) of its half cycles."""
    cycles = list(dict.fromkeys(f"{cycle:g}" for cycle, _ in members))
    named = ", ".join(cycles[:EXAMPLES]) + (" …" if len(cycles) > EXAMPLES else "")
    cycle, words = members[0]
    return f"{len(members)} {of_all} (cycles {named}): cycle {cycle:g}: {words}"


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
        half.start.missing_ampere_hour,
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
