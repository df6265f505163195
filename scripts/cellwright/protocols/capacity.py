"""Capacity by direction and rate, from complete discharges and charges only."""

from typing import NamedTuple

import numpy as np

from cellwright.protocols.start import NEAR_VOLT, Before, Swing, spans_with_lost_charges, starts_of
from cellwright.records.anchor import first_rest_second
from cellwright.records.conditions import same_rate
from cellwright.refusal import Refusal
from cellwright.series.steps import assumed_rating

TURN_SHARE = 0.02  # of the rating: a smaller return of charge (regeneration, dither) is no turn
RATE_SHARE = 0.9  # of the charge must move at the one rate that a capacity is stated for
NAMES = {1: "charge", -1: "discharge"}
CONSTANT_SHARE = 0.05  # by which portions of one discharge at a constant current may differ


class Half(NamedTuple):
    """One charge or discharge between two turns of the counted charge.

    sign : +1 charge, -1 discharge. first_row, last_row : inclusive; the first is the last one
    before the load. rate_ampere : size of its constant current [A]. held_row : where its voltage
    is first held, or its last row. fault : why it is not complete, "" where it is.
    missing_ampere_hour : standard deviation of what an unsure start may lack [Ah]. words : on it.
    """

    sign: int
    first_row: int
    last_row: int
    rate_ampere: float
    held_row: int
    fault: str
    missing_ampere_hour: float = 0.0
    words: str = ""


def turns(charge_ampere_hour, steps, *, least_ampere_hour):
    """Spans of steps between turning points of the counted charge.

    Parameters
    ----------
    charge_ampere_hour : (n,) net charge since the first row [Ah].
    steps : Steps of the record.
    least_ampere_hour : a return of less than this is no turn [Ah].

    Returns
    -------
    list of (sign, first step, last step); empty where less than that is moved.
    """
    level = np.append(charge_ampere_hour[0], charge_ampere_hour[steps.last_row])
    spans, low, high, start, peak, sign = [], 0, 0, 0, 0, 0
    for k in range(1, len(level)):
        if sign == 0:  # until the first turn is known, both extremes may be its start
            low = k if level[k] < level[low] else low
            high = k if level[k] > level[high] else high
            sign = int(level[k] - level[low] >= least_ampere_hour)
            sign -= int(level[high] - level[k] >= least_ampere_hour)
            start, peak = (low if sign > 0 else high), k
        elif sign * (level[k] - level[peak]) > 0:
            peak = k
        elif sign * (level[peak] - level[k]) >= least_ampere_hour:
            spans.append((sign, start, peak - 1))
            start, peak, sign = peak, k, -sign
    return [*spans, (sign, start, peak - 1)] if sign else spans


class _Record(NamedTuple):
    """Columns of a test (n,) [A], [V], [Ah], its steps, and its lower and upper cut-off [V], which
    may be None."""

    current: np.ndarray
    voltage: np.ndarray
    charge: np.ndarray
    steps: object
    limits: tuple

    def end_limit(self, sign):
        """Cut-off at which a charge (+1) or discharge (-1) ends [V], or None."""
        return self.limits[sign > 0]


def _half_cycles(record, rated, known, *, whole):
    """Half cycles of a record in time order, each with the reason why it is not complete.

    They are counted to the turn of the charge where `whole`, else to where the cut-off is first
    reached. known : start.Before.
    """
    steps, halves, swings = record.steps, [], {}
    spans = turns(record.charge, steps, least_ampere_hour=TURN_SHARE * rated)
    columns = (record.current, record.voltage, record.charge)
    for sign, first, last in spans_with_lost_charges(spans, columns, steps, record.limits):
        loads = [k for k in range(first, last + 1) if steps.kind[k] != "rest"]
        if not loads:
            halves.append(_at_rest(record, sign, first, last))
            continue
        reached = _reaches(record, sign, loads)
        halves.append(_half(record, sign, loads, reached, whole))
        swings[len(halves) - 1] = _swing(record, halves[-1], loads, reached)
    starts = starts_of(list(swings.values()), columns, record.limits, known)
    for place, start in zip(swings, starts, strict=True):
        if not halves[place].fault:
            halves[place] = halves[place]._replace(**start._asdict())
    return halves


