"""Electrodes against each other: published potentials, balances, what losses do."""

import numpy as np
import pytest

from virtual_lab import electrodes
from virtual_lab.electrodes import HALF_CELLS

SOC = np.linspace(0.0, 1.0, 2001)
LOSSES = [
    {},
    {"lli": 0.1},
    {"lli": 0.1, "lam_negative": 0.05},
    {"lli": 0.15, "lam_negative": 0.1, "lam_positive": 0.1},
    {"lli": 0.4, "lam_negative": 0.2, "lam_positive": 0.2},
]


def of(chemistry, **losses):
    return electrodes.window(chemistry, electrodes.usual_rating(chemistry, 5.0), **losses)


@pytest.mark.parametrize("losses", LOSSES)
@pytest.mark.parametrize("chemistry", electrodes.CHEMISTRIES)
def test_voltage_rises_from_cutoff_to_cutoff(chemistry, losses):
    volt = electrodes.open_circuit_volt(chemistry, of(chemistry, **losses), SOC)
    assert volt[[0, -1]] == pytest.approx(electrodes.CHEMISTRIES[chemistry].cutoffs_volt, abs=1e-6)
    assert (np.diff(volt) > 0).all()


@pytest.mark.parametrize("losses", LOSSES)
@pytest.mark.parametrize("chemistry", electrodes.CHEMISTRIES)
def test_lithium_is_only_lost_as_stated(chemistry, losses):
    fresh, aged = of(chemistry), of(chemistry, **losses)
    for window, share in ((fresh, 1.0), (aged, 1 - losses.get("lli", 0.0))):
        for x, y in ((window.x_0, window.y_0), (window.x_100, window.y_100)):
            lithium = x * window.negative_ampere_hour + y * window.positive_ampere_hour
            made = electrodes.CHEMISTRIES[chemistry]
            whole = made.lithium_per_positive * fresh.positive_ampere_hour
            assert lithium == pytest.approx(share * whole, rel=1e-9)
    moved = aged.positive_ampere_hour * (aged.y_0 - aged.y_100)
    assert moved == pytest.approx(aged.capacity_ampere_hour, rel=1e-9)


def test_size_is_the_data_sheets():
    small, large = (
        electrodes.window("LFP", electrodes.usual_rating("LFP", capacity))
        for capacity in (1.2, 60.0)
    )
    assert large.capacity_ampere_hour == pytest.approx(50 * small.capacity_ampere_hour)
    assert large.x_100 == pytest.approx(small.x_100)


@pytest.mark.parametrize("chemistry", electrodes.CHEMISTRIES)
def test_lost_lithium_takes_capacity(chemistry):
    left = [of(chemistry, lli=lli).capacity_ampere_hour for lli in (0.0, 0.05, 0.1, 0.2, 0.3)]
    assert (np.diff(left) < 0).all()


def test_a_cell_that_cannot_be_charged_is_refused():
    with pytest.raises(ValueError, match=r"no lithiation gives 4\.2 V"):
        of("NMC", lam_negative=0.3)


def test_lmo_has_the_peaks_of_the_thesis():
    """S9: 3.75, 3.90, 4.02, 4.07 V at C/30, some 10 mV of which are polarisation."""
    window = of("LMO")
    volt = electrodes.open_circuit_volt("LMO", window, SOC)
    slope = np.gradient(SOC, volt)
    grid = np.arange(3.6, 4.15, 0.002)
    density = np.interp(grid, volt, slope)
    inner = density[1:-1]
    peaks = grid[1:-1][(inner > density[:-2]) & (inner > density[2:])]
    for told in (3.75, 3.90, 4.02, 4.07):
        assert np.abs(peaks - told).min() < 0.05


def test_lmo_moves_with_temperature_as_in_the_thesis():
    """S6, at −15 °C from 20 °C: up to 30 mV more at 10–40 % SoC, up to 10 mV less at 60–100 %."""
    shift = -35 * electrodes.entropic_volt_per_kelvin("LMO", of("LMO"), SOC)
    assert 0.025 < shift[(SOC >= 0.1) & (SOC <= 0.4)].max() < 0.035
    assert (np.abs(shift[SOC >= 0.6]) < 0.0105).all()
    assert (shift[SOC >= 0.6] < 0).all()
    assert shift[SOC < 0.45].min() > 0 > shift[SOC > 0.55].max()


def test_lost_lithium_shortens_the_plateau_of_full_graphite():
    """S13: the first 10 % of an LFP cell's loss are in the plateau at high SoC, none elsewhere."""
    fresh, aged = of("LFP"), of("LFP", lli=0.08)
    stage = 0.61  # of graphite_siox: the step between its last two plateaus
    upper, lower = (
        [w.negative_ampere_hour * (w.x_100 - stage) for w in (fresh, aged)],
        [w.negative_ampere_hour * (stage - w.x_0) for w in (fresh, aged)],
    )
    whole = fresh.capacity_ampere_hour
    assert upper[0] - upper[1] == pytest.approx(0.08 * whole, rel=0.1)
    assert lower[0] - lower[1] == pytest.approx(0.0, abs=0.01 * whole)


PUBLISHED = [
    ("graphite_siox", "Chen2020", "Negative electrode OCP [V]"),
    ("nmc811", "Chen2020", "Positive electrode OCP [V]"),
    ("graphite", "Mohtat2020", "Negative electrode OCP [V]"),
    ("lfp", "Prada2013", "Positive electrode OCP [V]"),
    ("lco", "Marquis2019", "Positive electrode OCP [V]"),
    ("nca", "NCA_Kim2011", "Positive electrode OCP [V]"),
    ("graphite", "ORegan2022", "Negative electrode OCP entropic change [V.K-1]"),
    ("nmc811", "ORegan2022", "Positive electrode OCP entropic change [V.K-1]"),
    ("lco", "Ai2020", "Positive electrode OCP entropic change [V.K-1]"),
]


@pytest.mark.parametrize(("material", "set_name", "parameter"), PUBLISHED)
def test_functions_are_those_of_the_papers(material, set_name, parameter):
    pybamm = pytest.importorskip("pybamm")
    half = HALF_CELLS[material]
    ours = half.entropic_volt_per_kelvin if "entropic" in parameter else half.potential_volt
    sto = np.linspace(max(half.lowest, 0.011), half.highest - 0.01, 300)
    theirs = pybamm.ParameterValues(set_name)[parameter](pybamm.Vector(sto)).evaluate().ravel()
    np.testing.assert_allclose(ours(sto), theirs, rtol=1e-9, atol=1e-4 * np.abs(theirs).max())
