"""Driving schedules made here: speed over time, then power at the wheels, then current of a cell.

They resemble the UDDS (city) and US06 (fast motorway) schedules in length, stops, mean and top
speed and hardest acceleration, but are not those schedules: each is a row of micro-trips drawn
from a seeded generator.
"""

from typing import NamedTuple

import numpy as np

MASS_KILOGRAM = 1600.0
DRAG_AREA_SQUARE_METRE = 0.65
ROLLING_RESISTANCE = 0.01
AIR_DENSITY = 1.2
GRAVITY = 9.81
DRIVETRAIN_EFFICIENCY = 0.9
REGENERATED_FRACTION = 0.35
HOTEL_WATT = 400.0
KILOMETRE_PER_HOUR = 1 / 3.6


class Style(NamedTuple):
    """Statistics of a schedule: speeds [km/h], accelerations [m/s²], times [s]."""

    seed: int
    duration_second: int
    trips: int
    mean_top_speed: float
    highest_speed: float
    acceleration: float
    idle_second: float
    peak_discharge_ampere: float


STYLES = {
    "udds": Style(1, 1370, 17, 45.0, 91.0, 1.3, 14.0, 14.0),
    "us06": Style(6, 600, 6, 82.0, 129.0, 3.2, 6.0, 14.0),
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


def wheel_power(speed: np.ndarray) -> np.ndarray:
    """Power [W] asked of the battery at each second for a speed [m/s], discharge positive."""
    force = MASS_KILOGRAM * (np.gradient(speed) + GRAVITY * ROLLING_RESISTANCE * (speed > 0))
    power = (force + 0.5 * AIR_DENSITY * DRAG_AREA_SQUARE_METRE * speed**2) * speed
    driven = power / DRIVETRAIN_EFFICIENCY
    return HOTEL_WATT + np.where(power > 0, driven, power * REGENERATED_FRACTION)


def current_profile(schedule: str, *, scale: float = 1.0) -> np.ndarray:
    """Cell current of a schedule.

    Parameters
    ----------
    schedule : "udds" or "us06".
    scale : factor on the current, 1 at 25 °C for one cell.

    Returns
    -------
    array [s, A], positive on charge; it starts and ends at zero current.
    """
    style = STYLES[schedule]
    power = wheel_power(speed_profile(style))
    current = -scale * style.peak_discharge_ampere * power / power.max()
    current = np.round(np.concatenate([[0.0], current, [0.0]]), 3)
    return np.column_stack([np.arange(current.size, dtype=float), current])


def repeated(profile: np.ndarray, *, ampere_hour: float) -> list[np.ndarray]:
    """The profile as often as a charge allows; the last one is cut short where it is used up."""
    time, current = profile.T
    drawn = -np.cumsum(0.5 * (current[1:] + current[:-1]) * np.diff(time)) / 3600
    whole = int(ampere_hour // drawn[-1])
    left = ampere_hour - whole * drawn[-1]
    end = int(np.searchsorted(np.maximum.accumulate(drawn), left))
    parts = [profile] * whole
    return parts if end < 30 else [*parts, _stopped(profile[: end + 1])]


def _stopped(profile: np.ndarray) -> np.ndarray:
    """Ends at zero current, one second after the last point."""
    return np.vstack([profile, [profile[-1, 0] + 1.0, 0.0]])
