"""Periodogram and daily cycle of a series on uneven times, with a trend and correlated noise."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.lines import CORRELATIONS, coloured_line, whitened

DAY_HOUR = 24.0


class Period(NamedTuple):
    """Periodogram, its best period, and the amplitude and phase of the cycle of 24 h.

    period_hour, power : (k,) periods looked at, and twice the gain of log-likelihood of a sine of
    that period. best_period_hour, false_alarm : the highest, and the share of series without any
    period whose highest is as high. daily_amplitude, daily_std : half the swing of the 24 h sine,
    in the unit of the data. daily_peak_hour : of its maximum, modulo 24 h, on the clock of the
    times given. daily_false_alarm : of 24 h alone.
    reason : why the daily cycle is NaN, or "".
    """

    period_hour: np.ndarray
    power: np.ndarray
    best_period_hour: float
    false_alarm: float
    daily_amplitude: float
    daily_std: float
    daily_peak_hour: float
    daily_false_alarm: float
    reason: str


def periods(hour, values, trend, *, seed=0):
    """Least-squares periodogram with a trend fitted along, tested against simulated coloured noise.

    Sine and cosine of each period join the columns of the trend (the floating trend of the
    generalised Lomb–Scargle periodogram); noise is exponentially correlated, its memory fitted
    with and without the sine. False-alarm probabilities count how often noise of the fitted
    memory, without a period, does as well; 400 simulations resolve down to 0.0025.

    Parameters
    ----------
    hour : (n,) rising times [h]. values : (n,) in any unit. trend : (n, p) columns.
    seed : of the simulated noise.

    Returns
    -------
    Period; with a reason and NaN where the record is shorter than two days or has fewer than
    three values a day.

    Source: M. Zechmeister, M. Kürster, A&A 496 (2009) 577; simulated levels instead of theirs for
    white noise.
    """
    span, spacing = float(hour[-1] - hour[0]), float(np.median(np.diff(hour)))
    reason = _reason(len(hour), span, spacing, trend.shape[1])
    if reason:
        nothing = np.zeros(0)
        return Period(nothing, nothing, *[np.nan] * 6, reason)
    frequency = np.arange(1.5 / span, 0.5 / spacing, 0.25 / span)
    frequency = np.append(frequency, 1 / DAY_HOUR)
    place = (hour - hour[0]) / spacing
    drawn = _noise(values, trend, place, seed)
    gains = _gains(np.column_stack([values, drawn]), trend, place, hour, frequency)
    power, noise = gains[:, 0], gains[:, 1:]
    best, day = int(np.argmax(power[:-1])), len(frequency) - 1
    amplitude, std, peak = daily_sine(values, trend, place, hour)
    return Period(
        1 / frequency[:-1],
        power[:-1],
        float(1 / frequency[best]),
        _share(noise[:-1].max(axis=0), power[best]),
        amplitude,
        std,
        peak,
        _share(noise[day], power[day]),
        "",
    )


def _reason(count, span, spacing, trend):
    """Why no daily cycle can be determined; "" where it can."""
    if span < 2 * DAY_HOUR:
        return f"the record spans {span:.0f} h; a daily cycle needs two days"
    if spacing > DAY_HOUR / 3:
        return f"a value every {spacing:.0f} h; a daily cycle needs three a day"
    if count < trend + 6:
        return f"{count} values are too few for a period beside {trend} of the trend"
    return ""


def _noise(values, trend, place, seed):
    """Simulated series without a period, with the correlation of the values about their trend."""
    # The residual likelihood's: the plain one takes a memory for part of the trend.
    memory = coloured_line(trend, values, place).correlation
    draws = np.random.default_rng(seed).standard_normal((len(place), 400))
    kept = memory ** np.diff(place) if memory else np.zeros(len(place) - 1)
    for k in range(1, len(place)):
        draws[k] = kept[k - 1] * draws[k - 1] + np.sqrt(1 - kept[k - 1] ** 2) * draws[k]
    return draws


def _trend_removed(series, trend, place, correlation):
    """Log-likelihood of each series (n, m) with the trend alone, at one correlation, and its parts:
    the whitened residual, its squares, the basis of the trend, the constant.
    """
    design, logarithm = whitened(trend, place, correlation)
    seen, _ = whitened(series, place, correlation)
    basis = np.linalg.qr(design)[0]
    rest = seen - basis @ (basis.T @ seen)
    squares = np.sum(rest**2, axis=0)
    return _likelihood(squares, len(series), logarithm), rest, squares, basis, logarithm


def _likelihood(squares, count, logarithm):
    """Log-likelihood from sums of squares, the variance at its best value."""
    return -0.5 * count * np.log(np.maximum(squares, np.finfo(float).tiny)) - logarithm


def _gains(series, trend, place, hour, frequency):
    """Twice the gain of log-likelihood by a sine of each frequency: (frequencies, series)."""
    phase = 2 * np.pi * hour[:, None] * frequency
    waves = np.concatenate([np.cos(phase), np.sin(phase)], axis=1)
    plain, with_sine = [], []
    for correlation in CORRELATIONS:
        likely, rest, squares, basis, logarithm = _trend_removed(series, trend, place, correlation)
        seen, _ = whitened(waves, place, correlation)
        cosine, sine = np.split(seen - basis @ (basis.T @ seen), 2, axis=1)
        cosine /= np.linalg.norm(cosine, axis=0)
        sine -= cosine * np.sum(cosine * sine, axis=0)
        sine /= np.linalg.norm(sine, axis=0)
        squares_beside = squares - (cosine.T @ rest) ** 2 - (sine.T @ rest) ** 2
        plain.append(likely)
        with_sine.append(_likelihood(squares_beside, len(series), logarithm))
    return 2 * (np.max(with_sine, axis=0) - np.max(plain, axis=0))


def _share(noise, value):
    """False-alarm probability: share of simulated noise that reaches the value."""
    return float((1 + np.sum(noise >= value)) / (1 + len(noise)))


def daily_sine(values, trend, place, hour):
    """Amplitude of the daily sine, its standard deviation, and the hour of its maximum [h].

    Arrays as for `periods`; `place` as for `coloured_line`.
    """
    phase = 2 * np.pi / DAY_HOUR * hour
    columns = np.column_stack([trend, np.cos(phase), np.sin(phase)])
    line = coloured_line(columns, values, place)
    cosine, sine = line.values[-2:]
    amplitude = float(np.hypot(cosine, sine))
    std = float(np.hypot(cosine * line.std[-2], sine * line.std[-1]) / amplitude)
    peak = float(np.arctan2(sine, cosine) / (2 * np.pi) * DAY_HOUR % DAY_HOUR)
    return amplitude, std, peak
