"""A parallel group simulated from its models through its record, and scored."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.model_file import plain_member
from cellwright.numerics.statistics import rms
from cellwright.packs.identify import REST_SHARE, _logged
from cellwright.packs.parallel import group_of, simulate_parallel
from cellwright.records.basis import stated_or_reference
from cellwright.records.record import group_record, stated_soc
from cellwright.refusal import Refusal


class GroupValidation(NamedTuple):
    """Rows of scores, one a branch, the series they were taken from, sentences for the report."""

    rows: list
    series: dict
    notes: tuple


def validate_group(models, branches, test):
    """Group simulated through its whole record, scored on the rows not used for the fit.

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
    group = group_of(
        models, temperature_celsius=stated_or_reference(test.facts.ambient_temperature_celsius)
    )
    members = [plain_member(model) for model in models]
    notes = _replaced(models, members)
    wire = _wires(branches, notes)
    start = _initial_soc(stated_soc(test.facts, branches), group, record, notes)
    run = simulate_parallel(time, total, group, initial_soc=start, wire_resistance_ohm=wire)
    scored = _unseen(models, record, notes)
    rows = _rows(record, run, scored, branches, members, group)
    names = ("test_time_second", "current_ampere", "voltage_volt")
    columns = {name: getattr(record, name) for name in names}
    columns |= {"simulated_voltage_volt": run.voltage_volt, "scored": scored}
    for k in range(len(branches)):
        columns[f"branch_{k + 1}_current_ampere"] = measured[:, k]
        columns[f"simulated_branch_{k + 1}_current_ampere"] = run.branch_current_ampere[:, k]
    return GroupValidation(rows, columns, tuple(notes))


def _replaced(models, members):
    """Notes on cells simulated by another member than the chosen one."""
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
    """SoC of each cell at the start (cells,): stated, else from the rest voltage at the start."""
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
    """Rows (n,) of the record outside the stretch that the models were fitted to."""
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
