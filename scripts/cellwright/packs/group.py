"""Models of the cells of a parallel group, and the group simulated against its branch currents."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.circuits.model_file import plain_member
from cellwright.identification.cell import SCHEMA
from cellwright.numerics.statistics import rms
from cellwright.packs.branches import identify_branches, rest_offset
from cellwright.packs.parallel import group_of, simulate_parallel
from cellwright.records.basis import REFERENCE_CELSIUS
from cellwright.records.group import branch_currents, group_record, stated_soc
from cellwright.refusal import Refusal

KNOTS = 21
REST_SHARE = 0.02


def group_models(test, steps, cells):
    """Models of all cells of a group from the longest charge in its own record.

    1. The stretch runs from the end of the rest before the group's longest charge to the end of
    the rest after it; the branch sensors' offsets are what they read in the rest before.
    2. `branches.identify_branches` fits it. 3. What lies outside the stretch is left for scoring:
    each model says in `fitted` which part of the record it has seen.

    Parameters
    ----------
    test : MeasuredTest of the group, with branch_<k>_current_ampere.
    steps : dict of columns of stage `segment`.
    cells : names of the cells, in the order of the branches.

    Returns
    -------
    models : dict, cell → model of schema cellwright-model/2, kind "group".

    Raises
    ------
    Refusal
        No branch currents, no charge between two rests, or as `identify_branches`.
    """
    facts, series = test
    current = _logged(branch_currents(series))
    before, last = _charge_between_rests(steps)
    rest = slice(steps["first_row"][before], steps["last_row"][before] + 1)
    total = series["current_ampere"]
    tail = slice(max(rest.stop - (rest.stop - rest.start) // 2, rest.start), rest.stop)
    limit = REST_SHARE * np.abs(total).max()
    offset = rest_offset(current[tail], total[tail], rest_ampere=limit)
    rows = slice(rest.stop - 1, steps["last_row"][last] + 1)
    time = series["test_time_second"][rows]
    fit = identify_branches(time, current[rows] - offset, series["voltage_volt"][rows])
    fitted = {"test": facts.test, "from_second": float(time[0]), "to_second": float(time[-1])}
    celsius = _chamber_celsius(facts)
    note = (
        f"identified inside its group from the charge at {time[0]:.0f} to {time[-1]:.0f} s of "
        f"{facts.test} (fit {1e3 * fit.fit_rmse_volt:.1f} mV); the rest of the record scores it"
    )
    return {
        cell: _model(cell, fit.group, branch, celsius, fit.fit_rmse_volt, fitted, note)
        for branch, cell in enumerate(cells)
    }


def _logged(current):
    if current is None or current.shape[1] < 2:
        raise Refusal("the record has no currents of two or more branches")
    return current


# ASSUME: All cells of a group have the chamber's temperature, 25 °C where none is stated.
def _chamber_celsius(facts):
    stated = facts.ambient_temperature_celsius
    return REFERENCE_CELSIUS if stated is None else stated


def _charge_between_rests(steps):
    """Indices of the rests before and after the longest charge."""
    kind, charge = steps["kind"], steps["charge_ampere_hour"]
    rests = np.flatnonzero(kind == "rest")
    spans = [
        (charge[before + 1 : after].sum(), before, after)
        for before, after in pairwise(rests)
        if after > before + 1 and (steps["current_mean_ampere"][before + 1 : after] > 0).all()
    ]
    if not spans:
        raise Refusal("the record has no charge between two rests to identify its cells from")
    _, before, after = max(spans)
    return before, after


def _model(cell, group, branch, celsius, rmse, fitted, note):
    grid = np.linspace(0.0, 1.0, group.ocv_volt.shape[1])
    ocv = {"ambient_temperature_celsius": celsius, "soc": grid.tolist()}
    ocv |= {"ocv_volt": group.ocv_volt[branch].tolist(), "branches": "group"}
    condition = {"ambient_temperature_celsius": celsius} | _courses(group, branch, grid)
    condition |= {"fit_rmse_volt": rmse, "tests": [fitted["test"]]}
    return {
        "schema": SCHEMA,
        "cell": cell,
        "capacity_ampere_hour": float(group.capacity_ampere_hour[branch]),
        "borrowed_from": None,
        "ocv": [ocv],
        "members": [{"model": "1RC", "left_out_rmse_volt": None, "conditions": [condition]}],
        "chosen": "1RC",
        "kind": "group",
        "fitted": fitted,
        "notes": [note],
    }


def _courses(group, branch, grid):
    """What a condition of a model file says over SoC, of one branch of the group."""
    knots = np.linspace(0.0, 1.0, KNOTS)
    unknown = [None] * KNOTS

    def at_knots(table):
        return np.interp(knots, grid, table).tolist()

    pairs = zip(group.r_ohm[branch], group.tau_second[branch], strict=True)
    return {
        "soc": knots.tolist(),
        "r0_ohm": at_knots(group.r0_ohm[branch]),
        "r0_std_ohm": unknown,
        "branches": [
            {"kind": "RC", "r_ohm": at_knots(r), "r_std_ohm": unknown}
            | {"tau_second": at_knots(tau), "tau_std_second": unknown}
            for r, tau in pairs
        ],
        "ocv_shift_volt": [0.0] * KNOTS,
        "ocv_scale": {"missing": 0.0, "stretch": 0.0},
        "activation_energy_joule_per_mole": 0.0,
        "at_bound": [],
    }


class GroupValidation(NamedTuple):
    """Rows of scores, one a branch, the series they were taken from, sentences for the report."""

    rows: list
    series: dict
    notes: tuple


def validate_group(models, branches, test):
    """Simulate a group through its whole record and score what its models have not seen.

    Parameters
    ----------
    models : list of model dicts, in the order of the branches.
    branches : list of BranchFacts in the same order.
    test : MeasuredTest of the group, with branch_<k>_current_ampere.

    Returns
    -------
    validation : GroupValidation.

    Raises
    ------
    Refusal
        As many branch currents as branches are wanted; a SoC at the start must be known.
    """
    record = group_record(test, branches)
    measured = _logged(record.branch_current_ampere)
    time, total = record.test_time_second, record.current_ampere
    group = group_of(models, temperature_celsius=_chamber_celsius(test.facts))
    members = [plain_member(model) for model in models]
    notes = _replaced(models, members)
    wire = _wires(branches, notes)
    start = _initial_soc(stated_soc(test.facts, branches), group, record, notes)
    run = simulate_parallel(time, total, group, initial_soc=start, wire_resistance_ohm=wire)
    scored = _unseen(models, record, notes)
    rows = _rows(record, run, scored, branches, members, group)
    shown = ("test_time_second", "current_ampere", "voltage_volt")
    columns = {name: getattr(record, name) for name in shown}
    columns |= {"simulated_voltage_volt": run.voltage_volt, "scored": scored}
    for k in range(len(branches)):
        columns[f"branch_{k + 1}_current_ampere"] = measured[:, k]
        columns[f"simulated_branch_{k + 1}_current_ampere"] = run.branch_current_ampere[:, k]
    return GroupValidation(rows, columns, tuple(notes))


def _replaced(models, members):
    """What is said where a cell's chosen member is none that the parallel solver can run."""
    return [
        f"{model['cell']} simulated as {member}: its {model['chosen']} is more than RC pairs"
        for model, member in zip(models, members, strict=True)
        if member != model["chosen"]
    ]


