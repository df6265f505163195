"""The search of one parallel group: from its tests and its cells' models to a verdict."""

from typing import NamedTuple

import numpy as np

from cellwright.effects.finding import KEPT, ranking_of
from cellwright.effects.groups.branch import branch_of, smooth_ocv
from cellwright.effects.groups.case import GroupCase
from cellwright.effects.groups.model import document
from cellwright.effects.library.groups import GROUP_LIBRARY
from cellwright.effects.records import group_stacked, parts_of, two_temperatures
from cellwright.effects.search import search
from cellwright.effects.state import SIDES
from cellwright.effects.story.messages import say
from cellwright.effects.story.result import Finding
from cellwright.effects.story.sizes import Fitted
from cellwright.effects.story.words import paragraph
from cellwright.effects.verdict import outcome, verdict_of
from cellwright.numerics.least_squares import covariances
from cellwright.numerics.statistics import rms
from cellwright.records import inputs
from cellwright.records.conditions import at_rest_in_record, low_current
from cellwright.records.record import group_record
from cellwright.records.thinning import averaged_to
from cellwright.refusal import Refusal

FIRST_ROWS = 3
LEAST_TESTS = 3  # of role fit, where none is for proof: every third one then judges
PARTS = 3


def group_finding(
    group,
    cells,
    records,
    *,
    initial_soc=None,
    hold="zero_order",
    library=GROUP_LIBRARY,
):
    """Verdict on a group: which effect one of its branches has, with ranking and series.

    Parameters
    ----------
    group : name. cells : sequence of Branch, in the order of the branches.
    records : sequence of (role, Record of a group), role "fit" or "validation".
    initial_soc : (b,) stated SoC at the start of every record that states none of its own [1], or
        None: all alike, from the voltage of the first rows.
    hold : of the total current between rows, see `group_stacked`. library : dict of Effect by id.

    Returns
    -------
    finding : Finding, its ranking, series and model alone.

    Raises
    ------
    Refusal : no record to fit or none that judges; a record without a stated SoC that begins under
        load; see `group_stacked`.
    """
    case = _case(cells, records, initial_soc, hold)
    found = search(case, library)
    solution, parts = found.last.solution, parts_of(case.fit)
    channels = len(solution.whitened) // len(parts)
    fitted = Fitted(solution.names, covariances(solution, np.tile(parts, channels)))
    result = outcome(found, fitted)
    verdict = group_verdict(group, found, result, fitted.stds, library)
    kept = found.last if verdict["verdict"] in KEPT else found.first
    return Finding(
        verdict,
        ranking=ranking_of(found, result),
        series=_series(case, found.first, result.last),
        model=document(case, kept),
    )


def _case(cells, records, initial_soc, hold):
    tables = [len(cell.ocv_volt) for cell in cells]
    if len(set(tables)) > 1:
        raise Refusal(f"OCV tables of one length were wanted for all branches, not {tables}")
    stacks = []
    cells = tuple(cell._replace(ocv_volt=smooth_ocv(cell.ocv_volt)) for cell in cells)
    for role in ("fit", "validation"):
        of_role = [record for given, record in records if given == role]
        if not of_role:
            raise Refusal(f"the group has no record of role {role}")
        stack = group_stacked(of_role, branches=len(cells), hold=hold)
        starts = [_stated(cells, record, initial_soc) for record in of_role]
        stacks.append(stack._replace(soc_at_start=np.array(starts)))
    if any(stack.branch_current_ampere is None for stack in stacks):
        stacks = [stack._replace(branch_current_ampere=None) for stack in stacks]
    return GroupCase(cells, *stacks)


def _stated(cells, record, initial_soc):
    """SoC of all branches at the start of a record (b,)."""
    # ASSUME: Where no SoC is stated, a record begins with the group at rest and its cells alike.
    stated = initial_soc if record.initial_soc is None else record.initial_soc
    if stated is not None:
        return np.asarray(stated, float)
    rating = sum(cell.capacity_ampere_hour for cell in cells)
    if not low_current(record.current_ampere[0], rating):
        raise Refusal(f"{record.test} begins under load, and no SoC at its start is stated")
    ocv = np.mean([cell.ocv_volt for cell in cells], axis=0)
    volt = np.median(record.voltage_volt[:FIRST_ROWS])
    soc = np.interp(volt, np.maximum.accumulate(ocv), np.linspace(0.0, 1.0, len(ocv)))
    return np.full(len(cells), soc)


