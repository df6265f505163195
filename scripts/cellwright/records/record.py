"""A test laid out on the SoC scale: its rows, what part may be fitted, and tests by temperature."""

from typing import NamedTuple

import numpy as np

from cellwright.records.anchor import REST_C_RATE
from cellwright.records.basis import REFERENCE_CELSIUS, soc_of
from cellwright.refusal import Refusal
from cellwright.series.rest_current import hidden_rest_level


def blocks(test_time_second, current_ampere, *, rest_second=120.0, rest_ampere):
    """Number of the block that each row belongs to, from 0: a load and the rest that follows it.

    A relaxation so stays together with the load that caused it. A rest at the very start ends no
    block. Where the reading of the record's rests is above what counts as rest, a rest is also what
    stays within that of it: an offset of the sensor must not turn rests into loads.

    Parameters
    ----------
    test_time_second, current_ampere : (n,) [s], [A].
    rest_second : shortest stretch without current that ends a block [s].
    rest_ampere : current below which the cell rests [A].

    Returns
    -------
    block : (n,) integers.
    """
    level = hidden_rest_level(test_time_second, current_ampere, rest_ampere)
    resting = np.minimum(np.abs(current_ampere), np.abs(current_ampere - level)) <= rest_ampere
    bounds = np.flatnonzero(np.diff(resting.astype(int), prepend=0, append=0))
    first, last = bounds[::2], bounds[1::2] - 1
    long = test_time_second[last] - test_time_second[first] >= rest_second
    starts = last[long & (first > 0)] + 1
    return np.searchsorted(starts, np.arange(len(resting)), side="right")


def fit_mask(test_time_second, current_ampere, *, rest_second=120.0, rest_ampere):
    """Cut a record into blocks at its rests: odd blocks fit, even blocks validate, counted from 1.

    Parameters
    ----------
    test_time_second, current_ampere, rest_second, rest_ampere : as in `blocks`.

    Returns
    -------
    fit : (n,) bool, True where the row may be fitted.

    Raises
    ------
    Refusal : fewer than two blocks: nothing would be left to validate.

    Source: campaign contract, role `split`.
    """
    settings = {"rest_second": rest_second, "rest_ampere": rest_ampere}
    block = blocks(test_time_second, current_ampere, **settings)
    if block[-1] == 0:
        raise Refusal(f"no rest of {rest_second:g} s inside the record to cut it at")
    return block % 2 == 0


def blocks_of_used(records, *, rest_second, rest_ampere):
    """Number of the block of each used row of several records, counted on from one to the next.

    Parameters
    ----------
    records : sequence of `records.Record`. rest_second, rest_ampere : as in `blocks`.

    Returns
    -------
    block : list of (used rows,) integers, one a record.
    """
    found, next_free = [], 0
    for record in records:
        time, current = record.test_time_second, record.current_ampere
        block = blocks(time, current, rest_second=rest_second, rest_ampere=rest_ampere)
        found.append(next_free + block[record.used])
        next_free += block.max() + 1
    return found


EDGE_PART = 20.0  # a change of this part of a record's largest is a step
DRIVE_SHARE = 0.5  # of steps that stand alone, below which a record is a drive


class Record(NamedTuple):
    """One stretch of measurement that starts from rest; all arrays (n,).

    warmth : factor that the resistances have at the cell's temperature, 1 at the condition's [1].
    """

    test_time_second: np.ndarray
    current_ampere: np.ndarray
    voltage_volt: np.ndarray
    soc: np.ndarray
    used: np.ndarray
    warmth: np.ndarray


def record_of(test_time_second, current_ampere, voltage_volt, soc, *, used=None, warmth=None):
    """A measured series as a record that an identification can use.

    Parameters
    ----------
    test_time_second, current_ampere, voltage_volt, soc : (n,) [s], [A], [V], [1].
    used : (n,) bool, rows that may be fitted; None takes all. Rows left out still drive the
        states.
    warmth : (n,) factor on the resistances [1]; None: 1 everywhere.

    Returns
    -------
    record : Record.

    Raises
    ------
    Refusal : not finite, one sample only, time running back, SoC outside −0.1…1.1.
    """
    used = np.ones(len(soc), bool) if used is None else used
    warmth = np.ones(len(soc)) if warmth is None else warmth
    columns = (test_time_second, current_ampere, voltage_volt, soc)
    columns = [np.asarray(column, float) for column in columns]
    _check(*columns)
    return Record(*columns, used, np.asarray(warmth, float))


