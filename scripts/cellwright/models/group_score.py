"""A parallel group simulated from its cells' models, against its measured branch currents."""

from typing import NamedTuple

import numpy as np

from cellwright.models.basis import REFERENCE_CELSIUS
from cellwright.models.group_models import REST_SHARE, branch_currents
from cellwright.models.pack import group_of, simulate_parallel
from cellwright.models.plain import plain_member
from cellwright.refusal import Refusal


class GroupValidation(NamedTuple):
    """Rows of scores, one a branch, the series they were taken from, sentences for the report."""

    rows: list
    series: dict
    notes: tuple


def validate_group(models, branches, series, *, test, celsius):
    """Simulate a group through its whole record and score what its models have not seen.

    Parameters
    ----------
    models : list of model dicts, in the order of the branches.
    branches : list of dict, rows of groups.tsv in the same order.
    series : dict of (n,) columns with branch_<k>_current_ampere.
    test : name of the record.
    celsius : chamber temperature [°C], None: taken as 25.

    Returns
    -------
    validation : GroupValidation.

    Raises
    ------
    Refusal
        As many branch currents as branches are wanted; a SoC at the start must be known.
    """
    measured = branch_currents(series)
    if measured.shape[1] != len(branches):
        found = f"{measured.shape[1]} branch currents for {len(branches)} branches of groups.tsv"
        raise Refusal(f"the record has {found}")
    time, total = series["test_time_second"], series["current_ampere"]
    celsius = REFERENCE_CELSIUS if celsius is None else celsius
    group = group_of(models, temperature_celsius=celsius)
    members = [plain_member(model) for model in models]
    notes = _replaced(models, members)
    wire = _wires(branches, notes)
    start = _initial_soc(branches, group, series, notes)
    run = simulate_parallel(time, total, group, initial_soc=start, wire_resistance_ohm=wire)
    scored = _unseen(models, time, test, notes)
    rows = _rows(measured, run, series, scored, branches, members, group)
    columns = {n: series[n] for n in ("test_time_second", "current_ampere", "voltage_volt")}
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
    stated = [row["wire_resistance_ohm"] for row in branches]
    if None in stated:
        notes.append("wire resistances are not stated: taken as none beyond the cells' own")
    return np.array([0.0 if value is None else value for value in stated])


def _initial_soc(branches, group, series, notes):
    """As stated, else each cell's own SoC at the group's rest voltage at the start."""
    stated = [row["initial_soc"] for row in branches]
    if None not in stated:
        return np.array(stated, float)
    total = series["current_ampere"]
    if abs(total[0]) > REST_SHARE * np.abs(total).max():
        raise Refusal("initial_soc is not stated in groups.tsv, and the record begins under load")
    # ASSUME: A group that starts at rest without a stated SoC is at equilibrium: the OCV of every
    # cell is the group's first voltage.
    notes.append("SoC at the start from the group's first voltage")
    grid = np.linspace(0.0, 1.0, group.ocv_volt.shape[1])
    rising = np.maximum.accumulate(group.ocv_volt, axis=1)
    found = [np.interp(series["voltage_volt"][0], curve, grid) for curve in rising]
    return np.array([v if s is None else s for s, v in zip(stated, found, strict=True)])


def _unseen(models, time, test, notes):
    """Rows that no model was fitted to."""
    unseen = np.ones(len(time), bool)
    for fitted in (model.get("fitted") for model in models):
        if fitted and fitted["test"] == test:
            unseen &= (time < fitted["from_second"]) | (time > fitted["to_second"])
    if not unseen.any():
        raise Refusal("the models were fitted to the whole record: nothing is left to score")
    if not unseen.all():
        notes.append(f"{np.mean(~unseen):.0%} of the record was fitted and is not scored")
    return unseen


def _rows(measured, run, series, scored, branches, members, group):
    total = run.branch_current_ampere.sum(axis=1) - series["current_ampere"]
    voltage_error = (series["voltage_volt"] - run.voltage_volt)[scored]
    rows = []
    for k, (branch, member) in enumerate(zip(branches, members, strict=True)):
        error = (measured[:, k] - run.branch_current_ampere[:, k])[scored]
        rows.append(
            {
                "branch": branch["position"],
                "cell": branch["cell"],
                "current_rmse_ampere": float(np.sqrt(np.mean(error**2))),
                "current_max_ampere": float(np.abs(error).max()),
                "voltage_rmse_volt": float(np.sqrt(np.mean(voltage_error**2))),
                "capacity_ampere_hour": float(group.capacity_ampere_hour[k]),
                "kcl_residual_ampere": float(np.abs(total).max()),
                "samples": int(scored.sum()),
                "model": member,
            }
        )
    return rows
