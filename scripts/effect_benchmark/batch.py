"""Answers for one batch of cells: the search, the true class left out, and the controls."""

import json
import time
from typing import NamedTuple

import numpy as np

from cellwright.effects import prepare, search
from cellwright.effects.finding import settings_of
from cellwright.effects.library import LIBRARY
from cellwright.effects.paired import paired
from cellwright.effects.search import matters, significant
from cellwright.refusal import Refusal
from effect_benchmark import answers, controls, groups, loading
from effect_benchmark.methods import BIC, EXTRA, LEFT_OUT, PERMUTED, RANDOM, SEARCH, VALIDATION
from runtime.artefact import plain

SETTLED = ("clean", "segment", "ocv")
NAN = float("nan")
MOST_ROWS = 40_000  # where the config says nothing


class Task(NamedTuple):
    """What a batch works on: a campaign, the stages' settings, what cells borrow, and choices.

    settings : of the search, as `finding.missing_effect` takes them. left_out : ids that the second
    search of a cell does without, by cell. paired_chemistry : of cells that are held against their
    references. seed : of the controls. control_every : which part of the cells has second search
    and controls. of_groups : settings of the search in groups.
    """

    place: loading.Place
    steps: loading.Steps
    known: dict
    settings: dict
    left_out: dict
    paired_chemistry: str
    seed: int
    control_every: int
    of_groups: dict


def task(folder, left_out: dict, config: dict) -> Task:
    """What all cells of a campaign share; its truth is not looked at.

    Parameters
    ----------
    folder : of the campaign. left_out : ids by cell.
    config : sections clean, segment, ocv, models, missing_effect, missing_effect_group and
    benchmark.
    """
    place, chosen = loading.place(folder), config["benchmark"]
    steps = loading.Steps(*(config[name] for name in SETTLED))
    known = loading.lenders(place, steps)
    split = {"split_rest_second": config["models"]["split_rest_second"]}
    settings = {"most_rows": MOST_ROWS} | config["missing_effect"] | split
    names = ("paired_chemistry", "seed", "control_every")
    choices = (left_out, *(chosen[name] for name in names))
    return Task(place, steps, known, settings, *choices, config["missing_effect_group"])


def answered(work: Task, number: int, of: int) -> list[dict]:
    """Rows of every `of`-th cell of a campaign, from the one with this number: one row a method."""
    rows = []
    for place, cell in list(enumerate(loading.searched(work.place)))[number::of]:
        try:
            rows += _rows(work, cell, place % work.control_every == 0)
        except Refusal as refusal:
            rows.append(_row(cell, SEARCH, None, reason=str(refusal)))
    return rows


def _rows(work, cell, controlled):
    if cell in work.place.branches:
        return _group_rows(work, cell)
    case = _case(work, cell)
    if work.place.cells[cell]["chemistry"] == work.paired_chemistry:
        return _paired_rows(work, cell, case)
    return _cell_rows(work, cell, case, controlled)


def _case(work, cell):
    """As `finding.missing_effect` lays it out."""
    row, basis, tests = loading.loaded(work.place, cell, work.known, work.steps)
    mine = [test for test in tests if test.facts.kind in prepare.KINDS]
    gates, tolerance = settings_of(work.settings)
    options = {"tolerance": tolerance, "gates": gates, "settings": work.settings}
    return prepare.prepared(row, basis, mine, **options).case


def _group_rows(work, group):
    """A group beside what its cells are by themselves, in each way to look at it."""
    branches = work.place.branches[group]
    cells = [groups.known(row.cell, _case(work, row.cell)) for row in branches]
    tests = loading.tests_of(work.place, group, work.steps)
    return [
        _row(group, method, said, rounds=len(said["effects"]) + 1 if said else 0, **cost)
        for method, said, cost in groups.answers(group, branches, cells, tests, work.of_groups)
    ]


def _paired_rows(work, cell, case):
    """A cell beside the reference cells of its type."""
    alike = work.known.get(work.paired_chemistry, [])
    references = {one.cell: _case(work, one.cell) for one in alike}
    return [_searched(cell, paired(case, references).case)[0]]


def _searched(cell, case):
    """(row of the search, its rounds)"""
    begun = time.process_time()
    rounds = search.search(case, LIBRARY)
    spent = time.process_time() - begun
    said = answers.verdict(cell, rounds, case.gates)
    return _row(cell, SEARCH, said, rounds=len(rounds), cpu_second=spent), rounds


def _cell_rows(work, cell, case, controlled):
    row, rounds = _searched(cell, case)
    first, gates = rounds[0], case.gates
    rows = [row, _row(cell, BIC, answers.bic_alone(first, gates))]
    rows.append(_row(cell, VALIDATION, answers.validation_alone(first, gates)))
    if not controlled:
        return rows
    if without := work.left_out.get(cell):
        rest = {name: one for name, one in LIBRARY.items() if name not in without}
        other = answers.verdict(cell, search.search(case, rest), gates)
        rows.append(_row(cell, LEFT_OUT, other))
    return rows + _control_rows(cell, case, first, work.seed)


def _control_rows(cell, case, first, seed):
    """Each control term beside the plain model; `named` where it would pass the gates."""
    if not first.trials:
        return []
    best = (first.chosen or first.trials[0]).effect
    random = np.random.default_rng([seed, *cell.encode()])
    drawn = max(sum(p.step > 0 for p in best.parameters), 1)
    values = first.before.solution.values
    terms = {
        RANDOM: controls.random_term(drawn, case.cell.capacity_ampere_hour, random),
        PERMUTED: controls.permuted(best, case.cell, values, int(random.integers(2**31))),
        EXTRA: controls.extra_rc(),
    }
    return [_control_row(cell, case, first, name, term) for name, term in terms.items()]


def _control_row(cell, case, first, name, term):
    """The verdict, had the search chosen this term wherever it passes the gates."""
    trial = controls.tried(case, first, term)
    gates, floor, before = case.gates, first.floor_volt, first.before
    needed = before.worst_volt > gates.nothing_ratio * floor
    passed = needed and significant(gates, before, trial)
    passed = passed and matters(gates, before, before, trial, floor)
    chosen = first._replace(chosen=trial if passed else None, tied=())
    rounds = [chosen, chosen._replace(before=trial.state, chosen=None)][: 1 + passed]
    said = answers.verdict(cell, rounds, gates)
    volt = {"before": before.validation_rmse_volt, "after": trial.state.validation_rmse_volt}
    closed = answers.closed(before, trial.state, floor)
    return _row(cell, name, said | {"validation_rmse_volt": volt, "gap_closed": closed})


def _row(cell, method, said, *, rounds=0, cpu_second=NAN, reason=""):
    known = said or {"verdict": "", "effects": []}
    volt = known.get("validation_rmse_volt", {"before": NAN, "after": NAN})
    closed = known.get("gap_closed")
    return {
        "cell": cell,
        "method": method,
        "verdict": known["verdict"],
        "effects": " + ".join(one["effect"] for one in known["effects"]),
        "gap_closed": NAN if closed is None else closed,
        "floor_volt": known.get("floor_volt", NAN),
        "validation_before_volt": volt["before"],
        "validation_after_volt": volt["after"],
        "rounds": rounds,
        "cpu_second": cpu_second,
        "reason": reason,
        "document": json.dumps(plain(said), allow_nan=False) if said else "",
    }
