"""Rests of a record as points of an OCV curve."""

import numpy as np

from cellwright.models.rests import rests_of
from cellwright.protocols.ocv_rests import RestPoints

LEAST_PORTION = 0.003  # of the charge that the record moves: less before a rest is no load
LATE = 0.02  # of a rest: its end
PER_LOAD = 10.0  # lengths of the load: a shorter rest counts after so many, before the first one


def rest_points(
    test_time_second,
    current_ampere,
    voltage_volt,
    charge_ampere_hour,
    steps,
    *,
    rest_second=600.0,
):
    """Rests of at least `rest_second` that follow a load, with what of them is still to relax.

    Before the first of them, where the cell is nearly full, a rest after a discharge counts that is
    ten times as long as its load: a pulse of seconds leaves little to relax.

    Parameters
    ----------
    test_time_second, current_ampere, voltage_volt, charge_ampere_hour : (n,) [s], [A] positive on
        charge, [V], net charge [Ah].
    steps : series.segments.Steps.
    rest_second : [s].

    Returns
    -------
    points : protocols.ocv_rests.RestPoints.
    """
    time, voltage, charge = (
        np.asarray(column, float) for column in (test_time_second, voltage_volt, charge_ampere_hour)
    )
    series = (time, np.asarray(current_ampere, float), voltage)
    found = rests_of(
        *series,
        np.full(len(time), np.nan),
        steps,
        shortest_rest_second=rest_second,
    ).rows
    least = LEAST_PORTION * float(np.ptp(charge))
    rows = [_long(found, k) for k in np.flatnonzero(found.chosen)]
    rows = [row for row in rows if row.pop("portion") >= least]
    first = min((row["start"] for row in rows), default=-np.inf)
    rows = [*_short(steps, before=first), *rows]
    return _points([row | _ends(time, voltage, charge, row) for row in rows])


def _long(found, k):
    """A rest with its exponentials, used where at least two are told."""
    told = found.exponentials[k] >= 2 and np.isfinite(found.ocv_std_volt[k])
    doubt = np.nanmax([2 * abs(found.drift_volt[k]), found.ocv_std_volt[k]])
    return {
        "start": found.start_time_second[k],
        "end": found.start_time_second[k] - found.delay_second[k] + found.rest_second[k],
        "relaxed_volt": found.ocv_volt[k] if told else np.nan,
        "doubt_volt": doubt if told else np.nan,
        "direction": found.direction[k],
        "current_ampere": found.current_before_ampere[k],
        "rest_second": found.rest_second[k],
        "portion": abs(found.current_before_ampere[k]) * found.load_second[k] / 3600,
    }


def _short(steps, *, before):
    """Rests much longer than the discharge before them, ahead of the first long rest."""
    kind, last = np.asarray(steps.kind), steps.duration_second
    for k in np.flatnonzero(kind[1:] == "rest") + 1:
        joins = steps.start_time_second[k] == steps.end_time_second[k - 1]
        early = (
            joins and steps.end_time_second[k] <= before and steps.current_mean_ampere[k - 1] < 0
        )
        if early and last[k] >= PER_LOAD * last[k - 1]:
            yield {
                "start": steps.start_time_second[k],
                "end": steps.end_time_second[k],
                "relaxed_volt": np.nan,
                "doubt_volt": np.nan,
                "direction": "discharge",
                "current_ampere": steps.current_mean_ampere[k - 1],
                "rest_second": last[k],
            }


def _ends(time, voltage, charge, row):
    """Voltage and charge at the end of a rest, and what was counted within it."""
    inside = (time >= row["start"]) & (time <= row["end"])
    late = inside & (time >= row["end"] - LATE * row["rest_second"])
    within = charge[inside]
    return {
        "charge_ampere_hour": within[-1],
        "end_volt": voltage[late].mean(),
        "read_ampere_hour": within[-1] - within[0],
    }


def _points(rows):
    names = RestPoints._fields
    return RestPoints(**{name: np.array([row[name] for row in rows]) for name in names})