def _swing(record, half, loads, reached):
    """Swing of a half cycle, to its last load."""
    steps = record.steps
    end = int(steps.last_row[loads[-1]])
    moved = abs(float(record.charge[end] - record.charge[half.first_row]))
    volt, under_load = float(record.voltage[end]), loads[0] == 0
    return Swing(half.sign, half.first_row, end, moved, reached is not None, volt, under_load)


def _at_rest(record, sign, first, last):
    """Half cycle in which only rests were counted: the current reading is off by a constant."""
    rows = int(record.steps.first_row[first]), int(record.steps.last_row[last])
    read = float(np.median(record.current[rows[0] : rows[1] + 1]))
    fault = f"it holds no load: all that was counted is {read:.3g} A read at rest"
    return Half(sign, *rows, abs(read), rows[1], fault)


def _half(record, sign, loads, reached, whole):
    """Half cycle over the given loads, with the fault of its end or of its rate."""
    steps = record.steps
    used = loads if whole or reached is None else loads[: loads.index(reached) + 1]
    moved = np.abs(steps.charge_ampere_hour[used])
    main = used[int(np.argmax(moved))]
    rate, held = _rate(record, main)
    rates = np.array([_rate(record, k)[0] for k in used])
    same = np.abs(rates / rate - 1.0) <= CONSTANT_SHARE
    fault = ""
    if reached is None:
        fault = _end_fault(record, sign, used[-1])
    elif steps.kind[main] == "dynamic":
        fault = "the load is dynamic, not a constant current"
    elif not whole and moved[same].sum() < RATE_SHARE * moved.sum():
        fault = "its current changes: less than 90 % of the charge moved at one rate"
    first_row = max(steps.first_row[loads[0]] - 1, 0)
    return Half(sign, first_row, int(steps.last_row[used[-1]]), rate, held, fault)


def _rate(record, step):
    """Size of the current of a step before its voltage is held [A], and the row that ends it."""
    first = int(record.steps.first_row[step])
    held, last = int(record.steps.cv_first_row[step]), int(record.steps.last_row[step])
    end = held if held > first else last + 1
    size = float(np.median(np.abs(record.current[first:end])))
    return max(size, 1e-12), min(end, last)


def _reaches(record, sign, loads):
    """First of the loads that reaches the cut-off of its direction, or None.

    Reached also where a line through its last samples does: the cut-off then lies between two.
    """
    voltage, steps, limit = record.voltage, record.steps, record.end_limit(sign)
    if limit is None:
        return None
    for step in loads:
        first, last = steps.first_row[step], steps.last_row[step]
        along = sign * steps.charge_ampere_hour[step] > 0
        earlier = max(last - 5, first)
        slope = (voltage[last] - voltage[earlier]) / max(last - earlier, 1)
        ahead = sign * (voltage[last] + slope)
        best = max(np.max(sign * voltage[first : last + 1]), ahead)
        if along and steps.kind[step] != "dynamic" and best >= sign * limit - NEAR_VOLT:
            return step
    return None


def _end_fault(record, sign, last_load):
    """Why a half cycle that does not reach its cut-off is not complete."""
    limit = record.end_limit(sign)
    if limit is None:
        name = "upper" if sign > 0 else "lower"
        return f"the {name} cut-off is not stated, so its end cannot be told"
    end = record.voltage[record.steps.last_row[last_load]]
    return f"it ends at {end:.3f} V, before the cut-off of {limit} V"


EFFICIENCY_MAX = 1.05  # above it the two were not one cycle between the same two ends


