"""The tests of a cell by temperature, as records that an identification can use."""

from typing import NamedTuple

import numpy as np

from cellwright.models.basis import REFERENCE_CELSIUS, soc_of
from cellwright.models.records import bridged, record_of
from cellwright.models.split import fit_mask
from cellwright.refusal import Refusal
from cellwright.series.anchor import REST_C_RATE

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
