"""Shift of the open-circuit voltage since an earlier check-up, from charges and discharges."""

from typing import NamedTuple

import numpy as np

from cellwright.records.conditions import same_rate
from cellwright.refusal import Refusal

LEAST_SHARE = 0.7  # of a half cycle: what must move at one current for its voltage to be compared
GRID = np.linspace(0.0, 1.0, 41)
COMPARED = (0.05, 0.95)  # SoC beyond which the polarisation of a load that begins or ends is read


class OcvShift(NamedTuple):
    """Shift of the OCV over SoC, (41,) each.

    soc : of the check-up's own capacity [1]. shift_volt, shift_std_volt : against the earlier
    check-up at the same SoC, and its standard deviation [V].
    """

    soc: np.ndarray
    shift_volt: np.ndarray
    shift_std_volt: np.ndarray


class _Branch(NamedTuple):
    """Voltage of one half cycle over SoC at one current [A], + on charge."""

    soc: np.ndarray
    volt: np.ndarray
    ampere: float


def ocv_shift(earlier, later):
    """Shift of the OCV between two check-ups that both have a charge and a discharge at one rate.

    1. Of each record the largest constant-current discharge and charge are taken over SoC, each
    scaled by the charge of its whole half cycle. 2. Between the check-ups each direction shifts by
    that of the OCV and by that of its polarisation, which has the other sign in the other
    direction: the mean of both is the shift of the OCV. 3. Were the polarisation's growth not equal
    in both directions, the OCV could have shifted by anything between the two: the standard
    deviation is their half distance over √3.

    Parameters
    ----------
    earlier, later : (current [A], voltage [V], charge [Ah], Steps) of a record of each check-up.

    Returns
    -------
    shift : OcvShift; below 5 % and above 95 % SoC it is held.

    Raises
    ------
    Refusal : a record without such a charge and discharge, or of another rate than the other.
    """
    old, new = _branches(*earlier), _branches(*later)
    for one, other in zip(old, new, strict=True):
        if not same_rate(abs(other.ampere), abs(one.ampere)):
            raise Refusal(f"{abs(other.ampere):.3g} A and {abs(one.ampere):.3g} A are not one rate")
    inner = np.clip(GRID, *COMPARED)
    moved = [
        np.interp(inner, b.soc, b.volt) - np.interp(inner, a.soc, a.volt)
        for a, b in zip(old, new, strict=True)
    ]
    half_distance = np.abs(moved[1] - moved[0]) / 2
    return OcvShift(GRID, (moved[0] + moved[1]) / 2, half_distance / np.sqrt(3))


def shifts_since_first(records, *, same_cycles=5.0):
    """Shift of the OCV of every later check-up against the first.

    Parameters
    ----------
    records : list of (test, cycle, record), each record as of `ocv_shift`.
    same_cycles : tests so near in cycles to the first are of the same check-up [1].

    Returns
    -------
    rows : list of dict: cycle, soc, shift_volt, shift_std_volt, test, reference_test.
    notes : list of str, what could not be compared and why.
    """
    first = min((cycle for _, cycle, _ in records), default=0.0)
    references = [entry for entry in records if entry[1] - first <= same_cycles]
    rows, notes = [], []
    for test, cycle, record in records:
        if cycle - first <= same_cycles:
            continue
        found, reason = _first_comparable(references, record)
        if found is None:
            notes.append(f"OCV shift of {test}: {reason}")
            continue
        facts = {"cycle": float(cycle), "test": test, "reference_test": found[0]}
        columns = [column.tolist() for column in found[1]]
        rows += [
            facts | dict(zip(OcvShift._fields, row, strict=True))
            for row in zip(*columns, strict=True)
        ]
    return rows, notes


def _first_comparable(references, record):
    """(test, shift) against the first reference that can be compared, or None and why not."""
    reason = "the first check-up has no capacity test"
    for test, _, reference in references:
        try:
            return (test, ocv_shift(reference, record)), ""
        except Refusal as refusal:
            reason = str(refusal)
    return None, reason


def _branches(current, voltage, charge, steps):
    """Discharge and charge branch of a record."""
    return [_branch(sign, (current, voltage, charge), steps) for sign in (-1, 1)]


def _branch(sign, columns, steps):
    current, voltage, charge = columns
    moved = sign * np.where(np.isin(steps.kind, ("CC", "CCCV")), steps.charge_ampere_hour, 0.0)
    step = int(np.argmax(moved))
    whole = moved[step] + _held(sign, step, steps)
    if moved[step] <= 0 or moved[step] < LEAST_SHARE * float(np.ptp(charge)):
        name = "charge" if sign > 0 else "discharge"
        raise Refusal(f"no {name} at one current over most of the capacity")
    first, held = int(steps.first_row[step]), int(steps.cv_first_row[step])
    last = held if held > first else int(steps.last_row[step]) + 1
    rows = slice(first, last)
    passed = sign * (charge[rows] - charge[max(first - 1, 0)]) / whole
    soc = passed if sign > 0 else 1 - passed
    order = np.argsort(soc)
    return _Branch(soc[order], voltage[rows][order], float(np.median(current[rows])))


def _held(sign, step, steps):
    """Charge of a hold that follows a step as a step of its own [Ah]."""
    after = step + 1
    if after >= len(steps.kind) or steps.kind[after] != "CV":
        return 0.0
    return max(sign * float(steps.charge_ampere_hour[after]), 0.0)
