"""Dynamic loads: driving schedules, the dynamic stress test, random loads, tests of them.

A cycler in the laboratory follows a current. Where a test is defined by its power, the current is
that power over the middle of the cell's voltage window.

The driving schedules resemble public ones of the US EPA (40 CFR 86, appendix I; figures by
dieselnet.com and transportpolicy.net) but are not those: each is a row of trips drawn from a
seeded generator.

|                         | UDDS  | ftp72 | udds | US06  | sftp  | us06 |
|-------------------------|-------|-------|------|-------|-------|------|
| duration [s]            | 1369  | 1367  | 1399 | 596   | 596   | 613  |
| distance [km]           | 12.07 | 11.97 | 12.6 | 12.8  | 12.9  | 14.5 |
| mean speed [km/h]       | 31.5  | 31.5  | 32.3 | 77.9  | 77.9  | 84.7 |
| top speed [km/h]        | 91.25 | 91.25 | 91   | 129.2 | 129.2 | 129  |
| hardest start [m/s²]    | 1.5   | 1.5   | 1.7  | 3.78  | 3.78  | 3.1  |
| trips from rest to rest | 17    | 17    | 17   | 5     | 5     | 6    |

`udds` and `us06` are the first versions, which the demo campaign keeps.
"""

from typing import NamedTuple

import numpy as np

from virtual_lab.behaviour import Rating
from virtual_lab.protocols.steps import HOUR, LONG_PERIOD, MINUTE, Step, draw, rest

AIR_DENSITY = 1.2
GRAVITY = 9.81
DRIVETRAIN_EFFICIENCY = 0.9
HOTEL_WATT = 400.0
KILOMETRE_PER_HOUR = 1 / 3.6
SHORTEST_SECOND = 30  # a shorter rest of a schedule is left out


class ScheduleStyle(NamedTuple):
    """What a driving schedule is drawn from: speeds [km/h], acceleration [m/s²], times [s].

    The schedule comes out up to 2 % longer than `duration_second`.
    """

    seed: int
    duration_second: int
    trips: int
    mean_top_speed: float
    highest_speed: float
    acceleration: float
    idle_second: float


class Vehicle(NamedTuple):
    """A vehicle by what its power depends on.

    Mass [kg], drag coefficient times front area [m²], rolling resistance [1], share of the braking
    power that is regenerated [1].
    """

    mass_kilogram: float
    drag_area_square_metre: float
    rolling_resistance: float
    regenerated_fraction: float


# A family car; a van as the one behind the USABC's FUDS, with regenerative brakes (sizes assumed).
CAR = Vehicle(1600.0, 0.65, 0.01, 0.35)
VAN = Vehicle(2200.0, 1.3, 0.012, 0.5)
SCHEDULE_STYLES = {
    "udds": ScheduleStyle(1, 1370, 17, 45.0, 91.0, 1.3, 14.0),
    "us06": ScheduleStyle(6, 600, 6, 82.0, 129.0, 3.2, 6.0),
    "ftp72": ScheduleStyle(27, 1339, 17, 40.0, 91.25, 1.2, 13.0),
    "sftp": ScheduleStyle(57, 585, 5, 82.0, 129.2, 3.8, 6.0),
}


