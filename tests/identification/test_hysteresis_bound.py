"""What a slow test allows as hysteresis, and a fit that stays within it."""

import numpy as np
import pytest
from synthetic import data, fit, hysteresis, measured

from cellwright.protocols.ocv.gap import largest_hysteresis

READING_VOLT = 3e-3  # how far the reading of a slow branch is trusted
KNOTS = np.array([0.0, 0.1, 0.5, 0.9, 1.0])


def slow(celsius=25.0, half_gap_volt=0.02, branches="both"):
    soc = np.linspace(0, 1, 201)
    gap = np.where((soc > 0.02) & (soc < 0.98), half_gap_volt, np.nan)
    return {
        "test": f"ocv_{celsius:g}",
        "ambient_temperature_celsius": celsius,
        "branches": branches,
        "soc": soc.tolist(),
        "half_gap_volt": [None if np.isnan(volt) else volt for volt in gap],
        "charge_current_ampere": 0.1,
        "discharge_current_ampere": -0.1,
    }


def basis(*curves, borrowed_from=None):
    return {"ocv": list(curves), "borrowed_from": borrowed_from}


def test_half_the_gap_is_the_most_with_the_reading_of_the_branches():
    most_volt, words = largest_hysteresis(basis(slow()), 25.0, KNOTS)
    np.testing.assert_allclose(most_volt, 0.02 + READING_VOLT)
    assert words == "is at most 23 to 23 mV, half the gap between the branches of ocv_25"


def test_a_steep_gap_is_taken_where_it_is_widest_within_the_socs_doubt():
    curve = slow()
    curve["half_gap_volt"] = np.linspace(0.1, 0.0, 201).tolist()
    most_volt, _ = largest_hysteresis(basis(curve), 25.0, np.array([0.5]))
    np.testing.assert_allclose(most_volt, 0.052 + READING_VOLT)


def test_what_comes_at_once_is_taken_off_where_it_is_most_of_the_gap():
    for step_volt, left in ((0.005, 0.02), (0.015, 0.005)):
        most_volt, _ = largest_hysteresis(basis(slow() | {"step_volt": step_volt}), 25.0, KNOTS)
        np.testing.assert_allclose(most_volt, left + READING_VOLT)


@pytest.mark.parametrize("celsius", [-25.0, 0.0, 25.0, 45.0])
def test_polarisation_in_the_cold_allows_no_hysteresis_that_a_warm_gap_does_not(celsius):
    """A C/30 gap of 100 mV at −25 °C is polarisation where that at 25 °C is 12 mV."""
    curves = (slow(-25.0, 0.1), slow(25.0, 0.012), slow(5.0, 0.02))
    most_volt, words = largest_hysteresis(basis(*curves), celsius, KNOTS)
    np.testing.assert_allclose(most_volt, 0.012 + READING_VOLT)
    assert words == "is at most 15 to 15 mV, half the gap between the branches of ocv_25"


def test_at_each_soc_the_test_serves_that_allows_least():
    falling, flat = slow(25.0), slow(5.0, 0.02)
    falling["half_gap_volt"] = np.linspace(0.04, 0.0, 201).tolist()
    most_volt, words = largest_hysteresis(basis(falling, flat), 0.0, np.array([0.1, 0.9]))
    np.testing.assert_allclose(most_volt, np.array([0.02, 0.0048]) + READING_VOLT)
    assert "of ocv_25 and ocv_5" in words


@pytest.mark.parametrize(("celsius", "left_volt"), [(25.0, 0.014), (24.0, 0.014), (0.0, 0.02)])
def test_the_drop_over_the_resistance_at_the_tests_own_temperature_is_none(celsius, left_volt):
    """0.1 A over 60 mΩ are 6 mV of a half gap of 20 mV."""
    sizes = {"prompt_ohm": np.full(5, 0.06)}
    most_volt, words = largest_hysteresis(basis(slow()), celsius, KNOTS, **sizes)
    np.testing.assert_allclose(most_volt, left_volt + READING_VOLT)
    assert ("less 6 to 6 mV over the resistance" in words) is (celsius > 0)


@pytest.mark.parametrize(
    ("known", "words"),
    [
        (basis(slow(0.0, branches="discharge")), "no slow test ran both ways"),
        (basis(slow(0.0), borrowed_from="R1"), "the OCV is that of R1"),
        (basis(), "no slow test ran both ways"),
    ],
)
def test_where_no_slow_test_tells_there_is_no_bound(known, words):
    most_volt, bounded_by = largest_hysteresis(known, 0.0, KNOTS)
    assert most_volt is None
    assert f"not bounded: {words}" in bounded_by


def sizes(condition):
    return condition.branches[-1].values["m_volt"]


def test_a_hysteresis_below_its_bound_is_found_as_without_one():
    ready = data(*measured(1, extra=(hysteresis(),)))
    wide = np.full(len(ready.knots), 0.05)
    free, bounded = (fit(one, "2RC+H") for one in (ready, ready._replace(most_volt=wide)))
    np.testing.assert_array_equal(sizes(bounded.condition), sizes(free.condition))
    np.testing.assert_allclose(sizes(bounded.condition), 0.02, rtol=0.15)


def test_a_sink_holds_no_more_than_the_slow_test_allows():
    ready = data(*measured(1, extra=(hysteresis(0.06),)))
    most = np.full(len(ready.knots), 0.025)
    free, bounded = (fit(one, "2RC+H") for one in (ready, ready._replace(most_volt=most)))
    assert sizes(free.condition).max() > 0.03
    assert sizes(bounded.condition).max() == 0.025
    held = [one for one in bounded.condition.at_bound if one["limit"] == "slow_test"]
    assert len(held) == np.count_nonzero(sizes(bounded.condition) == 0.025)
    assert np.isnan(bounded.condition.branches[-1].stds["m_volt"]).sum() >= len(held)


def test_a_bound_is_kept_when_blocks_are_left_out():
    from cellwright.identification.regression import held_out

    ready = data(*measured(1, extra=(hysteresis(),)))
    most = np.full(len(ready.knots), 0.005)
    fitted = fit(ready._replace(most_volt=most), "2RC+H")
    fold = np.arange(len(fitted.solution.residual_volt)) * 4 // len(fitted.solution.residual_volt)
    assert np.isfinite(held_out(fitted.system, fitted.solution, fold)).all()
    assert sizes(fitted.condition).max() <= 0.005
