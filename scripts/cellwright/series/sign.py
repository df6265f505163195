"""Which way the current of a record counts: found from the data, for cyclers disagree.

The house counts charge positive. A cell's voltage rises when current is pushed in: at once, through
its resistance, and slowly, through its state of charge. Both are asked.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal

CONVENTIONS = {"charge_positive": 1, "discharge_positive": -1}
NO_READING = 1e30  # beyond it stands an instrument's mark, not a number
NO_CURRENT = "no current flows"
MAGNITUDES = "the current never changes its sign while the voltage shows charge and discharge"
LAGS = (0, -1, 1, 2)  # samples by which the voltage's channel may lag that of the current
SHORTEST_TREND = 100.0  # [s] below it the resistance's relaxation hides the state of charge
LONGEST_STEP = 300.0  # [s] beyond it the state of charge, not the resistance, moved the voltage


class Sign(NamedTuple):
    """What the data say of the sign of the current."""

    sign: int  # +1 charge positive, -1 discharge positive, 0 the data cannot tell
    evidence: float  # -1 … 1: how far steps and trends agree on it
    reason: str


def current_sign(
    test_time_second: np.ndarray,
    current_ampere: np.ndarray,
    voltage_volt: np.ndarray,
    *,
    clear: float = 0.8,
) -> Sign:
    """Sign of the current from steps of the voltage at steps of the current, and from its trend.

    1. Steps: where the current changes by more than a tenth of its largest change, the voltage
       must change in the same direction (its channel may lag by one or two samples). Votes weigh
       by ΔI·ΔV.
    2. Trend: over each long stretch of steady current the voltage must move in the direction of
       the current. Votes weigh by ampere-hours.
    3. Where both can be asked they must agree: a record of magnitudes, with charge and discharge
       both positive, does not pass.

    Parameters
    ----------
    test_time_second, current_ampere, voltage_volt : arrays [s], [A], [V]
    clear : float
        Evidence [-1…1, magnitude] below which the data cannot tell.

    Returns
    -------
    Sign
    """
    good = np.isfinite(test_time_second) & (np.abs(current_ampere) < NO_READING)
    good &= np.isfinite(voltage_volt)
    time, current, voltage = (x[good] for x in (test_time_second, current_ampere, voltage_volt))
    if time.size < 2 or not np.any(current):
        return Sign(0, 0.0, NO_CURRENT)
    step, trend = _step_vote(time, current, voltage), _trend_vote(time, current, voltage)
    if _magnitudes(current) and abs(step if np.isnan(trend) else trend) < 0.7:
        return Sign(0, 0.0, MAGNITUDES)
    return _verdict(step, trend, clear)


def _magnitudes(current: np.ndarray) -> bool:
    """Apart from the noise around zero, the current is never negative."""
    return current.min() > -0.02 * current.max()


def _verdict(step: float, trend: float, clear: float) -> Sign:
    """The sign that the votes agree on; a vote of NaN does not count."""
    said = f"steps {step:+.2f}, trend {trend:+.2f}".replace("+nan", "none")
    if np.isnan(step) and np.isnan(trend):
        return Sign(0, 0.0, "the current neither steps nor moves the voltage")
    evidence, wanted = _agreed(step, trend), clear
    if np.isnan(step) or np.isnan(trend):  # one witness alone has to be surer
        wanted = 0.5 * (1 + clear)
    if abs(evidence) < wanted:
        return Sign(0, evidence, f"voltage and current contradict each other ({said})")
    return Sign(int(np.sign(evidence)), evidence, said)


def _agreed(step: float, trend: float) -> float:
    """What the votes agree on: their mean, or nothing where they differ in sign.

    Where the voltage is the one that is set (holds, dithers), it does not follow the current's
    steps: a step vote that is no clearer than a coin leaves the word to a unanimous trend.
    """
    if np.isnan(step) or np.isnan(trend):
        return float(np.nansum([step, trend]))
    if abs(step) < 0.5 and abs(trend) > 0.9:
        return trend
    return 0.5 * (step + trend) if step * trend > 0 else 0.0


def _step_vote(time: np.ndarray, current: np.ndarray, voltage: np.ndarray) -> float:
    """Σ ΔI·ΔV over Σ |ΔI·ΔV| at the steps of the current, at the lag of the channels that fits."""
    change, moved = np.diff(current), np.diff(voltage)
    least = max(0.1 * np.abs(change).max(), 0.05 * np.abs(current).max())
    rows = np.flatnonzero(np.abs(change) > least)
    rows = rows[np.diff(time)[rows] < LONGEST_STEP]
    sums = np.array([_lagged(change, moved, rows, lag) for lag in LAGS])
    best = np.argmax(np.abs(sums[:, 0]) * (1, 0.5, 0.5, 0.5))  # no lag, unless one fits far better
    agreed, total = sums[best]
    return float(agreed / total) if total > 0 else np.nan


def _lagged(change: np.ndarray, moved: np.ndarray, rows: np.ndarray, lag: int) -> tuple:
    there = rows[(rows + lag >= 0) & (rows + lag < moved.size)]
    product = change[there] * moved[there + lag]
    return product.sum(), np.abs(product).sum()


def _trend_vote(time: np.ndarray, current: np.ndarray, voltage: np.ndarray) -> float:
    """Vote of the long stretches of steady current, weighted with their ampere-hours.

    NaN where such stretches carry less than half of the charge: a drive cycle has no trend.
    """
    start, end = _stretches(time, current)
    charge = current[start] * (time[end] - time[start])
    moved = voltage[end] - voltage[start]
    interval = np.diff(time)
    flowed = 0.5 * np.abs(current[1:] + current[:-1]) * np.abs(interval)
    long = (time[end] - time[start] > SHORTEST_TREND) & (moved != 0)
    weight = np.abs(charge[long]).sum()
    if weight < 0.4 * flowed[interval < LONGEST_STEP].sum():  # half, less the fifth left out below
        return np.nan
    return float(np.sum(charge[long] * np.sign(moved[long])) / weight)


def _stretches(time: np.ndarray, current: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and last rows of the stretches of steady current, past the first fifth's relaxation."""
    steps = np.abs(np.diff(current)) > 0.05 * np.abs(current).max()
    breaks = np.flatnonzero(steps | (np.diff(time) > LONGEST_STEP)) + 1
    first = np.concatenate([[0], breaks])
    length = np.diff(np.concatenate([first, [time.size]]))
    level = np.repeat(current[first + np.minimum(2, length - 1)], length)
    # A hold's taper is no step, but no steady current either: a stretch ends where it begins.
    held = np.abs(current - level) < 0.1 * np.abs(level)
    end = np.maximum.reduceat(np.where(held, np.arange(time.size), 0), first)
    end = np.maximum(end, first)
    return first + (end - first) // 5, end


