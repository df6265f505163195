"""What is said of one cell or group, as the contract's verdict: by the search, and otherwise."""

import time

import cellwright as cw
from cellwright.effects import search
from cellwright.effects.finding import KEPT, model_of
from cellwright.effects.groups.finding import KnownCell
from cellwright.effects.library import LIBRARY
from cellwright.effects.verdict import gap_closed, outcome, verdict_of
from cellwright.records.basis import REFERENCE_CELSIUS
from cellwright.refusal import Refusal

# Names of what is asked of each cell.
SEARCH, LEFT_OUT = "search", "class_left_out"
BIC, VALIDATION = "bic_alone", "validation_rmse_alone"
RANDOM, PERMUTED, EXTRA = "random_term", "permuted_current", "extra_rc"
# Of groups: the search with tests near 25 °C alone, and without branch currents.
ONE_TEMPERATURE, BLIND = "one_temperature", "no_branch_currents"


def verdict(cell: str, rounds, gates) -> dict:
    """The verdict of a search, without the maps and plots of the pipeline.

    Parameters
    ----------
    cell : its name. rounds : list of search.Round. gates : case.Gates.
    """
    return verdict_of(cell, outcome(rounds, gates), rounds, None)


def plain_names(names) -> dict:
    """A verdict that only names, or says that nothing is missing: of the controls."""
    said = "named" if names else "none"
    return {"verdict": said, "effects": [{"effect": name} for name in names]}


def bic_alone(one, gates) -> dict:
    """What the criterion on the records fitted would say of the first round, with its own gate."""
    best = max(one.trials, key=lambda t: t.delta_bic, default=None)
    return plain_names([best.effect.id] if best and best.delta_bic > gates.bic else [])


def validation_alone(one, gates) -> dict:
    """What the smallest error on validation data would say of the first round, with its gate."""
    best = min(one.trials, key=lambda t: t.state.validation_rmse_volt, default=None)
    most = (1.0 - gates.validation_fall) * one.before.validation_rmse_volt
    falls = best is not None and best.state.validation_rmse_volt <= most
    return plain_names([best.effect.id] if falls else [])


def closed(before, after, floor_volt: float) -> float:
    """Share of the gap on validation data that is closed between two States; NaN without a gap."""
    share = gap_closed(before.validation_rmse_volt, after.validation_rmse_volt, floor_volt)
    return float("nan") if share is None else share


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


def of_group(group: str, branches, cells, tests, settings) -> list[tuple]:
    """(method, verdict or None, CPU time and reason) of each way to look at a group.

    Parameters
    ----------
    group : name. branches : list of BranchFacts. cells : list of KnownCell. tests : (TestFacts,
    columns) each. settings : section missing_effect_group of the config.
    """
    ways = {SEARCH: tests, ONE_TEMPERATURE: _at_one(tests), BLIND: [_blind(t) for t in tests]}
    return [
        (method, *_answer(group, branches, cells, some, settings)) for method, some in ways.items()
    ]


def _answer(group, branches, cells, tests, settings):
    begun = time.process_time()
    try:
        found = cw.missing_group_effect(group, branches, cells, tests, settings)
    except Refusal as refusal:
        return None, {"reason": str(refusal)}
    return found.verdict, {"cpu_second": time.process_time() - begun}


def _at_one(tests):
    """Tests near 25 °C only."""
    celsius = [facts.ambient_temperature_celsius for facts, _ in tests]
    near = [abs(value - REFERENCE_CELSIUS) <= SAME_CELSIUS for value in celsius]
    return [test for test, kept in zip(tests, near, strict=True) if kept]


def _blind(test):
    """A test as it would be had only the group's voltage and current been logged."""
    facts, series = test
    return facts, {name: x for name, x in series.items() if not name.startswith("branch_")}
