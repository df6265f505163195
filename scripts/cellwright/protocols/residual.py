"""The relaxation that is left in a rest, carried on to times at which it could not be seen."""

from typing import NamedTuple

import numpy as np

from cellwright.protocols.plateaus import BIN_SECOND

FASTEST_HOUR, SLOWEST_RESTS, RATES = 0.5, 10.0, 120


class Course(NamedTuple):
    """Voltage and its standard deviation at the times asked (m,) [V]; scatter of one bin [V]."""

    volt: np.ndarray
    std_volt: np.ndarray
    noise_volt: float


def extrapolated(test_time_second, voltage_volt, used, at_second, *, known_until):
    """One exponential through the rows used, with every time constant weighted by its likelihood.

    Parameters
    ----------
    test_time_second, voltage_volt : (n,) of one rest [s], [V].
    used : list of (first, last) rows, inclusive, that are at the reference temperature.
    at_second : (m,) where the voltage is wanted [s].
    known_until : end of the first stretch; what relaxes afterwards is extrapolated [s].

    Returns
    -------
    Course : its deviation holds the scatter, the choice of the time constant, and that in the cold
        the relaxation may have stood still (rectangular, from nothing to what was extrapolated).

    Source: thesis 3.3 (the dotted lines of fig. 3.9); weighting by likelihood is ours.
    """
    time, volt = (np.asarray(column, float) for column in (test_time_second, voltage_volt))
    seen, means = _binned(time, volt, used)
    slowest = SLOWEST_RESTS * (time[-1] - time[0])
    taus = np.geomspace(3600 * FASTEST_HOUR, max(slowest, 7200.0 * FASTEST_HOUR), RATES)
    wanted = np.append(np.asarray(at_second, float), known_until)
    fits = [_with(tau, seen - time[0], means, wanted - time[0]) for tau in taus]
    errors = np.array([error for error, _, _ in fits])
    # A record without any scatter still does not tell voltages below a microvolt apart.
    variance = max(errors.min() / max(len(seen) - 3, 1), 1e-12)
    weights = np.exp(-(errors - errors.min()) / (2 * variance))
    weights /= weights.sum()
    values = np.array([value for _, value, _ in fits])
    mean = weights @ values
    within = weights @ (variance * np.array([leverage for _, _, leverage in fits]))
    spread = within + weights @ (values - mean) ** 2
    later = np.asarray(at_second, float) > known_until
    # ASSUME: The cold slows a relaxation down, so it lies between its extrapolation and a halt.
    drift = np.where(later, mean[:-1] - mean[-1], 0.0)
    std = np.sqrt(spread[:-1] + drift**2 / 3)
    return Course(mean[:-1], std, float(np.sqrt(variance)))


def _binned(time, volt, used):
    """Means over bins, so that neither many samples nor their correlation count for much."""
    rows = np.concatenate([np.arange(first, last + 1) for first, last in used])
    number = ((time[rows] - time[0]) // BIN_SECOND).astype(int)
    edges = np.flatnonzero(np.diff(number, prepend=-1))
    counts = np.diff(np.append(edges, len(rows)))
    return tuple(np.add.reduceat(column[rows], edges) / counts for column in (time, volt))


def _with(tau, seen, volt, wanted):
    """Squared error, values at the times wanted and their leverage for one time constant [s].

    The column is so scaled that a long time constant becomes a straight line, not a constant.
    """
    columns, asked = (
        np.stack([np.ones(len(t)), np.expm1(-(t - seen[0]) / tau)], axis=1) for t in (seen, wanted)
    )
    scale = np.abs(columns[:, 1]).max()
    columns[:, 1] /= scale
    asked[:, 1] /= scale
    weights = np.linalg.pinv(columns)
    found = weights @ volt
    leverage = np.sum((asked @ weights) ** 2, axis=1)
    return np.sum((columns @ found - volt) ** 2), asked @ found, leverage
