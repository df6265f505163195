"""From a cell's tests to a case: which records are fitted, which judge, and how fine they are."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base, plain
from cellwright.effects.case import Case, filters_of, steep
from cellwright.effects.library import LIBRARY
from cellwright.effects.records import Record, stacked
from cellwright.effects.screen import chi_square_of
from cellwright.numerics.noise import FIRST
from cellwright.protocols.ocv.gap import slow_gap
from cellwright.records.anchor import REST_C_RATE
from cellwright.records.basis import REFERENCE_CELSIUS, soc_of
from cellwright.records.record import bridged, course_celsius, fit_mask, record_of
from cellwright.refusal import Refusal
from cellwright.series.rest_current import as_logged

KINDS = ("capacity", "hppc", "pulse_resistance", "drive")
GRID = np.linspace(0.0, 1.0, 1001)
EDGE_PART = 200.0  # a change of this part of a record's largest ends a steady stretch
GROWTH = 0.1  # of the time since the last step, from one kept row to the next
PORTION_SOC = 0.005  # a row at least each time so much charge has passed
FINEST_SECOND = 0.8  # records sampled faster are averaged to whole seconds
RATED_CAPACITY = 0.05  # tolerance of a capacity that nobody measured
HOLDS = ("zero_order", "first_order")


class Prepared(NamedTuple):
    """A case, in words how it was made, and what weakens a proof by it: part of the verdict."""

    case: Case
    notes: tuple
    caveats: tuple = ()


def prepared(cell, basis, tests, *, tolerance, gates, settings):
    """Lay the tests of a cell out for a search.

    Tests of role fit are fitted, of role validation judge; of a split test the odd blocks are
    fitted and the even ones judge. Where no test judges, every third one is kept out of the fit
    for it, so that rates and temperatures stay on both sides.

    Parameters
    ----------
    cell : dict, the cell's row of the sheet. basis : dict, from `models.basis.basis`.
    tests : list of models.cell.FitTest. tolerance : plain.Tolerance. gates : case.Gates.
    settings : dict with most_rows, split_rest_second.

    Returns
    -------
    prepared : Prepared.

    Raises
    ------
    Refusal : no OCV, nothing to fit, or nothing that judges.
    """
    if not basis["ocv"]:
        raise Refusal(
            "no OCV curve: no slow test of the cell or its type, and no rests that tell one"
        )
    fitted, judging, notes = _sides(cell, basis, tests, settings)
    if basis["capacity_source"] == "rating":
        tolerance = tolerance._replace(capacity=RATED_CAPACITY)
        notes.append("no measured capacity: the rating, to 5 %")
    curve = _nearest(basis)
    caveats = (*_stand_in(tests, judging), *_of_rests(curve, judging))
    capacity = basis["capacity_ampere_hour"]
    most = settings["most_rows"]
    fitted, judging = _thinned(fitted, most, capacity), _thinned(judging, most, capacity)
    about = base.Cell(capacity, np.interp(GRID, curve["soc"], curve["ocv_volt"]))
    sides = (fitted, judging)
    cases = []
    for hold in HOLDS:
        both = [stacked(side, capacity_ampere_hour=capacity, hold=hold) for side in sides]
        cases.append(Case(about, *both, tolerance, gates, slow_gap(curve)))
    return Prepared(min(cases, key=_misfit), tuple(notes), caveats)


def _sides(cell, basis, tests, settings):
    """Records that are fitted and that judge, with notes on those that cannot be used."""
    young, later = _by_age(tests)
    fitted, judging, notes = [], [], [f"not used, of a later check-up: {n}" for n in later]
    for test in young:
        try:
            record = _record(cell, basis, test, settings)
        except Refusal as refusal:
            notes.append(f"not used: {test.facts['test']}: {refusal}")
            continue
        role = test.facts["role"]
        if role == "split":
            fitted.append(record)
            judging.append(record._replace(used=~record.used))
        else:
            (judging if role == "validation" else fitted).append(record)
    if not judging and len(fitted) >= 3:
        kept = [k for k in range(len(fitted)) if k % 3 == (k // 3) % 3]
        judging = [fitted[k] for k in kept]
        fitted = [record for k, record in enumerate(fitted) if k not in kept]
        names = ", ".join(record.test for record in judging)
        notes.append(f"no test of role validation: {names} judged instead, and were not fitted")
    if not fitted or not judging:
        which = "fitted" if not fitted else "kept out of the fit for validation"
        raise Refusal(f"no test can be {which}; {'; '.join(notes)}")
    return fitted, judging, notes


def _by_age(tests):
    """Tests of the earliest check-up, and names of the others: a cell that ages is another cell."""
    cycles = [test.facts["cycle"] or 0 for test in tests]
    first = min(cycles, default=0)
    later = [t.facts["test"] for t, cycle in zip(tests, cycles, strict=True) if cycle > first]
    return [t for t, cycle in zip(tests, cycles, strict=True) if cycle == first], later


def _record(cell, basis, test, settings):
    # What the instrument read, with what cleaning did not count: an offset is one of the effects.
    series, facts = as_logged(test.series), test.facts
    anchored = soc_of(series, basis, facts, cell)
    time, current = series["test_time_second"], series["current_ampere"]
    used = None
    if facts["role"] == "split":
        rest = REST_C_RATE * basis["capacity_ampere_hour"]
        cut = test.series["current_ampere"]
        used = fit_mask(time, cut, rest_second=settings["split_rest_second"], rest_ampere=rest)
    celsius = celsius_of(facts, series)
    record = record_of(
        time, current, series["voltage_volt"], anchored.soc, used=used, warmth=celsius
    )
    record = bridged(record, capacity_ampere_hour=basis["capacity_ampere_hour"])
    return Record(
        facts["test"],
        facts["kind"],
        record.test_time_second,
        record.current_ampere,
        record.voltage_volt,
        record.warmth,
        float(record.soc[0]),
        record.used,
        record.soc,
    )


def celsius_of(facts, series):
    """The surface's temperature, else the measured chamber's, else the stated one."""
    chamber = series.get("ambient_temperature_celsius")
    known = series.get("surface_temperature_celsius")
    if known is None and chamber is not None and np.isfinite(chamber).all():
        return np.asarray(chamber, float)
    return course_celsius(facts, series)[0]


def _nearest(basis):
    """OCV curve nearest 25 °C."""

    def off(curve):
        celsius = curve["ambient_temperature_celsius"]
        return abs(REFERENCE_CELSIUS - (REFERENCE_CELSIUS if celsius is None else celsius))

    return min(basis["ocv"], key=off)


def _stand_in(tests, judging):
    """Said where the sheet has no test for validation, and others served for it."""
    if not any(test.facts["role"] in ("validation", "split") for test in tests):
        names = ", ".join(record.test for record in judging)
        yield f"No test of this cell is for validation: {names} judged, unfitted; that is no proof."


def _of_rests(curve, judging):
    """What a judgement is worth where the OCV is that of a test's own rests."""
    if curve.get("branches") == "rests":
        own = any(record.test == curve["test"] for record in judging)
        also = "it is one of those that judge" if own else "what they had not relaxed is in it"
        yield f"The open-circuit voltage is from the rests of {curve['test']}: {also}."


