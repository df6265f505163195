"""A model on a grid of temperatures: what was tested, what lies between, what is beyond."""

import copy

import numpy as np
import pytest
import truth

from cellwright.circuits.temperature import resistance_factor
from cellwright.identification.compensation import temperature_table

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
    expected = resistance_factor(celsius, 25.0, ENERGY)
    tested, rtol = (celsius >= 2) & (celsius <= 25), {True: 1e-3, False: 0.1}
    for name, ohm in (("r_ohmic_ohm", truth.R0[2]), ("r_relaxing_ohm", truth.R[:, 2].sum())):
        for inside in (True, False):
            here = tested == inside
            found = table[name][middle][here]
            np.testing.assert_allclose(found, ohm * expected[here], rtol=rtol[inside])
    assert not table["r_kinetic_ohm"].any()


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
