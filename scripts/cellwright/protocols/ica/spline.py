"""dQ/dV of a charge by a spline of V(Q) whose logarithmic slope is smooth, and its peaks.

The charge is known far better than the voltage, so the voltage is smoothed over the charge and
dQ/dV is one over the slope: noise and steps of the converter then act where they arise, and a peak
keeps its height however narrow it is in voltage.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.numerics import monotone, rising_curve
from cellwright.numerics.statistics import NORMAL_95
from cellwright.protocols.ica.blocks import readings
from cellwright.refusal import Refusal

# Rise of a peak out of its surroundings, of the curve's highest. Beside one narrow peak that towers
# over all others even 0.05 would hide graphite's; below it noise decides by itself.
PROMINENCE = 0.02


class IncrementalCapacity(NamedTuple):
    """dQ/dV over a uniform grid of voltage, and dV/dQ over the charge at the same points.

    voltage_volt, charge_ampere_hour, dq_dv_ampere_hour_per_volt, dv_dq_volt_per_ampere_hour,
    dq_dv_std_ampere_hour_per_volt : (n,); charge from the first point of the curve.
    """

    voltage_volt: np.ndarray
    charge_ampere_hour: np.ndarray
    dq_dv_ampere_hour_per_volt: np.ndarray
    dv_dq_volt_per_ampere_hour: np.ndarray
    dq_dv_std_ampere_hour_per_volt: np.ndarray


class Peaks(NamedTuple):
    """Peaks in order of voltage (k,); empty where the curve has none, which is a result.

    Position [V], height [Ah/V], area from valley to valley [Ah], full width at half of the rise
    above the higher valley [V], each with its standard deviation;
    position_height_covariance [Ah]. prominence : rise above the higher valley, as a share of the
    curve's highest dQ/dV [1].
    """

    voltage_volt: np.ndarray
    voltage_std_volt: np.ndarray
    height_ampere_hour_per_volt: np.ndarray
    height_std_ampere_hour_per_volt: np.ndarray
    area_ampere_hour: np.ndarray
    area_std_ampere_hour: np.ndarray
    width_volt: np.ndarray
    width_std_volt: np.ndarray
    position_height_covariance_ampere_hour: np.ndarray
    prominence: np.ndarray


class Slope(NamedTuple):
    """Fitted V(Q) of a charge on a fine grid, from low voltage, without the very ends (n,).

    place in cells of the fit; charge [Ah], voltage [V], dV/dQ [V/Ah], d2V/dQ2 [V/Ah²].
    reading_ampere_hour : charge between two readings.
    """

    fit: rising_curve.RisingCurve
    place: np.ndarray
    charge_ampere_hour: np.ndarray
    voltage_volt: np.ndarray
    dv_dq_volt_per_ampere_hour: np.ndarray
    bend: np.ndarray
    reading_ampere_hour: float


def slope_of_charge(voltage_volt, charge_ampere_hour):
    """Voltage over charge of one constant-current charge as a rising curve.

    voltage_volt, charge_ampere_hour : (n,) [V], [Ah].

    Returns slope: Slope. Raises Refusal: fewer than 50 rows, or a voltage that does not rise.

    Source: cellwright.numerics.monotone.
    """
    volt, charge, rows = readings(voltage_volt, charge_ampere_hour)
    # Fewer levels than a coarse spline has cells: its slope would be the prior's.
    if len(volt) < 12:
        raise Refusal(f"{len(volt)} distinct readings of voltage are too few for dQ/dV")
    try:
        # With more cells than readings nothing would hold the curve between them.
        cells = min(len(volt), 300)
        fit = monotone.rising_curve(charge, volt, rows, cells=cells)
    except np.linalg.LinAlgError as fault:
        raise Refusal(f"no rising curve follows the voltage of this charge ({fault})") from fault
    cells = rising_curve.cells_of(fit)
    place = np.linspace(0, cells, 10 * cells + 1)
    course = rising_curve.course(fit, place)
    # What lies nearer to an end is judged by readings of one side alone.
    least = 0.002 * np.ptp(fit.x_range)
    first, end = np.searchsorted(course[0], np.array(fit.x_range) + (least, -least), side="right")
    columns = (column[first:end] for column in (place, *course))
    return Slope(fit, *columns, float(np.median(np.diff(charge))))


def slope_peaks(slope):
    """Peaks of dQ/dV, each with the covariance of what describes it.

    A peak of dQ/dV is a least slope of V(Q). It counts if it rises above the higher of its valleys
    by `PROMINENCE`, and the slope falls before and rises after it by more than its noise allows.
    The interval of its position holds the places where d2V/dQ2 may be zero.

    slope : Slope.

    Returns peaks: Peaks.
    """
    height = 1 / slope.dv_dq_volt_per_ampere_hour
    tops, bases, feet, highest = _resolved_tops(slope, height)
    sure = [k for k, top in enumerate(tops) if _stands_out(slope, top, *feet[k])]
    # Each peak reaches from valley to valley, and the outer ones to the ends of the curve.
    between = [a + int(height[a:b].argmin()) for a, b in pairwise(tops[sure])]
    edges = [0, *between, len(height) - 1]
    rows = [
        _described(slope, tops[k], edges[n], edges[n + 1], bases[k]) for n, k in enumerate(sure)
    ]
    shares = [(height[tops[k]] - bases[k]) / highest for k in sure]
    kept = [(*row, share) for row, share in zip(rows, shares, strict=True) if row is not None]
    columns = np.array(kept, float).reshape(len(kept), len(Peaks._fields))
    return Peaks(*columns.T)


def _resolved_tops(slope, height):
    """Rows of the peaks that the readings resolve and that rise enough, where they rise from, feet.

    Also the height of the highest of them, or of an end. What is narrower than four readings, two
    on each flank, may be a swing of the curve between them; what is narrower than three sigma of
    one reading is a voltage that stands still, as when the chamber changes. They set no scale.
    """
    from scipy.signal import find_peaks, peak_widths

    tops, found = find_peaks(height, prominence=0)
    _, _, left, right = peak_widths(height, tops, 0.5)
    rows = np.arange(len(height))
    charge = slope.charge_ampere_hour
    wide = np.interp(right, rows, charge) - np.interp(left, rows, charge)
    volt = np.interp([left, right], rows, slope.voltage_volt)
    resolved = wide >= 4 * slope.reading_ampere_hour
    resolved &= volt[1] - volt[0] >= 3.0 * np.sqrt(slope.fit.variance)
    highest = height[tops[resolved]].max(initial=max(height[0], height[-1]))
    kept = resolved & (found["prominences"] >= PROMINENCE * highest)
    feet = np.column_stack([found["left_bases"], found["right_bases"]])
    return tops[kept], (height[tops] - found["prominences"])[kept], feet[kept], highest


def _stands_out(slope, top, *feet):
    """Whether the slope at a peak is less than on either side by more than its noise allows.

    The sides reach to the lowest points before the next higher peak. 95 % in one direction.
    """
    sides = [np.unique(np.linspace(top, foot, 16).astype(int)) for foot in feet]
    rows, charge = np.concatenate(sides), slope.charge_ampere_hour
    peak = rising_curve.local_gradients(slope.fit, slope.place[[top]], 1, charge[[top]])
    beside = rising_curve.local_gradients(slope.fit, slope.place[rows], 1, charge[rows])
    std = rising_curve.deviations_between(slope.fit, beside, peak)
    rise = slope.dv_dq_volt_per_ampere_hour[rows] - slope.dv_dq_volt_per_ampere_hour[top]
    surest = np.split(rise / np.maximum(std, 1e-12), [len(sides[0])])
    return min(side.max() for side in surest) > 1.644854


def _described(slope, top, lower, upper, base):
    """Values of `Peaks` up to the covariance for one peak, or None where noise explains it."""
    fit, place = slope.fit, slope.place
    reach = _zero_range(slope, top, lower, upper)
    steep, height = slope.dv_dq_volt_per_ampere_hour, 1 / slope.dv_dq_volt_per_ampere_hour
    half = 0.5 * (height[top] + base)
    left = lower + int(np.argmax(height[lower : top + 1] > half))
    right = top + int(np.argmax(np.append(height[top : upper + 1] < half, True)))
    right = min(right, upper)
    rows = np.array([top, lower, upper, left, right])
    at = place[rows], slope.charge_ampere_hour[rows]
    value, first, second = (rising_curve.gradients(fit, at[0], d, at[1]) for d in (0, 1, 2))
    bend = _bend_rate(slope, rows)
    # Where dV/dQ is extreme, its place moves by -d(slope)/d(bend); the voltage moves with it.
    moved = -second / bend[:, None]
    position = value[0] + steep[top] * moved[0]
    tall = -first[0] * height[top] ** 2
    ends = [moved[k] if 0 < row < len(height) - 1 else 0 for k, row in ((1, lower), (2, upper))]
    crossing = [-first[k] / slope.bend[rows[k]] for k in (3, 4)]
    wide = value[4] - value[3] + steep[right] * crossing[1] - steep[left] * crossing[0]
    functions = np.array([position, tall, ends[1] - ends[0] + 0 * tall, wide])
    spread = rising_curve.covariance(fit, functions)
    std = np.sqrt(np.diag(spread))
    if std[1] > 0.5 * height[top]:  # so unsure a height is flat within noise
        return None
    charge, volt = slope.charge_ampere_hour, slope.voltage_volt
    reach_std = (reach[1] - reach[0]) / (2 * NORMAL_95)
    area, width = charge[upper] - charge[lower], volt[right] - volt[left]
    spans = (area, min(std[2], area), width, min(std[3], width))
    return volt[top], max(reach_std, std[0]), height[top], std[1], *spans, spread[0, 1]


def _bend_rate(slope, rows):
    """Third derivative of V(Q) at rows, from differences of the second."""
    near = np.clip(rows, 1, len(slope.bend) - 2)
    change = slope.bend[near + 1] - slope.bend[near - 1]
    rate = change / (slope.charge_ampere_hour[near + 1] - slope.charge_ampere_hour[near - 1])
    return np.where(rate == 0, np.inf, rate)


def _zero_range(slope, top, lower, upper):
    """Voltages between which the peak lies with 95 %; a valley where nothing nearer bounds it."""
    steps = np.linspace(0, 1, 24) ** 2
    left = np.unique(np.round(top - (top - lower) * steps).astype(int))[::-1]
    right = np.unique(np.round(top + (upper - top) * steps).astype(int))
    found = []
    for rows, sign in ((left, -1), (right, 1)):
        charge = slope.charge_ampere_hour[rows]
        local = rising_curve.local_gradients(slope.fit, slope.place[rows], 2, charge)
        std = rising_curve.local_deviations(slope.fit, *local)
        ratio = sign * slope.bend[rows] / std
        sure = ratio > NORMAL_95
        last = int(np.argmax(sure)) if sure.any() else len(rows) - 1
        volt = slope.voltage_volt[rows]
        span = slice(max(last - 1, 0), last + 1)
        found.append(float(np.interp(NORMAL_95, ratio[span], volt[span])))
    return found


def curve_of(slope):
    """dQ/dV of a fitted charge over a uniform grid of voltage.

    Its step is 3 mV, or a tenth of the narrowest range that holds a tenth of the charge.

    slope : Slope.

    Returns curve: IncrementalCapacity.
    """
    volt, charge = slope.voltage_volt, slope.charge_ampere_hour
    shares = np.interp(np.linspace(charge[0], charge[-1], 101), charge, volt)
    step = min(0.003, (shares[10:] - shares[:-10]).min() / 10)
    points = min(int(np.ptp(volt) / max(step, 1e-9)) + 2, 20_000)
    grid = np.linspace(volt[0], volt[-1], points)
    some = np.linspace(0, len(volt) - 1, min(400, len(volt))).astype(int)
    rates = rising_curve.local_gradients(slope.fit, slope.place[some], 1, charge[some])
    relative = rising_curve.local_deviations(slope.fit, *rates)
    relative = relative / slope.dv_dq_volt_per_ampere_hour[some]
    steep, at = (
        np.interp(grid, volt, column) for column in (slope.dv_dq_volt_per_ampere_hour, charge)
    )
    return IncrementalCapacity(
        voltage_volt=grid,
        charge_ampere_hour=at - at[0],
        dq_dv_ampere_hour_per_volt=1 / steep,
        dv_dq_volt_per_ampere_hour=steep,
        dq_dv_std_ampere_hour_per_volt=np.interp(grid, volt[some], relative) / steep,
    )
