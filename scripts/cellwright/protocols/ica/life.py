"""Charges of an ageing record whose dQ/dV is taken: a few dozen, evenly over the life."""

from typing import NamedTuple

import numpy as np

from cellwright.protocols.ica.charge import charge_slope, constant_rows
from cellwright.protocols.ica.curve import Peaks
from cellwright.protocols.ica.spline import slope_peaks
from cellwright.refusal import Refusal

AHEAD_SECOND = 1.0


def charges_of_life(cycles, steps, current_ampere, charge_ampere_hour, *, most):
    """Constant-current parts of complete charges, evenly over a life.

    Parameters
    ----------
    cycles : columns of stage `ageing_cycles`: cycle, direction, start_time_second, (k,) each.
    steps : columns kind, first_row, last_row, cv_first_row, start_time_second,
        current_mean_ampere, c_rate.
    current_ampere, charge_ampere_hour : (n,) of the clean series [A], [Ah].
    most : number of charges at most.

    Returns
    -------
    charges : list of (cycle, first row, last row, rate [1/h]), in time order.

    Raises
    ------
    Refusal : no complete charge in the record.
    """
    charging = np.flatnonzero(np.asarray(cycles["direction"]) == "charge")
    if not len(charging):
        raise Refusal("no complete charge in the ageing record, so no dQ/dV over its life")
    picked = charging[np.unique(np.linspace(0, len(charging) - 1, most).round().astype(int))]
    begins = np.append(np.asarray(cycles["start_time_second"], float), np.inf)
    found = []
    for k in picked:
        step = _largest_step(steps, charge_ampere_hour, begins[k], begins[k + 1])
        if step is not None:
            found.append((float(cycles["cycle"][k]), *_constant_part(steps, current_ampere, step)))
    return found


def _largest_step(steps, charge, begin, end):
    """Number of the constant-current step that moves most between times, or None."""
    start = np.asarray(steps["start_time_second"])
    inside = (start > begin - AHEAD_SECOND) & (start < end - AHEAD_SECOND)
    inside &= np.isin(steps["kind"], ["CC", "CCCV"]) & (steps["current_mean_ampere"] > 0)
    first, last = steps["first_row"], _last_rows(steps)
    moved = np.where(inside, charge[last] - charge[first], 0.0)
    return int(moved.argmax()) if len(moved) and moved.max() > 0 else None


def _last_rows(steps):
    """Last row of each step before its voltage is held."""
    held = steps["cv_first_row"]
    return np.where(held > steps["first_row"], held - 1, steps["last_row"])


def _constant_part(steps, current, step):
    """First and last row of a step at its constant current, and the rate there [1/h]."""
    first, last = constant_rows(current, steps["first_row"][step], _last_rows(steps)[step])
    rated = steps["current_mean_ampere"][step] / steps["c_rate"][step]
    return first, last, float(np.median(current[first : last + 1]) / rated)


class LifePeaks(NamedTuple):
    """Rows, one a peak or a charge without; curves: columns of all charges; notes: sentences."""

    rows: list
    curves: dict
    notes: list


CURVE_POINTS = 500


def peaks_of_life(
    current_ampere, voltage_volt, charge_ampere_hour, steps, cycles, *, prominence, most
):
    """Peaks of dQ/dV of charges spread evenly over an ageing record.

    Parameters
    ----------
    current_ampere, voltage_volt, charge_ampere_hour : (n,) clean series [A], [V], [Ah].
    steps, cycles : as for `charges_of_life`. prominence : as of
        `spline.slope_peaks`. most : charges at most.

    Returns
    -------
    life : LifePeaks.

    Raises
    ------
    Refusal : no complete charge, or none whose dQ/dV can be taken.
    """
    rows, curves, notes = [], [], []
    record = current_ampere, charge_ampere_hour
    for cycle, first, last, rate in charges_of_life(cycles, steps, *record, most=most):
        part = slice(first, last + 1)
        try:
            curve, slope = charge_slope(voltage_volt[part], charge_ampere_hour[part])
        except Refusal as refusal:
            notes.append(f"cycle {cycle:g}: {refusal}")
            continue
        rows += _rows(cycle, rate, slope_peaks(slope, prominence=prominence))
        curves.append(_thinned(cycle, curve))
    if not rows:
        raise Refusal(f"no charge of the record has a dQ/dV: {notes[0]}")
    names = ("cycle", "voltage_volt", "dq_dv_ampere_hour_per_volt")
    columns = (np.concatenate(column) for column in zip(*curves, strict=True))
    return LifePeaks(rows, dict(zip(names, columns, strict=True)), notes)


def _rows(cycle, rate, peaks):
    """Rows of one charge: one a peak, or one that says that there is none."""
    count = len(peaks.voltage_volt)
    shared = {"cycle": cycle, "c_rate": rate}
    if not count:
        unknown = dict.fromkeys(Peaks._fields, np.nan)
        return [shared | {"peak": 0} | unknown | {"reason": "no peaks: the curve is flat"}]
    rows = zip(*peaks, strict=True)
    return [
        shared
        | {"peak": k}
        | dict(zip(Peaks._fields, map(float, row), strict=True))
        | {"reason": ""}
        for k, row in enumerate(rows, 1)
    ]


def _thinned(cycle, curve):
    """Cycle, voltage and dQ/dV of a curve at so many points as a figure shows."""
    grid = np.linspace(curve.voltage_volt[0], curve.voltage_volt[-1], CURVE_POINTS)
    height = np.interp(grid, curve.voltage_volt, curve.dq_dv_ampere_hour_per_volt)
    return np.full(CURVE_POINTS, cycle), grid, height
