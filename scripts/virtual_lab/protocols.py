"""What the cycler is told to do: every protocol is a list of steps. Current positive on charge."""

from typing import NamedTuple

import numpy as np

from virtual_lab import schedules
from virtual_lab.cells import (
    LOWER_CUTOFF_VOLT,
    RATED_CAPACITY_AMPERE_HOUR,
    UPPER_CUTOFF_VOLT,
    Cell,
)

HOUR = 3600.0
MINUTE = 60.0
LONG_PERIOD = 10.0
REST_PERIOD = 30.0
PULSE_PERIOD = 0.5
DRIVE_PERIOD = 1.0
DEEPEST_DRIVE_SOC = 0.1


class Step(NamedTuple):
    """One step of a protocol.

    `kind` is "current" (value [A]), "hold" (value [V]) or "profile" (value: array [s, A], straight
    lines between its points). It ends after `duration_second`, or earlier when the voltage [V]
    passes `until_volt` or the current falls to `until_ampere`. A sample is asked for every
    `period_second`.
    """

    kind: str
    value: float | np.ndarray
    duration_second: float
    period_second: float
    until_volt: float | None = None
    until_ampere: float | None = None


def ampere(c_rate: float) -> float:
    """Current [A] of a C-rate, by the rating."""
    return c_rate * RATED_CAPACITY_AMPERE_HOUR


def rest(second: float, *, period_second: float = REST_PERIOD) -> Step:
    """No current."""
    return Step("current", 0.0, second, period_second)


def discharge(c_rate: float, *, period_second: float = LONG_PERIOD) -> Step:
    """Constant current to the lower cut-off."""
    longest = 1.5 * HOUR / c_rate
    return Step("current", -ampere(c_rate), longest, period_second, until_volt=LOWER_CUTOFF_VOLT)


def charge(c_rate: float, *, period_second: float = LONG_PERIOD) -> Step:
    """Constant current to the upper cut-off."""
    longest = 1.5 * HOUR / c_rate
    return Step("current", ampere(c_rate), longest, period_second, until_volt=UPPER_CUTOFF_VOLT)


def hold(*, until_c_rate: float = 1 / 20) -> Step:
    """Upper cut-off held until the current is small."""
    return Step("hold", UPPER_CUTOFF_VOLT, 10 * HOUR, 30.0, until_ampere=ampere(until_c_rate))


def capacity(*, repeats: int = 3) -> list[Step]:
    """C/2 discharge, rest, C/2 CCCV charge to C/20, rest; repeated."""
    once = [discharge(1 / 2), rest(HOUR), charge(1 / 2), hold(), rest(HOUR)]
    return [rest(MINUTE, period_second=5.0), *once * repeats]


def slow_ocv() -> list[Step]:
    """C/25 discharge, rest, C/25 charge, rest."""
    period = {"period_second": 40.0}
    return [
        rest(10 * MINUTE),
        discharge(1 / 25, **period),
        rest(2 * HOUR, period_second=60.0),
        charge(1 / 25, **period),
        rest(HOUR, period_second=60.0),
    ]


def incremental_capacity() -> list[Step]:
    """C/2 and then C/20 discharge until empty, rest, C/20 charge."""
    return [
        rest(MINUTE, period_second=5.0),
        discharge(1 / 2, period_second=30.0),
        rest(10 * MINUTE),
        discharge(1 / 20, period_second=30.0),
        rest(HOUR),
        charge(1 / 20),
        rest(10 * MINUTE),
    ]


def hybrid_pulses(cell: Cell, *, highest_charge_pulse_soc: float = 0.8) -> list[Step]:
    """Pulses at every tenth of the capacity and at a twentieth, from full.

    Each: 10 s at 1C discharge, 40 s rest, 10 s at 0.75C charge (left out near full, where it would
    pass the upper cut-off), 40 s rest; then C/2 discharge to the next point and 1 h rest.
    """
    points = [1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.05]
    steps = [rest(10 * MINUTE)]
    for soc, following in zip(points, [*points[1:], None], strict=True):
        steps += _pulse_pair(charge_too=soc <= highest_charge_pulse_soc)
        steps += [] if following is None else _to_next(soc - following, cell)
    return steps


def _pulse_pair(*, charge_too: bool) -> list[Step]:
    period = {"period_second": PULSE_PERIOD}
    pulses = [
        Step("current", -ampere(1.0), 10.0, until_volt=LOWER_CUTOFF_VOLT, **period),
        rest(40.0, **period),
    ]
    if charge_too:
        pulses += [
            Step("current", ampere(0.75), 10.0, until_volt=UPPER_CUTOFF_VOLT, **period),
            rest(40.0, **period),
        ]
    return pulses


def _to_next(soc_difference: float, cell: Cell) -> list[Step]:
    second = soc_difference * cell.capacity_ampere_hour / ampere(0.5) * HOUR
    down = discharge(0.5, period_second=5.0)._replace(duration_second=round(second, 1))
    return [down, rest(HOUR)]


def drive(cell: Cell, *, schedule: str, scale: float = 1.0) -> list[Step]:
    """5 min rest, a tenth taken out at C/2, then schedules with pauses down to 10 % SoC."""
    profile = schedules.current_profile(schedule, scale=scale)
    tenth = 0.1 * cell.capacity_ampere_hour / ampere(0.5) * HOUR
    steps = [
        rest(5 * MINUTE, period_second=5.0),
        discharge(0.5, period_second=DRIVE_PERIOD)._replace(duration_second=round(tenth)),
        rest(5 * MINUTE, period_second=5.0),
    ]
    available = (0.9 - DEEPEST_DRIVE_SOC) * cell.capacity_ampere_hour
    for part in schedules.repeated(profile, ampere_hour=available):
        steps.append(Step("profile", part, part[-1, 0], DRIVE_PERIOD, LOWER_CUTOFF_VOLT))
        steps.append(rest(5 * MINUTE, period_second=5.0))
    return steps


def pair(capacity_ampere_hour: float) -> list[Step]:
    """For cells in parallel, from a tenth: CC charge, rest, dynamic discharge, rest."""
    profile = schedules.current_profile("us06", scale=2.0)
    second = 0.73 * capacity_ampere_hour / ampere(1.0) * HOUR
    steps = [
        rest(5 * MINUTE, period_second=5.0),
        Step("current", ampere(1.0), round(second), LONG_PERIOD / 2),
        rest(HOUR, period_second=LONG_PERIOD),
    ]
    for part in schedules.repeated(profile, ampere_hour=0.77 * capacity_ampere_hour):
        steps.append(Step("profile", part, part[-1, 0], DRIVE_PERIOD))
        steps.append(rest(5 * MINUTE, period_second=5.0))
    return steps
