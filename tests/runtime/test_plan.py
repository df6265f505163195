"""What sheets say of cells, groups and tests, and which paths and facts a job gets from that."""

import pytest

from runtime.plan import Plan, gathered, near_in_cycles, of_rows, own, paths_of, where
from runtime.sheets import Campaign


class Wildcards(dict):
    """Wildcards of a job, as Snakemake gives them: by key and by attribute."""

    def __getattr__(self, name):
        return self[name]


def cell(name):
    limits = {"lower_cutoff_volt": 3.0, "upper_cutoff_volt": 4.2, "state_of_health": None}
    return {"cell": name, "rated_capacity_ampere_hour": 5.0, "chemistry": "NMC"} | limits


def a_test(name, test, kind, *, role="fit", celsius=25.0, cycle=None):
    facts = {"ambient_temperature_celsius": celsius, "cycle": cycle, "soc": None, "note": "x"}
    facts |= {"started": None}
    return {"cell": name, "test": test, "kind": kind, "role": role} | facts


def member(group, name, position):
    wiring = {"connection": "parallel", "wire_resistance_ohm": None, "link_resistance_ohm": None}
    return {"group": group, "cell": name, "position": position} | wiring


TESTS = [
    a_test("A", "pulses", "hppc", celsius=10.0),
    a_test("A", "drive", "drive", role="validation"),
    a_test("A", "old", "hppc", cycle=300.0),
    a_test("B", "pulses", "hppc"),
    a_test("G", "shared", "group"),
]
GROUPS = [member("G", "B", 2), member("G", "A", 1)]
PLAN = Plan(Campaign({}, [cell("A"), cell("B")], TESTS, GROUPS, []))
OF_A, OF_G = Wildcards(cell="A"), Wildcards(group="G")


def test_artefacts_are_those_of_tests_of_a_kind_and_role():
    assert PLAN.fitted("clean", "A", "hppc", "drive") == [
        "results/stages/clean/A/pulses.parquet",
        "results/stages/clean/A/old.parquet",
    ]
    assert PLAN.artefacts("clean", "A", "drive") == ["results/stages/clean/A/drive.parquet"]
    assert PLAN.everywhere("clean", "group", "hppc", roles=["fit"])[-1].endswith("G/shared.parquet")


def test_temperatures_and_cycles_are_those_that_the_sheet_states():
    assert PLAN.chamber_temperatures("A", "hppc", "drive") == {10.0, 25.0}
    assert PLAN.cycles("A", "hppc") == {0, 300.0}


def test_a_group_stands_for_its_cells_in_order_of_position():
    assert list(PLAN.leaves["G"]) == ["A", "B"]
    assert PLAN.cell_facts(OF_G)["cell"] == "A"
    assert PLAN.fitted_of(PLAN.leaves.get, "resistance", "hppc")(OF_G) == [
        "results/stages/resistance/A/pulses.parquet",
        "results/stages/resistance/A/old.parquet",
        "results/stages/resistance/B/pulses.parquet",
    ]


def test_facts_leave_out_what_no_analysis_needs():
    facts = PLAN.test_facts(Wildcards(cell="A", test="drive"))
    assert facts["role"] == "validation"
    assert "note" not in facts
    assert set(PLAN.facts_of_own_tests(OF_A)) == {"A/pulses", "A/drive", "A/old"}


def test_functions_of_a_job_are_asked_with_its_cell_or_group():
    assert own(PLAN.branches.get)(OF_G)[0]["cell"] == "A"
    assert PLAN.column("chemistry")(OF_A) == "NMC"
    assert paths_of(PLAN.leaves.get, "results/models/{}.json")(OF_G)[1] == "results/models/B.json"
    assert gathered(PLAN.leaves.get, list)(OF_G) == ["A", "B"]
    assert where({"A": None}, "results/stages/law/{}.json")(OF_A) == ["results/stages/law/A.json"]
    assert where({"B": None}, "results/stages/law/{}.json")(OF_A) == []


@pytest.mark.parametrize(("cycle", "near"), [(None, True), (5.0, True), (6.0, False)])
def test_tests_within_five_cycles_are_of_one_check_up(cycle, near):
    assert near_in_cycles({"cycle": cycle}, [0]) is near


def test_rows_that_a_rule_chooses_are_its_paths():
    assert PLAN.own_rows("ocv_rests", lambda name: PLAN.rows(name, "drive"))(OF_A) == of_rows(
        "ocv_rests", "A", [{"test": "drive"}]
    )
