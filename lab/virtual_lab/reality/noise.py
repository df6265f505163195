"""Noise, resolution and sampling clock of an instrument, from rests and constant currents.

White noise of standard deviation s leaves second differences of 6 s² (variances 1, 4 and 1 added),
whatever straight drift lies under it; a slow drift leaves almost none.
"""

import numpy as np
from scipy import signal

from virtual_lab.reality.records import Curve, number_rows

FEWEST = 48
REGULAR = 0.3
WINDOW = 512
LATTICE_STEPS = 12
LATTICE_MISS = 0.15
FEWEST_DISTANCES = 8
BLOCK = 8


def white_level(values: np.ndarray) -> float:
    """Standard deviation of the white noise of values (n,), in their unit."""
    return float(np.sqrt(np.mean(np.diff(values, 2) ** 2) / 6))


def resolution(values: np.ndarray) -> float:
    """Step of the grid that values (n,) lie on, in their unit; NaN where they lie on none.

    The least distances between the values met are a first guess, made exact by all distances of up
    to twelve steps; a grid it is when nine in ten of these are whole numbers of steps.
    """
    change = np.diff(np.unique(values))
    change = change[change > 1e-7]
    if change.size < FEWEST_DISTANCES:
        return float("nan")
    step = np.quantile(change, 0.1)
    near = change[change < (LATTICE_STEPS + 0.5) * step]
    count = np.round(near / step)
    step = float(near @ count / (count @ count))
    off = np.abs(near / step - np.round(near / step))
    return step if np.mean(off < LATTICE_MISS) > 0.9 else float("nan")


def spectrum(values: np.ndarray, period_second: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and density [unit/√Hz] of values (n,), one-sided.

    Hann windows of at most 512 samples, half overlapping, a parabola taken out of each; the three
    lowest frequencies, which the parabola eats, are left out.
    """
    width = min(WINDOW, values.size)
    starts = range(0, values.size - width + 1, max(width // 2, 1))
    centred = np.linspace(-1, 1, width)
    parts = [values[start : start + width] for start in starts]
    flat = [part - np.polyval(np.polyfit(centred, part, 2), centred) for part in parts]
    settings = {"fs": 1 / period_second, "window": "hann", "detrend": False}
    spectra = [signal.periodogram(part, **settings) for part in flat]
    density = np.sqrt(np.mean([power for _, power in spectra], axis=0))
    return spectra[0][0][3:], density[3:]


def slow_share(values: np.ndarray) -> float:
    """Scatter of eight-sample means about a parabola over that of white noise, [1].

    1: the noise is white. The scatter of neighbouring samples gives the white part.
    """
    blocks = values[: values.size // BLOCK * BLOCK].reshape(-1, BLOCK).mean(axis=1)
    white = white_level(values) / BLOCK**0.5
    if blocks.size < 6 or white == 0:
        return float("nan")
    place = np.linspace(-1, 1, blocks.size)
    rest = blocks - np.polyval(np.polyfit(place, blocks, 2), place)
    return float(np.sqrt(rest @ rest / (blocks.size - 3)) / white)


def steady_rows(record):
    """(step, condition, rows) of the quiet part of each rest and constant current.

    Of a rest the second half; of a load the middle half. Rows are the longest stretch in which the
    interval stays within 30 % of the usual one.
    """
    steps = record.steps
    for index, kind in enumerate(steps.kind):
        if kind not in ("rest", "CC"):
            continue
        first, last = steps.first_row[index], steps.last_row[index]
        size = last + 1 - first
        begin, end = (0.5, 1.0) if kind == "rest" else (0.25, 0.75)
        rows = np.arange(first + int(begin * size), first + int(end * size))
        rows = _regular(rows, record.second)
        if rows.size >= FEWEST:
            condition = "at rest" if kind == "rest" else "under constant current"
            yield index, condition, rows


def _regular(rows, second):
    if rows.size < FEWEST:
        return rows[:0]
    wait = np.diff(second[rows])
    usual = np.median(wait)
    breaks = np.flatnonzero(np.abs(wait - usual) > REGULAR * usual) + 1
    return max(np.split(rows, breaks), key=len)


def clock(second: np.ndarray) -> dict:
    """Numbers about the sampling times (n,) [s] of a stretch with one interval.

    The lag correlation of successive intervals tells a clock that is late each time anew (0) from
    one that keeps to a grid and misses it a little (−0.5).
    """
    wait = np.diff(second)
    away = wait - wait.mean()
    spread = away.std()
    lag = away[1:] @ away[:-1] / (away @ away) if spread > 1e-4 else np.nan
    return {
        "interval": (np.median(wait), "s"),
        "scatter of the interval": (1000 * spread, "ms"),
        "shortest to longest interval": (1000 * np.ptp(wait), "ms"),
        "correlation of successive intervals": (lag, "1"),
    }


def channels(record, rows) -> dict:
    """Noise of voltage, current and surface temperature in some rows."""
    volt, ampere = record.volt[rows], record.ampere[rows]
    numbers = {
        "white noise of voltage": (1e3 * white_level(volt), "mV"),
        "slow scatter of voltage over white": (slow_share(volt), "1"),
        "samples that repeat the voltage": (np.mean(np.diff(volt) == 0), "1"),
        "noise of current": (1e3 * ampere.std(), "mA"),
        "noise of current over rating": (1e6 * ampere.std() / record.rating_ampere_hour, "ppm"),
        "mean current": (1e3 * ampere.mean(), "mA"),
    }
    return numbers | {"white noise of temperature": (white_level(_celsius(record)[rows]), "K")}


def grids(record, rows) -> dict:
    """Resolution of each channel, from all quiet rows of a record."""
    return {
        "step of voltage": (1e3 * resolution(record.volt[rows]), "mV"),
        "step of current": (1e3 * resolution(record.ampere[rows]), "mA"),
        "step of temperature": (resolution(_celsius(record)[rows]), "K"),
    }


def _celsius(record):
    unknown = np.full(record.volt.size, np.nan)
    return record.columns.get("surface_temperature_celsius", unknown)


def look_at_noise(record):
    """Numbers and curves of a record's quiet stretches."""
    numbers, curves = [], []
    about = (record.source.name, record.cell, record.test)
    quiet = list(steady_rows(record))
    if quiet:
        all_rows = np.concatenate([rows for _, _, rows in quiet])
        numbers += number_rows(record, -1, "noise", "whole record", grids(record, all_rows))
    for step, condition, rows in quiet:
        second = record.second[rows]
        numbers += number_rows(record, step, "noise", condition, channels(record, rows))
        numbers += number_rows(record, step, "clock", condition, clock(second))
        hertz, density = spectrum(1e3 * record.volt[rows], float(np.median(np.diff(second))))
        curves.append(Curve(*about, f"spectrum {condition}", hertz, density))
        curves.append(Curve(*about, f"trace {condition}", *_trace(second, record.volt[rows])))
    return numbers, curves


def _trace(second, volt):
    """Sixty samples minus their parabola: number of the sample, and voltage [mV]."""
    rows = slice(0, 60)
    place = np.linspace(-1, 1, len(second[rows]))
    flat = volt[rows] - np.polyval(np.polyfit(place, volt[rows], 2), place)
    return np.arange(flat.size), 1e3 * flat
