"""Missing effects of parallel groups: truth of another simulation found again, and refusals."""

from functools import cache

import numpy as np
import pytest
from group_pair import CELLS, TABLE, record
from quick import slow_but

from cellwright.effects.groups.branch import branch_of
from cellwright.effects.groups.finding import group_finding
from cellwright.effects.groups.model import fields_of, group_run
from cellwright.effects.records import group_stacked
from cellwright.refusal import Refusal


@cache
def finding(**asked):
    return searched(**asked)


def searched(*, celsius=(25.0, 5.0), **hidden):
    fits = [("fit", record(f"fit{t:g}", 1, celsius=t, **hidden)) for t in celsius]
    judge = ("validation", record("judge", 2, **hidden))
    return group_finding("pair", CELLS, [*fits, judge], initial_soc=(0.9, 0.9))


HIDDEN = {
    "branch_wire_resistance": ("wire", 0.008, "excess_ohm"),
    "branch_initial_soc": ("soc", -0.05, "excess_soc"),
    "branch_capacity": ("capacity", -0.15, "excess_relative"),
    "branch_cell_resistance": ("resistance", 0.25, "excess_relative"),
    "branch_temperature": ("warmer", 6.0, "warmer_kelvin"),
    "branch_current_offset": ("offset", 0.3, "offset_ampere"),
    "branch_current_gain": ("gain", 0.08, "gain_relative"),
}


@pytest.mark.parametrize("effect", slow_but("branch_wire_resistance", HIDDEN))
def test_the_effect_of_one_branch_is_named_with_its_size(effect):
    name, size, parameter = HIDDEN[effect]
    verdict = finding(**{name: size}).verdict
    first = verdict["effects"][0]
    assert (first["effect"], first["branch"]) == (effect, 2)
    size_found = first["parameters"][parameter]
    assert size_found["value"] == pytest.approx(size, rel=0.15)
    assert abs(size_found["value"] - size) < 3 * size_found["std"] + 0.02 * abs(size)
    assert verdict["gap_closed"] > 0.9


def test_the_gap_closed_is_the_contracts():
    verdict = finding(wire=0.008).verdict
    floor, both = verdict["floor_volt"], verdict["validation_rmse_volt"]
    remaining, whole = (both[end] ** 2 - floor**2 for end in ("after", "before"))
    assert verdict["gap_closed"] == pytest.approx(1.0 - remaining / whole)
    assert verdict["effects"][0]["gap_closed"] == pytest.approx(verdict["gap_closed"])


def test_the_model_of_a_group_runs_as_the_search_left_it():
    result = finding(wire=0.008)
    fits = [record(f"fit{t:g}", 1, celsius=t, wire=0.008) for t in (25.0, 5.0)]
    stack = group_stacked(fits, branches=2, hold=result.model["hold"])
    voltage = group_run(fields_of(result.model), stack).voltage
    fitted = result.series["role"] == "fit"
    assert voltage == pytest.approx(result.series["after_volt"][fitted], abs=1e-12)


def test_a_healthy_group_lacks_nothing():
    verdict = finding().verdict
    assert (verdict["verdict"], verdict["effects"]) == ("none", [])


def test_what_is_within_the_declared_spread_is_healthy():
    assert finding(soc=0.003, resistance=0.01).verdict["verdict"] == "none"


@pytest.mark.slow
def test_a_warm_cell_and_a_low_resistance_are_one_at_one_temperature():
    verdict = finding(celsius=(25.0, 25.0, 25.0), warmer=6.0).verdict
    first = verdict["effects"][0]
    assert verdict["verdict"] == "ambiguous"
    assert {first["effect"], *first["alternatives"]} >= {
        "branch_temperature",
        "branch_cell_resistance",
    }
    assert "chamber temperature" in verdict["next_test"]


def blind(**hidden):
    records = [("fit", record("fit", 1, currents=False, **hidden))]
    records += [("validation", record("judge", 2, currents=False, **hidden))]
    return group_finding("pair", CELLS, records, initial_soc=(0.9, 0.9)).verdict


@pytest.mark.parametrize("hidden", [{}, {"offset": 0.3}, {"capacity": -0.15}])
def test_without_branch_currents_no_name_is_sure(hidden):
    verdict = blind(**hidden)
    assert verdict["verdict"] in ("none", "ambiguous")
    assert "Log the branch currents" in verdict["next_test"]
    assert {"branch_current_offset", "branch_current_gain"} <= set(verdict["not_testable"])


@pytest.mark.slow
def test_the_same_records_give_the_same_verdict():
    assert searched(wire=0.008).verdict == finding(wire=0.008).verdict


def test_ranking_and_series_have_columns_of_one_length():
    result = finding(wire=0.008)
    for columns in (result.ranking, result.series):
        assert len({len(column) for column in columns.values()}) == 1


def test_a_branch_is_made_of_a_cells_model():
    values = {"log_r0": -4.0, "log_r1": -5.0, "log_r2": -5.0, "log_tau1": 2.0, "log_tau2": 5.0}
    values |= {"capacity": 0.01} | {f"ocv[{k}]": 1e-3 for k in range(16)}
    model = {"capacity_ampere_hour": 5.0, "ocv_volt": TABLE.tolist(), "values": values}
    branch = branch_of("c", model, wire_ohm=1e-3)
    assert branch.capacity_ampere_hour == pytest.approx(5.05)
    assert branch.ocv_volt == pytest.approx(TABLE + 1e-3)
    assert branch.r_ohm[0] == pytest.approx(np.exp(-4.0))


BAD = {
    "not a number": lambda r: r._replace(voltage_volt=np.full_like(r.voltage_volt, np.nan)),
    "runs back": lambda r: r._replace(test_time_second=r.test_time_second[::-1]),
    "miss the total": lambda r: r._replace(member_current_ampere=-r.member_current_ampere),
    "of 2 branches": lambda r: r._replace(member_current_ampere=r.member_current_ampere[:, :1]),
}


@pytest.mark.parametrize("words", BAD)
def test_bad_records_are_refused(words):
    spoiled = BAD[words](record("fit", 1))
    with pytest.raises(Refusal, match=words):
        group_finding("pair", CELLS, [("fit", spoiled), ("validation", record("judge", 2))])


def test_a_group_without_a_judge_is_refused():
    with pytest.raises(Refusal, match="no record of role validation"):
        group_finding("pair", CELLS, [("fit", record("fit", 1))])
