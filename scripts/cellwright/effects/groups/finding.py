"""The whole search for one parallel group: from its tests and cells' models to a verdict."""

from typing import NamedTuple

import numpy as np

from cellwright.effects.base import OCV_KNOTS
from cellwright.effects.finding import KEPT, ranking_of
from cellwright.effects.groups.case import GroupCase, GroupGates
from cellwright.effects.groups.model import (
    Branch,
    Shared,
    Spread,
    document,
    group_fields,
    group_run,
    smooth_ocv,
    smooth_shares,
)
from cellwright.effects.groups.records import group_stacked
from cellwright.effects.groups.verdict import group_verdict
from cellwright.effects.library.groups import GROUP_LIBRARY
from cellwright.effects.records import LOADED_C_RATE
from cellwright.effects.search import search
from cellwright.records.record import group_record
from cellwright.records.thinning import averaged_to
from cellwright.refusal import Refusal

ENERGY = "resistance_temperature.activation_energy_joule_per_mole"
FIRST_ROWS = 3


class GroupFinding(NamedTuple):
    """verdict : dict of the contract. ranking, series : dicts of columns. model : dict, see
    `model.document`. notes : tuple of str."""

    verdict: dict
    ranking: dict
    series: dict
    model: dict
    notes: tuple = ()


def group_finding(
    group,
    cells,
    records,
    *,
    initial_soc=None,
    settings=None,
    hold="zero_order",
    library=GROUP_LIBRARY,
):
    """Search a group for what one of its branches has of its own.

    Parameters
    ----------
    group : name. cells : sequence of Branch, in the order of the branches.
    records : sequence of (role, GroupRecord), role "fit" or "validation".
    initial_soc : (b,) stated SoC at the start of every record that states none of its own [1], or
        None: all alike, from the voltage of the first rows.
    settings : dict of tuples by name: "spread" (Spread), "shared" (Shared), "gates" (GroupGates);
        those that lack are at their defaults.
    hold : of the total current between rows, see `group_stacked`. library : dict of Effect by id.

    Returns
    -------
    finding : GroupFinding.

    Raises
    ------
    Refusal : no record to fit or none that judges; a record without a stated SoC that begins under
        load; see `group_stacked`.
    """
    case = _case(cells, records, initial_soc, settings or {}, hold)
    rounds = search(case, library)
    verdict = group_verdict(group, case, rounds, library)
    kept = rounds[-1].before if verdict["verdict"] in KEPT else rounds[0].before
    return GroupFinding(verdict, ranking_of(rounds), _series(case, rounds), document(case, kept))


def branch_of(cell, model, *, wire_ohm=0.0, own=True):
    """Branch from the model that the search for a missing effect left of a cell (`Finding.model`).

    Parameters
    ----------
    cell : name. model : dict with capacity_ampere_hour, ocv_volt on an even SoC grid, values.
    wire_ohm : stated resistance of its connection [ohm].
    own : the model is of this very cell, not of its type.

    Returns
    -------
    branch : Branch. Of the effects in the model only resistance over temperature is kept.
    """
    # ASSUME: What a cell's model has beside the plain circuit and its resistance over temperature
    # is alike in all cells of a group, so that it moves no current from one branch to another.
    values, ocv = model["values"], np.asarray(model["ocv_volt"], float)
    error = smooth_shares(len(ocv), OCV_KNOTS) @ [values[f"ocv[{k}]"] for k in range(OCV_KNOTS)]
    return Branch(
        cell,
        model["capacity_ampere_hour"] * (1.0 + values["capacity"]),
        ocv + error,
        tuple(float(np.exp(values[f"log_r{k}"])) for k in range(3)),
        tuple(float(np.exp(values[f"log_tau{k}"])) for k in (1, 2)),
        values.get(ENERGY, 0.0),
        wire_ohm,
        own,
    )


def _case(cells, records, initial_soc, settings, hold):
    tables = [len(cell.ocv_volt) for cell in cells]
    if len(set(tables)) > 1:
        raise Refusal(f"OCV tables of one length were wanted for all branches, not {tables}")
    stacks, socs = [], []
    cells = tuple(cell._replace(ocv_volt=smooth_ocv(cell.ocv_volt)) for cell in cells)
    for role in ("fit", "validation"):
        own = [record for given, record in records if given == role]
        if not own:
            raise Refusal(f"the group has no record of role {role}")
        stacks.append(group_stacked(own, branches=len(cells), hold=hold))
        socs.append(np.array([_stated(cells, record, initial_soc) for record in own]))
    if any(stack.branch_current_ampere is None for stack in stacks):
        stacks = [stack._replace(branch_current_ampere=None) for stack in stacks]
    defaults = {"spread": Spread(), "shared": Shared(), "gates": GroupGates()}
    return GroupCase(cells, *stacks, *socs, **{k: settings.get(k, v) for k, v in defaults.items()})


def _stated(cells, record, initial_soc):
    """SoC of all branches at the start of a record (b,)."""
    # ASSUME: Where no SoC is stated, a record begins with the group at rest and its cells alike.
    stated = initial_soc if record.initial_soc is None else record.initial_soc
    if stated is not None:
        return np.asarray(stated, float)
    rating = sum(cell.capacity_ampere_hour for cell in cells)
    if abs(record.current_ampere[0]) > LOADED_C_RATE * rating:
        raise Refusal(f"{record.test} begins under load, and no SoC at its start is stated")
    ocv = np.mean([cell.ocv_volt for cell in cells], axis=0)
    volt = np.median(record.voltage_volt[:FIRST_ROWS])
    found = np.interp(volt, np.maximum.accumulate(ocv), np.linspace(0.0, 1.0, len(ocv)))
    return np.full(len(cells), found)


