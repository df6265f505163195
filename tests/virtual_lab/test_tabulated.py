"""The circuit of the thesis and its table 3.1."""

import numpy as np
import pytest

from virtual_lab import tabulated
from virtual_lab.tabulated import TabulatedCircuit, circuit_at, impedance_ohm


def test_without_diffusion_and_spread_it_is_a_semicircle():
    randles = TabulatedCircuit(0.002, 0.001, cpe_t=10.0, cpe_p=1.0, warburg_y0=1e12)
    top_hertz = 1 / (2 * np.pi * 0.001 * 10.0)
    found = impedance_ohm(randles, np.array([1e9, top_hertz, 1e-9]))
    np.testing.assert_allclose(found, [0.002, 0.0025 - 0.0005j, 0.003], atol=1e-6)


@pytest.mark.parametrize(("soc", "celsius"), tabulated.conditions())
def test_limits(soc, celsius):
    parameters = circuit_at(soc, celsius)
    highest, low, lower = impedance_ohm(parameters, np.array([1e12, 1e-7, 1e-8]))
    assert highest == pytest.approx(parameters.r_ohmic_ohm, rel=1e-3)
    # Diffusion: both parts grow alike, along 45 degrees.
    assert (lower - low).real == pytest.approx(-(lower - low).imag, rel=0.02)


def test_fifteen_conditions_of_finite_capacitive_spectra():
    assert len(set(tabulated.conditions())) == 15
    for soc, celsius in tabulated.conditions():
        found = impedance_ohm(circuit_at(soc, celsius), tabulated.FREQUENCY_HERTZ)
        assert (found.imag < 0).all()
        assert (np.diff(found.real) > 0).all()


@pytest.mark.parametrize(("soc", "told_kilojoule"), [(0.05, 70.2), (0.5, 70.5), (1.0, 67.7)])
def test_charge_transfer_follows_arrhenius(soc, told_kilojoule):
    """The erratum's evidence: with the header's signs turned ln Rct is linear in 1/T."""
    kelvin = 273.15 + np.array(tabulated.TEMPERATURES_CELSIUS)
    ohm = [circuit_at(soc, t).r_charge_transfer_ohm for t in tabulated.TEMPERATURES_CELSIUS]
    slope, _ = np.polyfit(1 / kelvin, np.log(ohm), 1)
    assert 8.314462618e-3 * slope == pytest.approx(told_kilojoule, abs=0.1)
    assert np.corrcoef(1 / kelvin, np.log(ohm))[0, 1] ** 2 > 0.995


def test_resistances_rise_in_the_cold():
    for soc in tabulated.SOCS:
        found = np.array([circuit_at(soc, t)[:2] for t in tabulated.TEMPERATURES_CELSIUS])
        assert (np.diff(found, axis=0) > 0).all()
        assert found[-1, 0] < 2 * found[0, 0]
        assert found[-1, 1] > 20 * found[0, 1]


def test_what_the_table_does_not_know_is_refused():
    with pytest.raises(ValueError, match=r"asked: 0\.4, 20\.0"):
        circuit_at(0.4, 20.0)
