"""From the tests of a cell to a case: what is fitted and what judges, laid out and thinned."""

from functools import partial
from typing import NamedTuple

import numpy as np

from cellwright.effects import base, beginning
from cellwright.effects.case import Case
from cellwright.effects.library import LIBRARY
from cellwright.effects.library.vocabulary import SLOW_TEST
from cellwright.effects.records import ages_of, stacked
from cellwright.numerics.least_squares import fit
from cellwright.protocols.ocv.gap import slow_gap
from cellwright.protocols.ocv.slow import mean_of_branches, rising
from cellwright.records.conditions import REFERENCE_CELSIUS, of_first_checkup
from cellwright.records.record import laid_out_to_fit
from cellwright.records.repeats import counted_once
from cellwright.records.thinning import (
    STEP_PART,
    averaged_to,
    driven,
    edge_ampere,
    largest_ampere,
    rows_of,
    thin,
    without_unsettled,
)
from cellwright.refusal import Refusal

MEASURED_SOC = 0.1, 0.9  # of a slow test; towards its ends the OCV is joined to what rests show
MOST_MOVED = 2.5  # of the capacity, by a slow test whose one discharge and charge tell the OCV
KINDS = ("capacity", "hppc", "pulse_resistance", "drive")  # and the slow test of the OCV
JUDGING = ("validation", "split")  # roles of tests that judge
GRID = np.linspace(0.0, 1.0, 1001)
GROWTHS = 0.1, 0.2, 0.4  # of the time since a step, to the next row of a steady stretch
MOST_ROWS = 13_000  # of either side: 20,000 took longer, and named the same in simulated cells
NOISES = 20.0  # usual changes of a steady reading: no noise steps by so much, heavy tails or not
EDGE_PART = 200.0  # a change of this part of a record's largest ends a steady stretch
RATED_CAPACITY = 0.05  # tolerance of a capacity that nobody measured
# ASSUME: After a tenth of a second the double layer has its charge and the tester its current; of
# what is quicker the search's circuit, whose pairs take seconds, holds nothing.
SETTLED_SECOND = 0.1
HOLDS = ("zero_order", "first_order")
STEPS_OF_HOLD = 6  # of the fit by which the hold is chosen


class Prepared(NamedTuple):
    """A case and its records, fitted and judging; notes on how it was made.

    caveats : what weakens a proof by it, part of the verdict.
    """

    case: Case
    records: tuple
    notes: tuple
    caveats: tuple = ()


