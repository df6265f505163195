"""The one law over temperature: it finds known energies, meets what was identified, and knows what
cells show where a cell does not tell it."""

import numpy as np
import pytest
import truth

from cellwright.circuits.model_check import refuse_unusable
from cellwright.circuits.model_file import circuit_at
from cellwright.circuits.temperature import (
    ENERGIES,
    fitted_law,
    laws_over_temperature,
    log_factor,
    resistance_factor,
)
from cellwright.refusal import Refusal

KNOWN = np.array([-20.0, 0.0, 25.0, 45.0])


def entry(celsius, ohmic, kinetic, relaxing=None):
    branch = {"kind": "kinetic", "r_ohm": [kinetic] * 2, "tau_second": [0.1] * 2}
    branches = [branch | {"scale_volt": [0.05] * 2}]
    if relaxing is not None:
        branches.append({"kind": "RC", "r_ohm": [relaxing] * 2, "tau_second": [50.0] * 2})
    about = {"ambient_temperature_celsius": celsius, "soc": [0.2, 0.8], "r0_ohm": [ohmic] * 2}
    return about | {"branches": branches}


def made(celsius, ohmic=12e3, kinetic=60e3, relaxing=25e3):
    """Condition of a cell with known activation energies [J/mol]."""
    ohms = [
        0.02 * resistance_factor(celsius, 25.0, energy) for energy in (ohmic, kinetic, relaxing)
    ]
    return entry(celsius, *ohms)


def ohms(conditions, celsius):
    """Resistances (branches, n) at half charge."""
    celsius = np.atleast_1d(np.asarray(celsius, float))
    circuit = circuit_at(conditions, np.full(len(celsius), 0.5), celsius).circuit
    return np.array([branch.parameters["r_ohm"] for branch in circuit])


@pytest.mark.parametrize("law", [0, 1, 2])
def test_what_was_identified_is_met(law):
    conditions = [made(t, 30e3 * (law == 0) + 5e3, 40e3, 60e3 * (law == 2)) for t in KNOWN]
    expected = np.array(
        [[c["r0_ohm"][0], *(b["r_ohm"][0] for b in c["branches"])] for c in conditions]
    )
    np.testing.assert_allclose(ohms(conditions, KNOWN), expected.T, rtol=1e-9)


@pytest.mark.parametrize("left_out", KNOWN)
def test_a_temperature_that_is_left_out_is_found_again(left_out):
    """Each kind has an energy of its own, off what cells usually have by one deviation."""
    conditions = [made(t, 22e3, 62e3, 12e3) for t in KNOWN if t != left_out]
    expected = made(left_out, 22e3, 62e3, 12e3)
    expected = np.array([expected["r0_ohm"][0], *(b["r_ohm"][0] for b in expected["branches"])])
    found = ohms(conditions, left_out)[:, 0]
    beyond = left_out in (KNOWN[0], KNOWN[-1])
    np.testing.assert_allclose(found, expected, rtol=0.2 if beyond else 1e-3)


def test_a_known_bend_is_found_and_followed_between_the_temperatures():
    inverse = 1.0 / (KNOWN + 273.15) - 1.0 / 298.15
    reference = 1.0 / 248.15 - 1.0 / 298.15
    log_ohm = (20e3 * inverse + 18e3 * inverse**2 / reference) / 8.314462618
    law = fitted_law(("ohmic",), KNOWN, log_ohm)
    assert law.bend_joule_per_mole == pytest.approx(18e3, abs=2.0 * law.bend_std_joule_per_mole)
    assert law.bend_std_joule_per_mole < 5e3
    here = np.array([12.0])
    between = np.interp(1.0 / 285.15, 1.0 / (KNOWN[::-1] + 273.15), log_ohm[::-1])
    at = 1.0 / 285.15 - 1.0 / 298.15
    expected = (20e3 * at + 18e3 * at**2 / reference) / 8.314462618
    found = between + log_factor(law, KNOWN, here)[0]
    assert abs(found - expected) < 0.4 * abs(between - expected)


