"""The sign of a test's current, from its voltage: which of the two a cell could have.

A cell's open-circuit voltage rises with its charge, and its resistance is positive. So

    V = OCV(q) + R·I,   q = ∫ I dt,   OCV never falling, R ≥ 0

is fitted to both signs of the current, and the one that it follows far better is the current's. A
single pulse and its rest, whose polarisation is most of the voltage, may fit neither: there the
steps and trends of the voltage vote.
"""

from typing import NamedTuple

import numpy as np

from cellwright.formats.pieces import (
    column_of,
    largest,
    pieces,
    rows_where,
    step_at,
    sum_of,
    summed,
)
from cellwright.series.cleaning import NO_READING, unmeasured

NO_CURRENT = "no current flows"
MAGNITUDES = "the current never changes its sign while the voltage shows charge and discharge"
OPPOSED = "voltage and current contradict each other"
LONGEST_STEP = 300.0  # [s] beyond it the state of charge, not the resistance, moved the voltage
# Of both signs' squares: the other sign leaves three times as much; of what may be magnitudes, of
# which a drive that mostly discharges looks like a discharge, twenty times.
CLEAR, CLEAR_OF_UNSIGNED = 0.5, 0.9
MOST_ROWS = 20_000  # that are compared
GAP_SECOND = 6 * 3600.0  # beyond it a pause of the record is a gap
MOST_OF_SPAN = 2.0  # the largest resistance, over the span of the voltage by that of the current
ROUNDED_VOLT = 1e-9  # what no voltage is read to


class Sign(NamedTuple):
    """Sign of the current according to the data, and how clear it is."""

    sign: int  # +1 charge positive, -1 discharge positive, 0 the data cannot tell
    evidence: float  # -1 … 1: how far the cell's model, or steps and trends, agree on it
    reason: str


def current_sign(
    test_time_second: np.ndarray,
    current_ampere: np.ndarray,
    voltage_volt: np.ndarray,
) -> Sign:
    """Sign of the current, from the voltage that follows it.

    1. The rising OCV and the positive resistance of a cell are fitted to either sign (see above).
       A sign that leaves a third of the other's squares, or less, is the current's.
    2. Elsewhere steps and trends vote. Steps: where the current changes by more than a tenth of
       its largest change, the voltage must change in the same direction (its channel may lag by
       one or two samples); votes weigh by ΔI·ΔV. Trend: over each long stretch of steady current
       the voltage must move in the direction of the current; votes weigh by ampere-hours. Where
       both can be asked they must agree.

    A record of magnitudes, with charge and discharge both positive, passes neither.

    test_time_second, current_ampere, voltage_volt : arrays [s], [A], [V]

    Returns Sign.
    """
    readings = test_time_second, current_ampere, voltage_volt
    good = is_reading(*readings)
    time, current, voltage = readings if good.all() else (x[good] for x in readings)
    if time.size < 2 or not np.any(current):
        return Sign(0, 0.0, NO_CURRENT)
    step, trend = _step_vote(time, current, voltage), _trend_vote(time, current, voltage)
    # Apart from noise around zero the current is never negative: the instrument may log its size.
    unsigned = current.min() > -0.02 * current.max()
    if unsigned and abs(step if np.isnan(trend) else trend) < 0.7:
        return Sign(0, 0.0, MAGNITUDES)
    evidence = _evidence_of_cell(time, current, voltage)
    if abs(evidence) < (CLEAR_OF_UNSIGNED if unsigned else CLEAR):
        return _verdict(step, trend)
    best = np.sqrt((1.0 - abs(evidence)) / (1.0 + abs(evidence)))
    words = f"a rising OCV and a resistance leave {100 * best:.2g} % of the other sign's error"
    return Sign(int(np.sign(evidence)), evidence, words)


def is_reading(time, current, voltage):
    """Rows that are readings, not marks for none."""
    good = ~unmeasured(voltage)
    return column_of(
        lambda t, i, v, g: g & np.isfinite(t) & (np.abs(i) < NO_READING) & (np.abs(v) < NO_READING),
        *(time, current, voltage, good),
        dtype=bool,
    )