class CapacityRows(NamedTuple):
    """One entry a direction and rate, arrays of shape (rows,).

    Capacity, energy and the rest are means over the repeats, capacity_std_ampere_hour is their
    standard deviation (ddof 1; NaN for a single one), and what an unsure start may lack.
    constant_current_ampere_hour is the part before the voltage was held.
    """

    direction: np.ndarray
    c_rate: np.ndarray
    capacity_ampere_hour: np.ndarray
    capacity_std_ampere_hour: np.ndarray
    energy_watt_hour: np.ndarray
    coulombic_efficiency: np.ndarray
    repeats: np.ndarray
    mean_current_ampere: np.ndarray
    temperature_mean_celsius: np.ndarray
    constant_current_ampere_hour: np.ndarray


class Capacities(NamedTuple):
    """Capacities, and a sentence for each half cycle that is incomplete or of unsure start."""

    rows: CapacityRows
    left_out: tuple


class _Measured(NamedTuple):
    """Numbers of one complete half cycle: rate and current [A], capacities [Ah], energy [Wh]."""

    sign: int
    rate: float
    capacity: float
    energy: float
    efficiency: float
    current: float
    temperature: float
    constant: float
    missing: float


def capacity(
    test_time_second,
    current_ampere,
    voltage_volt,
    charge_ampere_hour,
    steps,
    *,
    rated_capacity_ampere_hour,
    lower_cutoff_volt,
    upper_cutoff_volt,
    surface_temperature_celsius=None,
    whole_swing=False,
    state_before="",
    soc_at_start=None,
    curve=None,
):
    """Capacity of every complete discharge and charge, averaged over repeats at one rate.

    1. The record is cut where its counted charge turns. 2. A discharge is complete from full (the
    charge before it reached the upper cut-off, or the record begins full) to the lower cut-off, a
    charge from empty to the upper cut-off; what was held there at constant voltage is part of it.
    3. It is counted to where the limit is first reached; with `whole_swing` to the turn itself, so
    that a remainder drawn later, at another temperature, is included (slow OCV tests).
    4. Discharges, or charges, of one rate (`conditions.same_rate`) are repeats: mean and standard
    deviation (thesis, ch. 4.3).

    What an unsure start may lack is part of the standard deviation. Coulombic efficiency is the
    discharge over the charge before it, or else the one after it; NaN where there is none, or where
    it exceeds 1.05: such a charge did not return the discharge.

    Parameters
    ----------
    test_time_second, current_ampere, voltage_volt, charge_ampere_hour : (n,) [s], [A], [V], [Ah],
        positive on charge.
    steps : Steps of the record.
    rated_capacity_ampere_hour : [Ah] for the C-rate; None: `assumed_rating` of the record.
    lower_cutoff_volt, upper_cutoff_volt : [V]; the upper may be None: then no charge is complete.
    surface_temperature_celsius : (n,) [°C] or None.
    whole_swing : count from turn to turn of the charge.
    state_before : "full" or "empty", as the test before this one in time left the cell; "": not
        known.
    soc_at_start : of the first row, as the sheet states it [1], or None.
    curve : open-circuit voltage that this is held against, see `anchor.contradiction`, or None.

    Returns
    -------
    Capacities

    Raises
    ------
    Refusal : nothing in the record is complete; the reasons are named.
    """
    current, voltage = np.asarray(current_ampere, float), np.asarray(voltage_volt, float)
    charge, time = np.asarray(charge_ampere_hour, float), np.asarray(test_time_second, float)
    rated = rated_capacity_ampere_hour or assumed_rating(current, charge)
    record = _Record(current, voltage, charge, steps, (lower_cutoff_volt, upper_cutoff_volt))
    known = Before(state_before, soc_at_start, curve, first_rest_second(steps))
    halves = _half_cycles(record, rated, known, whole=whole_swing)
    left_out = tuple(
        f"{NAMES[half.sign]} from {time[half.first_row]:.0f} s: {half.fault or half.words}"
        for half in halves
        if half.fault or half.words
    )
    complete = [
        _measured(half, partner, voltage, charge, surface_temperature_celsius)
        for half, partner in zip(halves, _partners(halves), strict=True)
        if not half.fault
    ]
    if not complete:
        raise Refusal(f"no complete discharge or charge: {'; '.join(left_out) or 'none begins'}")
    return Capacities(_table(complete, rated), left_out)


