"""A step of a protocol, and the few kinds of step that all protocols consist of."""

from typing import NamedTuple

import numpy as np

from virtual_lab.behaviour import Rating

HOUR = 3600.0
MINUTE = 60.0
LONG_PERIOD = 10.0
REST_PERIOD = 30.0


class Step(NamedTuple):
    """One step of a protocol.

    `kind` is "current" (value [A]), "hold" (value [V]) or "profile" (value: array [s, A], straight
    lines between its points). It ends after `duration_second`, or earlier when the voltage [V]
    passes `until_volt` or the current [A] falls to `until_ampere`. A sample is asked for every
    `period_second`.
    """

    kind: str
    value: float | np.ndarray
    duration_second: float
    period_second: float
    until_volt: float | None = None
    until_ampere: float | None = None


def rest(second: float, *, period_second: float = REST_PERIOD) -> Step:
    """No current for a time [s]."""
    return Step("current", 0.0, second, period_second)


def discharge(rating: Rating, c_rate: float, *, period_second: float = LONG_PERIOD) -> Step:
    """Constant current to the lower cut-off."""
    longest, value = 1.5 * HOUR / c_rate, -rating.ampere(c_rate)
    return Step("current", value, longest, period_second, until_volt=rating.lower_cutoff_volt)


def charge(rating: Rating, c_rate: float, *, period_second: float = LONG_PERIOD) -> Step:
    """Constant current to the upper cut-off."""
    longest, value = 1.5 * HOUR / c_rate, rating.ampere(c_rate)
    return Step("current", value, longest, period_second, until_volt=rating.upper_cutoff_volt)


def hold(
    rating: Rating,
    *,
    until_c_rate: float = 1 / 20,
    empty: bool = False,
    longest_second: float = 10 * HOUR,
    period_second: float = REST_PERIOD,
) -> Step:
    """Upper cut-off voltage (or the lower one) held until the current falls to a C-rate."""
    volt = rating.lower_cutoff_volt if empty else rating.upper_cutoff_volt
    small = rating.ampere(until_c_rate)
    return Step("hold", volt, longest_second, period_second, until_ampere=small)


def draw(
    rating: Rating, ampere_hour: float, *, c_rate: float = 0.5, period_second: float = LONG_PERIOD
) -> Step:
    """Discharge of a given charge [Ah], or less if the lower cut-off comes first."""
    second = ampere_hour / rating.ampere(c_rate) * HOUR
    down = discharge(rating, c_rate, period_second=period_second)
    return down._replace(duration_second=round(second, 1))
