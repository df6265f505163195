"""Charges of an ageing record whose dQ/dV is taken: a few dozen, evenly over the life."""

from contextlib import suppress

import numpy as np

from cellwright.protocols.ica.charge import charge_slope, constant_current_charge, constant_rows
from cellwright.protocols.ica.parts import parts_joined
from cellwright.protocols.ica.spline import Peaks, slope_peaks
from cellwright.records import inputs
from cellwright.refusal import Refusal
from cellwright.result import Result


def ica_life(series, steps, cycles, *, most=30):
    """Peaks of dQ/dV of charges spread evenly over one ageing record.

    cycles : result of `ageing_cycles`, or its columns.
    most : charges at most.

    Returns rows, one a peak, or a charge without; curves: columns cycle, voltage [V], dQ/dV [Ah/V].
    Raises Refusal: no complete charge, or none whose dQ/dV can be taken. Source: docs/ica.md.
    """
    record = inputs.quantities(series, inputs.COUNTED)
    cycles = getattr(cycles, "rows", cycles)
    cycles = inputs.columns(cycles, "cycle", "direction", "start_time_second")
    steps, rows, curves, notes = inputs.steps(steps)._asdict(), [], [], []
    for cycle, part, words, rate in _charges_of_life(cycles, steps, record, most):
        notes += [f"cycle {cycle:g}: {said}" for said in words]
        try:
            curve, slope = charge_slope(record[2][part], record[3][part])
        except Refusal as refusal:
            notes.append(f"cycle {cycle:g}: {refusal}")
            continue
        rows += _rows({"cycle": cycle, "c_rate": rate}, slope_peaks(slope))
        # As many points as a figure shows.
        grid = np.linspace(curve.voltage_volt[0], curve.voltage_volt[-1], 500)
        height = np.interp(grid, curve.voltage_volt, curve.dq_dv_ampere_hour_per_volt)
        curves.append((np.full(len(grid), cycle), grid, height))
    if not rows:
        raise Refusal(f"no charge of the record has a dQ/dV: {notes[-1]}")
    names = ("cycle", "voltage_volt", "dq_dv_ampere_hour_per_volt")
    columns = (np.concatenate(column) for column in zip(*curves, strict=True))
    tables = {"rows": rows, "curves": dict(zip(names, columns, strict=True))}
    return Result(tables, notes=tuple(notes))


def _charges_of_life(cycles, steps, record, most):
    """(cycle, rows, notes, rate [1/h]) of complete charges, evenly over a life."""
    _, current, _, charge = record
    charging = np.flatnonzero(np.asarray(cycles["direction"]) == "charge")
    if not len(charging):
        raise Refusal("no complete charge in the ageing record, so no dQ/dV over its life")
    # A life's peaks move slowly: some dozen charges follow them, thousands would take minutes.
    picked = charging[np.unique(np.linspace(0, len(charging) - 1, most).round().astype(int))]
    begins = np.append(np.asarray(cycles["start_time_second"], float), np.inf)
    start = np.asarray(steps["start_time_second"])
    for k in picked:
        # A step begins at the last sample before it, which may lie up to a second ahead.
        inside = (start > begins[k] - 1.0) & (start < begins[k + 1] - 1.0)
        with suppress(Refusal):
            *ends, step = constant_current_charge(steps, charge, among=inside)
            rows, notes = parts_joined(*record, steps, step, constant_rows(current, *ends))
            rated = steps["current_mean_ampere"][step] / steps["c_rate"][step]
            yield float(cycles["cycle"][k]), rows, notes, float(np.median(current[rows]) / rated)


def _rows(shared, peaks):
    """Rows of one charge: one a peak, or one that says that there is none."""
    if not len(peaks.voltage_volt):
        unknown = dict.fromkeys(Peaks._fields, np.nan)
        return [shared | {"peak": 0} | unknown | {"reason": "no peaks: the curve is flat"}]
    return [
        shared
        | {"peak": k}
        | dict(zip(Peaks._fields, map(float, row), strict=True))
        | {"reason": ""}
        for k, row in enumerate(zip(*peaks, strict=True), 1)
    ]
