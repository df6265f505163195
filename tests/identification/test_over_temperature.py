"""A model on a grid of temperatures: what was tested, what lies between, what is beyond."""

import copy

import numpy as np
import pytest
import truth

from cellwright.circuits.temperature import resistance_factor
from cellwright.identification.compensation import laws_beyond, temperature_table

ENERGY = 30e3


@pytest.fixture
def model():
    one, cold = (
        truth.model(celsius=t, scale=resistance_factor(t, 25.0, ENERGY)) for t in (25.0, 2.0)
    )
    one["members"][0]["conditions"] += cold["members"][0]["conditions"]
    for condition in one["members"][0]["conditions"]:
        condition["activation_energy_joule_per_mole"] = ENERGY
    return one


def test_tested_temperatures_are_there_and_others_follow_the_law(model):
    table = temperature_table(model, None)
    celsius = np.unique(table["temperature_celsius"])
    assert celsius.tolist() == [-5, 0, 2, 5, 10, 15, 20, 25, 30, 35]
    middle = table["soc"] == 0.5
    expected = truth.R0[2] * resistance_factor(celsius, 25.0, ENERGY)
    np.testing.assert_allclose(table["r_ohmic_ohm"][middle], expected, rtol=1e-9)
    relaxing = truth.R[:, 2].sum() * resistance_factor(celsius, 25.0, ENERGY)
    np.testing.assert_allclose(table["r_relaxing_ohm"][middle], relaxing, rtol=1e-9)
    assert not table["r_kinetic_ohm"].any()


def test_a_parabola_that_turns_in_the_heat_may_not_go_on_there():
    """An ohmic part that hardly moves any more once it is warm: ln R bends, the parabola turns."""

    def identified(factors):
        models = [
            truth.model(celsius=celsius, scale=factor)
            for celsius, factor in zip((0.0, 15.0, 30.0), factors, strict=True)
        ]
        for one in models[1:]:
            models[0]["members"][0]["conditions"] += one["members"][0]["conditions"]
        return models[0]

    offered, words = laws_beyond(identified([3.0, 1.1, 1.0]))
    assert offered == ("between", "arrhenius")
    assert "quadratic is not offered beyond the tested temperatures" in words
    arrhenius = [resistance_factor(celsius, 25.0, ENERGY) for celsius in (0.0, 15.0, 30.0)]
    assert laws_beyond(identified(arrhenius)) == (("between", "arrhenius", "quadratic"), "")


def test_what_was_not_tested_is_marked(model):
    table = temperature_table(model, None)
    beyond = (table["temperature_celsius"] < 2) | (table["temperature_celsius"] > 25)
    np.testing.assert_array_equal(table["extrapolated_temperature"], beyond)
    outside = (table["soc"] < truth.KNOTS[0]) | (table["soc"] > truth.KNOTS[-1])
    np.testing.assert_array_equal(table["extrapolated_soc"], outside)


def test_one_unknown_temperature_is_all_that_a_model_of_it_says():
    model = copy.deepcopy(truth.model())
    model["members"][0]["conditions"][0]["ambient_temperature_celsius"] = None
    table = temperature_table(model, "2RC")
    assert np.isnan(table["temperature_celsius"]).all()
    assert len(table["soc"]) == 21