def _partners(halves):
    """Complete other half of the cycle of each half cycle, or None.

    A cycle is a charge and the discharge after it, or else a discharge and the charge after it.
    """
    padded = [None, *halves, None]
    sides = [(padded[k], padded[k + 2]) for k in range(len(halves))]
    ordered = [
        side if half.sign < 0 else side[::-1] for half, side in zip(halves, sides, strict=True)
    ]
    return [
        next((half for half in side if half is not None and not half.fault), None)
        for side in ordered
    ]


def _measured(half, partner, voltage, charge, temperature):
    """Numbers of one complete half cycle; its partner gives the efficiency."""
    rows = slice(half.first_row, half.last_row + 1)
    moved = np.diff(charge[rows])
    middle = (voltage[rows][1:] + voltage[rows][:-1]) / 2
    celsius = np.nan if temperature is None else _mean(np.asarray(temperature, float)[rows])
    return _Measured(
        sign=half.sign,
        rate=half.rate_ampere,
        capacity=_moved(half, charge),
        energy=abs(float(np.sum(middle * moved))),
        efficiency=_efficiency(half, partner, charge),
        current=half.sign * half.rate_ampere,
        temperature=celsius,
        constant=abs(charge[half.held_row] - charge[half.first_row]),
        missing=half.missing_ampere_hour,
    )


def _moved(half, charge):
    """Charge of a half cycle [Ah]."""
    return abs(float(charge[half.last_row] - charge[half.first_row]))


def _efficiency(half, partner, charge):
    """Discharge over charge of a half cycle and its partner [1]; NaN where they are no cycle."""
    if partner is None:
        return np.nan
    discharge, its_charge = (half, partner) if half.sign < 0 else (partner, half)
    efficiency = _moved(discharge, charge) / _moved(its_charge, charge)
    return efficiency if efficiency <= EFFICIENCY_MAX else np.nan  # the charge was cut short


def _mean(values):
    """Mean of the finite values; NaN where there are none."""
    measured = values[np.isfinite(values)]
    return float(measured.mean()) if len(measured) else np.nan


def _table(complete, rated):
    """CapacityRows with the repeats of each direction and rate as one row."""
    repeats = []
    for half in sorted(complete, key=lambda half: (-half.sign, half.rate)):
        first = repeats[-1][0] if repeats else None
        if first and first.sign == half.sign and same_rate(half.rate, first.rate):
            repeats[-1].append(half)
        else:
            repeats.append([half])
    columns = zip(*[_row(halves, rated) for halves in repeats], strict=True)
    return CapacityRows(*[np.array(column) for column in columns])


def _row(halves, rated):
    """One row of CapacityRows: means over the repeats, standard deviation of the capacity."""
    sizes = np.array([half.capacity for half in halves])
    mean = {
        name: _mean(np.array([getattr(half, name) for half in halves]))
        for name in ("rate", "energy", "efficiency", "current", "temperature", "constant")
    }
    return (
        NAMES[halves[0].sign],
        mean["rate"] / rated,
        sizes.mean(),
        _std(sizes, np.mean([half.missing for half in halves])),
        mean["energy"],
        mean["efficiency"],
        len(sizes),
        mean["current"],
        mean["temperature"],
        mean["constant"],
    )


def _std(sizes, missing):
    """Standard deviation of repeats and of what their starts may lack [Ah]; NaN: not known."""
    if len(sizes) < 2:
        return missing or np.nan
    return float(np.hypot(sizes.std(ddof=1), missing))
