"""How the voltage comes to rest after a load: what share of the way by when."""

import numpy as np
from scipy.optimize import least_squares

from virtual_lab.reality.findings import Curve, numbers
from virtual_lab.reality.noise import white_level

ENDS_SECOND = (40.0, 180.0, 600.0, 3500.0)
TIMES_SECOND = (1.0, 10.0, 100.0, 1000.0)
FIT_SECOND = 600.0
LOADED_SECOND = 60.0
SLOWEST_FIRST_SAMPLE = 12.0
SAME, WIDEST = 0.1, 3.0
EARLY_SECOND, FEWEST_EARLY = 31.0, 3
LONGEST_INTERVAL = 65.0
LEAST_VOLT, LEAST_OVER_NOISE = 0.002, 20.0


def shares(second: np.ndarray, volt: np.ndarray, *, until_second: float) -> dict[float, float]:
    """Share [1] of the change from the last loaded sample to `until_second`, at 1, 10, … s.

    Parameters
    ----------
    second : (n,) [s] since the load ended; the first one is the last loaded sample, at 0.
    volt : (n,) [V].
    until_second : where the way is taken to end [s].

    Between samples the line is straight in log t; a time is left out where no sample lies within a
    tenth of it and the one after it is more than three times later than the one before.
    """
    whole = np.interp(until_second, second, volt) - volt[0]
    at, level = np.log(second[1:]), volt[1:] - volt[0]
    times = [time for time in TIMES_SECOND if time < until_second and _is_seen(second[1:], time)]
    return {time: float(np.interp(np.log(time), at, level) / whole) for time in times}


def _is_seen(second, time) -> bool:
    """A sample within a tenth of the time, or one on each side not far from the other."""
    if np.min(np.abs(second - time)) <= SAME * time:
        return True
    after = np.searchsorted(second, time)
    return 0 < after < second.size and second[after] <= WIDEST * second[after - 1]


def stretched(second: np.ndarray, volt: np.ndarray) -> tuple[float, float, float]:
    """Exponent [1], time constant [s] and rest of a fit of V∞ − A·exp(−(t/τ)^β).

    The rest is the RMS error over A. Samples are thinned to be even in log t, so that early and
    late times weigh alike. (Kohlrausch's law; β = 1 is one RC pair, 0.5 many of them.)
    """
    usable = second > 0
    at = np.geomspace(second[usable][0], second[-1], 60)
    wanted = np.interp(at, second, volt)
    size = wanted[-1] - wanted[0]

    def curve(p):
        with np.errstate(over="ignore"):
            return p[0] - p[1] * np.exp(-((at / np.exp(p[2])) ** p[3]))

    starts = [(wanted[-1], size, np.log(tau), 0.6) for tau in (20.0, 200.0, 1000.0)]
    bounds = ([-np.inf, -np.inf, np.log(0.1), 0.1], [np.inf, np.inf, np.log(1e5), 1.5])
    fits = [
        least_squares(lambda p: (curve(p) - wanted) / abs(size), start, bounds=bounds)
        for start in starts
    ]
    best = min(fits, key=lambda fit: fit.cost)
    rms = np.sqrt(2 * best.cost / at.size) * abs(size) / abs(best.x[1])
    return float(best.x[3]), float(np.exp(best.x[2])), float(rms)


def rests(record):
    """(step, condition, second, volt) of each rest after a load, rests in a row taken as one."""
    steps = record.steps
    for index in np.flatnonzero(steps.kind == "rest"):
        before = index - 1
        if before < 0 or steps.kind[before] == "rest":
            continue
        others = np.flatnonzero(steps.kind[index:] != "rest")
        last = steps.last_row[index + others[0] - 1] if others.size else steps.last_row[-1]
        rows = np.arange(steps.first_row[index] - 1, last + 1)
        second, rows = _unbroken(record.second[rows] - record.second[rows[0]], rows)
        if _usable(second):
            yield index, _load(steps, before), second, record.volt[rows]


def _unbroken(second, rows):
    """Up to the first hole, and one sample for each instant."""
    hole = np.flatnonzero(np.diff(second) > LONGEST_INTERVAL)
    stop = hole[0] + 1 if hole.size else second.size
    second, rows = second[:stop], rows[:stop]
    new = np.concatenate([[True], np.diff(second) > 0])
    return second[new], rows[new]


def _usable(second) -> bool:
    """Begun at once, and with enough early samples to draw a line."""
    early = second[1:] <= EARLY_SECOND
    return np.sum(early) >= FEWEST_EARLY and second[1] <= SLOWEST_FIRST_SAMPLE


def _moves(second, volt, end_second) -> bool:
    """The rest lasts that long, and its voltage moves by more than an instrument's doubts."""
    moved = np.interp(end_second, second, volt) - volt[0]
    return second[-1] >= 0.95 * end_second and abs(moved) > _doubt(volt)


def _doubt(volt) -> float:
    """Change [V] below which noise would shape the curve."""
    return max(LEAST_VOLT, LEAST_OVER_NOISE * white_level(volt[volt.size // 2 :]))


def _load(steps, before) -> str:
    """What went before, in words."""
    kind = steps.kind[before]
    way = "charge" if steps.current_mean_ampere[before] > 0 else "discharge"
    if kind == "dynamic":
        return "after a dynamic load"
    if kind in ("CV", "CCCV"):
        return f"after a {way} and hold"
    if steps.duration_second[before] < LOADED_SECOND:
        return f"after a {way} pulse"
    return (
        f"after a {way} to the end"
        if steps.duration_second[before] > 1500
        else f"after a {way} step"
    )


def look(record):
    """Numbers and curves of a record's rests."""
    found, curves = [], []
    for step, condition, second, volt in rests(record):
        row = {}
        for end in (e for e in ENDS_SECOND if _moves(second, volt, e)):
            row |= _way(second, volt, min(end, second[-1]), f"{end:g} s")
            curves.append(_curve(record, f"{condition}, to {end:g} s", second, volt, end))
        row |= _fit(second, volt)
        found += numbers(record, step, "relaxation", condition, row)
    return found, curves


def _way(second, volt, until, name) -> dict:
    part = shares(second, volt, until_second=until)
    row = {f"share of {name} by {time:g} s": (value, "1") for time, value in part.items()}
    return row | {f"way of {name}": (1e3 * (np.interp(until, second, volt) - volt[0]), "mV")}


def _fit(second, volt) -> dict:
    inside = (second >= 1.0) & (second <= 1.5 * FIT_SECOND)
    whole = volt[inside][[0, -1]]
    if second[-1] < 0.95 * FIT_SECOND or abs(np.diff(whole)[0]) < _doubt(volt):
        return {}
    exponent, tau, rms = stretched(second[inside], volt[inside])
    return {
        "stretched exponent": (exponent, "1"),
        "stretched time constant": (tau, "s"),
        "rest of the stretched fit": (rms, "1"),
    }


def _curve(record, panel, second, volt, until):
    at = second[(second > 0) & (second <= until)]
    whole = np.interp(until, second, volt) - volt[0]
    left = 1 - (np.interp(at, second, volt) - volt[0]) / whole
    return Curve(record.source.name, record.cell, record.test, panel, at, left)
