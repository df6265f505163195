"""The test to run next: from sensitivities, for small made-up cells."""

import numpy as np
import pytest
import small_cells as small

from cellwright.effects.columns import neutral
from cellwright.effects.library import LIBRARY
from cellwright.effects.planning import planner
from cellwright.effects.planning.planner import next_test
from cellwright.effects.planning.sensitivity import Model
from cellwright.refusal import Refusal

RATING = planner.Rating(2.0, 1.2)
TESTS = planner.menu(small.CELL, RATING, celsius=25.0)


@pytest.fixture(scope="module")
def usual():
    return small.usual()


def asked(usual, effect, *alternatives, **more):
    case, model = usual
    return next_test(case, model, effect, alternatives, library=LIBRARY, **more)


def after(advice, test):
    return dict(zip(advice.table["test"], advice.table["chi_square"], strict=True))[test]


def test_a_slow_cycle_separates_hysteresis_from_diffusion_better_than_a_drive(usual):
    advice = asked(usual, "hysteresis_one_state", "slow_diffusion")
    assert advice.test == "c20_both"
    assert after(advice, "c20_both") - advice.now > 20 * (after(advice, "drive_warm") - advice.now)
    assert advice.sentence.startswith("To tell hysteresis one state from slow diffusion: ")
    assert (
        "a C/20 discharge and charge (about 41 h), which would tell them apart by "
        in advice.sentence
    )
    assert f"now {np.sqrt(advice.now):.0f} standard deviations" in advice.sentence


def test_so_it_does_where_diffusion_is_the_truth(usual):
    """That in particles is told by any further drive as well: it goes with the OCV's slope."""
    advice = asked(usual, "slow_diffusion", "hysteresis_one_state")
    assert advice.test in ("c20_both", "cccv_4")
    assert after(advice, "c20_both") > 1.3 * advice.now


def test_another_temperature_is_no_advice_for_what_does_not_depend_on_it(usual):
    advice = asked(usual, "resistance_asymmetry")
    assert not advice.test.endswith(("_warm", "_cold"))
    assert "drive_warm" in advice.table["test"]


def test_other_temperatures_show_resistance_over_temperature(usual):
    advice = asked(usual, "resistance_temperature")
    assert advice.test in ("drive_warm", "drive_cold")
    assert advice.now < 25.0 < after(advice, advice.test) / 10


def test_self_heating_against_resistance_over_temperature(usual):
    """No test at the temperature of the records can tell them apart."""
    elsewhere = {f"{test}_{way}" for test in ("drive", "hppc") for way in ("warm", "cold")}
    advice = asked(usual, "resistance_temperature", "self_heating")
    assert advice.test in ("drive_warm", "drive_cold")
    assert set(advice.table["test"]) == elsewhere
    assert set(asked(usual, "self_heating").table["test"]) > elsewhere


@pytest.mark.parametrize(
    ("effect", "rival", "test"),
    [("leakage", "coulombic_inefficiency", "rest_48h"), ("time_skew", None, "edges")],
)
def test_the_known_best_test_is_found(usual, effect, rival, test):
    advice = asked(usual, effect, *[rival] * bool(rival))
    assert advice.test == test


def test_a_logged_current_is_cheaper_than_any_test(usual):
    advice = asked(usual, "current_offset", "leakage")
    assert "the logged current at commanded open circuit" in advice.sentence
    assert advice.now < 1.0


@pytest.mark.parametrize(
    ("pair", "word"),
    [
        (("lead_resistance",), "four-wire"),
        (("current_gain",), "reference shunt"),
        (("capacity_error", "current_gain"), "reference shunt"),
        (("voltage_offset", "ocv_shift"), "a voltage reference"),
    ],
)
def test_what_no_test_of_the_cell_tells_asks_for_a_check(usual, pair, word):
    advice = asked(usual, *pair)
    assert advice.test == "check"
    assert word in advice.sentence


def test_an_effect_in_the_model_is_weighed_at_its_estimate(usual):
    """Four times the size is sixteen times the chi-square, rival or not."""
    case, model = usual
    hidden = LIBRARY["hysteresis_one_state"]
    advices = []
    for size in (0.002, 0.008):
        values = model.values | dict(zip(hidden.names, (size, 12.0, 0.0), strict=True))
        state = Model(values, (hidden,))
        advices.append(next_test(case, state, hidden.id, ("slow_diffusion",), library=LIBRARY))
    low, high = (advice.table["chi_square"][0] for advice in advices)
    assert high == pytest.approx(16 * low, rel=0.02)


def test_an_estimate_of_zero_leaves_nothing(usual):
    case, model = usual
    hidden = LIBRARY["leakage"]
    state = Model(model.values | neutral(hidden), (hidden,))
    advice = next_test(case, state, hidden.id, library=LIBRARY)
    assert advice.test is None
    assert hidden.shows in advice.sentence
    assert max(advice.table["chi_square"]) < 1e-6


def test_more_records_never_leave_less(usual):
    advice = asked(usual, "polarisation_soc", "resistance_soc")
    assert min(advice.table["chi_square"]) >= advice.now - 1e-6 * abs(advice.now)
    assert advice.table["chi_square"] == sorted(advice.table["chi_square"], reverse=True)


def test_an_unknown_effect_is_refused(usual):
    with pytest.raises(Refusal, match="no effect 'gremlins'"):
        asked(usual, "leakage", "gremlins")


@pytest.mark.parametrize("test", TESTS, ids=lambda test: test.id)
def test_a_planned_test_stays_within_the_rating(test):
    record = test.record
    rates = record.current_ampere / small.CAPACITY
    gaps = np.diff(record.test_time_second)
    soc = 1.0 + np.cumsum(rates[:-1] * gaps) / 3600.0
    assert gaps.min() > 0.0
    assert -RATING.discharge_c_rate <= rates.min()
    assert rates.max() <= RATING.charge_c_rate
    assert soc.min() > -1e-9
    assert soc.max() < 1.0 + 1e-9
    assert len(gaps) < 6000


def test_the_drive_goes_no_further_than_the_cell_may():
    tests = planner.menu(small.CELL, RATING._replace(least_celsius=20.0), celsius=25.0)
    cold = next(test for test in tests if test.id == "drive_cold")
    assert cold.words == "the same drive 5 K colder"
    assert np.all(cold.record.celsius == 20.0)


def test_the_rating_is_that_of_the_records(usual):
    rating = planner.rating_of(usual[0].fit, small.CAPACITY)
    assert 1.8 < rating.discharge_c_rate <= 2.0
    assert 1.0 < rating.charge_c_rate <= 1.2


def test_a_fitted_leak_is_told_from_an_offset_by_no_test_of_the_cell(usual):
    """Not even by the curvature of the OCV, over which the leak has carried the cell."""
    case, model = usual
    hidden = LIBRARY["leakage"]
    state = Model(model.values | neutral(hidden) | {hidden.names[0]: 0.01}, (hidden,))
    advice = next_test(case, state, hidden.id, ("current_offset",), library=LIBRARY)
    assert advice.test == "check"
    assert max(advice.table["chi_square"]) < 10.0
    assert "in which only a leak discharges the cell" in advice.sentence