def prepared(cell, basis, tests, *, tolerance, gates, settings):
    """Case of a cell's tests: laid out over SoC, thinned, and divided into fitted and judging.

    Tests of role fit are fitted, of role validation judge; of a split test the odd blocks are
    fitted and the even ones judge. Where no test judges, every third one is kept out of the fit
    for it, so that rates and temperatures stay on both sides.

    Parameters
    ----------
    cell : CellFacts. basis : dict, from `basis.basis`.
    tests : list of MeasuredTest. tolerance : base.Tolerance. gates : Gates.
    settings : dict with split_rest_second.

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
    curve = _curve_at_reference(basis)
    fitted, judging, notes = _sides(cell, basis, _with_slow_test(tests, basis, curve), settings)
    if basis["capacity_source"] == "rating":
        tolerance = tolerance._replace(capacity=RATED_CAPACITY)
        notes.append("no measured capacity: the rating, to 5 %")
    caveats = (*_stand_in(tests, judging), *_of_rests(curve, judging))
    capacity = basis["capacity_ampere_hour"]
    sides = tuple(_thinned(side, capacity) for side in (fitted, judging))
    sides = tuple([_settled(record) for record in side] for side in sides)
    measured = base.Cell(capacity, np.interp(GRID, curve["soc"], _between_branches(curve)))
    about = tolerance, gates, slow_gap(curve)
    ages = ages_of([*sides[0], *sides[1]], reference=curve["test"])
    laid = {"capacity_ampere_hour": capacity, "ages": ages}
    cases = [Case(measured, *(stacked(s, hold=h, **laid) for s in sides), *about) for h in HOLDS]
    begin = beginning.first_capacity(measured, cases[0].fit)
    slow = any(record.kind == SLOW_TEST for record in sides[0])
    held = slow and curve["branches"] == "both"
    cases = [case._replace(first_capacity=begin, holds_declared=held) for case in cases]
    better, other = sorted(cases, key=_misfit)
    return Prepared(better._replace(otherwise=other), sides, tuple(notes), caveats)


def _with_slow_test(tests, basis, curve):
    """Tests that the search reads: none slow but that of the cell's own OCV, if of one check-up.

    Both branches of it hold the OCV where it is. Drives discharge most of the time, and alone they
    would let it follow a hysteresis.
    """
    others = [test for test in tests if test.facts.kind != SLOW_TEST]
    name = None if basis.get("borrowed_from") else curve["test"]
    own = [t for t in tests if t.facts.kind == SLOW_TEST and t.facts.test == name]
    first, _ = of_first_checkup(others)
    together, _ = of_first_checkup([*own, *first])
    return [*own, *others] if len(together) == len(own) + len(first) else others


def _sides(cell, basis, tests, settings):
    """Records that are fitted and that judge, with notes on those that cannot be used."""
    young, later = of_first_checkup(tests)
    young, words = counted_once(young)
    fitted, judging, notes = [], [], [f"not used, of a later check-up: {n}" for n in later]
    notes += words
    for test in young:
        role, given = test.facts.role, (test, basis, cell, settings)
        try:
            fitted += [] if role == "validation" else [_record(*given)]
            judging += [_record(*given, proof=True)] if role in JUDGING else []
        except Refusal as refusal:
            notes.append(f"not used: {test.facts.test}: {refusal}")
    dynamic = [record for record in fitted if record.kind != SLOW_TEST]
    if not judging and len(dynamic) >= 3:
        judging = [record for k, record in enumerate(dynamic) if k % 3 == (k // 3) % 3]
        kept_out = {record.test for record in judging}
        fitted = [record for record in fitted if record.test not in kept_out]
        names = ", ".join(record.test for record in judging)
        notes.append(f"no test of role validation: {names} judged instead, and were not fitted")
    if not dynamic or not judging:
        which = "fitted" if not dynamic else "kept out of the fit for validation"
        raise Refusal(f"no test can be {which}; {'; '.join(notes)}")
    return fitted, judging, notes


def _record(test, basis, cell, settings, *, proof=False):
    # What the instrument read, with what cleaning did not count: an offset is one of the effects.
    cut = {"split_rest_second": settings["split_rest_second"]}
    record = laid_out_to_fit(test, basis, cell, proof=proof, as_read=True, **cut)
    if not record.used.any():
        raise Refusal("all of it counts in another test")
    if record.kind != SLOW_TEST:
        return record
    moved = np.abs(np.diff(record.soc)).sum()
    if moved > MOST_MOVED:
        raise Refusal(f"it moves {moved:.1f} times the capacity: more than one slow cycle")
    low, high = MEASURED_SOC
    return record._replace(used=record.used & (record.soc >= low) & (record.soc <= high))


def _curve_at_reference(basis):
    """OCV curve of the temperature nearest 25 °C."""

    def distance_kelvin(curve):
        celsius = curve["ambient_temperature_celsius"]
        return abs(REFERENCE_CELSIUS - (REFERENCE_CELSIUS if celsius is None else celsius))

    return min(basis["ocv"], key=distance_kelvin)


def _between_branches(curve):
    """OCV (n,) [V] at the curve's SoC, the mean of its branches where both were measured.

    Joined from their ends as hysteresis grows to half charge, of a hysteresis that grows within a
    few percent it is a fifth of the gap off at 30 and at 70 % SoC, as an effect of its own would.
    """
    if curve.get("joined_by") != "equilibrium":
        return curve["ocv_volt"]
    branches = (np.asarray(curve[f"{name}_volt"], float) for name in ("discharge", "charge"))
    return rising(mean_of_branches(np.asarray(curve["soc"], float), *branches)[0])


def _stand_in(tests, judging):
    """Caveat of a cell without a test for validation, where others judge."""
    if not any(test.facts.role in JUDGING for test in tests):
        names = ", ".join(record.test for record in judging)
        yield f"No test of this cell is for validation: {names} judged, unfitted; that is no proof."


def _of_rests(curve, judging):
    """Caveat of an OCV that is from a test's own rests."""
    if curve.get("branches") == "rests":
        judges = any(record.test == curve["test"] for record in judging)
        also = "it is one of those that judge" if judges else "what they had not relaxed is in it"
        yield f"The open-circuit voltage is from the rests of {curve['test']}: {also}."


