"""A group simulated from its cells' models: no error for the truth, Kirchhoff, what is scored."""

import numpy as np
import pytest
import truth
from sheets_facts import branch_facts, measured_test

from cellwright.identification.borrowed import scaled_reference
from cellwright.packs.group import validate_group
from cellwright.packs.parallel import group_of, simulate_parallel
from cellwright.refusal import Refusal

MODELS = [
    truth.model("A"),
    scaled_reference(truth.model(), cell="B", capacity=1.6, resistance_ratio=1.7),
]
TIME = np.arange(0.0, 6000.0, 10.0)
TOTAL = np.where(TIME < 100, 0.0, np.where(TIME % 2000 < 1500, -2.0, 1.0))
SOC, WIRE = [0.9, 0.9], [0.01, 0.0]


def branches(soc=SOC, wire=WIRE):
    return branch_facts("AB", soc, wire)


def record(soc=SOC, wire=WIRE):
    group = group_of(MODELS, temperature_celsius=25.0)
    run = simulate_parallel(TIME, TOTAL, group, initial_soc=soc, wire_resistance_ohm=wire)
    series = {"test_time_second": TIME, "current_ampere": TOTAL, "voltage_volt": run.voltage_volt}
    measured = {f"branch_{k + 1}_current_ampere": run.branch_current_ampere[:, k] for k in (0, 1)}
    return series | measured


def score(series, rows=None, models=MODELS, **facts):
    test = measured_test(series, "pair", "group", **facts)
    return validate_group(models, rows or branches(), test)


def test_the_truth_has_no_error_and_currents_sum_to_the_total():
    scored = score(record(), celsius=None)
    for row, model in zip(scored.rows, MODELS, strict=True):
        assert row["current_rmse_ampere"] < 1e-9
        assert row["voltage_rmse_volt"] < 1e-9
        assert row["kcl_residual_ampere"] < 1e-9
        assert row["samples"] == len(TIME)
        assert row["capacity_ampere_hour"] == model["capacity_ampere_hour"]
    assert [(row["branch"], row["cell"]) for row in scored.rows] == [(1, "A"), (2, "B")]
    assert scored.notes == ()


def test_a_member_that_a_group_cannot_run_is_replaced_and_it_is_said():
    entry = MODELS[0]["members"][0]["conditions"][0]
    kinetic = {"kind": "kinetic", "r_ohm": [0.01] * 5, "tau_second": [1.0] * 5}
    kinetic |= {"scale_volt": [0.05] * 5}
    more = {"model": "DRT+K", "conditions": [entry | {"branches": [kinetic]}]}
    first = MODELS[0] | {"members": [more, *MODELS[0]["members"]], "chosen": "DRT+K"}
    scored = score(record(), models=[first, MODELS[1]])
    assert [row["model"] for row in scored.rows] == ["2RC", "2RC"]
    assert scored.notes == ("A simulated as 2RC: its DRT+K is more than RC pairs",)
    assert scored.rows[0]["current_rmse_ampere"] < 1e-9


def test_an_error_of_one_sensor_is_that_branch_alone():
    series = record()
    series["branch_2_current_ampere"] = series["branch_2_current_ampere"] + 0.05
    first, second = score(series).rows
    assert first["current_rmse_ampere"] < 1e-9
    assert second["current_rmse_ampere"] == pytest.approx(0.05)
    assert second["current_max_ampere"] == pytest.approx(0.05)


def fitted(start, stop, test="pair"):
    span = {"test": test, "from_second": start, "to_second": stop}
    return [MODELS[0] | {"fitted": span}, MODELS[1]]


def test_what_a_model_was_fitted_to_is_not_scored():
    series = record()
    seen = (TIME >= 1000.0) & (TIME <= 3000.0)
    series["branch_1_current_ampere"] = series["branch_1_current_ampere"] + seen
    scored = score(series, models=fitted(1000.0, 3000.0))
    np.testing.assert_array_equal(scored.series["scored"], ~seen)
    assert scored.rows[0]["current_max_ampere"] < 1e-9
    assert scored.rows[0]["samples"] == (~seen).sum()
    assert scored.notes == (f"{seen.mean():.0%} of the record was fitted and is not scored",)
    other = score(series, models=fitted(1000.0, 3000.0, test="another"))
    assert other.series["scored"].all()
    with pytest.raises(Refusal, match="nothing is left to score"):
        score(series, models=fitted(0.0, 6000.0))


def test_soc_at_the_start_is_found_from_the_rest_voltage_where_not_stated():
    scored = score(record(), branches(soc=[None, None]))
    assert scored.notes == ("SoC at the start from the group's first voltage",)
    assert scored.rows[0]["current_rmse_ampere"] < 2e-3
    mixed = score(record(soc=[0.8, 0.9]), branches(soc=[0.8, None]))
    assert mixed.series["simulated_voltage_volt"][0] == pytest.approx(
        record([0.8, 0.9])["voltage_volt"][0], abs=0.03
    )
    loaded = record() | {"current_ampere": TOTAL - 1.0}
    with pytest.raises(Refusal, match="initial_soc is not stated"):
        score(loaded, branches(soc=[0.9, None]))


def test_wires_that_are_not_stated_are_none_and_it_is_said():
    scored = score(record(wire=[0.01, 0.0]), branches(wire=[0.01, None]))
    assert scored.rows[0]["current_rmse_ampere"] < 1e-9
    assert scored.notes == ("wire resistances are not stated: taken as none beyond the cells' own",)


def test_refuses_another_number_of_branches():
    with pytest.raises(Refusal, match=r"found Branch 2 Current / A; groups\.tsv wires 1 members"):
        score(record(), branches()[:1], models=MODELS[:1])
