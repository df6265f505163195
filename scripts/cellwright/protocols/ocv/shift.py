"""Shift of the open-circuit voltage since an earlier check-up, from charges and discharges."""

import numpy as np

from cellwright.records import inputs
from cellwright.records.conditions import in_first_checkup, same_rate
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.series.steps import constant_current_end

GRID = np.linspace(0.0, 1.0, 41)


def ocv_shift(earlier, later):
    """Shift of the OCV between two check-ups that both have a charge and a discharge at one rate.

    1. Of each record the largest constant-current discharge and charge are taken over SoC, each
    scaled by the charge of its whole half cycle. 2. Between the check-ups each direction shifts by
    that of the OCV and by that of its polarisation, which has the other sign in the other
    direction: the mean of both is the shift of the OCV. 3. Were the polarisation's growth not equal
    in both directions, the OCV could have shifted by anything between the two: the standard
    deviation is their half distance over √3.

    earlier, later : (current [A], voltage [V], charge [Ah], Steps) of a record of each check-up.

    Returns shift: dict of (41,) columns: soc [1] of the check-up's own capacity, shift_volt
    against the earlier check-up at the same SoC, shift_std_volt [V]. Below 5 % and above 95 % SoC,
    where the polarisation of a load that begins or ends is read, they stay as they are there.
    Raises Refusal: a record without such a charge and discharge, or of another rate than the other.
    """
    moved = []
    for sign in (-1, 1):
        soc, old_volt, old_ampere = _branch(sign, *earlier)
        inner = np.clip(GRID, 0.05, 0.95)
        before = np.interp(inner, soc, old_volt)
        soc, volt, ampere = _branch(sign, *later)
        if not same_rate(ampere, old_ampere):
            raise Refusal(f"{ampere:.3g} A and {old_ampere:.3g} A are not one rate")
        moved.append(np.interp(inner, soc, volt) - before)
    std = np.abs(moved[1] - moved[0]) / 2 / np.sqrt(3)
    return {"soc": GRID, "shift_volt": (moved[0] + moved[1]) / 2, "shift_std_volt": std}


def ocv_shifts(tests):
    """Shift of the OCV [V] of a cell since its first check-up, from charges and discharges alike.

    tests : (test, series, result of `segment`) each, of capacity tests at several `cycle`s.

    Returns rows, one a later test and SoC: cycle, soc [1], shift_volt, shift_std_volt [V], test,
    reference_test. What cannot be compared is in the notes. Source: docs/state-of-charge.md.
    """
    records = []
    for test, series, steps in tests:
        facts, counted = inputs.test_facts(test), inputs.quantities(series, inputs.COUNTED)
        # A test without a stated cycle is of the fresh cell, with which the others are compared.
        records.append((facts.test, facts.cycle or 0.0, (*counted[1:], inputs.steps(steps))))
    is_first = in_first_checkup([cycle for _, cycle, _ in records])
    references = [entry for entry, first in zip(records, is_first, strict=True) if first]
    rows, notes = [], []
    for (test, cycle, record), first in zip(records, is_first, strict=True):
        if first:
            continue
        shift, of = _first_comparable(references, record)
        if shift is None:
            notes.append(f"OCV shift of {test}: {of}")
            continue
        facts = {"cycle": float(cycle), "test": test, "reference_test": of}
        values = zip(*(column.tolist() for column in shift.values()), strict=True)
        rows += [facts | dict(zip(shift, row, strict=True)) for row in values]
    return Result({"rows": rows}, notes=tuple(notes))


def _first_comparable(references, record):
    """Shift and name of the first reference that can be compared, or None and why not."""
    reason = "the first check-up has no capacity test"
    for test, _, reference in references:
        try:
            return ocv_shift(reference, record), test
        except Refusal as refusal:
            reason = str(refusal)
    return None, reason


def _branch(sign, current, voltage, charge, steps):
    """SoC (m,) and voltage (m,) of a half cycle at its current, and the size of that [A]."""
    moved = sign * np.where(np.isin(steps.kind, ("CC", "CCCV")), steps.charge_ampere_hour, 0.0)
    step = int(np.argmax(moved))
    # At one current most of the charge must move for its voltage to be compared.
    if moved[step] <= 0 or moved[step] < 0.7 * float(np.ptp(charge)):
        name = "charge" if sign > 0 else "discharge"
        raise Refusal(f"no {name} at one current over most of the capacity")
    whole, after = moved[step], step + 1
    if after < len(steps.kind) and steps.kind[after] == "CV":  # a hold as a step of its own
        whole += max(sign * float(steps.charge_ampere_hour[after]), 0.0)
    first = int(steps.first_row[step])
    end = constant_current_end(first, steps.last_row[step], steps.cv_first_row[step])
    passed = sign * (charge[first:end] - charge[max(first - 1, 0)]) / whole
    soc = passed if sign > 0 else 1 - passed
    order = np.argsort(soc)
    return soc[order], voltage[first:end][order], float(np.median(np.abs(current[first:end])))
