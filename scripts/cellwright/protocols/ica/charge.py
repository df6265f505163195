"""Incremental capacity dQ/dV of a constant-current charge, and its peaks."""

import numpy as np

from cellwright.numerics.statistics import robust_std
from cellwright.protocols.ica.blocks import rises
from cellwright.protocols.ica.spline import PROMINENCE, curve_of, slope_of_charge, slope_peaks
from cellwright.protocols.messages import say
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.series.steps import constant_current_end

LEAST_ROWS = 50  # of a charge, for its dQ/dV
USUAL_SHARE = 0.02  # of a charge's current, by which it may be off its usual one


def constant_current_charge(steps, charge_ampere_hour, *, among=True, half="charge"):
    """Rows of the constant-current charge that moves the most charge.

    steps : columns kind, first_row, last_row, cv_first_row, current_mean_ampere, (k,) each.
    charge_ampere_hour : (n,) net charge of the record the rows point into [Ah].
    among : (k,) mask of the steps that count. half : "charge", or "discharge" of its mirror image.

    Returns first_row, last_row: inclusive, without the part at constant voltage; step : row of
    `steps` that they come from. Raises Refusal: no step of constant current charges the cell.
    """
    charging = np.isin(steps["kind"], ["CC", "CCCV"]) & (steps["current_mean_ampere"] > 0) & among
    first = steps["first_row"]
    last = constant_current_end(first, steps["last_row"], steps["cv_first_row"]) - 1
    moved = np.where(charging, charge_ampere_hour[last] - charge_ampere_hour[first], 0.0)
    if not len(moved) or moved.max() <= 0:
        raise Refusal(say("ica.no_constant_current", half=half, count=len(moved)))
    step = int(moved.argmax())
    return int(first[step]), int(last[step]), step


def constant_rows(current_ampere, first, last):
    """First and last row between which the current of a charge is its usual one.

    At the upper cut-off the current may begin to fall before the voltage is seen to be held: dQ/dV
    would rise there without end.

    current_ampere : (n,) of the record [A]. first, last : rows of a charge, inclusive.

    Returns first, last: rows, inclusive.
    """
    part = current_ampere[first : last + 1]
    usual = np.median(part)
    # Within 2 %, or five sigma of the noise where a small current scatters by more.
    tolerance = max(USUAL_SHARE * usual, 5.0 * robust_std(part - usual))
    steady = np.flatnonzero(np.abs(part - usual) <= tolerance)
    return int(first + steady[0]), int(first + steady[-1])


def charge_slope(voltage_volt, charge_ampere_hour, *, half="charge"):
    """dQ/dV of one charge, and the fit behind it.

    voltage_volt, charge_ampere_hour : (n,) rows of one constant-current charge [V], [Ah].
    half : as of `constant_current_charge`.

    Returns curve: IncrementalCapacity [Ah/V]. slope : spline.Slope. Raises Refusal: fewer than 50
    rows, or a voltage that does not rise, or too little of it.

    Source: docs/ica.md.
    """
    voltage, charge = np.asarray(voltage_volt, float), np.asarray(charge_ampere_hour, float)
    if len(voltage) < LEAST_ROWS or charge.max() <= charge.min():
        raise Refusal(say("ica.few_rows", rows=len(voltage), half=half, wanted=LEAST_ROWS))
    if not rises(voltage):
        raise Refusal(say(f"ica.no_rise_{half}"))
    slope = slope_of_charge(voltage, charge)
    return curve_of(slope), slope


def ica_peaks(ica):
    """Peaks of the incremental capacity of one charge: voltage [V], height [Ah/V], area [Ah].

    ica : result of `ica`.

    Returns rows, (k,): voltage [V], height [Ah/V], area [Ah], width [V], each with its standard
    deviation; doubt: where the charge was interrupted, and where its curve ends for another reason
    than the charge itself. Raises Refusal: no peaks; a flat curve is typical of an aged cell or a
    high rate. Source: docs/ica.md.
    """
    columns = slope_peaks(ica.slope)._asdict()
    count = len(columns["voltage_volt"])
    if not count:
        raise Refusal(f"no peaks: dQ/dV at {ica.c_rate:.3g}C is flat within {PROMINENCE:.0%}")
    about = {"c_rate": np.full(count, ica.c_rate), "peak": np.arange(1, count + 1)}
    return Result({"rows": about | columns | {"doubt": np.full(count, "; ".join(ica.notes))}})
