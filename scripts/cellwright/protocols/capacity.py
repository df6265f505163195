"""Capacity by direction and rate, from complete discharges and charges only."""

from typing import NamedTuple

import numpy as np

from cellwright.protocols.half_cycles import NAMES, SAME_RATE, half_cycles
from cellwright.refusal import Refusal
from cellwright.series.segments import assumed_rating

EFFICIENCY_MAX = 1.05  # above it the two were not one cycle between the same two ends


class CapacityRows(NamedTuple):
    """One entry a direction and rate, arrays of shape (rows,).

    Capacity, energy and the rest are means over the repeats, capacity_std_ampere_hour is their
    standard deviation (ddof 1; NaN for a single one). constant_current_ampere_hour is the part
    before the voltage was held.
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
    """The table, and a sentence for every discharge or charge that was left out of it."""

    rows: CapacityRows
    left_out: tuple


class _One(NamedTuple):
    sign: int
    rate: float
    capacity: float
    energy: float
    efficiency: float
    current: float
    temperature: float
    constant: float


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
):
    """Capacity of every complete discharge and charge, averaged over repeats at one rate.

    1. The record is cut where its counted charge turns. 2. A discharge is complete from full (the
    charge before it reached the upper cut-off, or the record begins full) to the lower cut-off, a
    charge from empty to the upper cut-off; what was held there at constant voltage is part of it.
    3. It is counted to where the limit is first reached; with `whole_swing` to the turn itself, so
    that a remainder drawn later, at another temperature, is included (slow OCV tests).
    4. Rates within 5 % are repeats of one: mean and standard deviation (thesis, ch. 4.3).

    Coulombic efficiency is the discharge over the charge before it, or else the one after it; NaN
    where there is none, or where it exceeds 1.05: such a charge did not return the discharge.

    Parameters
    ----------
    test_time_second, current_ampere, voltage_volt, charge_ampere_hour : (n,) [s], [A], [V], [Ah],
        positive on charge.
    steps : Steps of the record.
    rated_capacity_ampere_hour : [Ah] for the C-rate; None: `assumed_rating` of the record.
    lower_cutoff_volt, upper_cutoff_volt : [V]; the upper may be None: then no charge is complete.
    surface_temperature_celsius : (n,) [°C] or None.
    whole_swing : count from turn to turn of the charge.

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
    limits = (lower_cutoff_volt, upper_cutoff_volt)
    halves = half_cycles(
        current,
        voltage,
        charge,
        steps,
        rated=rated,
        limits=limits,
        whole=whole_swing,
    )
    left_out = tuple(
        f"{NAMES[half.sign]} from {time[half.first_row]:.0f} s: {half.fault}"
        for half in halves
        if half.fault
    )
    ones = [
        _one(half, other, voltage, charge, surface_temperature_celsius)
        for half, other in zip(halves, _partners(halves), strict=True)
        if not half.fault
    ]
    if not ones:
        raise Refusal(f"no complete discharge or charge: {'; '.join(left_out) or 'none begins'}")
    return Capacities(_table(ones, rated), left_out)


def _partners(halves):
    """For each half cycle the complete other half of its cycle, or None.

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


def _one(half, other, voltage, charge, temperature):
    """Numbers of one complete half cycle; its partner gives the efficiency."""
    rows = slice(half.first_row, half.last_row + 1)
    moved = np.diff(charge[rows])
    middle = (voltage[rows][1:] + voltage[rows][:-1]) / 2
    celsius = np.nan if temperature is None else _mean(np.asarray(temperature, float)[rows])
    return _One(
        sign=half.sign,
        rate=half.rate_ampere,
        capacity=_moved(half, charge),
        energy=abs(float(np.sum(middle * moved))),
        efficiency=_efficiency(half, other, charge),
        current=half.sign * half.rate_ampere,
        temperature=celsius,
        constant=abs(charge[half.held_row] - charge[half.first_row]),
    )


def _moved(half, charge):
    return abs(float(charge[half.last_row] - charge[half.first_row]))


def _efficiency(half, other, charge):
    if other is None:
        return np.nan
    mine, theirs = _moved(half, charge), _moved(other, charge)
    efficiency = mine / theirs if half.sign < 0 else theirs / mine
    return efficiency if efficiency <= EFFICIENCY_MAX else np.nan  # the charge was cut short


def _mean(values):
    """Mean of what is a number; NaN where nothing is."""
    some = values[np.isfinite(values)]
    return float(some.mean()) if len(some) else np.nan


def _table(ones, rated):
    """The repeats of each direction and rate as one row."""
    groups = []
    for one in sorted(ones, key=lambda one: (-one.sign, one.rate)):
        last = groups[-1][0] if groups else None
        if last and last.sign == one.sign and one.rate <= SAME_RATE * last.rate:
            groups[-1].append(one)
        else:
            groups.append([one])
    columns = zip(*[_row(group, rated) for group in groups], strict=True)
    return CapacityRows(*[np.array(column) for column in columns])


def _row(group, rated):
    sizes = np.array([one.capacity for one in group])
    mean = {
        name: _mean(np.array([getattr(one, name) for one in group]))
        for name in ("rate", "energy", "efficiency", "current", "temperature", "constant")
    }
    return (
        NAMES[group[0].sign],
        mean["rate"] / rated,
        sizes.mean(),
        sizes.std(ddof=1) if len(sizes) > 1 else np.nan,
        mean["energy"],
        mean["efficiency"],
        len(sizes),
        mean["current"],
        mean["temperature"],
        mean["constant"],
    )
