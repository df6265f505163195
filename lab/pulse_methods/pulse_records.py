"""Pulses of a test, each with its rest and the OCV under it, laid out for identification."""

from typing import NamedTuple

import numpy as np

from cellwright.records.basis import state_of_charge
from cellwright.records.conditions import same_rate, stated_or_reference
from cellwright.records.facts import TestFacts

RELAXED_SECOND = 600.0  # a rest so long before a pulse leaves nothing to relax in it …
RELAXED_LOADS = 10.0  # … nor does one of so many lengths of the load before it
FEWEST = 4  # samples of a pulse
NONE = (
    f"no pulse of {FEWEST} samples with a rest after it and, before it, a rest of "
    f"{RELAXED_SECOND:g} s or of {RELAXED_LOADS:g} lengths of the load before"
)


class PulseTest(NamedTuple):
    """A test with pulses: what the sheet says of it, its clean series, its steps."""

    facts: TestFacts
    series: dict
    steps: NamedTuple


class PulseRecord(NamedTuple):
    """One pulse from its last sample before to the end of its rest; arrays are (n,).

    soc : before the pulse [1], NaN where not known. level_ampere : of the pulse, + on charge.
    edge : index of the first sample of the rest. ocv_volt : voltage before the pulse, moved along
    the OCV curve with the charge passed [V]. others : [s], [A], [V].
    """

    test: str
    ambient_temperature_celsius: float | None
    start_time_second: float
    soc: float
    level_ampere: float
    edge: int
    time_second: np.ndarray
    current_ampere: np.ndarray
    voltage_volt: np.ndarray
    ocv_volt: np.ndarray


class PulseRecords(NamedTuple):
    """The pulses that were taken, and a sentence for each test of which some or all were not."""

    records: tuple
    left_out: tuple


def counted_here(steps, elsewhere):
    """Steps whose pulses that count in another test are no pulses; see `repeats.steps_elsewhere`.

    Parameters
    ----------
    steps : series.steps.Steps. elsewhere : (steps,) str, empty where a step counts here.
    """
    repeated = (elsewhere != "") & (np.asarray(steps.kind) == "pulse")
    return steps._replace(kind=np.where(repeated, "repeat", steps.kind))