def bridged(record, *, capacity_ampere_hour, gap_second=600.0, c_rate=1.0):
    """The record with its gaps filled by what must have happened in them.

    Some testers store the pulses of an HPPC only, and not the discharges to the next set point.
    The relaxation after such a discharge goes on for hours and is in what follows; so the charge
    that the counter says has passed is let flow at the gap's beginning, and the rest is a rest.

    Parameters
    ----------
    record : Record, whose SoC runs on over its gaps.
    capacity_ampere_hour : what its SoC refers to [Ah].
    gap_second : a longer time between two samples while charge has passed is a gap [s].
    c_rate : current of what is filled in, over the capacity [1/h].

    Returns
    -------
    record : Record, four more rows for each gap, none of which is used in a fit.
    """
    # ASSUME: The charge that passed in a gap of a record flowed at 1C at the gap's beginning.
    time, soc = record.test_time_second, record.soc
    moved = np.diff(soc)
    gaps = np.flatnonzero((np.diff(time) > gap_second) & (np.abs(moved) > 1e-4))
    if not len(gaps):
        return record
    length = np.diff(time)[gaps]
    lasts = np.minimum(np.abs(moved[gaps]) * 3600.0 / c_rate, 0.9 * length)
    ampere = moved[gaps] * capacity_ampere_hour * 3600.0 / lasts
    share = np.array([0.0, 0.5, 1.0, 1.0])
    inside = Record(
        (time[gaps, None] + lasts[:, None] * share).ravel(),
        (ampere[:, None] * np.array([1.0, 1.0, 1.0, 0.0])).ravel(),
        np.repeat(record.voltage_volt[gaps], 4),
        (soc[gaps, None] + moved[gaps, None] * share).ravel(),
        np.zeros(4 * len(gaps), bool),
        np.repeat(record.warmth[gaps], 4),
    )
    where = np.repeat(gaps + 1, 4)
    return Record(*(np.insert(old, where, new) for old, new in zip(record, inside, strict=True)))


def _check(time, current, voltage, soc):
    if len(time) < 2:
        raise Refusal(f"record has {len(time)} sample(s); a model needs a course of time")
    if not all(np.isfinite(column).all() for column in (time, current, voltage, soc)):
        raise Refusal("time, current, voltage or SoC holds values that are not finite")
    if np.any(np.diff(time) < 0):
        raise Refusal("time runs back inside the record")
    if soc.min() < -0.1 or soc.max() > 1.1:
        found = f"{soc.min():.3f} to {soc.max():.3f}"
        raise Refusal(f"SoC of the record runs from {found}, outside −0.1 to 1.1")


def edges(record, *, step_ampere):
    """Rows at which the current has stepped by more than a threshold since the row before."""
    return np.flatnonzero(np.abs(np.diff(record.current_ampere)) > step_ampere) + 1


def thin(record, *, step_ampere, growth=0.1):
    """Drop rows of steady current that say the same as their neighbours.

    A row stays if the current steps before or after it; in a steady stretch the rows stay at
    times since the last step that grow by `growth` each. At rest the relaxations between kept
    rows are exact; every decade of time after a step then weighs the same in the fit, whatever
    the logger's rate was.

    Parameters
    ----------
    record : Record.
    step_ampere : change of current between samples that counts as a step [A].
    growth : growth of the time since the last step from one kept row to the next [1].

    Returns
    -------
    record : Record, fewer rows.
    """
    time, rows = record.test_time_second, np.arange(len(record.soc))
    edge = np.zeros(len(rows), bool)
    edge[edges(record, step_ampere=step_ampere)] = edge[0] = True
    age = time - time[np.maximum.accumulate(np.where(edge, rows, 0))]
    decade = np.floor(np.log1p(age) / growth)
    keep = edge | np.append(edge[1:], True) | (np.diff(decade, prepend=-1.0) != 0)
    return Record(*(column[keep] for column in record))


def without_edges(record, *, step_ampere):
    """The record without the rows at which the current has just stepped between steady stretches.

    Such a row was sampled within the edge: its voltage may belong to the current before. In a
    drive, where the current steps at every row, none is left out.

    Parameters
    ----------
    record : Record.
    step_ampere : change of current between samples that counts as a step [A].
    """
    steps = np.abs(np.diff(record.current_ampere)) > step_ampere
    before, after = np.append(False, steps[:-1]), np.append(steps[1:], False)
    alone = np.append(False, steps & ~before & ~after)
    return record._replace(used=record.used & ~alone)


def driven(current_ampere):
    """Whether the current of a record steps at most rows where it steps at all: a drive.

    Else it steps between steady stretches, and does so at once, however sparse the rows are.

    Parameters
    ----------
    current_ampere : (n,) [A].
    """
    current = np.asarray(current_ampere, float)
    moved = np.abs(np.diff(current, prepend=current[:1]))
    step = moved > moved.max(initial=0.0) / EDGE_PART
    around = np.append(False, step[:-1]) | np.append(step[1:], False)
    return bool((step & ~around).sum() < DRIVE_SHARE * step.sum())


