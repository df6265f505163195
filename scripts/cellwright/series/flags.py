"""What is wrong with the rows of a series: detectors flag, each with its reason; none removes."""

from collections.abc import Mapping
from enum import IntFlag

import numpy as np


def spike_rows(
    current_ampere: np.ndarray,
    voltage_volt: np.ndarray,
    *,
    limit_volt: float = 0.01,
    noise_factor: float = 8.0,
    current_step_ampere: float,
) -> np.ndarray:
    """Rows of the voltage that are spikes.

    1. The steps to both neighbours exceed the limit and have opposite signs.
    2. The limit is `limit_volt`, or `noise_factor` times the typical step nearby if that is more.
    3. The current of the five samples around moves by less than `current_step_ampere`: a step of
       the voltage that the current explains is never a spike, even where its channel lags by two.
    4. Nor does the current jump out and back with it by three of its own small steps: on a
       coarse grid a short pulse leaves little of its current and much of its voltage.
    5. The four neighbours agree with each other better than with the spike: it jumped out of a
       smooth curve, and back.

    Parameters
    ----------
    current_ampere, voltage_volt : arrays [A], [V], same length
    limit_volt : float [V]
    noise_factor : float
    current_step_ampere : float [A]

    Returns
    -------
    array of row numbers

    Source
    ------
    Thesis ch. 5.2 and table 5.1. Erratum: its test compares signed differences; the two steps of
    a spike have opposite signs, so magnitudes and signs are compared here.
    """
    step = np.diff(voltage_volt)
    if step.size < 4:
        return np.empty(0, dtype=int)
    rows = np.arange(2, voltage_volt.size - 2)
    into, out = step[1:-2], step[2:-1]
    least = np.minimum(np.abs(into), np.abs(out))
    suspect = rows[(into * out < 0) & (least > limit_volt)]
    limit = noise_factor * _typical_step(step, suspect)
    suspect = suspect[least[suspect - 2] > limit]
    around = suspect[:, None] + np.arange(-2, 3)
    quiet = np.ptp(current_ampere[around], axis=1) < current_step_ampere
    quiet &= ~_answered(current_ampere, voltage_volt, suspect, 0.1 * current_step_ampere)
    neighbours = voltage_volt[around[:, [0, 1, 3, 4]]]
    smooth = np.ptp(neighbours, axis=1) < 0.5 * least[suspect - 2]
    return suspect[quiet & smooth]


