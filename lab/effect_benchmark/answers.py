"""Verdicts on a batch of hidden cells and groups: the search, the true class left out, controls."""

import json
import time
from typing import NamedTuple

import numpy as np

import cellwright as cw
from cellwright.effects.finding import KEPT, model_of
from cellwright.effects.given.paired import paired
from cellwright.effects.groups.finding import KnownCell
from cellwright.effects.library import LIBRARY
from cellwright.effects.proof import excess_volt, explained, significant
from cellwright.effects.records import parts_of
from cellwright.effects.verdict import entry_of, gap_closed, outcome, searched, verdict_of
from cellwright.records.conditions import REFERENCE_CELSIUS
from cellwright.refusal import Refusal
from effect_benchmark import campaign, controls
from runtime.artefact import plain

# Methods by which each cell is answered.
SEARCH, LEFT_OUT = "search", "class_left_out"
BIC, VALIDATION = "bic_alone", "validation_rmse_alone"
RANDOM, PERMUTED, EXTRA = "random_term", "permuted_current", "extra_rc"
# Of groups: the search with tests near 25 °C alone, and without branch currents.
ONE_TEMPERATURE, BLIND = "one_temperature", "no_branch_currents"


def verdict_of_search(cell: str, found) -> dict:
    """The verdict of a search as in the pipeline, without its maps and plots.

    Parameters
    ----------
    cell : its name. found : cellwright.effects.verdict.Searched.
    """
    parts = parts_of(found.case.fit)
    entry = {"entry": lambda *of: entry_of(*of, parts)}
    return verdict_of(cell, found.result, found.rounds, None, **entry)


def plain_names(names) -> dict:
    """A verdict that only names effects, or says that nothing is missing."""
    word = "named" if names else "none"
    return {"verdict": word, "effects": [{"effect": name} for name in names]}


def bic_alone(first_round, gates) -> dict:
    """Verdict by the information criterion of the fit alone, after the first round."""
    best = max(first_round.trials, key=lambda t: t.delta_bic, default=None)
    return plain_names([best.effect.id] if best and best.delta_bic > gates.bic else [])


def validation_alone(first_round, gates) -> dict:
    """Verdict by the smallest error on validation data alone, where its fall is material."""
    best = min(first_round.trials, key=lambda t: t.state.validation_rmse_volt, default=None)
    if best is None:
        return plain_names([])
    errors = first_round.before.validation_rmse_volt, best.state.validation_rmse_volt
    return plain_names([best.effect.id] if excess_volt(*errors) > gates.material_volt else [])


def gap_share(before, after, floor_volt: float) -> float:
    """Share of the gap on validation data that is closed between two States; NaN without a gap."""
    share = gap_closed(before.validation_rmse_volt, after.validation_rmse_volt, floor_volt)
    return float("nan") if share is None else share


SAME_CELSIUS = 2.0


def known_cell(cell: str, case) -> KnownCell:
    """Model of a branch's cell after a search of the cell alone, as in the pipeline's model.json.

    Parameters
    ----------
    cell : its name. case : cellwright.effects.case.Case.
    """
    found = searched(case, LIBRARY)
    state = found.result.last if found.result.word in KEPT else found.rounds[0].before
    return KnownCell(model_of(found.case, state), cell)


def answers_of_group(group: str, branches, cells, tests, settings) -> list[tuple]:
    """(method, verdict or None, CPU time and reason) of each way to look at a group.

    Parameters
    ----------
    group : name. branches : list of BranchFacts. cells : list of KnownCell. tests : (TestFacts,
    columns) each. settings : section missing_effect_group of the config.
    """
    logged = {SEARCH: tests, ONE_TEMPERATURE: _at_one(tests), BLIND: [_blind(t) for t in tests]}
    return [
        (method, *_answer(group, branches, cells, records, settings))
        for method, records in logged.items()
    ]


def _answer(group, branches, cells, tests, settings):
    begun = time.process_time()
    try:
        finding = cw.missing_group_effect(group, branches, cells, tests, settings)
    except Refusal as refusal:
        return None, {"reason": str(refusal)}
    return finding.verdict, {"cpu_second": time.process_time() - begun}


def _at_one(tests):
    """Tests near 25 °C only."""
    celsius = [facts.ambient_temperature_celsius for facts, _ in tests]
    near = [abs(value - REFERENCE_CELSIUS) <= SAME_CELSIUS for value in celsius]
    return [test for test, kept in zip(tests, near, strict=True) if kept]


def _blind(test):
    """A test as it would be had only the group's voltage and current been logged."""
    facts, series = test
    return facts, {name: x for name, x in series.items() if not name.startswith("branch_")}


NAN = float("nan")


class Task(NamedTuple):
    """Input of a batch: a campaign, settings of the stages, lenders by chemistry, choices.

    settings : of the search, section missing_effect of the config. split_rest_second : shortest
    rest that cuts a test of role split [s]. left_out : ids that the second search of a cell does
    without, by cell. paired_chemistry : of cells that are held against their references. seed : of
    the controls. control_every : which part of the cells has second search and controls.
    of_groups : settings of the search in groups, section missing_effect_group.
    """

    campaign: campaign.Campaign
    steps: campaign.Steps
    lenders: dict
    settings: dict
    split_rest_second: float
    left_out: dict
    paired_chemistry: str
    seed: int
    control_every: int
    of_groups: dict


