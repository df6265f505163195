"""OCV functions and surface over temperature: the surface rises, fits recover the truth."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cellwright.laws.ocv.entropy import Readings, zero_crossings
from cellwright.laws.ocv.surface import (
    Surface,
    compare,
    fit_form,
    form_ocv,
    is_tested,
    powers_of,
    table_at,
)
from cellwright.protocols.ocv.functions import FORMS, parameter_stds
from cellwright.refusal import Refusal

SOC = np.linspace(0, 1, 201)
AT = np.linspace(0.02, 0.98, 333)
TRUTH = {
    "log": [3.6, 0.003, -0.5, 0.02, -0.03],
    "two_exponentials": [3.0, 0.6, 0.4, 20.0, -0.3, 0.5],
    "inverse": [4.1, 0.005, -0.9, 0.5],
    "polynomial": [3.0, 3.0, -10.0, 22.0, -28.0, 19.0, -5.0],
}


def moving(name):
    """Parameters of which each linear one moves with temperature."""
    places = np.array(FORMS[name].places)
    parameters = np.zeros((len(places), 3))
    parameters[:, 0] = TRUTH[name]
    parameters[places >= 0, 1] = 1e-3 * parameters[places >= 0, 0]
    parameters[places >= 0, 2] = 1e-5
    return parameters


def surface(seed=1, plateau=True):
    """A table with a plateau that the shift bends downwards."""
    random = np.random.default_rng(seed)
    rises = random.uniform(0, 4e-3, 200) * (random.uniform(size=200) > 0.5 * plateau)
    volt = 3.0 + np.append(0, np.cumsum(rises))
    slope = np.interp(SOC, np.linspace(0, 1, 9), random.normal(0, 6e-4, 9))
    return Surface(SOC, volt, slope, np.full(201, 1e-6), 25.0, (0.1, 0.9), (-20.0, 40.0))


@pytest.mark.parametrize("name", TRUTH)
def test_a_function_over_temperature_finds_itself(name):
    soc, celsius = (part.ravel() for part in np.meshgrid(AT[::4], [-20.0, -5.0, 10.0, 25.0, 40.0]))
    settings = {"reference_celsius": 25.0}
    volt = form_ocv(name, moving(name), soc, celsius, **settings)
    fitted = fit_form(name, soc, celsius, volt, degree=2, **settings)
    again = form_ocv(name, fitted, soc, celsius, **settings)
    assert np.abs(again - volt).max() < 1e-5
    noisy = volt + np.random.default_rng(1).normal(0, 1e-3, len(volt))
    fit = fit_form(name, soc, celsius, noisy, degree=2, near=fitted, **settings)
    powers = powers_of(celsius, settings["reference_celsius"], 2)
    std = parameter_stds(FORMS[name], fit, soc, noisy, powers=powers)
    free = np.isfinite(std)
    assert np.mean(np.abs((fit - moving(name))[free] / std[free]) < 3) > 0.85


@given(st.integers(0, 50), st.floats(-40, 60))
def test_a_surface_rises_at_every_temperature(seed, celsius):
    volt, _ = table_at(surface(seed), celsius)
    assert (np.diff(volt) > 0).all()


def test_a_surface_says_where_it_was_tested():
    table = surface(3)
    assert np.array_equal(is_tested(table, SOC, -20.0), (SOC >= 0.0999) & (SOC <= 0.9001))
    assert not is_tested(table, SOC, -30.0).any()
    assert is_tested(table, 0.5, 25.0)


def readings(celsius, std=1e-4):
    volt = np.stack([3.4 + 0.5 * SOC + 3e-4 * (SOC - 0.5) * (T - 25) for T in celsius], axis=1)
    volt = volt + np.random.default_rng(0).normal(0, 1e-5, volt.shape)
    level = np.broadcast_to(np.array(celsius, float), volt.shape)
    parts = (np.full(volt.shape, std), np.zeros(volt.shape))
    return Readings(SOC, level, volt, *parts, ())


def test_what_has_no_temperature_to_leave_out_is_refused():
    settings = {"reference_celsius": 25.0}
    with pytest.raises(Refusal, match=r"at 3 temperature\(s\)"):
        compare(readings((0, 25, 40)), **settings)
    with pytest.raises(Refusal, match=r"within ±20 mV at 0 temperature\(s\)"):
        compare(readings((0, 10, 25, 40), std=0.1), **settings)


@pytest.mark.slow
def test_left_out_temperatures_are_the_same_points_for_all():
    functions = compare(readings((-10, 0, 10, 25, 40)), reference_celsius=25.0)
    errors = {f["function"]: f["cross_validation_rmse_volt"] for f in functions}
    assert errors["polynomial"] < 5e-5
    assert errors["isothermal"] > 1e-3
    assert errors["surface"] < 5e-5
    assert sum(f["chosen"] for f in functions) == 1


def test_a_crossing_lies_between_certain_signs_only():
    soc, slope = np.linspace(0, 1, 11), np.linspace(-1, 1, 11) + 0.05
    std = np.full(11, 0.2)
    (crossing,) = zero_crossings(soc, slope, std, slope - 0.4, slope + 0.4)
    assert crossing["lower_soc"] == pytest.approx(0.2)
    assert crossing["upper_soc"] == pytest.approx(0.7)
    assert crossing["soc"] == pytest.approx(0.475)
    assert zero_crossings(soc, slope, std, slope - 2, slope + 2) == []
    (falling,) = zero_crossings(soc, -slope, std, -slope - 0.4, -slope + 0.4)
    assert falling["sign_above"] == -1