class Signed(NamedTuple):
    """A series with its current positive on charge."""

    columns: dict[str, np.ndarray]
    note: str  # what was decided and why; empty where nothing is worth saying


def charge_positive(
    columns: Mapping[str, np.ndarray], *, stated: str | None = None, default: str | None = None
) -> Signed:
    """Turn the current of a series, and its branches and counter, positive on charge.

    Parameters
    ----------
    columns : mapping of arrays
        test_time_second [s], current_ampere [A], voltage_volt [V]; branch_…_current_ampere [A] and
        net_capacity_ampere_hour [Ah] where there are any.
    stated : {None, "charge_positive", "discharge_positive"}
        What the sheet says of the file.
    default : {None, "charge_positive", "discharge_positive"}
        What the file's format says; it serves where the data cannot tell.

    Raises
    ------
    Refusal
        The data clearly contradict what is stated, or show magnitudes only; or nothing is stated
        and nothing can tell.
    """
    series = ("test_time_second", "current_ampere", "voltage_volt")
    found = current_sign(*(columns[name] for name in series))
    sign, note = _decided(found, stated, default)
    return Signed(_turned(columns, sign), note)


def _decided(found: Sign, stated: str | None, default: str | None) -> tuple[int, str]:
    """The sign to go by, and a note where it is not plainly what the data say."""
    rule = stated or default
    if found.reason == NO_CURRENT:
        return CONVENTIONS[rule or "charge_positive"], f"{NO_CURRENT}: its sign does not matter"
    if found.reason == MAGNITUDES or not (found.sign or rule):
        raise Refusal(
            f"the data cannot tell the sign of the current: {found.reason}; "
            f"state current_sign ({' or '.join(CONVENTIONS)}) of a signed current"
        )
    if not found.sign:
        return CONVENTIONS[rule], f"current taken as {rule}: the data cannot tell ({found.reason})"
    shown = "charge_positive" if found.sign > 0 else "discharge_positive"
    if stated and stated != shown:
        raise Refusal(
            f"current_sign says {stated}, the voltage shows {shown} ({found.reason}); "
            "correct the sheet, or leave it blank"
        )
    against = f"current is {shown} by its voltage, against the format's rule {default}"
    return found.sign, "" if stated or default in (None, shown) else against


def _turned(columns: Mapping[str, np.ndarray], sign: int) -> dict[str, np.ndarray]:
    turned = dict(columns)
    for name in columns:
        if name.endswith("current_ampere"):
            turned[name] = columns[name] * sign
    counter = columns.get("net_capacity_ampere_hour")
    if counter is not None:
        turned["net_capacity_ampere_hour"] = counter * _counter_sign(turned)
    return turned


def _counter_sign(columns: Mapping[str, np.ndarray]) -> int:
    """-1 where the instrument's counter falls while charge flows in: it counts the other way."""
    time, current = columns["test_time_second"], columns["current_ampere"]
    counter = columns["net_capacity_ampere_hour"]
    flowed = 0.5 * (current[1:] + current[:-1]) * np.diff(time)
    steady = np.abs(np.diff(current)) <= 0.5 * np.abs(current[1:])
    return -1 if np.nansum((flowed * np.diff(counter))[steady]) < 0 else 1
