"""Charges: capacities of full discharges and charges, states of charge, shares of a group."""

from typing import NamedTuple

import numpy as np

from virtual_lab.rating import Rating

NEAR_VOLT = 0.002  # a step that is ended by a cut-off meets it within this
NEAR_FULL = 0.01  # a test begins full, or empty, within this
SAME_RATE = 1.02
INSTANTS = 20_000
GRID_SECOND = 0.25
SHORTEST_SECOND = 0.1


class Swing(NamedTuple):
    """A complete discharge (sign -1) or charge (+1): size of its current [A], charge, energy."""

    sign: int
    ampere: float
    ampere_hour: float
    watt_hour: float


def capacity_rows(steps: list, behaviours: list, *, rating: Rating, initial_soc=1.0) -> list[dict]:
    """Capacity and energy of each direction and rate, means over the complete repeats.

    Complete is a discharge of constant current from full to the lower cut-off, a charge from empty
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
    found: list[list[Swing]] = []
    for swing in sorted(_swings(steps, behaviours, rating, initial_soc), key=_order):
        last = found[-1][-1] if found else None
        alike = last and last.sign == swing.sign and swing.ampere <= SAME_RATE * last.ampere
        found = [*found[:-1], [*found[-1], swing]] if alike else [*found, [swing]]
    return [_capacity_row(alike, rating) for alike in found]


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


def _order(swing):
    return (-swing.sign, swing.ampere)


def _capacity_row(swings, rating) -> dict:
    return {
        "direction": "charge" if swings[0].sign > 0 else "discharge",
        "c_rate": round(swings[0].ampere / rating.capacity_ampere_hour, 4),
        "capacity_ampere_hour": round(float(np.mean([s.ampere_hour for s in swings])), 6),
        "energy_watt_hour": round(float(np.mean([s.watt_hour for s in swings])), 6),
        "repeats": len(swings),
    }


def _swings(steps, behaviours, rating, initial_soc) -> list[Swing]:
    """The complete ones, in time order."""
    end = 1 if initial_soc > 1 - NEAR_FULL else -1 if initial_soc < NEAR_FULL else 0
    limits = {1: rating.upper_cutoff_volt, -1: rating.lower_cutoff_volt}
    swings, follower = [], 0
    for k, (step, behaviour) in enumerate(zip(steps, behaviours, strict=True)):
        if k < follower or behaviour.duration_second < SHORTEST_SECOND or _rests(step):
            continue
        sign, follower = _direction(behaviour), k + 1
        met = abs(float(behaviour.voltage(behaviour.duration_second)) - limits[sign]) < NEAR_VOLT
        if step.kind == "current" and met:
            follower += follower < len(steps) and steps[follower].kind == "hold"
            swings += [_swing(sign, step, behaviours[k:follower])] if end == -sign else []
        end = sign if met else 0
    return swings


def _rests(step) -> bool:
    return step.kind == "current" and step.value == 0.0


def _direction(behaviour) -> int:
    return 1 if flowed(behaviour) > 0 else -1


def _swing(sign, step, behaviours) -> Swing:
    charge = sum(flowed(behaviour) for behaviour in behaviours)
    energy = sum(_energy(behaviour) for behaviour in behaviours)
    return Swing(sign, abs(step.value), abs(charge), abs(energy))


def flowed(behaviour) -> float:
    """Charge [Ah] that has flowed into the cell in a step."""
    if behaviour.charge is not None:
        return float(behaviour.charge(behaviour.duration_second))
    return _integral(behaviour.current, behaviour.duration_second)


def grid(duration_second: float) -> np.ndarray:
    """Instants of a step [s]: dense after its begin, then every quarter of a second.

    Steps of more than 5,000 s: 20,000 instants.
    """
    every = max(GRID_SECOND, duration_second / INSTANTS)
    regular = np.arange(0.0, duration_second, every)
    early = np.geomspace(1e-3, 10.0, 60)
    return np.unique(np.concatenate([regular, early[early < duration_second], [duration_second]]))


def _energy(behaviour) -> float:
    return _integral(
        lambda s: behaviour.current(s) * behaviour.voltage(s), behaviour.duration_second
    )


def _integral(function, duration_second) -> float:
    """Integral of a function of time over a step, per hour."""
    second = grid(duration_second)
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
    """State of charge [1] where each step begins, and at the end of the last (steps + 1,).

    As the generator knows it; else from what has flowed.
    """
    if behaviours[0].soc is not None:
        begins = [float(behaviour.soc(0.0)) for behaviour in behaviours]
        return np.array([*begins, float(behaviours[-1].soc(behaviours[-1].duration_second))])
    charges = [flowed(behaviour) for behaviour in behaviours]
    return initial_soc + np.cumsum([0.0, *charges]) / capacity_ampere_hour
