"""How a voltage that still relaxes would go on: what a pulse after a short rest begins with."""

from typing import NamedTuple

import numpy as np

LEAST_ROWS = 3  # of a line and its scatter
SETTLED_SECOND = 36_000.0  # by which a rest has come to its end: the OCV that slow tests show


class Drift(NamedTuple):
    """Relaxation that goes on: the voltage moves by `volt` for each factor e of the time at rest.

    volt, std_volt : and its standard deviation [V]. rested_second : how long the cell rests [s].
    """

    volt: float = 0.0
    std_volt: float = 0.0
    rested_second: float = np.inf

    def moved_volt(self, delay_second):
        """Voltage by which it moves within each delay (n,) [V]."""
        return self.volt * np.log1p(delay_second / self.rested_second)

    def moved_std_volt(self, delay_second):
        """Its standard deviation (n,) [V]: of the line, and of the law, which is one of several.

        A relaxation only slows down: on its present slope it would go farthest. What it would go
        less than that by this law, it may go less again, being a few exponentials.
        """
        part = delay_second / self.rested_second
        law = self.volt * (part - np.log1p(part))
        return np.hypot(self.std_volt * np.log1p(part), law)


# ASSUME: A relaxation that many time constants make goes with the logarithm of the time at rest.
def still_to_go_volt(time, voltage, begin_second):
    """Voltage [V] by which a rest is from its end, and the standard deviation of that.

    Its own slope against the logarithm of time, taken on to ten hours at rest. Parameters as of
    `drift_of_rest`.
    """
    drift = drift_of_rest(time, voltage, begin_second)
    decades = np.log(max(SETTLED_SECOND / drift.rested_second, 1.0))
    return float(drift.volt * decades), float(drift.std_volt * decades)


def drift_of_rest(time, voltage, begin_second):
    """Drift of a rest at its end, by a line over the logarithm of the time in its second half.

    Parameters
    ----------
    time, voltage : (n,) rows of the rest [s], [V]. begin_second : when its load ended [s].

    Returns
    -------
    drift : Drift; without any where its second half has fewer than three rows. Its deviation holds
        the scatter about the line and how far the last quarter's slope lies from it.
    """
    rested = time - begin_second
    late = rested >= rested[-1] / 2
    if np.count_nonzero(late) < LEAST_ROWS or not rested[-1] > 0:
        return Drift()
    slope, std = _line(np.log(rested[late]), voltage[late])
    last = rested >= 0.75 * rested[-1]
    if np.count_nonzero(last) >= LEAST_ROWS:
        std = np.hypot(std, _line(np.log(rested[last]), voltage[last])[0] - slope)
    return Drift(float(slope), float(std), float(rested[-1]))


def _line(x, y):
    """Slope of a line and its standard deviation."""
    apart = x - x.mean()
    square = apart @ apart
    slope = apart @ (y - y.mean()) / square
    left = y - y.mean() - slope * apart
    return slope, np.sqrt(left @ left / (len(x) - 2) / square)
