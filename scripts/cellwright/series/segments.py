"""A record cut into steps: rest, constant current, held voltage, pulse, dynamic load."""

from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal
from cellwright.series.kinds import alike, dynamic_chains, join, join_holds, run_kinds
from cellwright.series.runs import (
    Record,
    drop_noise,
    edge_rows,
    gap_rows,
    hold_tolerance,
    join_transients,
    rest_rows,
    runs,
)

KINDS = ("rest", "CC", "CV", "CCCV", "pulse", "dynamic")


class Steps(NamedTuple):
    """One entry a step, arrays of shape (steps,). Rows count into the record, both inclusive.

    kind is one of KINDS; cv_first_row is −1 where the voltage is never held; c_rate is the size
    of the mean current over the rating; charge is positive on charge. A step starts at the last
    sample before it (the edge lies after it), after a gap at its own first sample.
    """

    step: np.ndarray
    kind: np.ndarray
    first_row: np.ndarray
    last_row: np.ndarray
    start_time_second: np.ndarray
    end_time_second: np.ndarray
    duration_second: np.ndarray
    current_mean_ampere: np.ndarray
    voltage_before_volt: np.ndarray
    voltage_start_volt: np.ndarray
    voltage_end_volt: np.ndarray
    voltage_min_volt: np.ndarray
    voltage_max_volt: np.ndarray
    charge_ampere_hour: np.ndarray
    cv_first_row: np.ndarray
    c_rate: np.ndarray


# ASSUME: Without a rating, C-rates and thresholds refer to the charge that the record moves.
def assumed_rating(current_ampere, charge_ampere_hour):
    """Rating [Ah] that segmentation uses where none is stated, from the record (n,) [A], [Ah].

    The larger of the charge that the record moves and a third of its largest current times 1 h.

    Returns
    -------
    float [Ah].

    Raises
    ------
    Refusal : no current flows in the record.
    """
    rating = max(np.ptp(charge_ampere_hour), np.abs(current_ampere).max() / 3.0)
    if not rating > 0:
        raise Refusal("no rating is stated and no current flows, so none can be assumed")
    return float(rating)


def segment(
    test_time_second,
    current_ampere,
    voltage_volt,
    charge_ampere_hour,
    *,
    rated_capacity_ampere_hour=None,
    file_index=None,
    rest_c_rate=0.004,
    pulse_max_second=120.0,
    gap_second=300.0,
):
    """Cut a record into steps by what the current and the voltage do, never by step numbers.

    1. Rest is where |current| stays below `rest_c_rate`. 2. An edge is a step of current that the
    voltage answers, a change between rest and load, a gap, or the joint of two files. 3. Lone
    samples of noise and the rise of the tester's output join the run they belong to. 4. Chains
    of short runs with many levels are one dynamic step. 5. A steady short load next to a rest, or
    on top of a running load, is a pulse. 6. What is left is CC, CV or CCCV, by whether the
    current decays while the voltage is held.

    Parameters
    ----------
    test_time_second : (n,) [s], not decreasing.
    current_ampere : (n,) [A], positive on charge.
    voltage_volt : (n,) [V].
    charge_ampere_hour : (n,) net charge since the first row [Ah].
    rated_capacity_ampere_hour : [Ah]; None: `assumed_rating` of the record.
    file_index : (n,) number of the joined file of each row [1]; None: one file.
    rest_c_rate : largest current at rest over the rating [1/h].
    pulse_max_second : longest pulse, and longest run of a dynamic load (with a quarter more) [s].
    gap_second : shortest hole in the record that ends a step [s].

    Returns
    -------
    Steps

    Raises
    ------
    Refusal : fewer than three rows, time that runs backwards, or no rating and no current.
    """
    time, current = np.asarray(test_time_second, float), np.asarray(current_ampere, float)
    voltage, charge = np.asarray(voltage_volt, float), np.asarray(charge_ampere_hour, float)
    _check(time)
    rated = rated_capacity_ampere_hour or assumed_rating(current, charge)
    files = np.zeros(len(time), int) if file_index is None else np.asarray(file_index)
    gap = gap_rows(time, files, gap_second=gap_second)
    rest = rest_rows(time, current, threshold=rest_c_rate * rated, rated=rated)
    record = Record(time, current, voltage, gap, rest)
    tolerance = hold_tolerance(voltage, record.rest)
    record, edges = drop_noise(record, edge_rows(record, rated, tolerance), rated)
    edges = join_transients(record, edges)
    edges, dynamic = dynamic_chains(record, edges, 1.25 * pulse_max_second)
    found = runs(record, edges)
    kind, held = run_kinds(record, found, dynamic, tolerance, pulse_max_second, rated)
    found, kind, held = join_holds(record, found, kind, held, tolerance)
    found, kind, held = join(record, found, kind, held, alike(found, kind))
    return _steps(record, charge, found, kind, held, rated)


def _check(time):
    if len(time) < 3:
        raise Refusal(f"the record has {len(time)} rows; steps need at least 3")
    if np.any(np.diff(time) < 0):
        raise Refusal("test time runs backwards; clean the record first")


def _steps(record, charge, found, kind, held, rated):
    """The table of steps (columns of `Steps`) from the runs and their kinds."""
    first, last = found.first, found.last
    begin = np.where(found.gap, first, first - 1)
    mean = _mean_current(record, charge, found)
    return Steps(
        step=np.arange(len(first)),
        kind=kind,
        first_row=first,
        last_row=last,
        start_time_second=record.time[begin],
        end_time_second=record.time[last],
        duration_second=found.span,
        current_mean_ampere=mean,
        voltage_before_volt=np.where(first == 0, np.nan, record.voltage[first - 1]),
        voltage_start_volt=record.voltage[first],
        voltage_end_volt=record.voltage[last],
        voltage_min_volt=np.minimum.reduceat(record.voltage, first),
        voltage_max_volt=np.maximum.reduceat(record.voltage, first),
        charge_ampere_hour=_charge(charge, found),
        cv_first_row=held,
        c_rate=np.abs(mean) / rated,
    )


def _mean_current(record, charge, found):
    """Mean current of each run over the time between its own samples [A]."""
    hour = (record.time[found.last] - record.time[found.first]) / 3600
    moved = charge[found.last] - charge[found.first]
    some = (hour > 0) & (found.last - found.first > 2)
    return np.divide(moved, hour, out=found.level.copy(), where=some)


def _charge(charge, found):
    """Net charge of each run [Ah]: an interval between rest and load belongs to the load."""
    leads_in = ~found.gap & ~(found.rest & ~np.roll(found.rest, 1))
    begin = charge[np.where(leads_in, found.first - 1, found.first)]
    rest_follows = np.roll(found.rest & ~found.gap, -1) & ~found.rest
    rest_follows[-1] = False
    after = np.minimum(found.last + 1, len(charge) - 1)
    return charge[np.where(rest_follows, after, found.last)] - begin
