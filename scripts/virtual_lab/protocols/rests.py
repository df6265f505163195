"""Rests: slow open-circuit curves, relaxations, and rests in a chamber that steps."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from virtual_lab.chamber import Chamber, stepped
from virtual_lab.protocols.steps import HOUR, MINUTE, Step, charge, discharge, draw, rest
from virtual_lab.rating import Rating

THESIS_CELSIUS = (20.0, 15.0, 10.0, 5.0, 0.0, -5.0, -10.0, -15.0, -20.0)


def slow_ocv(rating: Rating, *, c_rate: float = 1 / 25, period_second: float = 40.0) -> list[Step]:
    """Slow discharge, rest, slow charge, rest."""
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
    """From full, a share taken out and a rest, until little is left (thesis 3.3: S8)."""
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
    """Long rest at a state of charge, then the chamber steps and goes back (thesis 3.3: S6).

    Parameters
    ----------
    rating : of the cell, which is full at the start.
    capacity_ampere_hour : of the cell at the first temperature [Ah].
    soc : states of charge from high to low, each below 1 by a discharge at C/2.
    celsius : temperatures of the chamber in turn [°C]; it begins at the first.
    long_rest_second, dwell_second : at the first temperature and at each other one, the way
        there included [s].
    kelvin_per_minute : how fast the chamber moves.

    Returns
    -------
    The steps, and the chamber over the time of the test. A draw that meets the lower cut-off ends
    early and leaves the chamber late: keep away from an empty cell.
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
