"""Pulse tests and rests: HPPC, pulses on a discharge, slow OCV, relaxation, temperature steps."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from virtual_lab.behaviour import Rating
from virtual_lab.chamber import Chamber, stepped
from virtual_lab.protocols.steps import HOUR, MINUTE, Step, charge, discharge, draw, rest

PULSE_PERIOD = 0.5
POINTS = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.05)
POINTS_BELOW_FULL = (0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1)


def hybrid_pulses(
    rating: Rating,
    capacity_ampere_hour: float,
    *,
    highest_charge_pulse_soc: float = 0.8,
    points: Sequence[float] = POINTS,
    discharge_c_rate: float = 1.0,
    charge_c_rate: float = 0.75,
) -> list[Step]:
    """Pulses at every tenth of the capacity and at a twentieth, from full.

    Each: 10 s at 1C discharge, 40 s rest, 10 s at 0.75C charge (left out near full, where it would
    pass the upper cut-off), 40 s rest; then C/2 discharge to the next point and 1 h rest.

    Parameters
    ----------
    rating : of the cell.
    capacity_ampere_hour : what the laboratory takes for the cell's capacity [Ah].
    highest_charge_pulse_soc : above it the charge pulse is left out.
    points : states of charge, from 1 down.
    discharge_c_rate, charge_c_rate : of the pulses [1/h].
    """
    steps = [rest(10 * MINUTE)]
    for soc, following in zip(points, [*points[1:], None], strict=True):
        up = charge_c_rate if soc <= highest_charge_pulse_soc else None
        steps += _pulse_pair(rating, discharge_c_rate, up)
        if following is not None:
            taken = (soc - following) * capacity_ampere_hour
            steps += [draw(rating, taken, period_second=5.0), rest(HOUR)]
    return steps


def hybrid_pulses_below_full(
    rating: Rating,
    capacity_ampere_hour: float,
    *,
    points: Sequence[float] = POINTS_BELOW_FULL,
    discharge_c_rate: float = 1.5,
    charge_c_rate: float = 1.0,
    first_charge_c_rate: float = 0.4,
    rest_second: float = 40 * MINUTE,
    period_second: float = 15.0,
) -> list[Step]:
    """C/3 to each point and 40 min rest, then 10 s at 1.5C, 40 s, 10 s of charge at 1C, 40 s.

    The charge pulse of the first point is smaller (`first_charge_c_rate`). The other parameters
    are those of `hybrid_pulses`; `period_second` is that of the C/3 parts and of the long rests.
    """
    steps, up = [rest(10 * MINUTE, period_second=5.0)], first_charge_c_rate
    for before, after in pairwise([1.0, *points]):
        taken = (before - after) * capacity_ampere_hour
        steps.append(draw(rating, taken, c_rate=1 / 3, period_second=period_second))
        steps.append(rest(rest_second, period_second=period_second))
        steps += _pulse_pair(rating, discharge_c_rate, up, period_second=1.0)
        up = charge_c_rate
    return [*steps, rest(10 * MINUTE, period_second=period_second)]


def pulses_on_discharge(
    rating: Rating,
    capacity_ampere_hour: float,
    *,
    c_rate: float = 1 / 3,
    pulse_c_rate: float = 2.0,
    pulse_second: float = 0.015,
    every_second: float = 15.0,
    lowest_soc: float = 0.05,
    period_second: float = 5.0,
) -> list[Step]:
    """A discharge from full with a short harder pulse every 15 s (thesis 3.3 and 4.3: S7, S11).

    Parameters
    ----------
    rating : of the cell.
    capacity_ampere_hour : of the cell at the temperature of the test [Ah].
    c_rate : of the discharge [1/h]: C/3 or C/2.
    pulse_c_rate : whole current of a pulse [1/h].
    pulse_second, every_second : length of a pulse, and from one to the next [s].
    lowest_soc : without pulses below; the discharge goes on to the lower cut-off.
    period_second : between samples of the discharge.
    """
    between = every_second - pulse_second
    base = discharge(rating, c_rate, period_second=period_second)
    hard = Step("current", -rating.ampere(pulse_c_rate), pulse_second, pulse_second)
    part = [base._replace(duration_second=between), hard]
    drawn = (rating.ampere(c_rate) * between - hard.value * pulse_second) / HOUR
    count = int((1 - lowest_soc) * capacity_ampere_hour / drawn)
    return [rest(10 * MINUTE, period_second=5.0), *part * count, base, rest(30 * MINUTE)]


def pulses_at_rest(
    rating: Rating,
    capacity_ampere_hour: float,
    *,
    points: Sequence[float] = POINTS_BELOW_FULL,
    c_rate: float = 2.0,
    pulse_second: float = 10.0,
    rest_second: float = HOUR,
) -> list[Step]:
    """Discharge pulses from rest: C/2 to each point, a long rest, one pulse, 5 min rest."""
    pulse = Step(
        "current", -rating.ampere(c_rate), pulse_second, PULSE_PERIOD, rating.lower_cutoff_volt
    )
    steps = [rest(10 * MINUTE)]
    for before, after in pairwise([1.0, *points]):
        taken = (before - after) * capacity_ampere_hour
        down = [draw(rating, taken), rest(rest_second)] if taken > 0 else []
        steps += [*down, pulse, rest(5 * MINUTE, period_second=PULSE_PERIOD)]
    return steps


def _pulse_pair(rating, discharge_c_rate, charge_c_rate, *, period_second=PULSE_PERIOD):
    """10 s discharge, 40 s rest, 10 s charge, 40 s rest; without the charge if its rate is None."""
    lower, upper = rating.lower_cutoff_volt, rating.upper_cutoff_volt
    pause = rest(40.0, period_second=period_second)
    down = Step("current", -rating.ampere(discharge_c_rate), 10.0, period_second, lower)
    if charge_c_rate is None:
        return [down, pause]
    up = Step("current", rating.ampere(charge_c_rate), 10.0, period_second, upper)
    return [down, pause, up, pause]


THESIS_CELSIUS = (20.0, 15.0, 10.0, 5.0, 0.0, -5.0, -10.0, -15.0, -20.0)


def slow_ocv(rating: Rating, *, c_rate: float = 1 / 25, period_second: float = 40.0) -> list[Step]:
    """Discharge, rest, charge, rest, so slow that the voltage is nearly the OCV."""
    period = {"period_second": period_second}
    return [
        rest(10 * MINUTE),
        discharge(rating, c_rate, **period),
        rest(2 * HOUR, period_second=60.0),
        charge(rating, c_rate, **period),
        rest(HOUR, period_second=60.0),
    ]


def relaxations(
    rating: Rating,
    capacity_ampere_hour: float,
    *,
    share: float = 0.1,
    lowest_soc: float = 0.1,
    c_rate: float = 0.5,
    rest_second: float = 40 * MINUTE,
    period_second: float = 5.0,
) -> list[Step]:
    """Discharges of a share of the capacity, each with a rest, from full (thesis 3.3: S8)."""
    count = round((1 - lowest_soc) / share)
    down = draw(rating, share * capacity_ampere_hour, c_rate=c_rate, period_second=period_second)
    pause = rest(rest_second, period_second=period_second)
    return [rest(10 * MINUTE), *[down, pause] * count]


def temperature_steps(
    rating: Rating,
    capacity_ampere_hour: float,
    *,
    soc: Sequence[float] = (0.5,),
    celsius: Sequence[float] = THESIS_CELSIUS,
    long_rest_second: float = 10 * HOUR,
    dwell_second: float = 2 * HOUR,
    kelvin_per_minute: float = 1.0,
) -> tuple[list[Step], Chamber]:
    """Long rest at a state of charge, then the chamber steps through temperatures and back (S6).

    Parameters
    ----------
    rating : of the cell, which is full at the start.
    capacity_ampere_hour : of the cell at the first temperature [Ah].
    soc : states of charge from high to low, each below 1 by a discharge at C/2.
    celsius : temperatures of the chamber in turn [°C]; it begins at the first.
    long_rest_second, dwell_second : at the first temperature and at each other one, the ramp
        included [s].
    kelvin_per_minute : heating and cooling rate of the chamber.

    Returns
    -------
    The steps, and the chamber over the time of the test. A discharge that meets the lower cut-off
    ends early, so that the chamber changes too late: the cell must not be nearly empty.
    """
    turn = stepped(
        (*celsius, celsius[0]),
        rest_second=long_rest_second,
        hold_second=dwell_second,
        kelvin_per_minute=kelvin_per_minute,
    )
    still = rest(round(float(turn.second[-1]) + dwell_second, 1), period_second=60.0)
    steps, second = [rest(10 * MINUTE)], []
    for before, after in pairwise([1.0, *soc]):
        steps += [draw(rating, (before - after) * capacity_ampere_hour)] if after < before else []
        second.append(sum(step.duration_second for step in steps) + turn.second)
        steps.append(still)
    return steps, Chamber(np.concatenate(second), np.tile(turn.celsius, len(second)))