def test_far_temperatures_tell_an_energy_and_near_ones_leave_it_as_cells_have_it():
    unusual = 70e3
    far, near = (
        laws_over_temperature([made(t, ohmic=unusual) for t in pair])
        for pair in ((-20.0, 45.0), (24.0, 26.0))
    )
    prior = ENERGIES["ohmic"]
    (of_far,) = [law for law in far if law.kinds[0] == "ohmic"]
    (of_near,) = [law for law in near if law.kinds[0] == "ohmic"]
    assert abs(of_near.cold_joule_per_mole - prior.mean) < prior.std
    assert of_far.cold_joule_per_mole > of_near.cold_joule_per_mole + 0.5 * prior.std
    assert of_near.cold_std_joule_per_mole == pytest.approx(prior.std, rel=0.05)


@pytest.mark.parametrize(("stated", "factor"), [(None, None), (0.0, 1.0), (35e3, None)])
def test_one_temperature_follows_what_it_states_and_else_what_cells_have(stated, factor):
    one = made(25.0) | {"activation_energy_joule_per_mole": stated}
    found = ohms([one], [0.0])[:, 0] / 0.02
    energies = [ENERGIES[kind].mean if stated is None else stated for kind in ENERGIES]
    expected = [resistance_factor(0.0, 25.0, energy) for energy in energies]
    np.testing.assert_allclose(found, expected if factor is None else factor, rtol=1e-9)


def test_no_resistance_rises_with_temperature_beyond_the_tests():
    """An ohmic part that hardly moves any more once it is warm, and a kind that rises there."""
    conditions = [
        entry(t, o, k) for t, o, k in ((0.0, 3.0, 0.3), (15.0, 1.1, 0.3), (30.0, 1.0, 0.5))
    ]
    assert (np.diff(ohms(conditions, np.linspace(30.0, 60.0, 20))) <= 0).all()
    assert (np.diff(ohms(conditions, np.linspace(-30.0, 0.0, 20))) <= 0).all()


def test_a_kind_that_is_nothing_somewhere_joins_the_others():
    conditions = [entry(0.0, 0.04, 0.0), entry(40.0, 0.01, 0.01)]
    assert 0.02 < ohms(conditions, 20.0).sum() < 0.04
    assert {"ohmic", "kinetic"} <= set(laws_over_temperature(conditions)[0].kinds)


def test_every_kind_has_one_law():
    laws = laws_over_temperature(truth.model()["members"][0]["conditions"])
    assert sorted(kind for law in laws for kind in law.kinds) == sorted(ENERGIES)


@pytest.mark.parametrize("found", ["35 kJ/mol", float("nan"), 1e9, True])
def test_an_energy_that_is_no_number_is_refused(found):
    model = truth.model()
    model["members"][0]["conditions"][0]["activation_energy_joule_per_mole"] = found
    with pytest.raises(Refusal, match=r"conditions\[0\].activation_energy_joule_per_mole is "):
        refuse_unusable(model)


def test_energies_that_hold_everywhere_are_followed_beyond_and_those_of_own_warming_as_far_as_it():
    pair = [made(t) | {"activation_energy_joule_per_mole": 35e3} for t in (0.0, 25.0)]
    found = ohms(pair, [45.0])[:, 0] / ohms(pair, [25.0])[:, 0]
    np.testing.assert_allclose(found, resistance_factor(45.0, 25.0, 35e3), rtol=1e-9)
    warmed = pair[1] | {"activation_energy_kelvin": 8.0}
    near, far = (ohms([warmed], [celsius])[0, 0] / 0.02 for celsius in (33.0, 45.0))
    assert near == pytest.approx(resistance_factor(33.0, 25.0, 35e3))
    usual = resistance_factor(45.0, 33.0, ENERGIES["ohmic"].mean)
    assert far == pytest.approx(near * usual)
    flat = warmed | {"activation_energy_joule_per_mole": 0.0}
    near, far = (ohms([flat], [celsius])[0, 0] / 0.02 for celsius in (33.0, 45.0))
    assert (near, far) == pytest.approx((1.0, usual))


def test_how_far_an_energy_holds_is_refused_where_it_is_no_number():
    model = truth.model()
    model["members"][0]["conditions"][0]["activation_energy_kelvin"] = -3.0
    with pytest.raises(Refusal, match=r"activation_energy_kelvin is -3\.0, wanted a number of 0"):
        refuse_unusable(model)
