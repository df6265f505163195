"""From a group's tests and its cells' models to records and branches that can be searched."""

from typing import NamedTuple

import numpy as np

from cellwright.effects.group_case import GroupGates
from cellwright.effects.group_finding import branch_of, group_finding
from cellwright.effects.group_free import Shared, Spread
from cellwright.effects.group_records import GroupRecord
from cellwright.effects.prepare import celsius_of
from cellwright.refusal import Refusal

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
    group : name. branches : list of dict, the group's rows of groups.tsv in order of position.
    known : list of KnownCell in that order. tests : list of models.cell.FitTest of kind `group`.
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
        f"{row['cell']} is known by its type only, from {one.source}"
        for row, one in zip(branches, known, strict=True)
        if one.source != row["cell"]
    ]
    sides = _sides(tests, notes)
    records = []
    for role, side in sides.items():
        made = [_record(test, branches, notes) for test in side]
        records += [(role, one) for one in thinned(made, settings["most_rows"])]
    chosen = {name: kind(**settings[name]) for name, kind in SECTIONS.items()}
    # ASSUME: A group's current was logged as its cells' were: it moves between two rows as their
    # own tests were best explained by.
    hold = known[0].model["hold"]
    found = group_finding(group, cells, records, settings=chosen, hold=hold)
    return found._replace(notes=(*notes, *found.notes))


def _cells(branches, known):
    lacking = [r["cell"] for r, one in zip(branches, known, strict=True) if one.model is None]
    if lacking:
        raise Refusal(
            f"no model of {', '.join(lacking)} by itself, and none of its type: a branch is held "
            "against what its cell is known to be, from a test to fit and one for proof"
        )
    return [
        branch_of(
            row["cell"],
            one.model,
            wire_ohm=row["wire_resistance_ohm"] or 0.0,
            own=one.source == row["cell"],
        )
        for row, one in zip(branches, known, strict=True)
    ]


def _sides(tests, notes):
    """Tests that are fitted and that judge."""
    split = [test.facts["test"] for test in tests if test.facts["role"] == "split"]
    if split:
        notes.append(
            f"not used, of role split: {', '.join(split)}: behind a cut the branches carry on "
            "unequal, and a group's record has to begin at rest"
        )
    sides = {
        role: [test for test in tests if test.facts["role"] == role]
        for role in ("fit", "validation")
    }
    if not sides["validation"] and len(sides["fit"]) >= LEAST_TESTS:
        fitted = sides["fit"]
        sides = {"fit": [t for k, t in enumerate(fitted) if k % 3 != 2], "validation": fitted[2::3]}
        names = ", ".join(test.facts["test"] for test in sides["validation"])
        notes.append(f"no test of role validation: {names} judged instead, and were not fitted")
    if not sides["fit"] or not sides["validation"]:
        have = ", ".join(f"{t.facts['test']} ({t.facts['role']})" for t in tests) or "none"
        raise Refusal(
            f"tests of the group: {have}; one of role fit and another of role validation were "
            "wanted (or three to fit): what a test was fitted to it cannot prove"
        )
    return sides


def _record(test, branches, notes):
    series, facts = test.series, test.facts
    names = [f"branch_{k}_current_ampere" for k in range(1, len(branches) + 1)]
    logged = [name for name in series if name.startswith("branch_")]
    if logged and sorted(logged) != sorted(names):
        found = f"{len(logged)} branch currents for {len(branches)} branches of groups.tsv"
        raise Refusal(f"{facts['test']} has {found}")
    if not logged:
        notes.append(f"{facts['test']}: branch currents were not logged")
    return GroupRecord(
        facts["test"],
        series["test_time_second"],
        series["current_ampere"],
        series["voltage_volt"],
        celsius_of(facts, series),
        np.column_stack([series[name] for name in names]) if logged else None,
        _initial_soc(facts, branches),
    )


def _initial_soc(facts, branches):
    """As the test says, else as groups.tsv says, else None: from the first voltage."""
    stated = [row["initial_soc"] for row in branches]
    if facts["soc"] is not None:
        stated = [facts["soc"]] * len(branches)
    return None if None in stated else np.array(stated, float)


def thinned(records, most_rows):
    """Records averaged over 1, 2, 4 … s where they are sampled faster, to so many rows in all.

    Parameters
    ----------
    records : list of GroupRecord. most_rows : int.

    Returns
    -------
    records : list of GroupRecord; a mean is of what is linear between rows.
    """
    width, found = 1.0, [_averaged(record, 1.0) for record in records]
    while sum(len(r.test_time_second) for r in found) > most_rows:
        width *= 2
        found = [_averaged(record, width) for record in records]
    return found


def _averaged(record, width_second):
    steps = np.diff(record.test_time_second)
    if not len(steps) or np.median(steps) >= 0.8 * width_second:
        return record
    _, bins = np.unique(np.floor(record.test_time_second / width_second), return_inverse=True)
    count = np.bincount(bins)

    def mean(column):
        return np.bincount(bins, column) / count

    own = record.branch_current_ampere
    names = ("test_time_second", "current_ampere", "voltage_volt", "celsius")
    return record._replace(
        **{name: mean(getattr(record, name)) for name in names},
        branch_current_ampere=None if own is None else np.stack([mean(c) for c in own.T], axis=1),
    )
