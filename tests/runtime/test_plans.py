"""Which cells have a model, from what, and which are searched: sheets whose answer is known."""

from types import SimpleNamespace

import pytest

from runtime.bias_plan import BiasPlan
from runtime.health_plan import HealthPlan
from runtime.model_plan import ModelPlan
from runtime.plan import Plan, of_first_checkup
from runtime.record_plan import RecordPlan
from runtime.search_plan import SearchPlan
from runtime.sheets import Campaign

SLOW = ("ica", "capacity")
SETTINGS = {"enabled": True, "bases": ["plain", "own", "external"]}


class Wildcards(SimpleNamespace):
    """Wildcards of a job, as Snakemake gives them: by attribute and by `get`."""

    def get(self, name):
        return getattr(self, name, None)


def cell(name, chemistry="NMC", *, reference="", table=None):
    facts = {"rated_capacity_ampere_hour": 5.0, "reference": reference, "model_table": table}
    facts |= {"lower_cutoff_volt": 3.0, "upper_cutoff_volt": 4.2, "state_of_health": None}
    facts |= {"ageing_protocol": None}
    return {"cell": name, "chemistry": chemistry} | facts


def a_test(name, kind, test=None, *, role="fit", celsius=25.0, cycle=None, simulated=None):
    facts = {"ambient_temperature_celsius": celsius, "cycle": cycle, "simulated_file": simulated}
    facts |= {"soc": None, "started": None}
    return {"cell": name, "test": test or kind, "kind": kind, "role": role} | facts


def member(group, name, position, *, connection="parallel", link=None):
    wiring = {"connection": connection, "link_resistance_ohm": link}
    return {"group": group, "cell": name, "position": position} | wiring


def planned(cells, tests, groups=(), **settings):
    plan = Plan(Campaign({}, cells, tests, list(groups), []))
    fits = ModelPlan(plan, scored_kinds=("drive", "hppc", "capacity"))
    return fits, SearchPlan(plan, fits, SETTINGS | settings)


def test_a_model_comes_from_the_first_source_that_a_cell_has():
    cells = [
        *(cell("pulsed"), cell("table", table="t.csv"), cell("peaks"), cell("both", table="t.csv")),
        *(cell("loads", "LFP"), cell("branch", "LTO"), cell("bare", "LCO")),
    ]
    tests = [
        *(a_test("pulsed", "hppc"), a_test("both", "hppc"), a_test("peaks", "ica")),
        *(a_test("loads", "capacity"), a_test("loads", "ocv"), a_test("G", "group")),
    ]
    groups = [member("G", "branch", 1), member("G", "pulsed", 2)]
    fits, _ = planned(cells, tests, groups)
    assert list(fits.excited) == ["pulsed", "both"]
    assert list(fits.given) == ["table"]
    assert list(fits.biased) == ["peaks"]
    assert list(fits.loaded) == ["loads"]
    assert fits.grouped == {"branch": "G"}
    assert list(fits.unmodelled) == ["bare"]
    sources = {name: fits.source_of_model(Wildcards(cell=name)) for name in fits.modelled}
    assert sources == {
        "pulsed": "results/stages/identify/pulsed.json",
        "both": "results/stages/identify/both.json",
        "loads": "results/stages/identify/loads.json",
        "table": "results/stages/given_model/table.json",
        "peaks": "results/stages/bias/peaks.json",
        "branch": "results/stages/branches/G.json",
    }


def test_a_test_for_validation_makes_no_model():
    tests = [a_test("A", "drive"), a_test("B", "drive", role="validation")]
    fits, _ = planned([cell("A"), cell("B")], tests)
    assert list(fits.excited) == ["A"]


def test_a_string_in_series_tells_no_model_of_a_cell():
    groups = [member("S", name, k, connection="series") for k, name in enumerate("AB", 1)]
    fits, _ = planned([cell("A"), cell("B")], [a_test("S", "group")], groups)
    assert not fits.parallel
    assert list(fits.unmodelled) == ["A", "B"]


def test_curves_are_lent_by_marked_cells_else_by_all_to_those_that_have_none():
    tests = [a_test("A", "ocv"), a_test("B", "ocv"), a_test("C", "hppc")]
    fits, _ = planned([*map(cell, "ABC"), cell("D", "LFP"), cell("E", None)], tests)
    assert [fits.curve_lenders(name) for name in "ABCDE"] == [[], [], ["A", "B"], [], []]
    fits, _ = planned([cell("A"), cell("B", reference="yes"), cell("C")], tests)
    assert [fits.curve_lenders(name) for name in "ABC"] == [["B"], [], ["B"]]


