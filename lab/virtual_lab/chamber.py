"""Temperature of the climate chamber or the room over the time of a test."""

from typing import NamedTuple

import numpy as np

POINTS_OF_A_SWING = 12
HALF_HOUR_SECOND = 1800.0


class Chamber(NamedTuple):
    """Chamber temperature: times [s] from the start of the test, temperatures [°C], lines between.

    Before the first and after the last point the temperature is that of the point.
    """

    second: np.ndarray
    celsius: np.ndarray


def steady(celsius: float) -> Chamber:
    """A chamber at one constant temperature [°C]."""
    return Chamber(np.zeros(1), np.full(1, float(celsius)))


def temperature_at(chamber: Chamber, second: np.ndarray) -> np.ndarray:
    """Chamber temperature [°C] at times [s] from the start of the test."""
    return np.interp(second, chamber.second, chamber.celsius)


def later(chamber: Chamber, second: float) -> Chamber:
    """The chamber for a test that begins `second` [s] after the start of the given time axis."""
    return Chamber(chamber.second - second, chamber.celsius)


def wobbling(
    celsius: float,
    *,
    amplitude_kelvin: float,
    period_second: float,
    duration_second: float,
    seed: int,
) -> Chamber:
    """Chamber temperature that oscillates around the set point [°C], as a controller makes it.

    Parameters
    ----------
    amplitude_kelvin : largest deviation from the set point [K].
    period_second : of one swing [s]; each takes up to a fifth longer or shorter.
    duration_second : how long it goes on [s]; after that the last temperature stays.
    seed : of the swings' lengths and heights.

    Returns
    -------
    Chamber with a point at every twelfth of a swing.
    """
    random = np.random.default_rng(seed)
    most = int(duration_second / (0.8 * period_second)) + 2
    lengths = period_second * random.uniform(0.8, 1.2, most)
    phase = np.arange(most * POINTS_OF_A_SWING + 1) / POINTS_OF_A_SWING + random.uniform()
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    second = np.interp(phase - phase[0], np.arange(most + 1), ends)
    height = np.interp(phase - phase[0], np.arange(most + 1), random.uniform(0.6, 1.0, most + 1))
    swings = Chamber(second, celsius + amplitude_kelvin * height * np.sin(2 * np.pi * phase))
    kept = np.append(second[second < duration_second], duration_second)
    return Chamber(kept, temperature_at(swings, kept))


def room(
    celsius: float,
    *,
    swing_kelvin: float = 4.0,
    duration_second: float,
    warmest_hour: float = 16.0,
    begin_hour: float = 8.0,
    drift_kelvin: float = 0.0,
    seed: int | None = None,
) -> Chamber:
    """Temperature of an air-conditioned room over the day (thesis 3.1: 24 h, 4 K).

    Parameters
    ----------
    celsius : mean [°C].
    swing_kelvin : from the coldest to the warmest of a day [K].
    duration_second : how long it goes on [s].
    warmest_hour, begin_hour : time of day at which it is warmest, and at which the test begins [h].
    drift_kelvin : standard deviation of the daily means [K]; needs a `seed`.

    Returns
    -------
    Chamber with a point every half hour.
    """
    second = np.arange(0.0, duration_second + HALF_HOUR_SECOND, HALF_HOUR_SECOND)
    day = (second / 3600 + begin_hour - warmest_hour) / 24
    shown = celsius + 0.5 * swing_kelvin * np.cos(2 * np.pi * day)
    if drift_kelvin:
        days = np.arange(int(day[-1] - day[0]) + 3) + day[0]
        daily = np.random.default_rng(seed).normal(0.0, drift_kelvin, days.size)
        shown = shown + np.interp(day, days, daily)
    return Chamber(second, shown)


def stepped(
    celsius: tuple[float, ...],
    *,
    rest_second: float,
    hold_second: float,
    kelvin_per_minute: float = 1.0,
) -> Chamber:
    """A chamber that holds one temperature after the other (thesis 3.3: 20 → −20 °C by 5).

    Parameters
    ----------
    celsius : set points in order [°C].
    rest_second : how long it stays at the first [s].
    hold_second : from one change of the set point to the next [s], the ramp included.
    kelvin_per_minute : heating and cooling rate of the chamber [K/min].
    """
    starts = rest_second + hold_second * np.arange(len(celsius) - 1)
    ramps = 60 * np.abs(np.diff(celsius)) / kelvin_per_minute
    if (ramps >= hold_second).any():
        raise ValueError(f"a ramp takes {ramps.max():g} s, longer than {hold_second:g} s")
    second = np.column_stack([starts, starts + ramps]).ravel()
    shown = np.column_stack([celsius[:-1], celsius[1:]]).ravel()
    return Chamber(np.append(0.0, second), np.append(celsius[0], shown).astype(float))


def added(first: Chamber, second: Chamber, *, about_celsius: float) -> Chamber:
    """A chamber plus the deviations of a second one from a temperature [°C]."""
    times = np.union1d(first.second, second.second)
    return Chamber(
        times, temperature_at(first, times) + temperature_at(second, times) - about_celsius
    )