def _series(case, rounds):
    """Fit and validation records: what was measured, and both models."""
    found = {}
    ends = rounds[0].before, rounds[-1].before
    for role, stack, soc in (
        ("fit", case.fit, case.fit_soc),
        ("validation", case.validation, case.validation_soc),
    ):
        runs = []
        for state in ends:
            values = state.solution.values if role == "fit" else state.values
            runs.append(group_run(group_fields(case.cells, soc, values, state.effects), stack))
        for name, column in _columns(role, stack, runs, case.cells).items():
            found.setdefault(name, []).append(column)
    return {name: np.concatenate(parts) for name, parts in found.items()}


def _columns(role, stack, runs, cells):
    before, after = runs
    capacity = np.array([cell.capacity_ampere_hour for cell in cells])
    share = capacity / capacity.sum()
    columns = {
        "role": np.full(len(stack.file), role),
        "test": np.array(stack.tests)[stack.file],
        "test_time_second": stack.second,
        "current_ampere": stack.current_ampere,
        "celsius": stack.celsius,
        "soc": after.soc @ share,
        "used": np.ones(len(stack.file), bool),
        "voltage_volt": stack.voltage_volt,
        "before_volt": before.voltage,
        "after_volt": after.voltage,
    }
    for b in range(stack.branches):
        if stack.branch_current_ampere is not None:
            columns[f"branch_{b + 1}_current_ampere"] = stack.branch_current_ampere[:, b]
        columns[f"before_branch_{b + 1}_current_ampere"] = before.current[:, b]
        columns[f"after_branch_{b + 1}_current_ampere"] = after.current[:, b]
        columns[f"soc_branch_{b + 1}"] = after.soc[:, b]
    return columns


LEAST_TESTS = 3  # of role fit, where none is for proof: every third one then judges
SECTIONS = {"spread": Spread, "shared": Shared, "gates": GroupGates}


class KnownCell(NamedTuple):
    """What a branch's cell is known by.

    model : dict, as a search leaves it (`finding.Finding.model`); None where there is none.
    source : name of the cell that it is the model of: this very one, or one of its type.
    """

    model: dict | None
    source: str


def missing_group_effect(group, branches, known, tests, *, settings):
    """Search a group of the campaign's sheets for what one of its branches has of its own.

    Parameters
    ----------
    group : name. branches : list of BranchFacts in order of position.
    known : list of KnownCell in that order. tests : list of MeasuredTest of kind `group`.
    settings : dict: most_rows, and those of Spread, Shared and GroupGates by name under "spread",
        "shared" and "gates".

    Returns
    -------
    finding : group_finding.GroupFinding, with the notes of its preparation.

    Raises
    ------
    Refusal : a branch without a model; nothing to fit or nothing that judges; see `group_finding`.
    """
    cells = _cells(branches, known)
    notes = [
        f"{row.cell} is known by its type only, from {one.source}"
        for row, one in zip(branches, known, strict=True)
        if one.source != row.cell
    ]
    sides = _sides(tests, notes)
    records = []
    for role, side in sides.items():
        made = [group_record(test, branches) for test in side]
        notes += [
            f"{one.test}: branch currents were not logged"
            for one in made
            if one.branch_current_ampere is None
        ]
        few = averaged_to(made, most_rows=settings["most_rows"])
        records += [(role, one) for one in few]
    chosen = {name: kind(**settings[name]) for name, kind in SECTIONS.items()}
    # ASSUME: A group's current was logged as its cells' were: it moves between two rows as their
    # own tests were best explained by.
    hold = known[0].model["hold"]
    found = group_finding(group, cells, records, settings=chosen, hold=hold)
    return found._replace(notes=(*notes, *found.notes))


def _cells(branches, known):
    lacking = [r.cell for r, one in zip(branches, known, strict=True) if one.model is None]
    if lacking:
        raise Refusal(
            f"no model of {', '.join(lacking)} by itself, and none of its type: a branch is held "
            "against what its cell is known to be, from a test to fit and one for proof"
        )
    return [
        branch_of(
            row.cell,
            one.model,
            wire_ohm=row.wire_resistance_ohm or 0.0,
            own=one.source == row.cell,
        )
        for row, one in zip(branches, known, strict=True)
    ]


def _sides(tests, notes):
    """Tests that are fitted and that judge."""
    split = [test.facts.test for test in tests if test.facts.role == "split"]
    if split:
        notes.append(
            f"not used, of role split: {', '.join(split)}: behind a cut the branches carry on "
            "unequal, and a group's record has to begin at rest"
        )
    sides = {
        role: [test for test in tests if test.facts.role == role] for role in ("fit", "validation")
    }
    if not sides["validation"] and len(sides["fit"]) >= LEAST_TESTS:
        fitted = sides["fit"]
        sides = {"fit": [t for k, t in enumerate(fitted) if k % 3 != 2], "validation": fitted[2::3]}
        names = ", ".join(test.facts.test for test in sides["validation"])
        notes.append(f"no test of role validation: {names} judged instead, and were not fitted")
    if not sides["fit"] or not sides["validation"]:
        have = ", ".join(f"{t.facts.test} ({t.facts.role})" for t in tests) or "none"
        raise Refusal(
            f"tests of the group: {have}; one of role fit and another of role validation were "
            "wanted (or three to fit): what a test was fitted to it cannot prove"
        )
    return sides