def _series(case, *ends):
    """Columns of all records: what was measured, and both models (healthy, with effects)."""
    columns = {}
    capacity = np.array([cell.capacity_ampere_hour for cell in case.cells])
    for side in SIDES:
        stack = case.stack(side)
        before, after = (case.run(side, state.values_on(side), state.effects) for state in ends)
        of_side = {
            "role": np.full(len(stack.file), side),
            "test": np.array(stack.tests)[stack.file],
            "test_time_second": stack.second,
            "current_ampere": stack.current_ampere,
            "celsius": stack.celsius,
            "soc": after.soc @ (capacity / capacity.sum()),
            "used": np.ones(len(stack.file), bool),
            "voltage_volt": stack.voltage_volt,
            "before_volt": before.voltage,
            "after_volt": after.voltage,
        }
        for b in range(len(case.cells)):
            if stack.branch_current_ampere is not None:
                of_side[f"branch_{b + 1}_current_ampere"] = stack.branch_current_ampere[:, b]
            of_side[f"before_branch_{b + 1}_current_ampere"] = before.current[:, b]
            of_side[f"after_branch_{b + 1}_current_ampere"] = after.current[:, b]
            of_side[f"soc_branch_{b + 1}"] = after.soc[:, b]
        for name, column in of_side.items():
            columns.setdefault(name, []).append(column)
    return {name: np.concatenate(parts) for name, parts in columns.items()}


class KnownCell(NamedTuple):
    """Model of a branch's cell, and whose it is.

    model : dict, as a search leaves it (`story.result.Finding.model`); None where there is none.
    source : name of the cell that it is the model of: this very one, or one of its type.
    """

    model: dict | None
    source: str


def missing_group_effect(group, branches, known_cells, tests):
    """Effects that one branch of a parallel group has and the others have not.

    group : its name. branches : in order of position.
    known_cells : `effects.groups.finding.KnownCell` of each branch.
    tests : of the group, with branch currents.

    Returns as `missing_effect`, with empty residual_map and evidence. Raises
    Refusal: a branch without a model, no test to fit, or none for validation.
    Source: docs/missing-effect.md.
    """
    branches, tests = [*map(inputs.branch_facts, branches)], inputs.tests(tests)
    models = [KnownCell(inputs.content(model), source) for model, source in known_cells]
    cells = _cells(branches, models)
    notes = [
        f"{row.cell} is known by its type only, from {cell.source}"
        for row, cell in zip(branches, models, strict=True)
        if cell.source != row.cell
    ]
    sides = _sides(tests, notes)
    records = []
    for role, side in sides.items():
        made = [group_record(test, branches) for test in side]
        notes += [
            f"{record.test}: branch currents were not logged"
            for record in made
            if record.branch_current_ampere is None
        ]
        records += [(role, record) for record in averaged_to(made)]
    # ASSUME: A group's current was logged as its cells' were: between two rows it is held, or
    # moves on a straight line, as in the model of the first cell.
    hold = models[0].model["hold"]
    finding = group_finding(group, cells, records, hold=hold)
    return finding._replace(notes=(*notes, *finding.notes)).result()


def _cells(branches, models):
    lacking = [row.cell for row, cell in zip(branches, models, strict=True) if cell.model is None]
    if lacking:
        raise Refusal(
            f"no model of {', '.join(lacking)} by itself, and none of its type: a branch is held "
            "against what its cell is known to be, from a test to fit and one for proof"
        )
    return [
        branch_of(
            row.cell,
            cell.model,
            wire_ohm=row.wire_resistance_ohm or 0.0,
            own=cell.source == row.cell,
        )
        for row, cell in zip(branches, models, strict=True)
    ]


def _sides(tests, notes):
    """Tests that are fitted and that judge, by role; adds notes on the others."""
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
            f"found tests of the group: {have}; a verdict needs one of role fit and one of role "
            "validation, or three of role fit, for a test that is fitted proves nothing"
        )
    return sides


