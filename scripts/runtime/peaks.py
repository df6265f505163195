"""Peaks and curves of dQ/dV from artefacts, of one cell's charges or those of a whole type."""

import math

import numpy as np

from cellwright.health.peaks.tracking import TrackedCharge
from runtime import artefact, tables

CURVE = ("voltage_volt", "dq_dv_ampere_hour_per_volt")


def of_check_ups(paths, curves, tests):
    """Peaks of the charges of tests of kind `ica`, also of those that have none, with the reason.

    Parameters
    ----------
    paths, curves : artefacts of stages `ica` and `ica_curve` of the same tests.
    tests : facts of the sheet by "cell/test". A charge whose curve is refused too is left out.
    """
    found = []
    for path, curve in zip(paths, curves, strict=True):
        about, made = artefact.read_about(path), artefact.read_about(curve)
        # A charge without peaks is a finding, one without a curve was never seen.
        if made["reason"] is None:
            peaks = artefact.load(path) if about["reason"] is None else {}
            facts, rate = _facts(about, tests), float(made["facts"]["c_rate"])
            found.append(_charge(about, facts, facts["cycle"] or 0.0, rate, peaks, about["reason"]))
    return found


def of_lives(paths, tests):
    """Peaks of the charges of ageing records.

    Parameters
    ----------
    paths : artefacts of stage `ica_life`. tests : facts of the sheet by "cell/test".
    """
    found, last = [], 0.0
    for peaks, about in artefact.load_all(paths):
        facts, cycles = _facts(about, tests), peaks["cycle"]
        # Records that follow each other without a stated cycle count on.
        before = last if facts["cycle"] is None and cycles.min() <= last else 0.0
        found += [_of_cycle(peaks, cycle, before, about, facts) for cycle in np.unique(cycles)]
        last = before + float(cycles.max())
    return found


def _of_cycle(peaks, cycle, before, about, facts):
    """One charge of an ageing record; `before`: cycles of the records before it."""
    own = {name: column[peaks["cycle"] == cycle] for name, column in peaks.items()}
    reason, rate = str(own["reason"][0]), float(own["c_rate"][0])
    return _charge(about, facts, before + cycle, rate, {} if reason else own, reason)


def _facts(about, tests):
    """What the sheet says of the test of an artefact."""
    return tests["/".join(_place(about))]


def _place(about):
    """Cell and test of an artefact."""
    return about["wildcards"]["cell"], about["wildcards"]["test"]


def _charge(about, facts, cycle, c_rate, peaks, reason):
    """One charge with its peaks."""
    celsius = facts["ambient_temperature_celsius"]
    return TrackedCharge(
        test=about["wildcards"]["test"],
        cycle=float(cycle),
        c_rate=c_rate,
        temperature_celsius=math.nan if celsius is None else float(celsius),
        peaks=peaks,
        reason=reason or "",
    )


def of_type(tracks, single, tests):
    """Rows of peaks: of tracked cells, and of those with a single charge; and the tracked cells."""
    followed = tables.rows_of(tracks, tests)
    cells = {row["cell"] for row in followed}
    alone = [row for row in tables.rows_of(single, tests) if row["cell"] not in cells]
    return [*followed, *alone], cells


def cycles_before(life_curves, peaks) -> dict:
    """Cycles that the tracks count before the records that count on, by (cell, test).

    Parameters
    ----------
    life_curves : artefacts of stage `ica_life_curve`. peaks : rows as of `of_type`.
    """
    tracked = {}
    for row in peaks:
        tracked.setdefault((row["cell"], row["test"]), set()).add(float(row["cycle"] or 0.0))
    found = {}
    for columns, about in artefact.load_all(life_curves):
        place = _place(about)
        found[place] = count_before(np.unique(columns["cycle"]), tracked.get(place, set()))
    return found


def count_before(own, tracked) -> float:
    """Cycles between the own count of a record and that of the tracks, by which most charges meet.

    Some charges have no peak, and so no track, and others no curve.
    """
    counts = [0.0, *(cycle - own[0] for cycle in sorted(tracked))]
    return float(max(counts, key=lambda before: len(tracked & {*(own + before)})))


def capacities(check_ups, lives, tests, before):
    """Rows of capacities of check-ups, and of the discharges of ageing records.

    `before` : as of `cycles_before`.
    """
    cycled = [
        row | {"of_a_life": True, "cycle": row["cycle"] + before.get((row["cell"], row["test"]), 0)}
        for row in tables.rows_of(lives, tests)
    ]
    return [*tables.rows_of(check_ups, tests), *cycled]


def curves(check_ups, lives, tests, before):
    """Columns of the curves (voltage, dQ/dV) by cell, test and cycle; `before` as there."""
    found = {}
    for columns, about in artefact.load_all(check_ups):
        key = *_place(about), float(_facts(about, tests)["cycle"] or 0)
        found[key] = {name: columns[name] for name in CURVE}
    for columns, about in artefact.load_all(lives):
        place = _place(about)
        for cycle in np.unique(columns["cycle"]):
            of_cycle = columns["cycle"] == cycle
            key = *place, float(cycle + before[place])
            found[key] = {name: columns[name][of_cycle] for name in CURVE}
    return found
