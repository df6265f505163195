"""Temperature around a cell over the time of a test."""

from typing import NamedTuple

import numpy as np


class Chamber(NamedTuple):
    """Straight lines between points: times [s] from the start of the test, temperatures [°C].

    Before the first and after the last point the temperature stays what it is there.
    """

    second: np.ndarray
    celsius: np.ndarray


def steady(celsius: float) -> Chamber:
    """A chamber that holds its temperature [°C]."""
    return Chamber(np.zeros(1), np.full(1, float(celsius)))


def at(chamber: Chamber, second: np.ndarray) -> np.ndarray:
    """Temperature [°C] at times [s] from the start of the test."""
    return np.interp(second, chamber.second, chamber.celsius)


def later(chamber: Chamber, second: float) -> Chamber:
    """The same chamber for a test that begins so many seconds after the clock of this one."""
    return Chamber(chamber.second - second, chamber.celsius)
