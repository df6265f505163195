"""Incremental capacity dQ/dV of a constant-current charge: where peaks lie and how wide they are.

Charge is counted into narrow bins of voltage, which noise cannot upset as it upsets a quotient of
differences, and smoothed by a Gaussian; the same for every record.
"""

import numpy as np
from scipy import ndimage, signal

from virtual_lab.reality.findings import Curve, numbers

BIN_VOLT = 0.001
SMOOTH_VOLT = {"LFP": 0.002}
USUAL_SMOOTH_VOLT = 0.005
LEAST_RANGE = 0.6
PROMINENCE = 0.05
FASTEST_C_RATE, SLOW_C_RATE = 0.6, 0.07


def incremental_capacity(
    volt: np.ndarray, ampere_hour: np.ndarray, *, smooth_volt: float
) -> tuple[np.ndarray, np.ndarray]:
    """Voltages [V] at the middle of bins of 1 mV and dQ/dV [Ah/V] of a charge.

    Parameters
    ----------
    volt, ampere_hour : (n,) [V], [Ah], in the order of time.
    smooth_volt : standard deviation of the Gaussian [V].
    """
    edges = np.arange(volt.min() - 5 * BIN_VOLT, volt.max() + 6 * BIN_VOLT, BIN_VOLT)
    between, gained = 0.5 * (volt[1:] + volt[:-1]), np.diff(ampere_hour)
    low, high = np.minimum(volt[1:], volt[:-1]), np.maximum(volt[1:], volt[:-1])
    width = np.maximum(high - low, 1e-6)
    low, high = between - 0.5 * width, between + 0.5 * width
    ramp = [np.sum(gained * np.clip((edge - low) / (high - low), 0, 1)) for edge in edges]
    raw = np.diff(ramp) / BIN_VOLT
    return edges[:-1] + 0.5 * BIN_VOLT, ndimage.gaussian_filter1d(raw, smooth_volt / BIN_VOLT)


def find(volt: np.ndarray, per_volt: np.ndarray) -> list[tuple[float, float, float]]:
    """(voltage [V], height, width [V] at half prominence) of each peak.

    A peak stands out by 5 % of the highest value or more.
    """
    least = PROMINENCE * per_volt.max()
    at, about = signal.find_peaks(per_volt, prominence=least, width=1, rel_height=0.5)
    step = volt[1] - volt[0]
    return [
        (float(volt[row]), float(per_volt[row]), float(step * width))
        for row, width in zip(at, about["widths"], strict=True)
    ]


def charges(record):
    """(step, rows) of charges at constant current through most of the charge, up to 0.6C."""
    steps = record.steps
    for index in np.flatnonzero(np.isin(steps.kind, ("CC", "CCCV"))):
        first, last = steps.first_row[index], steps.last_row[index]
        held = steps.cv_first_row[index]
        rows = np.arange(first + 1, (held if held > first else last) + 1)
        if rows.size < 60 or steps.current_mean_ampere[index] <= 0:
            continue
        moved = np.ptp(record.ampere_hour[rows])
        if (
            moved > LEAST_RANGE * np.ptp(record.ampere_hour)
            and _c_rate(record, rows) < FASTEST_C_RATE
        ):
            yield index, rows


def describe(found: list[tuple[float, float, float]]) -> dict:
    """Number of peaks, the narrowest and the highest, and each by rising voltage."""
    row = {"peaks": (len(found), "1")}
    if found:
        row["narrowest peak, width"] = (1e3 * min(width for _, _, width in found), "mV")
        row["highest peak, height over capacity"] = (max(height for _, height, _ in found), "1/V")
    for number, (place, height, width) in enumerate(found, 1):
        row[f"peak {number}, voltage"] = (place, "V")
        row[f"peak {number}, height over capacity"] = (height, "1/V")
        row[f"peak {number}, width"] = (1e3 * width, "mV")
    return row


def _interval(record, rows) -> float:
    return float(np.median(np.diff(record.second[rows])))


def _c_rate(record, rows) -> float:
    return float(np.median(record.ampere[rows]) / record.rating_ampere_hour)


def look(record):
    """Numbers and curves of a record's slow charges, heights over the charge that went in."""
    found, curves = [], []
    smooth = SMOOTH_VOLT.get(record.chemistry, USUAL_SMOOTH_VOLT)
    for step, rows in charges(record):
        c_rate = _c_rate(record, rows)
        moved = np.ptp(record.ampere_hour[rows])
        volt, per_volt = incremental_capacity(
            record.volt[rows], record.ampere_hour[rows] / moved, smooth_volt=smooth
        )
        row = {"C-rate": (c_rate, "1/h"), "interval": (_interval(record, rows), "s")}
        row |= describe(find(volt, per_volt))
        condition = "slow charge" if c_rate < SLOW_C_RATE else "charge"
        found += numbers(record, step, "peaks", condition, row)
        panel = f"{record.chemistry} {condition} at C/{1 / c_rate:.0f}"
        about = (record.source.name, record.cell, record.test, panel)
        curves.append(Curve(*about, volt, per_volt))
    return found, curves