def _evidence_of_cell(time, current, voltage):
    """How far a cell's model prefers the current as it is, 1, or turned, -1; 0: neither."""
    rows = np.arange(0, time.size, max(1, time.size // MOST_ROWS))
    columns = _charge_at(rows, time, current), current[rows], voltage[rows]
    as_is = _squares_of_cell(*columns)
    turned = _squares_of_cell(-columns[0], -columns[1], columns[2])
    least = len(columns[0]) * ROUNDED_VOLT**2
    return (turned - as_is) / (turned + as_is + least)


def _charge_at(rows, time, current):
    """Charge [As] that flowed up to ascending rows (k,), the first of which is 0."""
    found, last = [np.zeros(1)], None
    for part in pieces(time.size, beside=1):
        interval = np.diff(time[part])
        # Over a gap nobody knows what flowed; a clock that goes back counts nothing.
        interval[(interval < 0) | (interval > GAP_SECOND)] = 0.0
        charge = 0.5 * (current[part][1:] + current[part][:-1]) * interval
        last = summed(charge, last)
        inside = rows[np.searchsorted(rows, part.start + 1) : np.searchsorted(rows, part.stop)]
        found.append(charge[inside - part.start - 1])
    return np.concatenate(found)


def _squares_of_cell(charge, current, voltage):
    """Least sum of squares [V²] that an OCV which never falls with charge and a resistance leave.

    It is convex in the resistance, for the curves that never fall are a convex cone.
    """
    # Here: the import takes longer than most series.
    from scipy.optimize import isotonic_regression, minimize_scalar

    order = np.argsort(charge, kind="stable")
    current, voltage = current[order], voltage[order]

    def squares(ohm):
        bare = voltage - ohm * current
        off = bare - isotonic_regression(bare).x
        return float(off @ off)

    span = np.ptp(current)
    if span == 0.0:
        return squares(0.0)
    most = MOST_OF_SPAN * np.ptp(voltage) / span
    found = minimize_scalar(squares, bounds=(0.0, most), method="bounded")
    return min(squares(0.0), float(found.fun))


def _verdict(step: float, trend: float) -> Sign:
    """The sign that step vote and trend vote (-1 … 1) agree on; a vote of NaN does not count."""
    vote_text = f"steps {step:+.2f}, trend {trend:+.2f}".replace("+nan", "none")
    if np.isnan(step) and np.isnan(trend):
        return Sign(0, 0.0, "the current neither steps nor moves the voltage")
    evidence = _agreed(step, trend)
    alone = np.isnan(step) or np.isnan(trend)  # then it has to be clearer
    if abs(evidence) < (0.9 if alone else 0.8):
        return Sign(0, evidence, f"{OPPOSED} ({vote_text})")
    return Sign(int(np.sign(evidence)), evidence, vote_text)


def _agreed(step: float, trend: float) -> float:
    """Mean of step vote and trend vote (-1 … 1); 0 where they differ in sign.

    Where the tester sets the voltage (holds, dithers), it does not follow the steps of the current:
    where the step vote is unclear, a unanimous trend alone decides.
    """
    if np.isnan(step) or np.isnan(trend):
        return float(np.nansum([step, trend]))
    if abs(step) < 0.5 and abs(trend) > 0.9:
        return trend
    return 0.5 * (step + trend) if step * trend > 0 else 0.0


def _step_vote(time: np.ndarray, current: np.ndarray, voltage: np.ndarray) -> float:
    """Σ ΔI·ΔV over Σ |ΔI·ΔV| (-1 … 1) at the steps of the current, at the best lag of channels."""
    change = max(largest(np.diff(current[part])) for part in pieces(current.size, beside=1))
    least = max(0.1 * change, 0.05 * largest(current))
    rows = rows_where(lambda i: np.abs(np.diff(i)) > least, current, beside=1)
    rows = rows[step_at(time, rows) < LONGEST_STEP]
    # Samples by which the voltage's channel may lag that of the current.
    sums = np.array([_lagged(current, voltage, rows, lag) for lag in (0, -1, 1, 2)])
    best = np.argmax(np.abs(sums[:, 0]) * (1, 0.5, 0.5, 0.5))  # no lag, unless one fits far better
    agreed, total = sums[best]
    return float(agreed / total) if total > 0 else np.nan


def _lagged(current: np.ndarray, voltage: np.ndarray, rows: np.ndarray, lag: int) -> tuple:
    """Σ ΔI·ΔV and Σ |ΔI·ΔV| [AV] with the voltage `lag` samples behind the current."""
    paired = rows[(rows + lag >= 0) & (rows + lag < voltage.size - 1)]
    product = step_at(current, paired) * step_at(voltage, paired + lag)
    return product.sum(), np.abs(product).sum()


def _trend_vote(time: np.ndarray, current: np.ndarray, voltage: np.ndarray) -> float:
    """Share of the charge (-1 … 1) of long steady currents that the voltage moves along with.

    NaN where such stretches carry less than half of the charge: a drive cycle has no trend.
    """
    start, end = _stretches(time, current)
    charge = current[start] * (time[end] - time[start])
    moved = voltage[end] - voltage[start]
    # In less than 100 s the resistance's relaxation hides the state of charge.
    long = (time[end] - time[start] > 100.0) & (moved != 0)
    weight = np.abs(charge[long]).sum()
    # Half, less the fifth left out below.
    if weight <= 0.4 * sum_of(_flowed, time, current, beside=1):
        return np.nan
    return float(np.sum(charge[long] * np.sign(moved[long])) / weight)


def _flowed(time, current):
    """Charge [As] that flowed between rows, but for pauses."""
    interval = np.diff(time)
    flowed = 0.5 * np.abs(current[1:] + current[:-1]) * np.abs(interval)
    return flowed[interval < LONGEST_STEP]


def _stretches(time: np.ndarray, current: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and last rows of the stretches of steady current, past the first fifth's relaxation."""
    least = 0.05 * largest(current)

    def breaks(time, current):
        return (np.abs(np.diff(current)) > least) | (np.diff(time) > LONGEST_STEP)

    first = np.append(0, rows_where(breaks, time, current, beside=1) + 1)
    length = np.diff(first, append=time.size)
    level, end = current[first + np.minimum(2, length - 1)], first.copy()
    # A hold's taper is no step, but no steady current either: a stretch ends where it begins.
    for part in pieces(time.size):
        inside = slice(
            np.searchsorted(first, part.start + 1) - 1, np.searchsorted(first, part.stop)
        )
        begins = np.maximum(first[inside] - part.start, 0)
        levels = np.repeat(level[inside], np.diff(begins, append=part.stop - part.start))
        steady = np.abs(current[part] - levels) < 0.1 * np.abs(levels)
        rows = np.where(steady, np.arange(part.start, part.stop), 0)
        end[inside] = np.maximum(end[inside], np.maximum.reduceat(rows, begins))
    return first + (end - first) // 5, end
