"""Scores of a simulation: zero for the truth, and only over what was not fitted."""

import numpy as np
import pytest
import truth
from sheets_facts import cell_facts, facts_of

from cellwright.identification.validation import beyond_volt, scores, validate
from cellwright.records.facts import MeasuredTest
from cellwright.records.record import laid_out
from cellwright.refusal import Refusal

CELL = cell_facts()
FACTS = facts_of(soc=0.95, role="validation")
TIME, CURRENT = truth.drive(np.random.default_rng(5), 6000)
SOC = truth.soc_of(TIME, CURRENT, 0.95)


def series(**change):
    columns = {
        "test_time_second": TIME,
        "current_ampere": CURRENT,
        "charge_ampere_hour": (SOC - 0.95) * truth.CAPACITY_AMPERE_HOUR,
        "voltage_volt": truth.voltage(TIME, CURRENT, SOC),
    }
    return columns | change


def score(facts=FACTS, *, model=None, **change):
    test, model = MeasuredTest(facts, series(**change)), model or truth.model()
    record = laid_out(test, model, CELL, split_rest_second=120.0, proof=True)
    return validate(model, record)


def test_the_truth_has_no_error():
    scored = score()
    (row,) = scored.rows
    assert row["rmse_volt"] < 1e-12
    assert (row["model"], row["chosen"], row["samples"]) == ("2RC", True, len(TIME))
    assert (row["soc_start"], row["soc_anchor"]) == (0.95, "stated at the start")
    assert scored.notes == ("simulated at the chamber's temperature",)
    np.testing.assert_allclose(scored.series["simulated_2RC_volt"], scored.series["voltage_volt"])


def test_what_lies_outside_the_identified_range_is_counted():
    (row,) = score().rows
    outside = (truth.KNOTS[0] > SOC) | (truth.KNOTS[-1] < SOC)
    assert 0 < row["extrapolated"] == pytest.approx(outside.mean())
    assert score(FACTS._replace(ambient_temperature_celsius=40.0)).rows[0]["extrapolated"] == 1.0


def test_errors_within_and_beyond_what_was_fitted_stand_apart():
    outside = (truth.KNOTS[0] > SOC) | (truth.KNOTS[-1] < SOC)
    (row,) = score(voltage_volt=series()["voltage_volt"] + np.where(outside, 0.05, 0.01)).rows
    assert row["rmse_within_fitted_volt"] == pytest.approx(0.01)
    assert row["rmse_beyond_fitted_volt"] == pytest.approx(0.05)
    (row,) = score(FACTS._replace(ambient_temperature_celsius=40.0)).rows
    assert np.isnan(row["rmse_within_fitted_volt"])


def test_an_offset_is_the_error():
    (row,) = score(voltage_volt=series()["voltage_volt"] + 0.01).rows
    values = [row[name] for name in ("rmse_volt", "max_abs_volt", "mean_volt")]
    np.testing.assert_allclose(values, 0.01, rtol=1e-9)


def test_a_split_record_is_scored_on_even_blocks_only():
    odd = (TIME // 1500) % 2 == 0
    scored = score(FACTS._replace(role="split"), voltage_volt=series()["voltage_volt"] + odd)
    np.testing.assert_array_equal(scored.series["scored"], ~odd)
    assert scored.rows[0]["samples"] == (~odd).sum()
    assert scored.rows[0]["max_abs_volt"] < 1e-9


def two_temperatures():
    cold = truth.model(celsius=0.0, scale=3.0)
    warm = truth.model()
    conditions = [m["members"][0]["conditions"][0] for m in (cold, warm)]
    member = {"model": "2RC", "conditions": conditions}
    return warm | {"members": [member], "ocv": cold["ocv"] + warm["ocv"]}


def test_it_is_simulated_at_the_measured_surface_else_at_the_chamber():
    unknown = FACTS._replace(ambient_temperature_celsius=None)
    model, surface = two_temperatures(), {"surface_temperature_celsius": np.full(len(TIME), 0.0)}
    stated = score(FACTS._replace(ambient_temperature_celsius=0.0), model=model)
    for facts in (unknown, FACTS):
        measured = score(facts, model=model, **surface)
        assert measured.rows[0]["rmse_volt"] == stated.rows[0]["rmse_volt"] > 0.01
        assert measured.notes == ("simulated at the surface's measured temperature",)
    chamber = score(FACTS, model=model)
    assert chamber.rows[0]["rmse_volt"] < 1e-9
    neither = score(unknown, model=model)
    assert neither.rows[0]["rmse_volt"] < 1e-9
    assert neither.notes == ("simulated at 25 °C, for want of any temperature",)
    gaps = {"surface_temperature_celsius": np.where(TIME == 5, np.nan, 0.0)}
    assert score(unknown, model=model, **gaps).notes == neither.notes


def test_scores_are_arithmetic():
    errors = scores(np.array([3.0, -1.0, 1.0, -1.0]), np.array([0.01, 0.5, 0.6, 0.95]))
    assert errors["rmse_volt"] == pytest.approx(np.sqrt(3.0))
    assert errors["rmse_volt_soc_5_95"] == 1.0
    assert (errors["max_abs_volt"], errors["mean_volt"], errors["samples"]) == (3.0, 0.5, 4)
    assert np.isnan(scores(np.ones(2), np.zeros(2))["rmse_volt_soc_5_95"])


def test_a_simulation_outside_what_was_measured_is_told_by_how_much():
    """Two samples of a thousand at -1.5 V are 0.2 V rms, and no cell is ever there."""
    measured = np.linspace(4.2, 2.5, 1000)
    simulated_volt = measured.copy()
    simulated_volt[-2:] = -1.5
    assert scores(measured - simulated_volt, np.full(1000, 0.5))["rmse_volt"] < 0.2
    assert beyond_volt(measured, measured - simulated_volt) == pytest.approx(4.0)
    assert beyond_volt(measured, measured - measured.clip(3.0, 4.0)) == 0.0
    assert beyond_volt(measured, np.full(1000, -0.3)) == pytest.approx(0.3)


def test_the_whole_simulation_counts_not_only_what_is_scored():
    volt = series()["voltage_volt"]
    lowest = volt.min()
    (row,) = score(FACTS._replace(role="split"), voltage_volt=volt.clip(lowest + 0.2)).rows
    assert row["beyond_volt"] == pytest.approx(0.2)
    far = score(voltage_volt=volt.clip(lowest + 0.7))
    assert far.notes[1:] == ("2RC simulates 0.7 V outside what was measured: a fault",)


def test_refusals():
    with pytest.raises(Refusal, match="no sample is left"):
        scores(np.array([]), np.array([]))
    with pytest.raises(Refusal, match="1 simulated voltages are not finite"):
        scores(np.array([0.1, np.nan]), np.array([0.5, 0.5]))
    short = {"test_time_second": TIME / 20, "current_ampere": CURRENT - 1.5}
    with pytest.raises(Refusal, match="no rest of 120 s inside"):
        score(FACTS._replace(role="split"), **short)
    with pytest.raises(Refusal, match="no state of charge"):
        score(FACTS._replace(soc=None), current_ampere=CURRENT - 1.5)


def test_a_simulation_with_a_value_that_is_no_number_is_beyond_all_measurement():
    measured = np.linspace(3.0, 4.0, 10)
    assert beyond_volt(measured, np.where(np.arange(10) == 3, np.nan, 0.0)) == np.inf
