"""Noise of a voltage record: white noise plus a slow Ornstein-Uhlenbeck process, and whitening.

Residuals of a record are correlated over minutes; a test that takes them for independent finds an
effect in every healthy cell. A scalar Kalman filter turns them into independent ones in one pass,
on any clock (A. C. Harvey, Forecasting, Structural Time Series Models and the Kalman Filter, 1989,
3.4).
"""

from typing import NamedTuple

import numpy as np

from cellwright.native import array, count, function, real
from cellwright.numerics.statistics import rms, robust_std

RATIOS = (0.0, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0)  # variance of the slow part over the white one's
TIMES_SECOND = (30.0, 100.0, 300.0)
SMALLEST_VOLT = 1e-5


class Noise(NamedTuple):
    """White noise and slow Ornstein-Uhlenbeck noise of a voltage record.

    white_volt, slow_volt : standard deviations [V]; slow_second : time constant of the slow [s].
    """

    white_volt: float
    slow_volt: float
    slow_second: float

    @property
    def volt(self):
        """Standard deviation of both together [V]."""
        return float(np.hypot(self.white_volt, self.slow_volt))


FIRST = Noise(2e-3, 1e-3, 200.0)  # of a usual cycler: what a search begins with

REPEATED_SHARE = 0.95  # of the rows: levels read twice or more that hold so many are all there are


def least_digit(values):
    """Least digit of a reading, the step between its neighbouring levels; 0 where it has none.

    The smallest distance of neighbouring levels whose multiples hold 95 % of all such distances up
    to ten of it. Levels read once beside many that are repeated are repairs of cleaning; levels
    read once that are all one step apart are those at which a logger writes, and say nothing of its
    digit. Within a digit q the truth lies anywhere: its standard deviation is q/√12.

    Parameters
    ----------
    values : (n,) of one channel, in any unit; not finite ones are passed over.

    Returns
    -------
    digit : in the unit of the values.

    Source: W. R. Bennett, Bell System Technical Journal 27 (1948), 446 (noise of a quantised
    signal).
    """
    levels, repeated = read_levels(values)
    gaps = np.diff(levels)
    # Two levels that differ by less are one, written as float32.
    gaps = gaps[gaps > 5e-7 * np.abs(levels).max(initial=0.0)]
    for smallest in np.sort(gaps)[:30]:
        # A converter's step, written with few digits, is now 2 and now 3 of these.
        digit = float(gaps[(gaps >= smallest) & (gaps <= 1.6 * smallest)].mean())
        # Levels farther apart tell nothing of the digit.
        multiples = gaps[gaps <= 10.5 * digit] / digit
        if np.mean(np.abs(multiples - np.round(multiples)) <= 0.25) >= REPEATED_SHARE:
            by_steps = not repeated and np.all(np.round(multiples) == 1.0)
            return 0.0 if by_steps and len(multiples) > 1 else digit
    return 0.0


def read_levels(values):
    """Levels that a channel reads, rising, without repairs of cleaning; whether any is repeated.

    Levels read once beside many that are repeated are repairs.

    Parameters
    ----------
    values : (n,) of one channel, in any unit; not finite ones are passed over.
    """
    read = np.asarray(values, float)
    levels, rows = np.unique(read[np.isfinite(read)], return_counts=True)
    repeated = rows > 1
    few = rows[repeated].sum() >= REPEATED_SHARE * rows.sum()
    return levels[repeated] if few else levels, bool(repeated.any())


def least_digit_ampere(current_ampere):
    """Least digit of a current [A], zero being one of its levels; 0 where it has none.

    Levels that lie farther apart than a twentieth of the largest are the loads of a protocol.

    Parameters
    ----------
    current_ampere : (n,) [A].
    """
    digit = least_digit(np.append(current_ampere, [0.0, 0.0]))
    return digit if digit <= 0.05 * np.nanmax(np.abs(current_ampere), initial=0.0) else 0.0