SAME_CELSIUS = 2.0


class Group(NamedTuple):
    """The tests of one temperature, ready to be fitted.

    celsius : of the chamber [degC]. tests : names. records : tuple of Record, their warmth 1.
    courses : the cell's temperature along each record, (n,) each [degC]. pulsed : excited by pulses
    at set points, not by drives.
    """

    celsius: float
    tests: tuple
    records: tuple
    courses: tuple
    pulsed: bool


def course_celsius(facts, series):
    """Temperature of a cell along a record: its measured surface, else the chamber, else 25 °C.

    Parameters
    ----------
    facts : dict with ambient_temperature_celsius. series : dict of (n,) columns.

    Returns
    -------
    celsius : (n,) [degC]. source : in words.
    """
    # ASSUME: A model's temperature is that of the cell's surface where it was measured, else the
    # chamber's: the core of a loaded cell is warmer.
    measured = series.get("surface_temperature_celsius")
    if measured is not None and np.isfinite(measured).all():
        return np.asarray(measured, float), "the surface's measured"
    stated = facts["ambient_temperature_celsius"]
    source = "25 °C, for want of any" if stated is None else "the chamber's"
    held = REFERENCE_CELSIUS if stated is None else stated
    return np.full(len(series["test_time_second"]), float(held)), source


def groups_of(tests, basis, cell, *, split_rest_second):
    """Tests grouped by chamber temperature, coldest first, within 2 °C.

    In each group HPPC tests and beside them capacity tests, whose long loads show what pulses do
    not; where there is no HPPC, drives.

    Parameters
    ----------
    tests : list of (facts, series), roles fit or split.
    basis : dict, from `basis.basis`. cell : dict, the cell's row.
    split_rest_second : shortest rest that cuts a record of role `split` [s].

    Returns
    -------
    groups : list of Group. notes : list of str, what was left out and why.
    """
    groups, notes = [], []
    for celsius, members in _by_temperature(tests):
        tried = [(test, _tried(test, basis, cell, split_rest_second, notes)) for test in members]
        found = {test.facts["test"]: made for test, made in tried if made is not None}
        if found:
            records, courses = zip(*found.values(), strict=True)
            pulsed = any(test.facts["kind"] == "hppc" for test in members)
            groups.append(Group(celsius, tuple(found), records, courses, pulsed))
    return groups, notes


def _by_temperature(tests):
    grouped = {}
    for test in sorted(tests, key=_celsius):
        near = [t for t in grouped if abs(t - _celsius(test)) <= SAME_CELSIUS]
        grouped.setdefault(near[0] if near else _celsius(test), []).append(test)
    for celsius, group in grouped.items():
        kinds = {test.facts["kind"] for test in group}
        wanted = {"hppc", "capacity"} if "hppc" in kinds else {"drive"}
        chosen = [test for test in group if test.facts["kind"] in wanted]
        if chosen:
            yield celsius, chosen


def _celsius(test):
    """Chamber temperature, else the mean on the cell's surface, else 25 °C as for the basis."""
    stated = test.facts["ambient_temperature_celsius"]
    return (
        stated if stated is not None else float(course_celsius(test.facts, test.series)[0].mean())
    )


def _tried(test, basis, cell, split_rest_second, notes):
    """Record and course of a test, None with a note where it cannot be used."""
    try:
        return _record(test, basis, cell, split_rest_second, notes)
    except Refusal as refusal:
        notes.append(f"not fitted: {test.facts['test']}: {refusal}")
        return None


def _record(test, basis, cell, split_rest_second, notes):
    anchored = soc_of(test.series, basis, test.facts, cell)
    if test.facts["soc"] is None:
        notes.append(f"{test.facts['test']}: SoC by {anchored.anchor}")
    time, current = test.series["test_time_second"], test.series["current_ampere"]
    used = None
    if test.facts["role"] == "split":
        rest = REST_C_RATE * basis["capacity_ampere_hour"]
        used = fit_mask(time, current, rest_second=split_rest_second, rest_ampere=rest)
    record = record_of(time, current, test.series["voltage_volt"], anchored.soc, used=used)
    # The course of temperature travels in the place of the warmth: a bridged gap has it too.
    course = course_celsius(test.facts, test.series)[0]
    capacity = basis["capacity_ampere_hour"]
    full = bridged(record._replace(warmth=course), capacity_ampere_hour=capacity)
    return full._replace(warmth=np.ones(len(full.soc))), full.warmth