def spike_free(voltage_volt: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """The voltage [V] with each spike replaced by the mean of its four neighbours."""
    repaired = voltage_volt.copy()
    around = rows[:, None] + np.array([-2, -1, 1, 2])
    repaired[rows] = voltage_volt[around].mean(axis=1)
    return repaired


def _answered(
    current: np.ndarray, voltage: np.ndarray, rows: np.ndarray, least_ampere: float
) -> np.ndarray:
    """Whether the current left its neighbours in the direction of the voltage at each row."""
    beside = rows[:, None] + np.array([-1, 1])
    out_current = current[rows] - current[beside].mean(axis=1)
    out_voltage = voltage[rows] - voltage[beside].mean(axis=1)
    quiet = _typical_step(np.diff(current), rows, quantile=0.25)
    limit = np.maximum(3 * quiet, least_ampere)
    return (out_current * out_voltage > 0) & (np.abs(out_current) > limit)


def _typical_step(
    step: np.ndarray, rows: np.ndarray, *, quantile: float = 0.5, half_width: int = 10
) -> np.ndarray:
    """Quantile of the magnitude of the steps within `half_width` samples of each row."""
    near = np.clip(rows[:, None] + np.arange(-half_width, half_width), 0, step.size - 1)
    return np.quantile(np.abs(step[near]), quantile, axis=1)


NO_READING = 1e30  # instruments write ±3.4e38 for "no reading"
SERIES = ("test_time_second", "current_ampere", "voltage_volt")


class Flag(IntFlag):
    """Why a row is marked; a row may carry several."""

    NAN = 1  # time, current or voltage is no number
    SENTINEL = 2  # it holds an instrument's mark for "no reading"
    REPEAT = 4  # it repeats the row before, or its time stamp without a step of the current
    OUT_OF_PLACE = 8  # its time stamp alone lies behind that of the rows around it
    CLOCK = 16  # the clock jumped before it and goes on from there
    SPIKE = 32  # its voltage jumps out and back
    GAP = 64  # the record is silent before it
    REST_READING = 128  # a rest begins in which the current channel reads what is no current


REMOVED = Flag.NAN | Flag.SENTINEL | Flag.REPEAT | Flag.OUT_OF_PLACE


def flag(
    columns: Mapping[str, np.ndarray],
    *,
    spike_limit_volt: float = 0.01,
    spike_noise_factor: float = 8.0,
    current_step_fraction: float = 0.01,
    gap_second: float = 120.0,
    gap_factor: float = 5.0,
) -> np.ndarray:
    """Mark each row of a series with what is wrong with it.

    Parameters
    ----------
    columns : mapping of arrays
        test_time_second [s], current_ampere [A], voltage_volt [V]; file_index where files are
        joined.
    spike_limit_volt : float [V]
        Least step of the voltage to either neighbour that makes a spike.
    spike_noise_factor : float
        The same, in typical steps nearby.
    current_step_fraction : float
        Change of the current that counts as a step, as a fraction of its largest magnitude.
    gap_second, gap_factor : float [s], float
        An interval is a gap where it is longer than `gap_second`, and than `gap_factor` times both
        the interval before and the one after.

    Returns
    -------
    array of int, a combination of `Flag` for each row, 0 where nothing is wrong.
    """
    time, current, voltage = (columns[name] for name in SERIES)
    flags = _unreadable(time, current, voltage)
    step = current_step_fraction * float(np.max(np.abs(current[flags == 0]), initial=0.0))
    _flag_among(flags, lambda rows: _repeats(time[rows], current[rows], voltage[rows], step))
    _flag_among(flags, lambda rows: _out_of_place(time[rows]))
    _flag_among(flags, lambda rows: _clock_jumps(time[rows], rows, gap_factor))
    _flag_among(flags, lambda rows: _gaps(rebased(time[rows], flags[rows]), gap_second, gap_factor))
    _flag_among(
        flags,
        lambda rows: _spikes(
            current[rows], voltage[rows], spike_limit_volt, spike_noise_factor, step
        ),
    )
    if "file_index" in columns:
        _flag_among(flags, lambda rows: _file_starts(columns["file_index"][rows]))
    return flags


def counts(flags: np.ndarray) -> dict[str, int]:
    """How many rows carry each flag."""
    return {kind.name.lower(): int(np.count_nonzero(flags & kind)) for kind in Flag}


def _flag_among(flags: np.ndarray, detector) -> None:
    """Let a detector see the rows that will be kept, and add what it finds to `flags`."""
    rows = np.flatnonzero((flags & REMOVED) == 0)
    flags[rows] |= detector(rows)


def _unreadable(*columns: np.ndarray) -> np.ndarray:
    flags = np.zeros(columns[0].size, dtype=np.int16)
    for column in columns:
        flags[~np.isfinite(column)] |= Flag.NAN
        flags[np.isfinite(column) & (np.abs(column) > NO_READING)] |= Flag.SENTINEL
    flags[_dead(columns[2])] |= Flag.SENTINEL
    return flags


def _dead(voltage: np.ndarray) -> np.ndarray:
    """Rows of exactly 0 V between rows of more than 1 V: the instrument did not measure."""
    before, after = np.roll(voltage, 1), np.roll(voltage, -1)
    return (voltage == 0) & (np.abs(before) > 1) & (np.abs(after) > 1)


def _repeats(time: np.ndarray, current: np.ndarray, voltage: np.ndarray, step: float) -> np.ndarray:
    """Rows whose time stands twice; where the current steps there, the edge is kept."""
    same_time = np.diff(time, prepend=np.nan) == 0
    steps = np.abs(np.diff(current, prepend=np.inf)) > step
    return np.where(same_time & ~steps, Flag.REPEAT, 0).astype(np.int16)


def _out_of_place(time: np.ndarray) -> np.ndarray:
    """Single rows out of order in time: behind the row before, or too far ahead of the next."""
    flags = np.zeros(time.size, dtype=np.int16)
    for row in np.flatnonzero(np.diff(time) < 0) + 1:
        resumes = row + 1 >= time.size or time[row + 1] > time[row - 1]
        overshot = row > 1 and time[row - 2] < time[row] < time[row - 1]
        if resumes or overshot:
            flags[row if resumes else row - 1] |= Flag.OUT_OF_PLACE
    return flags


def _clock_jumps(time: np.ndarray, rows: np.ndarray, gap_factor: float) -> np.ndarray:
    """Rows before which the clock was set back, or forward again by what it had lost.

    Rows without a reading are gone from between, but their time passed: each counts as a step.
    """
    flags = np.zeros(time.size, dtype=np.int16)
    interval = np.diff(time)
    if not (interval < 0).any():
        return flags
    typical, lost = float(np.median(interval[interval > 0])), 0.0
    beyond = interval - typical * np.diff(rows)
    for row in np.flatnonzero((interval < 0) | (beyond > (gap_factor - 1) * typical)) + 1:
        ahead = beyond[row - 1]
        if ahead < 0 or ahead <= 1.1 * lost:
            flags[row] |= Flag.CLOCK
            lost = max(lost - ahead, 0.0)
    return flags


def _gaps(time: np.ndarray, gap_second: float, gap_factor: float) -> np.ndarray:
    interval = np.diff(time)
    around = np.pad(interval, 1)
    neighbour = np.maximum(around[:-2], around[2:])
    gap = (interval > gap_second) & (interval > gap_factor * neighbour)
    return np.where(np.concatenate([[False], gap]), Flag.GAP, 0).astype(np.int16)


def _file_starts(file_index: np.ndarray) -> np.ndarray:
    """First rows of files: what the cell did before them is not in the record."""
    return np.where(np.diff(file_index, prepend=file_index[0]) != 0, Flag.GAP, 0).astype(np.int16)


def _spikes(
    current: np.ndarray, voltage: np.ndarray, limit: float, factor: float, step: float
) -> np.ndarray:
    flags = np.zeros(voltage.size, dtype=np.int16)
    rows = spike_rows(
        current, voltage, limit_volt=limit, noise_factor=factor, current_step_ampere=step
    )
    flags[rows] = Flag.SPIKE
    return flags


def rebased(time: np.ndarray, flags: np.ndarray) -> np.ndarray:
    """Time [s] in which a row after a jump of the clock follows after the interval before it."""
    jumps = np.flatnonzero(flags & Flag.CLOCK)
    if not jumps.size:
        return time
    interval = np.diff(time, prepend=time[0])
    good = np.flatnonzero((flags & Flag.CLOCK) == 0)[1:]
    before = good[np.maximum(np.searchsorted(good, jumps) - 1, 0)]
    interval[jumps] = interval[before]
    return time[0] + np.cumsum(interval)