def speed_profile(style: ScheduleStyle) -> np.ndarray:
    """Speed [m/s] at each second, from rest to rest."""
    random = np.random.default_rng(style.seed)
    tops = random.gamma(6.0, style.mean_top_speed / 6.0, style.trips).clip(15, style.highest_speed)
    tops[style.trips // 3] = style.highest_speed
    shares = tops / tops.sum()
    idle = style.idle_second * style.trips
    trips = [
        _trip(top * KILOMETRE_PER_HOUR, share * (style.duration_second - idle), style, random)
        for top, share in zip(tops, shares, strict=True)
    ]
    pause = np.zeros(int(style.idle_second))
    speed = np.concatenate([piece for trip in trips for piece in (pause, trip)])
    return np.append(speed, np.zeros(5))


def _trip(top, duration, style, random) -> np.ndarray:
    """Speed of one trip: accelerate, cruise with small random changes, brake."""
    second = np.arange(max(duration, 2.5 * top / style.acceleration) + 1)
    acceleration = style.acceleration * random.uniform(0.7, 1.0)
    braking = acceleration * random.uniform(0.8, 1.1)
    variation = np.convolve(random.normal(0.0, 0.06, second.size), np.ones(8) / 8**0.5, "same")
    cruise = top * (0.95 + variation).clip(0.5, 1.0)
    up, down = acceleration * second, braking * (second[-1] - second)
    return np.minimum(np.minimum(up, down), cruise)


def wheel_power(speed: np.ndarray, vehicle: Vehicle = CAR) -> np.ndarray:
    """Power [W] asked of the battery at each second for a speed [m/s], discharge positive."""
    mass, area, rolling, regenerated = vehicle
    force = mass * (np.gradient(speed) + GRAVITY * rolling * (speed > 0))
    power = (force + 0.5 * AIR_DENSITY * area * speed**2) * speed
    driven = power / DRIVETRAIN_EFFICIENCY
    return HOTEL_WATT + np.where(power > 0, driven, power * regenerated)


def repeated(profile: np.ndarray, *, ampere_hour: float) -> list[np.ndarray]:
    """A profile as often as a charge [Ah] allows; the last one is cut short where it is used up."""
    time, current = profile.T
    drawn = -np.cumsum(0.5 * (current[1:] + current[:-1]) * np.diff(time)) / 3600
    whole = int(ampere_hour // drawn[-1])
    remaining = ampere_hour - whole * drawn[-1]
    end = int(np.searchsorted(np.maximum.accumulate(drawn), remaining))
    if time[end] < SHORTEST_SECOND:
        return [profile] * whole
    # The current is zero one second after the last point.
    return [profile] * whole + [np.vstack([profile[: end + 1], [time[end] + 1.0, 0.0]])]


PEAK_C_RATE = 2.8
EDGE_SECOND = 0.01
SCHEDULES = ("udds", "us06", "ftp72", "sftp", "fuds", "dst")
DYNAMIC_STRESS = np.array(
    [
        *[(16, 0.0), (28, -0.125), (12, -0.25), (8, 0.125)],
        *[(16, 0.0), (24, -0.125), (12, -0.25), (8, 0.125)],
        *[(16, 0.0), (24, -0.125), (12, -0.25), (8, 0.125)],
        *[(16, 0.0), (36, -0.125), (8, -1.0), (24, -0.625), (8, 0.25), (32, -0.25), (8, 0.5)],
        (44, 0.0),
    ]
)
"""Dynamic stress test: durations [s] and powers as shares of the peak, + on charge; 360 s.

USABC, Electric Vehicle Battery Test Procedures Manual, revision 2 (1996), procedure 5B: a
simplified FUDS of 20 steps whose mean is an eighth of its peak.
"""


class RandomStyle(NamedTuple):
    """A random load.

    Lengths [s] of it all, of a stretch of driving and of a pause (from, to); correlation time of
    the current [s] and its variation as a share of the current; largest currents [1/h].
    """

    duration_second: int
    stretch_second: tuple[int, int]
    pause_second: tuple[int, int]
    variation_second: float
    variation: float
    discharge_c_rate: float = 2.5
    charge_c_rate: float = 1.2


RANDOM_STYLES = {
    "soft": RandomStyle(3840, (100, 300), (10, 55), 7.0, 0.7),
    "harsh": RandomStyle(3200, (100, 300), (8, 50), 4.0, 0.9),
}
FULL_SHARE = 0.1  # of the charge: until so much is discharged nothing is recuperated


def current_profile(schedule: str, rating: Rating, *, scale: float = 1.0) -> np.ndarray:
    """Cell current of a schedule.

    Parameters
    ----------
    schedule : a name of SCHEDULES. udds and us06 keep roughly to the public schedules; ftp72 (the
        UDDS by its other name) and sftp (US06) closely; fuds is the power that a van takes through
        ftp72; dst the dynamic stress test.
    rating : of the cell; the hardest discharge is 2.8C.
    scale : factor on the current, 1 at 25 °C for one cell.

    Returns
    -------
    array [s, A], positive on charge; it starts and ends at zero current.
    """
    peak = -scale * rating.ampere(PEAK_C_RATE)
    if schedule == "dst":
        return _stairs(DYNAMIC_STRESS[:, 0], -peak * DYNAMIC_STRESS[:, 1])
    if schedule not in SCHEDULES:
        raise ValueError(f"no schedule {schedule!r}; there are {', '.join(SCHEDULES)}")
    speed = speed_profile(SCHEDULE_STYLES["ftp72" if schedule == "fuds" else schedule])
    vehicle = VAN if schedule == "fuds" else CAR
    power = wheel_power(speed, vehicle)
    current = np.round(np.concatenate([[0.0], peak * power / power.max(), [0.0]]), 3)
    return np.column_stack([np.arange(current.size, dtype=float), current])


def _stairs(durations, levels) -> np.ndarray:
    """A profile of constant levels, each entered within 10 ms; from zero to zero current."""
    ends = np.cumsum(durations)
    begins = ends - durations
    second = np.column_stack([begins + EDGE_SECOND, ends]).ravel()
    second = np.concatenate([[0.0], second])
    ampere = np.concatenate([[0.0], np.repeat(levels, 2)])
    return np.column_stack([second, np.round(ampere, 3)])


def random_load(
    style: str, rating: Rating, *, seed: int, ampere_hour: float, duration_second: int | None = None
) -> np.ndarray:
    """A load drawn from a seeded generator: stretches of driving, recuperation, pauses.

    Parameters
    ----------
    style : a name of RANDOM_STYLES.
    rating : of the cell; discharge stays within 2.5C and charge within 1.2C.
    seed : of the generator.
    ampere_hour : discharged in all [Ah].
    duration_second : if not that of the style.

    Returns
    -------
    array [s, A], positive on charge, a point a second, from zero to zero current.
    """
    chosen = RANDOM_STYLES[style]
    duration = duration_second or chosen.duration_second
    load = _unscaled_load(chosen, duration, np.random.default_rng([seed, len(style)]))
    drawn = np.cumsum(load.clip(min=0))
    load[(load < 0) & (drawn < FULL_SHARE * drawn[-1])] = 0.0
    factor = _load_factor(load, chosen, ampere_hour * 3600 / rating.capacity_ampere_hour)
    current = -rating.capacity_ampere_hour * _limited(factor * load, chosen)
    return np.column_stack([np.arange(current.size, dtype=float), np.round(current, 4)])


def _unscaled_load(style, duration, random) -> np.ndarray:
    """Load at each second in no unit yet, discharge positive."""
    parts, length = [np.zeros(1)], 1
    while length < duration:
        stretch = _stretch(random.integers(*style.stretch_second), style, random)
        parts += [stretch, np.zeros(random.integers(*style.pause_second))]
        length += stretch.size + parts[-1].size
    load = np.concatenate(parts)[: duration + 1]
    load[-1] = 0.0
    return load


def _stretch(length, style, random) -> np.ndarray:
    """A stretch of driving: random changes about one level, then a brake."""
    reach = int(4 * style.variation_second)
    bell = np.exp(-0.5 * (np.arange(-reach, reach + 1) / style.variation_second) ** 2)
    variation = np.convolve(
        random.normal(size=length + 2 * reach), bell / np.sqrt(bell @ bell), "valid"
    )
    level = random.gamma(8.0, 1 / 8)
    brake = np.sin(np.linspace(0, np.pi, random.integers(5, 14)))[1:-1]
    return np.concatenate(
        [level * (1 + style.variation * variation), -random.uniform(0.3, 1.2) * brake]
    )


def _limited(load, style) -> np.ndarray:
    return load.clip(-style.charge_c_rate, style.discharge_c_rate)


def _load_factor(load, style, wanted) -> float:
    """Factor with which the limited load [1/h] has a wanted charge [s/h], by bisection.

    Raises
    ------
    ValueError : so much cannot be discharged in the time.
    """
    low, high = 0.0, 100.0
    if np.trapezoid(_limited(high * load, style)) < wanted:
        raise ValueError("the load is too short for the charge that it is to take out")
    for _ in range(60):
        middle = 0.5 * (low + high)
        enough = np.trapezoid(_limited(middle * load, style)) >= wanted
        low, high = (low, middle) if enough else (middle, high)
    return high


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
    """5 min rest, a tenth discharged at C/2, then schedules with pauses down to 10 % SoC.

    Parameters
    ----------
    rating : of the cell.
    capacity_ampere_hour : what the laboratory takes for the cell's capacity [Ah].
    schedule : a name of SCHEDULES.
    scale : factor on the current, 1 at 25 °C.
    taken_first : share of the capacity discharged before the first schedule; 0 starts from full.
    deepest_soc : where the last schedule is cut short.
    """
    pause = rest(5 * MINUTE, period_second=5.0)
    steps = [pause]
    if taken_first:
        down = draw(rating, taken_first * capacity_ampere_hour, period_second=DRIVE_PERIOD)
        steps += [down._replace(duration_second=float(round(down.duration_second))), pause]
    available = (1.0 - taken_first - deepest_soc) * capacity_ampere_hour
    profile = current_profile(schedule, rating, scale=scale)
    for part in repeated(profile, ampere_hour=available):
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
    style : "soft" (3840 s) or "harsh" (3200 s), see RANDOM_STYLES.
    seed : of the load: the same for every cell gives the same load.
    ampere_hour : taken out in all [Ah]; 80 % of the rating if not given.
    duration_second : of the load, if not that of the style.
    """
    taken = 0.8 * rating.capacity_ampere_hour if ampere_hour is None else ampere_hour
    profile = random_load(
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
    """The drive of cells in series: the same current for each cell, ended by time alone.

    Parameters
    ----------
    rating : to which the schedule's current refers.
    schedule : a name of SCHEDULES.
    ampere_hour : taken out in all [Ah]: less than the weakest cell holds.
    scale : factor on the current.
    """
    pause = rest(5 * MINUTE, period_second=5.0)
    steps = [pause]
    profile = current_profile(schedule, rating, scale=scale)
    for part in repeated(profile, ampere_hour=ampere_hour):
        steps += [_driven(part, None), pause]
    return steps


def _driven(profile, until_volt) -> Step:
    return Step("profile", profile, float(profile[-1, 0]), DRIVE_PERIOD, until_volt)


def group_drive(
    rating: Rating, capacity_ampere_hour: float, *, schedule: str, scale: float = 1.0
) -> list[Step]:
    """A drive of a parallel group from full down to a tenth, by the group's rating; see `drive`."""
    return drive(rating, capacity_ampere_hour, schedule=schedule, scale=scale, taken_first=0.0)


def pair(rating: Rating, capacity_ampere_hour: float) -> list[Step]:
    """For two cells in parallel, from a tenth: CC charge, rest, dynamic discharge, rest.

    `rating` is that of one cell. Each step is ended by time, as `physics.simulate.run_pair` needs.
    """
    profile = current_profile("us06", rating, scale=2.0)
    second = 0.73 * capacity_ampere_hour / rating.ampere(1.0) * HOUR
    steps = [
        rest(5 * MINUTE, period_second=5.0),
        Step("current", rating.ampere(1.0), round(second), LONG_PERIOD / 2),
        rest(HOUR, period_second=LONG_PERIOD),
    ]
    for part in repeated(profile, ampere_hour=0.77 * capacity_ampere_hour):
        steps.append(Step("profile", part, part[-1, 0], 1.0))
        steps.append(rest(5 * MINUTE, period_second=5.0))
    return steps