def group_verdict(group, found, result, deviations, library):
    """Verdict of a group as dict of the contract.

    Parameters
    ----------
    group : name. found : search.Search of a GroupCase. result : verdict.Outcome of it.
    deviations : see `verdict.outcome`. library : dict of Effect by id.

    Returns
    -------
    verdict : dict of the contract; each effect has its `branch` (1 is the first), `cell`, and
    `branch_alternatives`, branches that predict as well by the same effect. `rmse_volt` is of the
    branch currents times their cells' ohmic resistance, of the voltage where none were logged:
    "before" is of the model that was fitted without the effect, bent towards it as far as the
    declared spread allows. What the last model would leave with its effects taken out is
    `without_effects_volt`; where most of the gap lay, `gap_at`.
    """
    case = found.case
    if any(_alternatives(found, one) for one in result.names) and result.word == "named":
        result = result._replace(word="ambiguous")
    if result.word == "unknown" and not result.names and not case.sensors:
        result = result._replace(word="none", adequate=True)
    # Ids of effects that at a plausible size would show in some branch.
    shown = set(found.possible) - set(found.hidden)
    visible = {found.possible[key].id for key in shown}
    verdict = verdict_of(
        *(group, found, result, _located(case, result.last), deviations),
        next_test=_next_test(found, result.names, library),
        not_testable=sorted(set(library) - visible),
    )
    for entry, one in zip(verdict["effects"] or verdict["partial"], result.names, strict=True):
        entry |= _of_branch(found, one, entry["parameters"])
    names = [name for one in result.names for name in one.effect.names]
    verdict |= {
        "without_effects_volt": _without(case, result.last, names),
        "branch_currents": case.sensors,
        "gap_at": _located(case, found.first) if names else None,
    }
    return verdict | {"paragraph": paragraph(verdict, library)}


def _without(case, state, names):
    """Errors of a model on both kinds of records with some of its effects taken out [V]."""
    errors = {}
    for side in SIDES:
        absent = state.values_on(side) | dict.fromkeys(names, 0.0)
        without = case.predict(side, absent, state.effects)
        errors[side] = rms(case.in_volt(case.measured(side) - without))
    return errors


def _of_branch(found, one, parameters):
    """What the entry of an effect of a branch has of its own."""
    effect = one.effect
    number = {"value": effect.position + 1, "std": None, "unit": "1", "at_bound": False}
    tied = [found.possible[key] for key in one.tied]
    return {
        "parameters": parameters | {"branch": number},
        "alternatives": _alternatives(found, one),
        "branch": effect.position + 1,
        "cell": found.case.cells[effect.position].cell,
        "branch_alternatives": [other.position + 1 for other in tied if other.id == effect.id],
    }


def _alternatives(found, one):
    """Ids of other effects that predict as well, or that these data cannot tell apart."""
    chosen = one.effect.id
    names = {found.possible[key].id for key in one.tied}
    if not found.case.sensors:
        names |= {effect.id for effect in found.possible.values()}
    if not two_temperatures(found.case.fit):
        names |= {tie.partner for tie in one.effect.ties if tie.one_temperature}
    return sorted(names - {chosen})


def _next_test(found, names, library):
    """Advice on the next test in words: on logging, or to break the first tie; None."""
    if not found.case.sensors:
        return say("next.log_branches")
    tied = next((one for one in names if _alternatives(found, one)), None)
    if tied is None:
        return None
    chosen, others = tied.effect.id, _alternatives(found, tied)
    pairs = [(tie, {name, tie.partner}) for name in (chosen, *others) for tie in library[name].ties]
    warm = [tie.check for tie, pair in pairs if tie.one_temperature and pair <= {chosen, *others}]
    if warm and not two_temperatures(found.case.fit):
        return say("next.group", tests=warm[0])
    shows = (library[chosen].shows, library[others[0]].shows)
    return say("next.group", tests=say("next.and_test").join(dict.fromkeys(shows)))


def _located(case, state):
    """Third of a validation record, and branch, with most of the squared residual."""
    stack = case.validation
    squares = np.square(case.in_volt(state.validation))
    places = [
        (float(squares[b, rows].sum()), k, b, rows)
        for k in range(len(stack.first))
        for rows in np.array_split(np.flatnonzero(stack.file == k), PARTS)
        for b in range(len(squares))
    ]
    most, record, b, rows = max(places, key=lambda place: place[0])
    soc = case.run("validation", state.values, state.effects).soc[rows]
    soc = soc[:, b] if case.sensors else soc.mean(axis=1)
    ampere = stack.current_ampere[rows]
    rest = at_rest_in_record(ampere)
    many = {"discharge": (ampere < 0) & ~rest, "charge": (ampere > 0) & ~rest, "rest": rest}
    return {
        "file": stack.tests[record],
        "branch": b + 1 if case.sensors else None,
        "second": [float(stack.second[rows[0]]), float(stack.second[rows[-1]])],
        "soc": [float(np.clip(end, 0.0, 1.0)) for end in (soc.min(), soc.max())],
        "current": max(many, key=lambda name: many[name].sum()),
        "temperature_celsius": [float(stack.celsius[rows].mean())],
        "share": most / max(float(squares.sum()), 1e-30),
    }
