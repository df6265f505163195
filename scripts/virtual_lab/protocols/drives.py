"""Dynamic loads, of one cell and of cells in series."""

from virtual_lab import loads, schedules
from virtual_lab.protocols.steps import MINUTE, Step, draw, rest
from virtual_lab.rating import Rating

DRIVE_PERIOD = 1.0
DEEPEST_DRIVE_SOC = 0.1


def drive(
    rating: Rating,
    capacity_ampere_hour: float,
    *,
    schedule: str,
    scale: float = 1.0,
    taken_first: float = 0.1,
    deepest_soc: float = DEEPEST_DRIVE_SOC,
) -> list[Step]:
    """5 min rest, a tenth taken out at C/2, then schedules with pauses down to 10 % SoC.

    Parameters
    ----------
    rating : of the cell.
    capacity_ampere_hour : what the laboratory takes for the cell's capacity [Ah].
    schedule : a name of `loads.SCHEDULES`.
    scale : factor on the current, 1 at 25 °C.
    taken_first : share of the capacity taken out before the first schedule; 0 starts from full.
    deepest_soc : where the last schedule is cut short.
    """
    pause = rest(5 * MINUTE, period_second=5.0)
    steps = [pause]
    if taken_first:
        down = draw(rating, taken_first * capacity_ampere_hour, period_second=DRIVE_PERIOD)
        steps += [down._replace(duration_second=float(round(down.duration_second))), pause]
    available = (1.0 - taken_first - deepest_soc) * capacity_ampere_hour
    profile = loads.current_profile(schedule, rating, scale=scale)
    for part in schedules.repeated(profile, ampere_hour=available):
        steps += [_driven(part, rating.lower_cutoff_volt), pause]
    return steps


def dynamic_load(
    rating: Rating,
    *,
    style: str,
    seed: int,
    ampere_hour: float | None = None,
    duration_second: int | None = None,
) -> list[Step]:
    """5 min rest, a random load with pauses and recuperation from full, 15 min rest.

    Parameters
    ----------
    rating : of the cell: currents are multiples of its capacity, whatever the cell has left.
    style : "soft" (3840 s) or "harsh" (3200 s), see `loads.STYLES`.
    seed : of the load: the same for every cell gives the same load.
    ampere_hour : taken out in all [Ah]; 80 % of the rating if not given.
    duration_second : of the load, if not that of the style.
    """
    taken = 0.8 * rating.capacity_ampere_hour if ampere_hour is None else ampere_hour
    profile = loads.random_load(
        style, rating, seed=seed, ampere_hour=taken, duration_second=duration_second
    )
    return [
        rest(5 * MINUTE, period_second=5.0),
        _driven(profile, rating.lower_cutoff_volt),
        rest(15 * MINUTE, period_second=5.0),
    ]


def series_drive(
    rating: Rating, *, schedule: str, ampere_hour: float, scale: float = 1.0
) -> list[Step]:
    """The load of a string: the same current for each of its cells, ended by time alone.

    Parameters
    ----------
    rating : to which the schedule's current refers.
    schedule : a name of `loads.SCHEDULES`.
    ampere_hour : taken out in all [Ah]: less than the weakest cell holds.
    scale : factor on the current.
    """
    pause = rest(5 * MINUTE, period_second=5.0)
    steps = [pause]
    profile = loads.current_profile(schedule, rating, scale=scale)
    for part in schedules.repeated(profile, ampere_hour=ampere_hour):
        steps += [_driven(part, None), pause]
    return steps


def _driven(profile, until_volt) -> Step:
    return Step("profile", profile, float(profile[-1, 0]), DRIVE_PERIOD, until_volt)
