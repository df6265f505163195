"""Noise of a voltage record: white noise plus a slow Ornstein-Uhlenbeck process, and whitening.

Residuals of a record are correlated over minutes; a test that takes them for independent finds an
effect in every healthy cell. A scalar Kalman filter turns them into independent ones in one pass,
on any clock (A. C. Harvey, Forecasting, Structural Time Series Models and the Kalman Filter, 1989,
3.4).
"""

from typing import NamedTuple

import numpy as np

from cellwright.native import array, count, function
from cellwright.numerics.statistics import rms

RATIOS = (0.0, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0)  # variance of the slow part over the white one's
TIMES_SECOND = (30.0, 100.0, 300.0)
SMALLEST_VOLT = 1e-5
LEAST_ROWS = 100  # from which the white part is read


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


# Shapes of the misfit of a model: variance of the slow part over the white one's, time constants.
MISFIT_RATIOS = (1.0, 3.0, 10.0, 30.0, 100.0)
MISFIT_SECOND = (100.0, 300.0, 1000.0, 3000.0)
MISFIT_NUMBERS = 3  # that each shape has beside the noise of all records, for the criterion
FIRST = Noise(2e-3, 1e-3, 200.0)  # of a usual cycler: what a search begins with


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
        """Whitened copy of rows (n,) or (n, m) [V] → [1]."""
        matrix = np.array(rows, float, order="C")
        kernel = function("whiten", count, count, array, array, array, array, array)
        columns = matrix.size // len(matrix)
        if kernel is None:
            return _whitened(matrix, *self)
        kernel(len(matrix), columns, *self, np.zeros(columns), matrix)
        return matrix


def whitening(noise, stack, *, extra_volt=0.0):
    """Filter gains that whiten residuals over a stack of records.

    Parameters
    ----------
    noise : Noise of all records, or a sequence of Noise, one a record.
    stack : records.Stack; each record starts anew.
    extra_volt : scalar or (n,) further white error of each row, such as of a steep OCV [V].

    Returns
    -------
    whitening : Whitening.
    """
    of_record = np.array([noise] * len(stack.first) if isinstance(noise, Noise) else noise)
    white_volt, slow_volt, slow_second = of_record[stack.file].T
    keep = np.exp(-stack.step_second / slow_second) * (1.0 - stack.fresh)
    white, slow = white_volt**2 + np.square(extra_volt), slow_volt**2
    gain, scale = np.empty(len(keep)), np.empty(len(keep))
    kernel = function("whitening_gains", count, *[array] * 5)
    if kernel is None:
        _gains(keep, white, slow, gain, scale)
    else:
        kernel(len(keep), keep, white, slow, gain, scale)
    return Whitening(keep, gain, scale)


def estimate_noise(residual_volt, stack, *, most_slow_volt, most_slow_second, extra_volt=0.0):
    """Most likely noise of residuals, its slow part within limits.

    The slow part must not grow until it holds a slow effect: hence the limits.

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
    size = max(_robust(residual_volt), SMALLEST_VOLT)
    best, cost = Noise(size, 0.0, TIMES_SECOND[0]), np.inf
    times = [t for t in TIMES_SECOND if t <= most_slow_second]
    # Without a slow part one time constant is enough.
    shapes = [(ratio, t) for ratio in RATIOS for t in (times if ratio else times[:1])]
    for ratio, second in shapes:
        tried = Noise(size, size * np.sqrt(ratio), second)
        for _ in range(2):
            tried = _scaled_to_residual(tried, residual_volt, stack, extra_volt, most_slow_volt)
        trial_cost = _cost(tried, residual_volt, stack, extra_volt)
        if trial_cost < cost:
            best, cost = tried, trial_cost
    return best


class Clock(NamedTuple):
    """What a whitening needs of the rows of one record; fields as of records.Stack."""

    step_second: np.ndarray
    fresh: np.ndarray
    first: np.ndarray
    file: np.ndarray


def with_misfit(noise, residual_volt, stack, *, extra_volt=0.0):
    """Noise of each record: that of all records, or a larger one where the model misses it.

    What no candidate explains in a record is no reading noise. It lasts for minutes to hours, and
    taken for independent rows it would make any effect that follows it significant. It is carried
    as slow noise of that record, where that is likelier by the Bayesian information criterion.

    Parameters
    ----------
    noise : Noise of all records. residual_volt : (n,) of the model with all candidates in it [V].
    stack : records.Stack. extra_volt : as in `whitening`.

    Returns
    -------
    noises : tuple of Noise, one a record.

    Source: M. Kennedy, A. O'Hagan, J. R. Stat. Soc. B 63 (2001) 425, a discrepancy of the model.
    """
    extra = np.broadcast_to(np.asarray(extra_volt, float), residual_volt.shape)
    noises = []
    for number in range(len(stack.first)):
        rows = stack.file == number
        clock = Clock(
            *(stack.step_second[rows], stack.fresh[rows]),
            np.zeros(1, int),
            np.zeros(rows.sum(), int),
        )
        noises.append(_misfit(noise, residual_volt[rows], clock, extra[rows]))
    return tuple(noises)


def _misfit(noise, residual_volt, clock, extra_volt):
    """Noise of one record: the one of all, or the likeliest of the shapes of a misfit."""
    best, cost = noise, _cost(noise, residual_volt, clock, extra_volt)
    cost -= MISFIT_NUMBERS * np.log(len(residual_volt))
    for ratio in MISFIT_RATIOS:
        for second in MISFIT_SECOND:
            tried = Noise(noise.white_volt, noise.white_volt * np.sqrt(ratio), second)
            for _ in range(2):
                tried = _scaled_to_residual(tried, residual_volt, clock, extra_volt, np.inf)
            if tried.volt <= noise.volt:
                continue
            tried_cost = _cost(tried, residual_volt, clock, extra_volt)
            best, cost = (tried, tried_cost) if tried_cost < cost else (best, cost)
    return best


def _cost(noise, residual_volt, stack, extra_volt):
    """Twice the negative log-likelihood of residuals, without its constant."""
    w = whitening(noise, stack, extra_volt=extra_volt)
    return w.log_variance + np.sum(w.apply(residual_volt) ** 2)


def _scaled_to_residual(tried, residual_volt, stack, extra_volt, most_slow_volt):
    """Noise of the same shape, scaled so that the whitened residual has unit variance."""
    w = whitening(tried, stack, extra_volt=extra_volt)
    factor = max(rms(w.apply(residual_volt)), 1e-3)
    slow = min(tried.slow_volt * factor, most_slow_volt)
    return Noise(max(tried.white_volt * factor, SMALLEST_VOLT), slow, tried.slow_second)


def read_volt(residual_volt, stack, *, steady_ampere):
    """White noise [V] from differences of neighbouring rows at steady current.

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
    if rows.sum() < LEAST_ROWS:
        return _robust(residual_volt)
    return max(_robust(np.diff(residual_volt)[rows]) / np.sqrt(2.0), SMALLEST_VOLT)


def _robust(values):
    """Standard deviation by the median of absolute deviations: few outliers change it little."""
    middle = np.median(values)
    return 1.4826 * float(np.median(np.abs(values - middle)))


def _gains(keep, white, slow, gain, scale):
    """Kalman gains and scales of every row; fills the last two arrays."""
    variance = 0.0
    for k in range(len(keep)):
        prior = keep[k] ** 2 * variance + (1.0 - keep[k] ** 2) * slow[k]
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