class Whitening(NamedTuple):
    """Filter gains for a stack of records; `apply` makes rows independent and of unit variance.

    keep, gain, scale : (n,) each.
    log_variance : sum of the logarithms of the innovations' variance.
    """

    keep: np.ndarray
    gain: np.ndarray
    scale: np.ndarray

    @property
    def log_variance(self):
        return float(-2.0 * np.log(self.scale).sum())

    def apply(self, rows):
        """Whitened copy of rows (n,) or (n, m) [V] → [1], each column in one piece of memory."""
        matrix = np.array(rows, float, order="F")
        kernel = function("whiten", count, count, array, array, array, array)
        if kernel is None:
            return _whitened(matrix, *self)
        kernel(len(matrix), matrix.size // len(matrix), *self, matrix.T)
        return matrix


def whitening(noise, stack, *, extra_volt=0.0):
    """Filter gains that whiten residuals over a stack of records.

    Parameters
    ----------
    noise : Noise.
    stack : records.Stack; each record starts anew.
    extra_volt : scalar or (n,) further white error of each row, such as of a steep OCV [V].

    Returns
    -------
    whitening : Whitening.
    """
    keep = np.exp(-stack.step_second / noise.slow_second) * (1.0 - stack.fresh)
    white = np.full(len(keep), noise.white_volt**2) + np.square(extra_volt)
    gain, scale = np.empty(len(keep)), np.empty(len(keep))
    kernel = function("whitening_gains", count, array, array, real, array, array)
    if kernel is None:
        _gains(keep, white, noise.slow_volt**2, gain, scale)
    else:
        kernel(len(keep), keep, white, noise.slow_volt**2, gain, scale)
    return Whitening(keep, gain, scale)


def digit_volt(stack):
    """Standard deviation of what the voltmeters' least digits hide, over all rows [V].

    Parameters
    ----------
    stack : records.Stack.
    """
    return max(rms(stack.least_digit_volt[stack.file]) / np.sqrt(12.0), SMALLEST_VOLT)


def estimate_noise(residual_volt, stack, *, most_slow_volt, most_slow_second, extra_volt=0.0):
    """Most likely noise of residuals, its slow part within limits.

    The slow part must not grow until it holds a slow effect: hence the limits. The white part is no
    smaller than what the least digit hides.

    Parameters
    ----------
    residual_volt : (n,) residuals of a model that lacks nothing [V].
    stack : records.Stack.
    most_slow_volt, most_slow_second : largest slow part [V], its longest time constant [s].
    extra_volt : as in `whitening`.

    Returns
    -------
    noise : Noise.
    """
    least_volt = digit_volt(stack)
    size = max(_robust(residual_volt), least_volt)
    best, cost = Noise(size, 0.0, TIMES_SECOND[0]), np.inf
    times = [t for t in TIMES_SECOND if t <= most_slow_second]
    # Without a slow part one time constant is enough.
    shapes = [(ratio, t) for ratio in RATIOS for t in (times if ratio else times[:1])]
    for ratio, second in shapes:
        tried = Noise(size, size * np.sqrt(ratio), second)
        for _ in range(2):
            tried = _scaled_to_residual(tried, residual_volt, stack, extra_volt, most_slow_volt)
            tried = tried._replace(white_volt=max(tried.white_volt, least_volt))
        w = whitening(tried, stack, extra_volt=extra_volt)
        trial_cost = w.log_variance + np.sum(w.apply(residual_volt) ** 2)
        if trial_cost < cost:
            best, cost = tried, trial_cost
    return best


def _scaled_to_residual(tried, residual_volt, stack, extra_volt, most_slow_volt):
    """Noise of the same shape, scaled so that the whitened residual has unit variance."""
    w = whitening(tried, stack, extra_volt=extra_volt)
    factor = max(rms(w.apply(residual_volt)), 1e-3)
    slow = min(tried.slow_volt * factor, most_slow_volt)
    return Noise(tried.white_volt * factor, slow, tried.slow_second)


def read_volt(residual_volt, stack, *, steady_ampere):
    """White noise [V] from differences of neighbouring rows at steady current, or the least digit.

    Where the voltage stands still for many rows, it is the digit that hides its noise.

    Parameters
    ----------
    residual_volt : (n,) [V]. stack : records.Stack.
    steady_ampere : a current that moves less between two rows is steady [A].

    Returns
    -------
    volt : standard deviation [V]; that of the residual where no two rows are neighbours.
    """
    moved = np.abs(np.diff(stack.current_ampere)) < steady_ampere
    near = stack.step_second[1:] <= 1.5 * np.median(stack.step_second[stack.step_second > 0])
    rows = moved & near & (stack.fresh[1:] == 0)
    # Fewer tell no white part.
    if rows.sum() < 100:
        return max(_robust(residual_volt), digit_volt(stack))
    return max(_robust(np.diff(residual_volt)[rows]) / np.sqrt(2.0), digit_volt(stack))


def _robust(values):
    """Standard deviation by the median of absolute deviations: few outliers change it little."""
    return robust_std(values - np.median(values))


def _gains(keep, white, slow, gain, scale):
    """Kalman gains and scales of every row; fills the last two arrays."""
    variance = slow
    for k in range(len(keep)):
        prior = keep[k] ** 2 * variance + (1.0 - keep[k] ** 2) * slow
        total = prior + white[k]
        gain[k], scale[k] = prior / total, 1.0 / np.sqrt(total)
        variance = (1.0 - gain[k]) * prior


def _whitened(matrix, keep, gain, scale):
    """Whitened rows, in place, where the compiled kernel is not there."""
    state = np.zeros(matrix.shape[1:])
    for k in range(len(matrix)):
        expected = keep[k] * state
        news = matrix[k] - expected
        state = expected + gain[k] * news
        matrix[k] = scale[k] * news
    return matrix
