"""Cells in parallel: currents and cut-offs are those of the group.

`rating` is that of the group: the sum of its cells' capacities, one cell's cut-offs.
"""

from virtual_lab import loads, schedules
from virtual_lab.protocols.drives import drive
from virtual_lab.protocols.steps import (
    HOUR,
    LONG_PERIOD,
    MINUTE,
    Step,
    charge,
    discharge,
    hold,
    rest,
)
from virtual_lab.rating import Rating


def group_capacity(
    rating: Rating, *, c_rate: float = 1.0, charge_c_rate: float = 0.5, period_second: float = 5.0
) -> list[Step]:
    """CC discharge to the group's cut-off, rest, CCCV charge, rest (thesis 5.2: 1C and 2C).

    In the rests the cells go on exchanging charge.
    """
    still = rest(HOUR, period_second=period_second)
    return [
        rest(5 * MINUTE, period_second=5.0),
        discharge(rating, c_rate, period_second=period_second),
        still,
        charge(rating, charge_c_rate, period_second=period_second),
        hold(rating),
        still,
    ]


def group_drive(
    rating: Rating, capacity_ampere_hour: float, *, schedule: str, scale: float = 1.0
) -> list[Step]:
    """A drive from full down to a tenth; see `drive`."""
    return drive(rating, capacity_ampere_hour, schedule=schedule, scale=scale, taken_first=0.0)


def pair(rating: Rating, capacity_ampere_hour: float) -> list[Step]:
    """For two cells in parallel, from a tenth: CC charge, rest, dynamic discharge, rest.

    `rating` is that of one cell. Each step is ended by time.
    """
    profile = loads.current_profile("us06", rating, scale=2.0)
    second = 0.73 * capacity_ampere_hour / rating.ampere(1.0) * HOUR
    steps = [
        rest(5 * MINUTE, period_second=5.0),
        Step("current", rating.ampere(1.0), round(second), LONG_PERIOD / 2),
        rest(HOUR, period_second=LONG_PERIOD),
    ]
    for part in schedules.repeated(profile, ampere_hour=0.77 * capacity_ampere_hour):
        steps.append(Step("profile", part, part[-1, 0], 1.0))
        steps.append(rest(5 * MINUTE, period_second=5.0))
    return steps
