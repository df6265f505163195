"""The model of one cell from its own tests: every condition, every member of the family."""

from typing import NamedTuple

import numpy as np

from cellwright.models.basis import REFERENCE_CELSIUS, soc_of
from cellwright.models.conditions import condition_entry, ocv_from_slow_branch, select
from cellwright.models.identify import identify
from cellwright.models.lookup import ocv_at
from cellwright.models.records import records_of
from cellwright.models.split import fit_mask
from cellwright.refusal import Refusal
from cellwright.series.anchor import REST_C_RATE

SCHEMA = "cellwright-model/1"
SAME_CELSIUS = 2.0
GRID = np.linspace(0.0, 1.0, 201)


class FitTest(NamedTuple):
    """A test that a model may be fitted to: its row of the sheet and its clean series."""

    facts: dict
    series: dict


def cell_model(cell, basis, tests, *, rc_branches, split_rest_second):
    """Identify every member of the circuit family at every temperature a cell was tested at.

    1. Tests of the earliest check-up are grouped by chamber temperature; at each, HPPC tests are
    used where there are any, else drives. Of a drive of role `split` only the odd blocks are
    fitted. 2. Where the OCV comes from one slow branch, its drop over the model's resistances is
    put back and the fit repeated. 3. The member with the smallest BIC over all conditions is the
    chosen one.

    Parameters
    ----------
    cell : dict, the cell's row of the sheet.
    basis : dict, from `basis.basis`.
    tests : list of FitTest, roles fit or split.
    rc_branches : numbers of RC branches, the members of the family.
    split_rest_second : shortest rest that cuts a record of role `split` [s].

    Returns
    -------
    model : dict of schema cellwright-model/1.

    Raises
    ------
    Refusal
        No OCV, or no condition could be identified; the reasons are named.
    """
    if not basis["ocv"]:
        raise Refusal("no OCV curve: neither a slow test of the cell nor one of its type")
    young, later = _by_age(tests)
    notes = [f"not fitted, of a later check-up: {', '.join(later)}"] if later else []
    conditions = []
    for celsius, group in _by_temperature(young):
        try:
            found = _records(group, basis, cell, split_rest_second, notes)
            conditions.append(_condition(celsius, found, basis, rc_branches))
        except Refusal as refusal:
            names = ", ".join(test.facts["test"] for test in group)
            notes.append(f"not identified at {celsius:g} °C ({names}): {refusal}")
    if not conditions:
        raise Refusal("; ".join(notes))
    members = [
        {"model": f"{n}RC", "conditions": [condition[n] for condition in conditions]}
        for n in rc_branches
    ]
    kinds = {test.facts["kind"] for test in young}
    return {
        "schema": SCHEMA,
        "cell": cell["cell"],
        "capacity_ampere_hour": basis["capacity_ampere_hour"],
        "borrowed_from": basis["borrowed_from"],
        "ocv": [condition["ocv"] for condition in conditions],
        "members": members,
        "chosen": select(members),
        "kind": "hppc" if "hppc" in kinds else "drive",
        "notes": notes,
    }


def _by_age(tests):
    """Tests of the earliest check-up, and the names of the others."""
    cycles = [test.facts["cycle"] or 0 for test in tests]
    first = min(cycles, default=0)
    pairs = list(zip(tests, cycles, strict=True))
    young = [test for test, cycle in pairs if cycle == first]
    return young, [test.facts["test"] for test, cycle in pairs if cycle > first]


def _by_temperature(tests):
    """(celsius, tests) of each condition, coldest first; HPPC tests displace drives."""
    groups = {}
    for test in sorted(tests, key=_celsius):
        near = [t for t in groups if abs(t - _celsius(test)) <= SAME_CELSIUS]
        groups.setdefault(near[0] if near else _celsius(test), []).append(test)
    for celsius, group in groups.items():
        pulses = [test for test in group if test.facts["kind"] == "hppc"]
        yield celsius, pulses or group


def _celsius(test):
    """Chamber temperature, else the mean on the cell's surface, else 25 °C as for the basis."""
    stated = test.facts["ambient_temperature_celsius"]
    if stated is not None:
        return stated
    measured = test.series.get("surface_temperature_celsius")
    return REFERENCE_CELSIUS if measured is None else float(np.nanmean(measured))


def _records(group, basis, cell, split_rest_second, notes):
    """Name and records of each usable test; one that cannot be used costs the others nothing."""
    found = {}
    for test in group:
        try:
            found[test.facts["test"]] = _record(test, basis, cell, split_rest_second, notes)
        except Refusal as refusal:
            notes.append(f"not fitted: {test.facts['test']}: {refusal}")
    if not found:
        raise Refusal("none of its tests can be used")
    return found


def _record(test, basis, cell, split_rest_second, notes):
    anchored = soc_of(test.series, basis, test.facts, cell)
    if test.facts["soc"] is None:
        notes.append(f"{test.facts['test']}: SoC by {anchored.anchor}")
    time, current = test.series["test_time_second"], test.series["current_ampere"]
    used = None
    if test.facts["role"] == "split":
        rest = REST_C_RATE * basis["capacity_ampere_hour"]
        used = fit_mask(time, current, rest_second=split_rest_second, rest_ampere=rest)
    return records_of(time, current, test.series["voltage_volt"], anchored.soc, used=used)


def _condition(celsius, found, basis, rc_branches):
    """Entries of one temperature by number of RC branches, and the OCV table they belong to."""
    records = [record for records in found.values() for record in records]
    curve = _nearest(basis["ocv"], celsius)
    ocv = ocv_at(_dated(basis["ocv"]), GRID, celsius)
    if curve["branches"] != "both":
        slow = curve[f"{curve['branches']}_current_ampere"]
        first = identify(records, GRID, ocv, n_rc=max(rc_branches))
        ocv = ocv_from_slow_branch(GRID, ocv, slow, first)
    entries = {"ocv": _table(celsius, ocv, curve)}
    for n_rc in rc_branches:
        fitted = identify(records, GRID, ocv, n_rc=n_rc)
        entry = condition_entry(fitted, ambient_temperature_celsius=celsius, tests=list(found))
        entries[n_rc] = entry
    return entries


def _table(celsius, ocv, curve):
    return {
        "ambient_temperature_celsius": celsius,
        "test": curve["test"],
        "branches": curve["branches"],
        "soc": GRID.tolist(),
        "ocv_volt": ocv.tolist(),
    }


def _dated(curves):
    """OCV tables with a temperature each: 25 °C where the sheet states none."""
    known = "ambient_temperature_celsius"
    return [c | {known: REFERENCE_CELSIUS if c[known] is None else c[known]} for c in curves]


def _nearest(curves, celsius):
    return min(_dated(curves), key=lambda c: abs(c["ambient_temperature_celsius"] - celsius))