def _thinned(records, most_rows, capacity_ampere_hour):
    """Records as fine as a search needs: whole seconds, steady stretches sparse, so many rows."""
    width = FINEST_SECOND
    while True:
        found = [_sparse(_averaged(record, width), capacity_ampere_hour) for record in records]
        if sum(len(r.test_time_second) for r in found) <= most_rows:
            return found
        width = max(2 * width, 1.0)


def _averaged(record, width_second):
    """Means over bins where a record is sampled faster: what is linear averages like its input."""
    steps = np.diff(record.test_time_second)
    if not len(steps) or np.median(steps) >= width_second:
        return record
    number = np.floor(record.test_time_second / max(width_second, 1.0)).astype(int)
    _, bins = np.unique(number, return_inverse=True)
    count = np.bincount(bins)

    def mean(column):
        return np.bincount(bins, column) / count

    names = ("test_time_second", "current_ampere", "voltage_volt", "celsius", "counted_soc")
    means = {name: mean(getattr(record, name)) for name in names}
    return record._replace(**means, used=mean(record.used.astype(float)) > 0.999)


def _sparse(record, capacity_ampere_hour):
    """Rows of steady stretches thinned: so many a decade of time after a step, and by charge."""
    time, current = record.test_time_second, record.current_ampere
    moved = np.abs(np.diff(current, prepend=current[:1]))
    edge = moved > moved.max(initial=0.0) / EDGE_PART
    edge[0] = True
    rows = np.arange(len(time))
    age = time - time[np.maximum.accumulate(np.where(edge, rows, 0))]
    decade = np.floor(np.log1p(age) / GROWTH)
    passed = np.abs(current) * np.diff(time, prepend=time[:1]) / 3600.0 / capacity_ampere_hour
    portion = np.floor(np.cumsum(passed) / PORTION_SOC)
    keep = edge | np.append(edge[1:], True)
    keep |= (np.diff(decade, prepend=-1.0) != 0) | (np.diff(portion, prepend=-1.0) != 0)
    names = ("test_time_second", "current_ampere", "voltage_volt", "celsius")
    names = (*names, "used", "counted_soc")
    record = record._replace(**{name: getattr(record, name)[keep] for name in names})
    return record._replace(thinned=np.diff(np.flatnonzero(keep), prepend=-1) > 1)


def _misfit(case):
    """What the plain model leaves of the records fitted, sensors read at different times allowed.

    Without that allowance a skewed clock would choose the hold that mimics it.
    """
    values = plain.first_values(case.cell, case.fit)
    filters = filters_of(case, FIRST, steep(case, values))
    skew = LIBRARY["time_skew"]
    costs = [chi_square_of(case, values, (), filters)]
    for start in skew.starts:
        here = values | {skew.names[0]: start["voltage_delay_second"]}
        here = plain.regressed(case.cell, case.fit, here, (skew,))
        costs.append(chi_square_of(case, here, (skew,), filters))
    return min(costs)