def test_a_later_check_up_with_pulses_and_a_capacity_has_a_model_of_its_own():
    tests = [a_test("A", kind, f"{kind}{k}", cycle=k) for k in (0, 300) for kind in ("hppc", "ocv")]
    tests += [a_test("A", "hppc", "alone", cycle=700)]
    tests += [a_test("A", "drive", f"drive{k}", role="validation", cycle=k) for k in (0, 300)]
    fits, _ = planned([cell("A")], tests)
    assert fits.checkups == {"A": ["300"]}
    series = fits.series_of_checkup(Wildcards(cell="A", checkup="300"))
    assert series == ["results/stages/clean/A/hppc300.parquet"]
    models = [fits.model_at_age(Wildcards(cell="A", test=f"drive{k}")) for k in (0, 300)]
    assert models == [
        "results/models/A.json",
        ["results/stages/models_of_checkups/A/300.json"],
    ]
    assert [row["test"] for row in fits.scored_at_its_age("A")] == ["drive0"]


def test_rests_of_pulses_give_a_curve_where_no_slow_test_is():
    tests = [a_test("A", "hppc", f"hppc{k}", cycle=k) for k in (0, 300)]
    tests += [a_test("A", "capacity", "c300", cycle=300)]
    fits, _ = planned([cell("A")], tests)
    assert [row["test"] for row in fits.resting("A")] == ["hppc0", "hppc300"]
    fits, _ = planned([cell("A")], [*tests, a_test("A", "ocv", cycle=0)])
    assert [row["test"] for row in fits.resting("A")] == ["hppc300"]
    assert fits.other_curves("A") == ["results/stages/ocv_rests/A/hppc300.parquet"]


def test_temperatures_of_a_model_are_those_of_what_it_is_fitted_to():
    tests = [a_test("A", "hppc", f"h{k}", celsius=k) for k in (25.0, -10.0, None)]
    tests += [a_test("A", "drive", f"d{k}", role="validation", celsius=k) for k in (25.0, 40.0)]
    fits, _ = planned([cell("A")], tests)
    assert fits.fit_celsius("A") == [-10.0, 25.0]
    assert fits.left_out_models("A")[0] == "results/stages/left_out/A/-10.json"
    assert fits.predictable("A", ["validation"]) == ["results/stages/clean/A/d25.0.parquet"]


def test_a_search_needs_a_test_for_proof_or_one_to_spare_of_the_first_check_up():
    proof = {"role": "validation"}
    tests = [a_test("A", "hppc"), a_test("A", "drive", **proof)]
    tests += [a_test("B", "hppc"), a_test("B", "drive", cycle=500, **proof)]
    tests += [a_test("C", "hppc", f"h{k}") for k in range(3)]
    tests += [a_test("D", "ocv")]
    _, searches = planned([*map(cell, "ABCD")], tests)
    assert list(searches.asked) == ["A", "B", "C"]
    assert list(searches.searched) == list(searches.searched_own) == ["A", "C"]
    assert searches.left_out_series("A") == ["results/stages/clean/A/drive.parquet"]
    assert searches.left_out_series("B") == []
    assert searches.choice_series("B") == ["results/stages/clean/B/hppc.parquet"]
    _, off = planned([*map(cell, "ABCD")], tests, enabled=False)
    assert not off.asked
    assert not off.searched_own


def test_a_branch_without_a_search_of_its_own_is_held_against_one_of_its_type():
    tests = [a_test("A", "hppc"), a_test("A", "drive", role="validation"), a_test("G", "group")]
    tests += [a_test("G", "group", "proof", role="validation"), a_test("L", "group")]
    groups = [member("G", "A", 1), member("G", "B", 2)]
    linked = [member("L", "A", 1), member("L", "B", 2, link=1e-4)]
    _, searches = planned([cell("A"), cell("B")], tests, [*groups, *linked])
    assert searches.groups_asked == searches.groups_searched == ["G"]
    of_group = Wildcards(group="G")
    assert searches.lenders(of_group) == {"A": "A", "B": "A"}
    assert searches.group_models(of_group) == ["results/missing_effect/A/model.json"]


def test_a_simulator_is_asked_about_where_it_has_simulated_a_test():
    tests = [a_test("A", "hppc"), a_test("A", "drive", simulated="s.csv"), a_test("B", "hppc")]
    _, searches = planned([cell("A"), cell("B")], tests)
    assert searches.searched_external == ["A"]
    assert searches.simulated_files(Wildcards(cell="A")) == {"drive": "s.csv"}


