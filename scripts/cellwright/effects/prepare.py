"""From a cell's tests to a case: which records are fitted, which judge, and how fine they are."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base, plain
from cellwright.effects.case import Case, filters_of, steep
from cellwright.effects.library import LIBRARY
from cellwright.effects.records import stacked
from cellwright.effects.screen import chi_square_of
from cellwright.numerics.noise import FIRST
from cellwright.protocols.ocv.gap import slow_gap
from cellwright.records.basis import REFERENCE_CELSIUS
from cellwright.records.facts import of_first_checkup
from cellwright.records.record import laid_out_to_fit
from cellwright.records.thinning import averaged_to, thin
from cellwright.refusal import Refusal

KINDS = ("capacity", "hppc", "pulse_resistance", "drive")
GRID = np.linspace(0.0, 1.0, 1001)
EDGE_PART = 200.0  # a change of this part of a record's largest ends a steady stretch
RATED_CAPACITY = 0.05  # tolerance of a capacity that nobody measured
JUDGING = ("validation", "split")  # roles of tests that judge
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
    cell : CellFacts. basis : dict, from `basis.basis`.
    tests : list of MeasuredTest. tolerance : plain.Tolerance. gates : case.Gates.
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
    young, later = of_first_checkup(tests)
    fitted, judging, notes = [], [], [f"not used, of a later check-up: {n}" for n in later]
    for test in young:
        role, given = test.facts.role, (test, basis, cell, settings)
        try:
            fitted += [] if role == "validation" else [_record(*given)]
            judging += [_record(*given, proof=True)] if role in JUDGING else []
        except Refusal as refusal:
            notes.append(f"not used: {test.facts.test}: {refusal}")
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


def _record(test, basis, cell, settings, *, proof=False):
    # What the instrument read, with what cleaning did not count: an offset is one of the effects.
    cut = {"split_rest_second": settings["split_rest_second"]}
    return laid_out_to_fit(test, basis, cell, proof=proof, as_read=True, **cut)


def _nearest(basis):
    """OCV curve nearest 25 °C."""

    def off(curve):
        celsius = curve["ambient_temperature_celsius"]
        return abs(REFERENCE_CELSIUS - (REFERENCE_CELSIUS if celsius is None else celsius))

    return min(basis["ocv"], key=off)


def _stand_in(tests, judging):
    """Said where the sheet has no test for validation, and others served for it."""
    if not any(test.facts.role in JUDGING for test in tests):
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

    def sparse(record):
        largest = np.abs(np.diff(record.current_ampere)).max(initial=0.0)
        return thin(
            record, step_ampere=largest / EDGE_PART, capacity_ampere_hour=capacity_ampere_hour
        )

    return averaged_to(records, most_rows=most_rows, thinned=sparse)


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
