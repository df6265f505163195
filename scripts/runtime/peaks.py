"""Peaks of dQ/dV of one cell's charges, from artefacts, with what the sheet says of each."""

import math

import numpy as np

from cellwright.health.peaks.tracking import TrackedCharge
from runtime import artefact


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
    return tests[f"{about['wildcards']['cell']}/{about['wildcards']['test']}"]


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
