"""The engine of laws: what a form finds, leaves out and tells of itself."""

import numpy as np
import pytest
from arrhenius import arrhenius_law
from hypothesis import given
from hypothesis import strategies as st

from cellwright.laws.law import best_of, fit_law, left_out, value_of
from cellwright.laws.temperature import FORMS
from cellwright.numerics.lines import generalised_line, inverse_temperature


@given(st.floats(1e-4, 10), st.floats(-5e4, 1e5), st.floats(-30, 60))
def test_the_arrhenius_fit_finds_its_law(value, energy, coldest):
    celsius = coldest + np.array([0.0, 10.0, 25.0, 40.0])
    truth = arrhenius_law(celsius, value, energy)
    law = fit_law(FORMS["arrhenius"], celsius, truth, unit="Ohm")
    assert law.values[0] == pytest.approx(value, rel=1e-6)
    assert law.values[1] == pytest.approx(energy, rel=1e-6, abs=1e-2)
    assert value_of(FORMS["arrhenius"], celsius, law.values) == pytest.approx(truth)
    assert law.units == ("Ohm", "J/mol")


def test_stated_errors_of_an_arrhenius_fit_are_those_of_the_value():
    """ln x is off by std/x; beyond two temperatures the energy's error is that over their span."""
    celsius, value = np.array([-20.0, 25.0, 25.0]), np.array([4.0, 1.0, 1.0])
    law = fit_law(FORMS["arrhenius"], celsius, value, np.array([0.04, 1e-9, 1e-9]), unit="Ohm")
    assert law.std[1] == pytest.approx(0.01 / np.ptp(inverse_temperature(celsius)), rel=1e-3)


def test_a_covariance_weighs_as_the_generalised_line_does():
    celsius, value = np.array([0.0, 10.0, 25.0, 40.0]), np.array([1.0, 1.4, 1.5, 2.2])
    shared = np.array([0.3, 0.2, 0.1, 0.0])
    covariance = np.diag([0.01, 0.02, 0.01, 0.02]) + np.outer(shared, shared)
    law = fit_law(FORMS["linear"], celsius, value, covariance, unit="V")
    line = generalised_line(FORMS["linear"].columns(celsius), value, covariance)
    np.testing.assert_allclose([law.values, law.std], [line.values, line.std])
    weight = np.linalg.inv(covariance)
    flat = value - np.ones(4) @ weight @ value / weight.sum()
    off = value - value_of(FORMS["linear"], celsius, law.values)
    assert law.r_squared == pytest.approx(1 - (off @ weight @ off) / (flat @ weight @ flat))


def test_what_is_left_out_is_predicted_by_the_others_alone():
    groups, value = np.array([0, 0, 1, 2, 2]), np.array([1.0, 3.0, 5.0, 7.0, 9.0])

    def mean_of_others(out):
        return np.full(out.sum(), value[~out].mean())

    found = left_out(mean_of_others, groups, least=2)
    np.testing.assert_allclose(found, [7.0, 7.0, 5.0, 3.0, 3.0])
    assert np.isnan(left_out(mean_of_others, groups, least=3)).all()


def test_the_best_is_the_first_of_the_least_and_never_one_unknown():
    assert best_of({"a": np.nan, "b": 2.0, "c": 1.0, "d": 1.0}) == "c"
    assert best_of({"a": np.nan, "b": np.nan}) == "a"
