"""Currents of dynamic loads: driving schedules, the dynamic stress test, random loads.

A cycler in the laboratory follows a current. Where a test is defined by its power, the current is
that power over the middle of the cell's voltage window.
"""

from typing import NamedTuple

import numpy as np

from virtual_lab import schedules
from virtual_lab.rating import Rating

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


class Style(NamedTuple):
    """A random load: lengths [s] of it all, of a stretch of driving and of a pause (from, to); how
    long an unrest of the current lasts [s], its size as a share of the current; largest currents
    [1/h]."""

    duration_second: int
    stretch_second: tuple[int, int]
    pause_second: tuple[int, int]
    unrest_second: float
    unrest: float
    discharge_c_rate: float = 2.5
    charge_c_rate: float = 1.2


STYLES = {
    "soft": Style(3840, (100, 300), (10, 55), 7.0, 0.7),
    "harsh": Style(3200, (100, 300), (8, 50), 4.0, 0.9),
}
FULL_SHARE = 0.1  # of what is taken out: until then nothing is recuperated


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
    speed = schedules.speed_profile(schedules.STYLES["ftp72" if schedule == "fuds" else schedule])
    vehicle = schedules.VAN if schedule == "fuds" else schedules.CAR
    power = schedules.wheel_power(speed, vehicle)
    current = np.round(np.concatenate([[0.0], peak * power / power.max(), [0.0]]), 3)
    return np.column_stack([np.arange(current.size, dtype=float), current])


def _stairs(durations, levels) -> np.ndarray:
    """Constant levels, each entered within 10 ms; from zero current to zero current."""
    ends = np.cumsum(durations)
    begins = ends - durations
    second = np.column_stack([begins + EDGE_SECOND, ends]).ravel()
    second = np.concatenate([[0.0], second])
    ampere = np.concatenate([[0.0], np.repeat(levels, 2)])
    return np.column_stack([second, np.round(ampere, 3)])


def random_load(
    style: str,
    rating: Rating,
    *,
    seed: int,
    ampere_hour: float,
    duration_second: int | None = None,
) -> np.ndarray:
    """A load drawn from a seeded generator: stretches of driving, recuperation, pauses.

    Parameters
    ----------
    style : a name of STYLES.
    rating : of the cell; discharge stays within 2.5C and charge within 1.2C.
    seed : of the generator.
    ampere_hour : taken out in all [Ah].
    duration_second : if not that of the style.

    Returns
    -------
    array [s, A], positive on charge, a point a second, from zero to zero current.
    """
    kind = STYLES[style]
    duration = duration_second or kind.duration_second
    wish = _wishes(kind, duration, np.random.default_rng([seed, len(style)]))
    taken = np.cumsum(wish.clip(min=0))
    wish[(wish < 0) & (taken < FULL_SHARE * taken[-1])] = 0.0
    asked = ampere_hour * 3600 / rating.capacity_ampere_hour
    factor = _factor(wish, kind, asked)
    current = -rating.capacity_ampere_hour * _limited(factor * wish, kind)
    return np.column_stack([np.arange(current.size, dtype=float), np.round(current, 4)])


def _wishes(kind, duration, random) -> np.ndarray:
    """What the driver asks for at each second, discharge positive, in no unit yet."""
    parts, length = [np.zeros(1)], 1
    while length < duration:
        stretch = _stretch(random.integers(*kind.stretch_second), kind, random)
        parts += [stretch, np.zeros(random.integers(*kind.pause_second))]
        length += stretch.size + parts[-1].size
    wish = np.concatenate(parts)[: duration + 1]
    wish[-1] = 0.0
    return wish


def _stretch(length, kind, random) -> np.ndarray:
    """Restless driving about one level, then a brake."""
    reach = int(4 * kind.unrest_second)
    bell = np.exp(-0.5 * (np.arange(-reach, reach + 1) / kind.unrest_second) ** 2)
    unrest = np.convolve(
        random.normal(size=length + 2 * reach), bell / np.sqrt(bell @ bell), "valid"
    )
    level = random.gamma(8.0, 1 / 8)
    brake = np.sin(np.linspace(0, np.pi, random.integers(5, 14)))[1:-1]
    return np.concatenate([level * (1 + kind.unrest * unrest), -random.uniform(0.3, 1.2) * brake])


def _limited(wish, kind) -> np.ndarray:
    return wish.clip(-kind.charge_c_rate, kind.discharge_c_rate)


def _factor(wish, kind, asked) -> float:
    """Factor that makes the limited load [1/h] take out what is asked [s/h], by bisection.

    Raises
    ------
    ValueError : so much cannot be taken out in the time.
    """
    low, high = 0.0, 100.0
    if np.trapezoid(_limited(high * wish, kind)) < asked:
        raise ValueError("the load is too short for the charge that it is to take out")
    for _ in range(60):
        middle = 0.5 * (low + high)
        enough = np.trapezoid(_limited(middle * wish, kind)) >= asked
        low, high = (low, middle) if enough else (middle, high)
    return high
