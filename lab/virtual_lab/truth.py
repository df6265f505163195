"""Rows of the truth tables about a test, without noise: from what its cell really did.

Capacities and states of charge, pulse resistances, peaks of dQ/dV, and shares of parallel
branches.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.signal import find_peaks

from virtual_lab.behaviour import Rating

NEAR_VOLT = 0.002  # a step that is ended by a cut-off meets it within this
NEAR_FULL = 0.01  # a test begins full, or empty, within this
SAME_RATE = 1.02
MOST_INSTANTS = 20_000
GRID_SECOND = 0.25
SHORTEST_SECOND = 0.1


class Swing(NamedTuple):
    """A complete discharge (sign −1) or charge (+1): current [A], charge [Ah], energy [Wh]."""

    sign: int
    ampere: float
    ampere_hour: float
    watt_hour: float


def capacity_rows(steps: list, behaviours: list, *, rating: Rating, initial_soc=1.0) -> list[dict]:
    """Capacity and energy of each direction and rate: means over the complete repeats.

    Complete is a constant-current discharge from full to the lower cut-off, or a charge from empty
    to the upper one; a hold right after it belongs to it. Full is a cell whose last load ended at
    the upper cut-off, or that began so by `initial_soc`; empty likewise.

    Parameters
    ----------
    steps, behaviours : what was asked (`protocols.Step`) and what happened.
    rating : to which the C-rates refer.
    initial_soc : state of charge at the start [1].

    Returns
    -------
    Rows of capacity.csv without cell and test; charges first.
    """
    repeats: list[list[Swing]] = []
    swings = _swings(steps, behaviours, rating, initial_soc)
    for swing in sorted(swings, key=lambda swing: (-swing.sign, swing.ampere)):
        last = repeats[-1][-1] if repeats else None
        if last and last.sign == swing.sign and swing.ampere <= SAME_RATE * last.ampere:
            repeats[-1].append(swing)
        else:
            repeats.append([swing])
    return [_capacity_row(alike, rating) for alike in repeats]


def cycle_rows(steps: list, behaviours: list, *, rating: Rating, initial_soc=1.0) -> list[dict]:
    """Capacity [Ah] and energy [Wh] of each complete discharge of a test, counted from 1.

    The parameters are those of `capacity_rows`.
    """
    down = [s for s in _swings(steps, behaviours, rating, initial_soc) if s.sign < 0]
    return [
        {
            "cycle": cycle,
            "capacity_ampere_hour": round(swing.ampere_hour, 6),
            "energy_watt_hour": round(swing.watt_hour, 6),
        }
        for cycle, swing in enumerate(down, 1)
    ]


def _capacity_row(swings, rating) -> dict:
    return {
        "direction": "charge" if swings[0].sign > 0 else "discharge",
        "c_rate": round(swings[0].ampere / rating.capacity_ampere_hour, 4),
        "capacity_ampere_hour": round(float(np.mean([s.ampere_hour for s in swings])), 6),
        "energy_watt_hour": round(float(np.mean([s.watt_hour for s in swings])), 6),
        "repeats": len(swings),
    }


def _swings(steps, behaviours, rating, initial_soc) -> list[Swing]:
    """Complete charges and discharges of a test, in time order."""
    end = 1 if initial_soc > 1 - NEAR_FULL else -1 if initial_soc < NEAR_FULL else 0
    limits = {1: rating.upper_cutoff_volt, -1: rating.lower_cutoff_volt}
    swings, follower = [], 0
    for k, (step, behaviour) in enumerate(zip(steps, behaviours, strict=True)):
        rests = step.kind == "current" and step.value == 0.0
        if k < follower or behaviour.duration_second < SHORTEST_SECOND or rests:
            continue
        sign, follower = 1 if flowed(behaviour) > 0 else -1, k + 1
        met = abs(float(behaviour.voltage(behaviour.duration_second)) - limits[sign]) < NEAR_VOLT
        if step.kind == "current" and met:
            follower += follower < len(steps) and steps[follower].kind == "hold"
            parts = behaviours[k:follower]
            charge, energy = (abs(sum(map(each, parts))) for each in (flowed, _energy))
            swings += [Swing(sign, abs(step.value), charge, energy)] if end == -sign else []
        end = sign if met else 0
    return swings


def flowed(behaviour) -> float:
    """Charge [Ah] that has flowed into the cell in a step."""
    if behaviour.charge is not None:
        return float(behaviour.charge(behaviour.duration_second))
    return _integral(behaviour.current, behaviour.duration_second)


def instants(duration_second: float) -> np.ndarray:
    """Times [s] at which a step is integrated: dense after its begin, then every quarter second.

    Steps of more than 5,000 s: 20,000 times.
    """
    every = max(GRID_SECOND, duration_second / MOST_INSTANTS)
    regular = np.arange(0.0, duration_second, every)
    early = np.geomspace(1e-3, 10.0, 60)
    return np.unique(np.concatenate([regular, early[early < duration_second], [duration_second]]))


def _energy(behaviour) -> float:
    """Energy [Wh] put into the cell in a step."""
    return _integral(
        lambda s: behaviour.current(s) * behaviour.voltage(s), behaviour.duration_second
    )


def _integral(function, duration_second) -> float:
    """Integral of a function of time over a step, per hour."""
    second = instants(duration_second)
    return float(np.trapezoid(function(second), second) / 3600)


def soc_rows(
    behaviours: list, *, capacity_ampere_hour: float, initial_soc: float = 1.0
) -> list[dict]:
    """True state of charge at the begin and the end of a test; rows of soc.csv.

    Parameters
    ----------
    behaviours : of the test.
    capacity_ampere_hour : of the full cell [Ah], to which the state of charge refers.
    initial_soc : at the start [1].
    """
    end = soc_at_begins(behaviours, capacity_ampere_hour, initial_soc)[-1]
    return [
        {
            "soc_begin": round(float(initial_soc), 6),
            "soc_end": round(float(end), 6),
            "capacity_ampere_hour": round(float(capacity_ampere_hour), 6),
        }
    ]


def soc_at_begins(behaviours: list, capacity_ampere_hour: float, initial_soc: float) -> np.ndarray:
    """State of charge [1] where each step begins, and at the end of the last, (steps + 1,).

    As the generator knows it; else by the charge that has flowed.
    """
    if behaviours[0].soc is not None:
        begins = [float(behaviour.soc(0.0)) for behaviour in behaviours]
        return np.array([*begins, float(behaviours[-1].soc(behaviours[-1].duration_second))])
    charges = [flowed(behaviour) for behaviour in behaviours]
    return initial_soc + np.cumsum([0.0, *charges]) / capacity_ampere_hour


DELAYS_SECOND = (0.0, 1.0, 10.0, 30.0)
FIRST_SECOND = 0.010  # where the first sample of a pulse lies
LONGEST_SECOND = 120.0  # a longer load is no pulse


def resistance_rows(
    steps: list,
    behaviours: list,
    *,
    capacity_ampere_hour: float,
    initial_soc: float = 1.0,
    delays_second: tuple[float, ...] = DELAYS_SECOND,
) -> list[dict]:
    """Resistance of each pulse: constant current for at most two minutes, after another current.

    Its step of the current is counted from the current before it: zero after a rest, that of the
    discharge where the pulse interrupts one. Delay 0 is 10 ms after the edge.

    Parameters
    ----------
    steps, behaviours : what was asked and what happened.
    capacity_ampere_hour : of the full cell [Ah], to which the state of charge refers.
    initial_soc : at the start [1].
    delays_second : after the edge [s]; those after the pulse's end are left out.

    Returns
    -------
    Rows of resistance.csv without cell and test.
    """
    soc = soc_at_begins(behaviours, capacity_ampere_hour, initial_soc)
    begins = np.cumsum([0.0, *[round(b.duration_second, 3) for b in behaviours]])
    rows = []
    for k, (before, pulse) in enumerate(pairwise(range(len(steps))), 1):
        if is_pulse(steps[before], steps[pulse]):
            shared = {"soc": round(float(soc[k]), 6), "start_time_second": round(begins[k], 3)}
            rows += _pulse_rows(behaviours[before], behaviours[pulse], delays_second, shared)
    return rows


def is_pulse(before, step) -> bool:
    """Whether a step is a pulse: short, of a constant current larger than that before."""
    constant = step.kind == before.kind == "current"
    short = step.duration_second <= LONGEST_SECOND
    return constant and short and abs(step.value) > abs(before.value)


def _pulse_rows(before, pulse, delays, shared) -> list[dict]:
    end = before.duration_second
    volt, ampere = float(before.voltage(end)), float(before.current(end))
    reached = [d for d in delays if max(d, FIRST_SECOND) <= pulse.duration_second + 1e-3]
    rows = []
    for delay in reached:
        second = min(max(delay, FIRST_SECOND), pulse.duration_second)
        change = float(pulse.current(second)) - ampere
        rows.append(
            {
                "soc": shared["soc"],
                "direction": "charge" if change > 0 else "discharge",
                "start_time_second": float(shared["start_time_second"]),
                "delay_second": delay,
                "resistance_ohm": float(f"{(float(pulse.voltage(second)) - volt) / change:.6g}"),
            }
        )
    return rows


PEAK_POINTS = 4001
BESIDE_SHARE = 0.002  # of the charge, to either side: what the slope of the voltage is taken over
PROMINENCE = 0.05
LONG_SECOND = 120.0
LEAST_SHARE = 0.3  # of the rating: a shorter charge shows no whole curve


def ica_rows(
    steps: list, behaviours: list, *, rating: Rating, prominence: float = PROMINENCE
) -> list[dict]:
    """Peaks of dQ/dV of every long constant-current charge, by rising voltage.

    Parameters
    ----------
    steps, behaviours : what was asked and what happened.
    rating : to which the C-rates refer.
    prominence : least prominence of a peak as a share of the highest dQ/dV [1].

    Returns
    -------
    Rows of ica.csv without cell and test.
    """
    rows = []
    for step, behaviour in zip(steps, behaviours, strict=True):
        if step.kind != "current" or step.value <= 0 or behaviour.duration_second < LONG_SECOND:
            continue
        moved = step.value * behaviour.duration_second / 3600
        if moved < LEAST_SHARE * rating.capacity_ampere_hour:
            continue
        volt, height = incremental_capacity(behaviour, step.value)
        rows += [
            {
                "c_rate": round(step.value / rating.capacity_ampere_hour, 4),
                "peak": number,
                "voltage_volt": round(float(volt[top]), 5),
                "height_ampere_hour_per_volt": float(f"{height[top]:.6g}"),
            }
            for number, top in enumerate(peak_indices(height, prominence), 1)
        ]
    return rows


def incremental_capacity(behaviour, current_ampere: float) -> tuple[np.ndarray, np.ndarray]:
    """Voltage [V] and dQ/dV [Ah/V] of a constant-current charge, shape (n,) each.

    Even steps of charge, so that a flat plateau has as many points as it has charge. Points where
    the voltage falls during the charge have no dQ/dV and are left out.
    """
    second = np.linspace(0.0, behaviour.duration_second, PEAK_POINTS)
    volt = behaviour.voltage(second)
    charge = current_ampere * second / 3600
    beside = round(BESIDE_SHARE * PEAK_POINTS)
    rise = volt[2 * beside :] - volt[: -2 * beside]
    middle = volt[beside:-beside]
    rising = rise > 0
    passed = charge[2 * beside] - charge[0]
    return middle[rising], passed / rise[rising]


def peak_indices(height: np.ndarray, prominence: float) -> np.ndarray:
    """Indices of peaks whose prominence is at least a share [1] of the highest point."""
    return find_peaks(height, prominence=prominence * height.max())[0]


def group_rows(
    steps: list,
    behaviours: list,
    *,
    names: Sequence[str],
    capacities_ampere_hour: Sequence[float | None],
) -> list[dict]:
    """Charge and largest current of each branch; rows of packs.csv without group and test.

    Parameters
    ----------
    steps, behaviours : of the test; each behaviour has a branch per name.
    names : cells in the order of the branches.
    capacities_ampere_hour : of these cells, alone [Ah].

    Returns
    -------
    One row a branch: `capacity_ampere_hour` of its cell; `charge_ampere_hour`, the net charge it
    gave while the group was discharged; `current_max_ampere`, its largest current of either
    direction; `group_capacity_ampere_hour`, the charge of the whole group in a constant-current
    discharge to its cut-off (the largest; blank where there was none).
    """
    nets = [_integral(behaviour.current, behaviour.duration_second) for behaviour in behaviours]
    discharged = [b for b, net in zip(behaviours, nets, strict=True) if net < -1e-6]
    whole = zip(steps, behaviours, nets, strict=True)
    complete = [-net for step, b, net in whole if net < 0 and _ended_empty(step, b)]
    rows = []
    for branch, (name, capacity) in enumerate(zip(names, capacities_ampere_hour, strict=True)):
        charge = sum(-_integral(b.branches[branch], b.duration_second) for b in discharged)
        largest = max(
            float(np.abs(b.branches[branch](instants(b.duration_second))).max()) for b in behaviours
        )
        rows.append(
            {
                "branch": branch + 1,
                "cell": name,
                "capacity_ampere_hour": None if capacity is None else round(float(capacity), 6),
                "charge_ampere_hour": round(charge, 6),
                "current_max_ampere": round(largest, 6),
                "group_capacity_ampere_hour": round(max(complete), 6) if complete else None,
            }
        )
    return rows


def _ended_empty(step, behaviour) -> bool:
    if step.kind != "current" or step.until_volt is None:
        return False
    end = float(behaviour.voltage(behaviour.duration_second))
    return abs(end - step.until_volt) < NEAR_VOLT


def string_rows(
    steps: list, behaviours: list, *, names: Sequence[str], capacities_ampere_hour: Sequence[float]
) -> list[dict]:
    """Charge and energy of a series string and the state of each cell; rows of series_packs.csv.

    Parameters
    ----------
    steps, behaviours : of the test; each behaviour has a voltage and a state of charge per cell.
    names : cells in the order of the string.
    capacities_ampere_hour : of the full cells [Ah].

    Returns
    -------
    One row a cell, none where nothing was discharged. Of the cell: its full charge, state of charge
    at begin and end of the test, lowest voltage, and voltage at the end of the last discharge. Of
    the string: net charge and energy of all that discharged it, and the cell of the lowest voltage
    at that end.
    """
    flows = [_integral(b.current, b.duration_second) for b in behaviours]
    down = [b for b, flow in zip(behaviours, flows, strict=True) if flow < -1e-6]
    if not down:
        return []
    shared = {
        "discharged_ampere_hour": round(-sum(flow for flow in flows if flow < 0), 6),
        "discharged_watt_hour": round(-sum(_energy(b) for b in down), 5),
    }
    last = down[-1].duration_second
    at_end = [float(volt(last)) for volt in down[-1].cell_voltages]
    shared["lowest_at_end"] = names[int(np.argmin(at_end))]
    rows = []
    for k, (name, full) in enumerate(zip(names, capacities_ampere_hour, strict=True)):
        lowest = min(float(b.cell_voltages[k](instants(b.duration_second)).min()) for b in down)
        rows.append(
            {"position": k + 1, "cell": name, "capacity_ampere_hour": round(full, 6)}
            | {"soc_begin": round(float(behaviours[0].cell_soc[k](0.0)), 6)}
            | {"soc_at_end_of_discharge": round(float(down[-1].cell_soc[k](last)), 6)}
            | {"lowest_volt": round(lowest, 6), "volt_at_end_of_discharge": round(at_end[k], 6)}
            | shared
        )
    return rows


PULSED = ("hppc", "pulse_resistance")
REFERENCE_CELSIUS = 25.0
CYCLED = ("capacity", "ocv", "fast_charge")


def rows(test, behaviours: list) -> dict[str, list[dict]]:
    """Rows of the truth tables about a test, without the columns cell and test.

    Parameters
    ----------
    test : with `kind`, `steps`, `initial_soc` and a `specimen`, as in `campaigns.Test`. The
        specimen has a `full_ampere_hour` and a `rating` (or its `cell` has); that of a group the
        `names` of its cells and their `capacities_ampere_hour`.
    behaviours : one per step.

    Returns
    -------
    Tables by name: packs for a parallel group, series_packs for cells in series; else soc and, by
    the kind, capacity, resistance and ica; of an ageing test cycles, since a mean over a life says
    nothing.
    """
    specimen = test.specimen
    if test.kind == "group":
        of_cells = {
            "names": specimen.names,
            "capacities_ampere_hour": specimen.capacities_ampere_hour,
        }
        if behaviours[0].cell_voltages:
            string = string_rows(test.steps, behaviours, **of_cells)
            return {"series_packs": [{"group": test.cell, **row} for row in string]}
        branches = group_rows(test.steps, behaviours, **of_cells)
        return {"packs": [{"group": test.cell, **row} for row in branches]}
    # Of the full cell at the temperature of the test.
    warmer = test.ambient_celsius - REFERENCE_CELSIUS
    growth = 1 + getattr(specimen, "capacity_per_kelvin", 0.0) * warmer
    full = {
        "capacity_ampere_hour": specimen.full_ampere_hour * growth,
        "initial_soc": test.initial_soc,
    }
    tables = {"soc": soc_rows(behaviours, **full)}
    if test.kind in PULSED:
        tables["resistance"] = resistance_rows(test.steps, behaviours, **full)
    if test.kind in CYCLED:
        tables["capacity"] = capacity_rows(test.steps, behaviours, **_rated(test))
    if test.kind == "ageing":
        tables["cycles"] = cycle_rows(test.steps, behaviours, **_rated(test))
    if test.kind == "ica":
        tables["ica"] = ica_rows(test.steps, behaviours, rating=rating_of(specimen))
    return tables


def _rated(test):
    return {"rating": rating_of(test.specimen), "initial_soc": test.initial_soc}


def rating_of(specimen) -> Rating:
    """Data sheet of a specimen or of its cell.

    Raises
    ------
    ValueError : it has neither.
    """
    for holder in (specimen, getattr(specimen, "cell", None)):
        if isinstance(rating := getattr(holder, "rating", None), Rating):
            return rating
    raise ValueError(f"{type(specimen).__name__} has no rating, to which C-rates could refer")