@pytest.mark.parametrize("cycles", [(0, 0, 400), (None, None, 400), (100, 101, 400)])
def test_the_first_check_up_is_the_earliest_of_the_tests_given(cycles):
    rows = [a_test("A", "capacity", str(k), cycle=cycle) for k, cycle in enumerate(cycles)]
    assert [row["test"] for row in of_first_checkup(rows)] == ["0", "1"]


def test_cells_of_a_group_are_named_in_its_order_where_they_have_what_is_asked_for():
    groups = [member("G", "B", 1), member("G", "A", 2)]
    tests = [a_test("A", "hppc"), a_test("B", "drive"), a_test("G", "group")]
    fits, _ = planned([cell("A"), cell("B")], tests, groups)
    assert fits.modelled_leaves("G") == ["B", "A"]
    assert fits.warmed_leaves("G") == ["A"]


def test_ways_to_a_model_are_judged_where_a_cell_of_the_type_has_a_test_no_fit_has_seen():
    tests = [a_test(name, kind) for name in "ABCD" for kind in ("hppc", "capacity")]
    proof = a_test("B", "drive", role="validation")
    cells = [cell("A", reference="yes"), cell("B"), cell("C"), cell("D", "LFP")]
    fits, _ = planned(cells, tests)
    assert BiasPlan(fits.plan, fits).judged == {}
    fits, _ = planned(cells, [*tests, proof])
    lent = BiasPlan(fits.plan, fits)
    assert lent.judged == {"A": ["A", "B"]}
    assert lent.judged_with(["B", "D"]) == ["A"]
    of_a = Wildcards(cell="A")
    assert lent.references(of_a) == ["A"]
    assert lent.inputs(of_a)["series"] == ["results/stages/clean/B/drive.parquet"]
    assert fits.excited_references("B") == ["A"]


def test_of_a_large_type_the_cells_that_are_judged_are_spread_over_the_sheet():
    names = [f"c{k:03d}" for k in range(150)]
    kinds = {"hppc": "fit", "capacity": "fit", "drive": "validation"}
    tests = [a_test(name, kind, role=role) for name in names for kind, role in kinds.items()]
    fits, _ = planned([cell(name) for name in names], tests)
    assert BiasPlan(fits.plan, fits).judged == {"c000": names[::3]}


def health_of(cells, tests):
    fits, _ = planned(cells, tests)
    return HealthPlan(fits.plan, fits)


def test_a_cell_ages_by_its_record_or_by_many_check_ups():
    tests = [a_test("A", "ageing"), a_test("D", "drive")]
    tests += [a_test("B", "capacity", f"c{k}", cycle=100 * k) for k in range(8)]
    tests += [a_test("C", "capacity", f"c{k}", cycle=100 * k) for k in range(7)]
    ageing = health_of([*map(cell, "ABC"), cell("D") | {"state_of_health": 0.9}], tests)
    assert (list(ageing.cycled), list(ageing.checked_often)) == (["A"], ["B"])
    assert list(ageing.aged) == ["A", "B"]
    assert list(ageing.checked) == ["B", "C"]
    # A stated state of health is no check-up.
    assert list(ageing.healthy) == ["A", "B", "C"]
    assert ageing.inputs_of_health(Wildcards(cell="B")) == {
        "life": "results/stages/life/B.parquet",
        "course": "results/stages/fade_course/B.parquet",
        "check_ups": "results/stages/checkups/B.parquet",
    }
    assert ageing.fleets == {"NMC, 5 Ah": ["B", "C"]}


def test_what_a_cell_lost_is_told_by_two_check_ups_or_beside_a_fresh_one():
    tests = [
        a_test("A", "ocv", cycle=0),
        a_test("B", "ocv", cycle=0),
        a_test("B", "ica", cycle=500),
    ]
    tests += [a_test("C", "ocv", cycle=500)]
    tests += [a_test("D", "hppc", f"h{cycle}", cycle=cycle) for cycle in (0, 500)]
    ageing = health_of([cell("A", reference="yes"), *map(cell, "BCD")], tests)
    assert list(ageing.aged_slowly) == ["B"]
    assert [ageing.fresh_cells(name) for name in "ABCD"] == [[], [], ["A"], []]
    assert list(ageing.degraded) == ["B", "C", "D"]