def _thinned(records, capacity_ampere_hour):
    """Records thinned for the search: whole seconds, steady stretches sparse, few."""

    def sparse(record, growth):
        about = {"growth": growth, "capacity_ampere_hour": capacity_ampere_hour}
        return thin(record, step_ampere=_least_step_ampere(record), **about)

    ways = [partial(sparse, growth=growth) for growth in GROWTHS]
    return averaged_to(records, most_rows=MOST_ROWS, thinned=ways)


def _settled(record):
    """Record without the rows just after a step of its current; a drive steps all the time.

    Nor has it rows before its first step where that follows at once: they were sampled in the edge,
    beside a current that is logged as none, and tell no voltage of a rest.
    """
    if driven(record.current_ampere):
        return record
    record = _from_first_load(record)
    step = _least_step_ampere(record)
    return without_unsettled(record, step_ampere=step, settled_second=SETTLED_SECOND)


def _from_first_load(record):
    """Record that begins with its first load where it rests less than `SETTLED_SECOND` before."""
    time, loaded = record.test_time_second, np.abs(record.current_ampere) > edge_ampere(record)
    first = int(np.argmax(loaded))
    if not loaded.any() or first == 0 or time[first] - time[0] >= SETTLED_SECOND:
        return record
    return rows_of(record, slice(first, None))


def _least_step_ampere(record):
    """Change of the current from row to row that ends a steady stretch of a record [A].

    Between the steps of a record that is no drive the usual change is noise, which no step may be
    taken for. In a drive that moves all the time, every change is one of the load.
    """
    change = np.abs(np.diff(record.current_ampere))
    largest = largest_ampere(record)
    least, noise = largest / EDGE_PART, NOISES * float(np.median(change)) if len(change) else 0.0
    if driven(record.current_ampere) and noise >= largest / STEP_PART:
        return least
    return max(least, min(noise, largest / STEP_PART))


def _misfit(case):
    """Chi-square of the plain model on the records fitted, the least over delays of the voltage.

    Fitted, for guessed time constants err by more than the holds differ. Without the delays, a time
    skew of the readings would choose the hold that imitates it (`Effect.hold_imitates`).
    """
    free, values, filters = case.begun()
    values = fit(case.problem((), free, filters), values, steps=STEPS_OF_HOLD).values

    def chi_square(values, *effects):
        volt = case.predict("fit", values, effects)
        white = filters.fit.apply(case.fit.voltage_volt - volt)
        return float(white @ white)

    costs = [chi_square(values)]
    alike = [effect for effect in LIBRARY.values() if effect.hold_imitates]
    for effect, start in [(one, start) for one in alike for start in one.starts]:
        begun = values | {f"{effect.key}.{name}": size for name, size in start.items()}
        begun = beginning.regressed(case.cell, case.fit, begun, (effect,))
        costs.append(chi_square(begun, effect))
    return min(costs)
