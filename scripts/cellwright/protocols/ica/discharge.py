"""dQ/dV of the charge or discharge of one test: a discharge is the mirror image of a charge."""

import numpy as np

from cellwright.protocols.ica.charge import (
    charge_slope,
    constant_current_charge,
    constant_rows,
    ica_peaks,
)
from cellwright.protocols.ica.parts import parts_joined
from cellwright.protocols.ica.spline import IncrementalCapacity, Peaks
from cellwright.records import inputs
from cellwright.records.conditions import SAME_RATE
from cellwright.refusal import Refusal
from cellwright.result import Result

NO_CURVE = IncrementalCapacity(*np.zeros((len(IncrementalCapacity._fields), 0)))
NO_PEAKS = {
    **{"c_rate": np.zeros(0), "peak": np.zeros(0, int)},
    **dict.fromkeys(Peaks._fields, np.zeros(0)),
    "doubt": np.zeros(0, str),
}


def ica(series, steps, *, direction="charge"):
    """Incremental capacity dQ/dV [Ah/V] over voltage of the constant-current charge in one test.

    Parts of a charge that was interrupted are one, as the notes say.

    direction : "discharge" for that of the discharge, which is read as its mirror image: charge and
        dQ/dV count from its lowest voltage, as those of a charge do.

    Returns curve, `protocols.ica.spline.IncrementalCapacity` [Ah/V] over voltage [V]; its c_rate
    [1/h]. Raises Refusal: no constant-current charge, or one over too small a voltage.
    Source: docs/ica.md.
    """
    if direction not in ("charge", "discharge"):
        raise Refusal(f'direction is {direction!r}, wanted "charge" or "discharge"')
    of_steps, columns = inputs.steps(steps)._asdict(), inputs.quantities(series, inputs.COUNTED)
    turned, half = direction == "discharge", {"half": direction}
    time, current, voltage, charge = columns
    if turned:
        (time, current, voltage, charge), of_steps = _mirrored(columns, of_steps)
    *ends, step = constant_current_charge(of_steps, charge, **half)
    ends = constant_rows(current, *ends)
    rows, notes = parts_joined(time, current, voltage, charge, of_steps, step, ends, **half)
    # The end of a discharge is where its voltage, and what it has left, is lowest.
    order, sign = (rows[::-1], -1.0) if turned else (rows, 1.0)
    curve, slope = charge_slope(sign * voltage[order], sign * charge[order], **half)
    # The mean current of a step that holds the voltage in the end is less than its constant one.
    rated = of_steps["current_mean_ampere"][step] / of_steps["c_rate"][step]
    about = {"c_rate": float(np.median(current[rows]) / rated), "slope": slope}
    return Result({"curve": curve}, about, tuple(notes))


def ica_discharge(series, steps, *, slow=False):
    """Incremental capacity of the slow discharge in one test, and its peaks, beside its charge.

    slow : whether any discharge of the test counts as slow, as in a test for the open-circuit
        voltage; else one no faster than the charge in it.

    Returns rows and curve as of `ica_peaks` and `ica`, without an entry where the test has no such
    discharge, as the notes say. Source: docs/ica.md.
    """
    try:
        found = ica(series, steps, direction="discharge")
        if not slow:
            _refuse_faster(found.c_rate, inputs.steps(steps))
        peaks = ica_peaks(found)
    except Refusal as refusal:
        notes = (f"no dQ/dV of a discharge: {refusal}",)
        return Result({"rows": NO_PEAKS, "curve": NO_CURVE}, {"c_rate": np.nan}, notes)
    return Result({"rows": peaks.rows, "curve": found.curve}, {"c_rate": found.c_rate}, found.notes)


def _mirrored(columns, steps):
    """A record in which discharges are charges: current, voltage and charge of the other sign.

    columns : time [s], current [A], voltage [V], charge [Ah], (n,) each. steps : columns of Steps.

    Returns columns, steps : as those given.
    """
    time, *others = columns
    turned = {"current_mean_ampere": -np.asarray(steps["current_mean_ampere"])}
    return [time, *(-np.asarray(column) for column in others)], steps | turned


def _refuse_faster(c_rate, steps):
    """Refuse a discharge that is faster than the fullest charge of its record.

    c_rate : of the discharge [1/h]. steps : Steps of the record. A record without a charge at
    constant current has none that is slower.
    """
    charging = np.isin(steps.kind, ["CC", "CCCV"]) & (steps.current_mean_ampere > 0)
    if not charging.any():
        return
    main = np.argmax(np.where(charging, steps.charge_ampere_hour, 0.0))
    if c_rate > SAME_RATE * steps.c_rate[main]:
        raise Refusal(
            f"at {c_rate:.3g}C it is faster than the charge of the test, {steps.c_rate[main]:.3g}C"
        )
