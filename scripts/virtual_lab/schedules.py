"""Driving schedules made here: speed over time, then power at the wheels.

They resemble public schedules of the US EPA (40 CFR 86, appendix I; figures by dieselnet.com and
transportpolicy.net) but are not those: each is a row of micro-trips drawn from a seeded generator.

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

AIR_DENSITY = 1.2
GRAVITY = 9.81
DRIVETRAIN_EFFICIENCY = 0.9
HOTEL_WATT = 400.0
KILOMETRE_PER_HOUR = 1 / 3.6
SHORTEST_SECOND = 30  # a shorter rest of a schedule is left out


class Style(NamedTuple):
    """What a schedule is drawn from: speeds [km/h], acceleration [m/s²], times [s].

    The schedule comes out up to 2 % longer than `duration_second`: trips take what they need.
    """

    seed: int
    duration_second: int
    trips: int
    mean_top_speed: float
    highest_speed: float
    acceleration: float
    idle_second: float


class Vehicle(NamedTuple):
    """Mass [kg], drag coefficient times front area [m²], rolling resistance [1], share of the
    braking power that comes back [1]."""

    mass_kilogram: float
    drag_area_square_metre: float
    rolling_resistance: float
    regenerated_fraction: float


# A family car; a van as the one behind the USABC's FUDS, with regenerative brakes (sizes assumed).
CAR = Vehicle(1600.0, 0.65, 0.01, 0.35)
VAN = Vehicle(2200.0, 1.3, 0.012, 0.5)
STYLES = {
    "udds": Style(1, 1370, 17, 45.0, 91.0, 1.3, 14.0),
    "us06": Style(6, 600, 6, 82.0, 129.0, 3.2, 6.0),
    "ftp72": Style(27, 1339, 17, 40.0, 91.25, 1.2, 13.0),
    "sftp": Style(57, 585, 5, 82.0, 129.2, 3.8, 6.0),
}


def speed_profile(style: Style) -> np.ndarray:
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
    """Accelerate, cruise with a driver's unrest, brake."""
    second = np.arange(max(duration, 2.5 * top / style.acceleration) + 1)
    hurry = style.acceleration * random.uniform(0.7, 1.0)
    braking = hurry * random.uniform(0.8, 1.1)
    unrest = np.convolve(random.normal(0.0, 0.06, second.size), np.ones(8) / 8**0.5, "same")
    cruise = top * (0.95 + unrest).clip(0.5, 1.0)
    up, down = hurry * second, braking * (second[-1] - second)
    return np.minimum(np.minimum(up, down), cruise)


def wheel_power(speed: np.ndarray, vehicle: Vehicle = CAR) -> np.ndarray:
    """Power [W] asked of the battery at each second for a speed [m/s], discharge positive."""
    mass, area, rolling, regenerated = vehicle
    force = mass * (np.gradient(speed) + GRAVITY * rolling * (speed > 0))
    power = (force + 0.5 * AIR_DENSITY * area * speed**2) * speed
    driven = power / DRIVETRAIN_EFFICIENCY
    return HOTEL_WATT + np.where(power > 0, driven, power * regenerated)


def repeated(profile: np.ndarray, *, ampere_hour: float) -> list[np.ndarray]:
    """The profile as often as a charge allows; the last one is cut short where it is used up."""
    time, current = profile.T
    drawn = -np.cumsum(0.5 * (current[1:] + current[:-1]) * np.diff(time)) / 3600
    whole = int(ampere_hour // drawn[-1])
    left = ampere_hour - whole * drawn[-1]
    end = int(np.searchsorted(np.maximum.accumulate(drawn), left))
    parts = [profile] * whole
    return parts if time[end] < SHORTEST_SECOND else [*parts, _stopped(profile[: end + 1])]


def _stopped(profile: np.ndarray) -> np.ndarray:
    """Ends at zero current, one second after the last point."""
    return np.vstack([profile, [profile[-1, 0] + 1.0, 0.0]])
