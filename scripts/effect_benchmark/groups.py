"""Answers for one parallel group: with branch currents, at one temperature, and without them."""

import time

from cellwright.effects import search
from cellwright.effects.finding import KEPT, model_of
from cellwright.effects.groups.finding import KnownCell, missing_group_effect
from cellwright.effects.library import LIBRARY
from cellwright.effects.verdict import outcome
from cellwright.records.basis import REFERENCE_CELSIUS
from cellwright.refusal import Refusal
from effect_benchmark.methods import BLIND, ONE_TEMPERATURE, SEARCH

SAME_CELSIUS = 2.0


def known(cell: str, case) -> KnownCell:
    """What the search of a branch's cell by itself leaves, as the pipeline's model.json.

    Parameters
    ----------
    cell : its name. case : cellwright.effects.case.Case.
    """
    rounds = search.search(case, LIBRARY)
    found = outcome(rounds, case.gates)
    state = found.last if found.word in KEPT else rounds[0].before
    return KnownCell(model_of(case, state), cell)


def answers(group: str, branches, cells, tests, settings) -> list[tuple]:
    """(method, verdict or None, CPU time and reason) of each way to look at a group.

    Parameters
    ----------
    group : name. branches : list of BranchFacts. cells : list of KnownCell. tests : list of
    MeasuredTest. settings : section missing_effect_group of the config.
    """
    ways = {SEARCH: tests, ONE_TEMPERATURE: _at_one(tests), BLIND: [_blind(t) for t in tests]}
    return [
        (method, *_answer(group, branches, cells, some, settings)) for method, some in ways.items()
    ]


def _answer(group, branches, cells, tests, settings):
    begun = time.process_time()
    try:
        found = missing_group_effect(group, branches, cells, tests, settings=settings)
    except Refusal as refusal:
        return None, {"reason": str(refusal)}
    return found.verdict, {"cpu_second": time.process_time() - begun}


def _at_one(tests):
    """Tests near 25 °C only."""
    return [
        test
        for test in tests
        if abs(test.facts.ambient_temperature_celsius - REFERENCE_CELSIUS) <= SAME_CELSIUS
    ]


def _blind(test):
    """A test as it would be had only the group's voltage and current been logged."""
    kept = {name: x for name, x in test.series.items() if not name.startswith("branch_")}
    return test._replace(series=kept)