def task(folder, left_out: dict, config: dict) -> Task:
    """The Task of a campaign; its truth is not read.

    Parameters
    ----------
    folder : of the campaign. left_out : ids by cell.
    config : sections clean, segment, ocv, models, missing_effect, missing_effect_group and
    benchmark.
    """
    sheets, benchmark = campaign.read(folder), config["benchmark"]
    steps = campaign.Steps(config["clean"], config["segment"], config["ocv"]["least_hour"])
    lenders = campaign.lenders(sheets, steps)
    plans = ("enabled", "bases")  # they decide which jobs there are
    settings = {k: v for k, v in config["missing_effect"].items() if k not in plans}
    rest = config["models"]["split_rest_second"]
    names = ("paired_chemistry", "seed", "control_every")
    choices = (left_out, *(benchmark[name] for name in names))
    of_groups = config["missing_effect_group"]
    return Task(sheets, steps, lenders, settings, rest, *choices, of_groups)


def answered(work: Task, number: int, of: int) -> list[dict]:
    """Rows of every `of`-th cell of a campaign, from the one with this number: one row a method."""
    rows = []
    for number_of_cell, cell in list(enumerate(campaign.searched(work.campaign)))[number::of]:
        try:
            rows += _rows(work, cell, number_of_cell % work.control_every == 0)
        except Refusal as refusal:
            rows.append(_row(cell, SEARCH, None, reason=str(refusal)))
    return rows


def _rows(work, cell, controlled):
    if cell in work.campaign.branches:
        return _group_rows(work, cell)
    case = _case(work, cell)
    if work.campaign.cells[cell]["chemistry"] == work.paired_chemistry:
        return _paired_rows(work, cell, case)
    return _cell_rows(work, cell, case, controlled)


def _case(work, cell):
    """Records and plain model of a cell, as `cw.missing_effect` prepares them."""
    cell_records = campaign.loaded(work.campaign, cell, work.lenders, work.steps)
    rest = work.split_rest_second
    return cw.prepared_case(*cell_records, work.settings, split_rest_second=rest)


def _group_rows(work, group):
    """Rows of a group, its cells known by their own searches, for each choice of logged columns."""
    branches = work.campaign.branches[group]
    cells = [known_cell(row.cell, _case(work, row.cell)) for row in branches]
    tests = campaign.tests_of(work.campaign, group, work.steps)
    return [
        _row(group, method, verdict, rounds=len(verdict["effects"]) + 1 if verdict else 0, **cost)
        for method, verdict, cost in answers_of_group(group, branches, cells, tests, work.of_groups)
    ]


def _paired_rows(work, cell, case):
    """Row of a cell that is compared with the reference cells of its type."""
    alike = work.lenders.get(work.paired_chemistry, [])
    references = {lender.cell: _case(work, lender.cell) for lender in alike}
    return [_searched(cell, paired(case, references).case)[0]]


def _searched(cell, case):
    """(row of the search, what it found)"""
    begun = time.process_time()
    found = searched(case, LIBRARY)
    spent = time.process_time() - begun
    verdict = verdict_of_search(cell, found)
    return _row(cell, SEARCH, verdict, rounds=len(found.rounds), cpu_second=spent), found


def _cell_rows(work, cell, case, controlled):
    row, found = _searched(cell, case)
    case, first, gates = found.case, found.rounds[0], found.case.gates
    rows = [row, _row(cell, BIC, bic_alone(first, gates))]
    rows.append(_row(cell, VALIDATION, validation_alone(first, gates)))
    if not controlled:
        return rows
    if without := work.left_out.get(cell):
        rest = {name: effect for name, effect in LIBRARY.items() if name not in without}
        verdict = verdict_of_search(cell, searched(case, rest))
        rows.append(_row(cell, LEFT_OUT, verdict))
    return rows + _control_rows(cell, case, first, work.seed)


def _control_rows(cell, case, first, seed):
    """Rows of the control terms; `named` where a term would pass the gates."""
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
    """Row of one control term: the verdict, were it chosen where it passes the gates."""
    trial = controls.tried(case, first, term)
    before, floor = first.before, first.floor
    passed = not explained(case.gates, before, floor)
    passed = passed and significant(case.gates, trial)
    passed = passed and case.matters(before, before, trial, floor)
    asked = first._replace(chosen=trial if passed else None, tied=())
    rounds = [asked, asked._replace(before=trial.state, chosen=None)][: 1 + passed]
    verdict = verdict_of(cell, outcome(rounds, case.gates), rounds, None)
    volt = {"before": before.validation_rmse_volt, "after": trial.state.validation_rmse_volt}
    closed = gap_share(before, trial.state, floor.validation_volt)
    return _row(cell, name, verdict | {"validation_rmse_volt": volt, "gap_closed": closed})


def _row(cell, method, verdict, *, rounds=0, cpu_second=NAN, reason=""):
    answer = verdict or {"verdict": "", "effects": []}
    volt = answer.get("validation_rmse_volt", {"before": NAN, "after": NAN})
    closed = answer.get("gap_closed")
    return {
        "cell": cell,
        "method": method,
        "verdict": answer["verdict"],
        "effects": " + ".join(effect["effect"] for effect in answer["effects"]),
        "gap_closed": NAN if closed is None else closed,
        "floor_volt": answer.get("floor_volt", NAN),
        "validation_before_volt": volt["before"],
        "validation_after_volt": volt["after"],
        "rounds": rounds,
        "cpu_second": cpu_second,
        "reason": reason,
        "document": json.dumps(plain(verdict), allow_nan=False) if verdict else "",
    }