def test_peaks_are_calibrated_within_a_type_of_four_known_capacities_or_a_record():
    few = [a_test("A", kind, f"{kind}{k}", cycle=k) for k in range(0, 300, 100) for kind in SLOW]
    assert health_of([cell("A"), cell("B")], few).peak_types == {}
    assert health_of([cell("A")], [*few, a_test("A", "ageing")]).peak_types == {"A": ["A"]}
    of_b = [a_test("B", kind, cycle=0) for kind in SLOW]
    ageing = health_of([cell("A"), cell("B")], [*few, *of_b])
    assert ageing.first_of_type == {"A": "A", "B": "A"}
    assert ageing.followed_of_type(Wildcards(cell="A")) == ["results/stages/ica_tracks/A.parquet"]
    assert ageing.calibration_of(Wildcards(cell="B")).endswith("peak_calibration/A.parquet")


def records_of(cells, tests, groups=()):
    plan = Plan(Campaign({}, cells, tests, list(groups), []))
    kinds = ("hppc", "drive", "capacity")
    return RecordPlan(plan, evidence_kinds=kinds[:2], series_kinds=kinds)


def test_a_test_that_may_be_fitted_repeats_nothing_of_one_that_may_not():
    tests = [a_test("A", "hppc"), a_test("A", "drive")]
    tests += [a_test("A", "drive", "v", role="validation")]
    tests += [a_test("B", "hppc"), a_test("B", "drive", role="validation"), a_test("B", "capacity")]
    records = records_of([cell("A"), cell("B")], tests)
    assert {part: list(cells) for part, cells in records.repeatable.items()} == {
        "fit": ["A"],
        "validation": ["A", "B"],
    }
    fit, proof = (Wildcards(cell="A", test="hppc", part=part) for part in ("fit", "validation"))
    fitted = [f"results/stages/clean/A/{test}.parquet" for test in ("hppc", "drive")]
    assert records.evidence_of(fit) == fitted
    assert records.evidence_of(proof) == [*fitted, "results/stages/clean/A/v.parquet"]
    assert (records.asked_roles(fit), records.asked_roles(proof)) == (
        ["fit"],
        ["validation", "split"],
    )
    assert records.repeats_of(Wildcards(cell="A", test="v")) == [
        "results/stages/repeats/A/validation.parquet"
    ]
    assert records.repeats_of(Wildcards(cell="B", test="hppc")) == []


def test_the_order_of_tests_counts_in_an_aged_cell_with_several():
    tests = [a_test("A", "hppc"), a_test("A", "drive"), a_test("B", "hppc", cycle=300)]
    tests += [a_test("C", "hppc", cycle=300), a_test("C", "drive"), a_test("G", "drive", cycle=3)]
    records = records_of([*map(cell, "ABC")], tests, [member("G", "A", 1), member("G", "B", 2)])
    courses = [records.course_of(Wildcards(cell=name)) for name in "ABCG"]
    assert courses == [[], [], ["results/stages/course/C.parquet"], []]


def test_what_the_sheet_says_of_a_tests_file_channels_and_state_of_charge():
    files = {"file": ["a.csv"], "sha256": None, "instrument": "bdf", "current_sign": None}
    row = a_test("A", "capacity") | files | {"columns": None}
    tests = [row, a_test("A", "ocv"), a_test("A", "drive") | {"soc": 0.5}, a_test("G", "group")]
    groups = [member("G", "A", 1), member("G", "B", 2)]
    stated = [{"cell": "A", "cycle": 3}, {"cell": "B", "cycle": 4}]
    plan = Plan(Campaign({}, [cell("A"), cell("B")], tests, groups, stated))
    assert plan.reading(Wildcards(cell="A", test="capacity")) == files | {"columns": None}
    assert plan.channels_of_group(Wildcards(cell="A", test="capacity")) == {}
    assert plan.channels_of_group(Wildcards(group="G")) == {"members": 2, "cells": 2}
    curves = [plan.curves_for_stated_soc(Wildcards(cell="A", test=t)) for t in ("drive", "ocv")]
    assert curves == [["results/stages/ocv/A/ocv.parquet"], []]
    assert plan.stated_check_ups(Wildcards(cell="B")) == [{"cell": "B", "cycle": 4}]
    assert plan.columns_of_tests("test", "role")(Wildcards(group="G")) == [
        {"test": "group", "role": "fit"}
    ]


def test_tests_beside_others_are_those_at_a_temperature_that_both_state():
    tests = [a_test("A", "eis", celsius=10.0), a_test("A", "eis", "e", celsius=None)]
    tests += [a_test("A", "drive", f"d{k}", celsius=k) for k in (10.0, 25.0, None)]
    plan = Plan(Campaign({}, [cell("A")], tests, [], []))
    assert [row["test"] for row in plan.rows_beside("eis", ["drive"], "A")] == ["d10.0"]
