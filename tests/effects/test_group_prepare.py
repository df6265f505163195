"""From a campaign's sheets to a group that can be searched: roles, models, starts, and why not."""

import numpy as np
import pytest
from group_pair import CELLS, TABLE
from sheets_facts import branch_facts, measured_test

from cellwright.effects.groups import finding
from cellwright.effects.groups.finding import KnownCell, missing_group_effect
from cellwright.effects.groups.known import Shared, Spread
from cellwright.effects.groups.model import group_frees
from cellwright.effects.story.result import Finding
from cellwright.refusal import Refusal

BRANCHES = branch_facts(["c1", "c2"], [0.9, 0.8])
VALUES = {"log_r0": -4.0, "log_r1": -5.0, "log_r2": -5.0, "log_tau1": 2.0, "log_tau2": 5.0}
VALUES |= {"capacity": 0.0} | {f"ocv[{k}]": 0.0 for k in range(16)}
MODEL = {"capacity_ampere_hour": 5.0, "ocv_volt": TABLE.tolist(), "values": VALUES}
KNOWN = [KnownCell(MODEL | {"hold": "first_order"}, f"c{k}") for k in (1, 2)]


def a_test(name, role, *, soc=None, branches=2, first=0.0, second=0.5):
    time = np.arange(0.0, 600.0, second)
    series = {"test_time_second": time, "current_ampere": np.where(time < 60, first, -4.0)}
    series |= {"voltage_volt": np.full(len(time), 3.9), "charge_ampere_hour": 0 * time}
    for k in range(branches):
        series[f"branch_{k + 1}_current_ampere"] = series["current_ampere"] / branches
    return measured_test(series, name, "group", soc=soc, role=role)


@pytest.fixture
def asked(monkeypatch):
    """What would be searched: group, cells, records, options; no search is made."""
    monkeypatch.setattr(
        finding,
        "group_finding",
        lambda *given, **options: Finding({}, model={"given": given, "options": options}),
    )

    def ask(*tests, known=KNOWN):
        result = missing_group_effect("pair", BRANCHES, known, list(tests))
        return *result.model["given"][1:], result.model["options"], result.notes

    return ask


def test_tests_keep_their_roles_and_long_ones_are_averaged(asked):
    _, records, options, notes = asked(a_test("a", "fit"), a_test("b", "validation"))
    assert [(role, record.test) for role, record in records] == [("fit", "a"), ("validation", "b")]
    assert all(len(record.test_time_second) == 600 for _, record in records)
    assert options["hold"] == "first_order"
    assert notes == ()


def test_of_three_tests_to_fit_one_judges(asked):
    _, records, _, notes = asked(*[a_test(name, "fit") for name in "abc"])
    assert [(role, record.test) for role, record in records][-1] == ("validation", "c")
    assert "c judged instead" in notes[0]


def test_the_start_is_the_tests_else_the_sheets(asked):
    _, records, _, _ = asked(a_test("a", "fit", soc=0.5), a_test("b", "validation"))
    assert [record.initial_soc.tolist() for _, record in records] == [[0.5, 0.5], [0.9, 0.8]]


def test_a_cell_of_the_type_stands_in_for_one_without_tests(asked):
    known = [KNOWN[0], KNOWN[0]]
    cells, _, _, notes = asked(a_test("a", "fit"), a_test("b", "validation"), known=known)
    assert [(cell.cell, cell.own) for cell in cells] == [("c1", True), ("c2", False)]
    assert notes == ("c2 is known by its type only, from c1",)


def test_without_branch_currents_that_is_said(asked):
    tests = a_test("a", "fit", branches=0), a_test("b", "validation", branches=0)
    _, records, _, notes = asked(*tests)
    assert [record.branch_current_ampere for _, record in records] == [None, None]
    assert notes[0] == "a: branch currents were not logged"


BOTH = (a_test("a", "fit"), a_test("b", "validation"))
REFUSED = {
    r"one \(fit\); a verdict needs one of role fit and one": ((a_test("one", "fit"),), KNOWN),
    "no model of c2 by itself": (BOTH, [KNOWN[0], KnownCell(None, "c2")]),
    "found Branch 3 Current / A": ((a_test("a", "fit", branches=3), BOTH[1]), KNOWN),
    "none; a verdict needs one of role fit": ((), KNOWN),
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_cannot_be_searched_has_a_reason(asked, words):
    tests, known = REFUSED[words]
    with pytest.raises(Refusal, match=words):
        asked(*tests, known=known)


def test_a_start_under_load_must_be_stated():
    branches = [row._replace(initial_soc=None) for row in BRANCHES]
    tests = [a_test("a", "fit", first=-4.0), a_test("b", "validation")]
    with pytest.raises(Refusal, match="a begins under load"):
        missing_group_effect("pair", branches, KNOWN, tests)


def test_cells_never_warmed_are_held_to_no_activation_energy():
    def spread_of(cells):
        free = group_frees(cells, 1, Spread(), Shared(), sensors=True)
        return next(parameter.std for parameter in free if parameter.name == "energy")

    cold = [cell._replace(effects=()) for cell in CELLS]
    assert spread_of(cold) == Shared().type_activation_joule_per_mole > spread_of(CELLS)