def _wires(branches, notes):
    stated = [row.wire_resistance_ohm for row in branches]
    if None in stated:
        notes.append("wire resistances are not stated: taken as none beyond the cells' own")
    return np.array([0.0 if value is None else value for value in stated])


def _initial_soc(stated, group, record, notes):
    """As stated, else each cell's own SoC at the group's rest voltage at the start."""
    if None not in stated:
        return np.array(stated, float)
    total = record.current_ampere
    if abs(total[0]) > REST_SHARE * np.abs(total).max():
        raise Refusal("initial_soc is not stated in groups.tsv, and the record begins under load")
    # ASSUME: A group that starts at rest without a stated SoC is at equilibrium: the OCV of every
    # cell is the group's first voltage.
    notes.append("SoC at the start from the group's first voltage")
    grid = np.linspace(0.0, 1.0, group.ocv_volt.shape[1])
    rising = np.maximum.accumulate(group.ocv_volt, axis=1)
    looked_up = [np.interp(record.voltage_volt[0], curve, grid) for curve in rising]
    return np.array([v if s is None else s for s, v in zip(stated, looked_up, strict=True)])


def _unseen(models, record, notes):
    """Rows that no model was fitted to."""
    time = record.test_time_second
    unseen = np.ones(len(time), bool)
    for fitted in (model.get("fitted") for model in models):
        if fitted and fitted["test"] == record.test:
            unseen &= (time < fitted["from_second"]) | (time > fitted["to_second"])
    if not unseen.any():
        raise Refusal("the models were fitted to the whole record: nothing is left to score")
    if not unseen.all():
        notes.append(f"{np.mean(~unseen):.0%} of the record was fitted and is not scored")
    return unseen


def _rows(record, run, scored, branches, members, group):
    measured = record.branch_current_ampere
    total = run.branch_current_ampere.sum(axis=1) - record.current_ampere
    voltage_error = (record.voltage_volt - run.voltage_volt)[scored]
    rows = []
    for k, (branch, member) in enumerate(zip(branches, members, strict=True)):
        error = (measured[:, k] - run.branch_current_ampere[:, k])[scored]
        rows.append(
            {
                "branch": branch.position,
                "cell": branch.cell,
                "current_rmse_ampere": rms(error),
                "current_max_ampere": float(np.abs(error).max()),
                "voltage_rmse_volt": rms(voltage_error),
                "capacity_ampere_hour": float(group.capacity_ampere_hour[k]),
                "kcl_residual_ampere": float(np.abs(total).max()),
                "samples": int(scored.sum()),
                "model": member,
            }
        )
    return rows