# ASSUME: A pulse changes the SoC so little that one set of circuit parameters holds within it.
def pulse_records(tests, basis, cell, *, pulses_per_cell=16, samples=200, rest_lengths=30.0):
    """Pulses of a cell's tests as records for identification, a bounded number, evenly over SoC.

    1. A pulse counts where it begins from a rest of 600 s, or of ten lengths of the load before,
    and is followed by a rest, both without a gap. 2. Of each test the pulses of one direction and
    rate are taken, the one most frequent (of equals the lowest rate). 3. Every test has the same
    share of `pulses_per_cell`; where there are more tests than pulses, tests are taken evenly in
    their order. 4. Of a test with more pulses than its share, those nearest to evenly spaced SoCs
    are taken, the ends included. 5. The rest counts up to `rest_lengths` lengths of its pulse.
    6. Of samples that a logger takes within half a usual step after an edge only the last one
    stays: what the voltage does before it counts as instantaneous, as if sampled uniformly.
    7. Pulse and rest are thinned to `samples` in all, dense at their beginnings.

    Parameters
    ----------
    tests : list of PulseTest.
    basis : dict of `records.basis.basis`: capacity and OCV curves that the SoC refers to.
    cell : CellFacts, of which the cut-off voltages count.
    pulses_per_cell, samples : at most so many. rest_lengths : lengths of the pulse [1].

    Returns
    -------
    records : PulseRecords; none where no test has a pulse that counts, and `left_out` says so.
    """
    usable, left_out = [], []
    for test in tests:
        name, steps = test.facts.test, _relaxed_pulses(test.steps)
        if not len(steps):
            left_out.append(f"{name}: {NONE}")
            continue
        chosen = _of_one_rate(test.steps, steps)
        usable.append((test, chosen, state_of_charge(test.series, basis, test.facts, cell).soc))
        if len(chosen) < len(steps):
            rate = float(np.median(test.steps.c_rate[chosen]))
            left_out.append(f"{name}: {len(chosen)} pulses at {rate:.2g}C of {len(steps)} in all")
    chosen_tests = [usable[k] for k in _evenly(np.arange(len(usable)), pulses_per_cell)]
    share = max(pulses_per_cell // max(len(usable), 1), 1)
    records = [
        _record(test, step, soc, basis, samples=samples, rest_lengths=rest_lengths)
        for test, steps, soc in chosen_tests
        for step in steps[_evenly(soc[test.steps.first_row[steps]], share)]
    ]
    return PulseRecords(tuple(records), tuple(left_out))


def _relaxed_pulses(steps):
    """Numbers of the steps that are pulses between two rests, the one before long enough."""
    kind, duration = np.asarray(steps.kind), np.asarray(steps.duration_second)
    joined = steps.start_time_second[1:] == steps.end_time_second[:-1]
    pulses = np.arange(1, len(kind) - 1)
    between = (kind[pulses - 1] == "rest") & (kind[pulses + 1] == "rest")
    complete = between & joined[pulses - 1] & joined[pulses] & (kind[pulses] == "pulse")
    load = np.where(pulses > 1, duration[pulses - 2], 0.0)
    needed = np.minimum(RELAXED_SECOND * 0.99, RELAXED_LOADS * load)
    counted = steps.last_row[pulses] - steps.first_row[pulses] + 1 >= FEWEST
    return pulses[complete & counted & (duration[pulses - 1] >= needed)]


def _of_one_rate(steps, pulses):
    """The pulses of the direction and rate that most of them have, of equals the lowest rate."""
    level = steps.current_mean_ampere[pulses]
    alike = same_rate(level[:, None], level)
    count = alike.sum(axis=1)
    first = min(range(len(pulses)), key=lambda k: (-count[k], abs(level[k])))
    return pulses[alike[:, first]]


def _evenly(values, count):
    """Indices of at most `count` values, nearest to evenly spaced ones; in order where NaN."""
    if len(values) <= count:
        return np.arange(len(values))
    places = values if np.isfinite(values).all() else np.arange(len(values))
    targets = np.linspace(np.max(places), np.min(places), count)
    return np.unique([int(np.argmin(np.abs(places - target))) for target in targets])


def _record(test, step, soc, basis, *, samples, rest_lengths):
    """One pulse with its rest as a PulseRecord."""
    steps, facts = test.steps, test.facts
    names = ("test_time_second", "current_ampere", "voltage_volt")
    time, current, voltage = (np.asarray(test.series[name], float) for name in names)
    first, edge = int(steps.first_row[step]), int(steps.first_row[step + 1])
    begin, length = time[first], time[edge] - time[first]
    last = int(np.searchsorted(time, time[edge] + rest_lengths * length, side="right")) - 1
    last = min(last, int(steps.last_row[step + 1]))
    usual = float(np.median(np.diff(time[first:edge])))
    pulse = _thinned(time, first, edge - 1, usual, samples // 2)
    rest = _thinned(time, edge, last, usual, samples // 2)
    rows = np.concatenate([[first - 1], pulse, rest])
    before = np.arange(steps.first_row[step - 1], first)
    before = before[time[before] >= begin - max(length, begin - time[first - 1])]
    ocv = float(np.mean(voltage[before])) + _moved_volt(soc, rows, basis, facts)
    return PulseRecord(
        test=facts.test,
        ambient_temperature_celsius=facts.ambient_temperature_celsius,
        start_time_second=float(begin),
        soc=float(soc[first - 1]),
        level_ampere=float(np.median(current[first:edge])),
        edge=1 + len(pulse),
        time_second=time[rows] - time[pulse[0]],
        current_ampere=current[rows],
        voltage_volt=voltage[rows],
        ocv_volt=ocv,
    )


def _thinned(time, first, last, usual, most):
    """Numbers of at most `most` rows after an edge, dense at first; of a burst the last row."""
    begin = int(np.searchsorted(time[: last + 1], time[first] + usual / 2)) - 1
    rows = np.arange(max(begin, first), last + 1)
    if len(rows) <= most:
        return rows
    return rows[np.unique(np.geomspace(1, len(rows), most).round().astype(int)) - 1]


def _moved_volt(soc, rows, basis, facts):
    """Change of the open-circuit voltage since the first of the rows (n,) [V]; 0 if not known."""
    celsius = stated_or_reference(facts.ambient_temperature_celsius)
    temperatures = [
        stated_or_reference(curve_celsius["ambient_temperature_celsius"])
        for curve_celsius in basis["ocv"]
    ]
    curves = [(abs(curve_celsius - celsius), k) for k, curve_celsius in enumerate(temperatures)]
    if not curves or not np.isfinite(soc[rows]).all():
        return np.zeros(len(rows))
    curve = basis["ocv"][min(curves)[1]]
    volt = np.interp(soc[rows], curve["soc"], curve["ocv_volt"])
    return volt - volt[0]
