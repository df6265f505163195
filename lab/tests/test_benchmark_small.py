"""The benchmark in small, end to end: a hidden campaign made, searched blindly, and scored.

Where the virtual laboratory runs (`./run --lab pytest lab/tests/test_benchmark_small.py`).
The seed is of no campaign that anything was chosen on. Thresholds are counts: they fail.
"""

from pathlib import Path

import pytest

from effect_benchmark import answers as methods
from effect_benchmark import scoring
from runtime import settings
from virtual_lab import campaigns
from virtual_lab.campaigns import making

pytest.importorskip("numba", reason="the virtual laboratory runs in its own environment: --lab")


SEED = 4711
STRONG_VOLT = 6e-3
HIDDEN = (
    "hysteresis_instant",
    "charge_transfer_nonlinearity",
    "entropic_ocv",
    "leakage",
    "resistance_temperature",
    "self_heating",
)
SCHEMAS = Path(__file__).resolve().parents[2] / "workflow" / "schemas"


def wanted(specimen) -> bool:
    strong = specimen.kind == "single" and specimen.strength_volt == STRONG_VOLT
    return specimen.kind != "single" or (strong and specimen.effects[0] in HIDDEN)


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """Every answer beside the truth: six strong effects, four healthy cells, two unknown."""
    folder = tmp_path_factory.mktemp("hidden")
    sizes = {"cells": 1, "healthy": 4, "unknown": 2, "two": 0, "physics": 0, "groups": 0}
    plan = campaigns.plan("hidden", seed=SEED, **sizes)
    cells = tuple(cell for cell in plan.cells if wanted(cell.specimen))
    names = {cell.name for cell in cells}
    tests = tuple(test._replace(batch="all") for test in plan.tests if test.cell in names)
    plan = plan._replace(cells=cells, tests=tests)
    making.make_batch(plan, "all", folder)
    making.make_sheets(plan, folder)
    config = settings.defaults(settings.load(SCHEMAS, "config"))
    config["benchmark"] |= {"control_every": 1}
    work = methods.task(folder, scoring.hidden_names(folder), config)
    return scoring.judged(folder, methods.answered(work, 0, 1))


def of(table, method, kind):
    return table[(table["method"] == method) & (table["kind"] == kind)]


def test_every_cell_was_answered(table):
    answers = table[table["method"] == methods.SEARCH]
    assert len(answers) == len(HIDDEN) + 4 + 2
    assert not (answers["outcome"] == "no verdict").any(), answers["reason"].tolist()


def test_no_healthy_cell_gets_a_name(table):
    assert (of(table, methods.SEARCH, "none")["outcome"] == "right").sum() == 4


def test_strong_effects_are_named(table):
    answers = of(table, methods.SEARCH, "single")
    assert scoring.right(answers).sum() >= len(HIDDEN) - 1, answers[["hidden", "said"]].to_string()
    assert not (answers["outcome"] == "false name").any()
    assert answers["gap_closed"].median() >= 0.9


def test_what_no_library_knows_gets_no_name(table):
    """Of two; a resistance that drifts within the campaign is named hysteresis."""
    answers = of(table, methods.SEARCH, "unknown")
    assert (answers["outcome"] == "right").sum() >= 1
    assert (answers["outcome"] == "false name").sum() <= 1


def test_without_the_true_class_most_are_unknown(table):
    answers = table[table["method"] == methods.LEFT_OUT]
    assert len(answers) == len(HIDDEN)
    assert (answers["verdict"] == "unknown").sum() >= len(HIDDEN) // 2


def test_terms_that_must_not_help_close_little_of_the_gap(table):
    answers = of(table, methods.RANDOM, "single")
    assert answers["gap_closed"].median() < 0.5
