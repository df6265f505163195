"""Circuit fit and Kramers-Kronig test: known circuits, noise, drift; Panasonic's table."""

import gzip

import numpy as np
import pytest

from cellwright.protocols.impedance import analyse
from cellwright.protocols.impedance.circuits import NAMES, circuit_impedance
from cellwright.protocols.impedance.fit import fit_circuit, zero_crossing
from cellwright.protocols.impedance.kramers_kronig import linear_kramers_kronig
from cellwright.refusal import Refusal

FREQUENCY = np.geomspace(1e-2, 1e3, 61)
# Thesis table 3.1, 50 % SoC at 20, 0 and −10 °C.
THESIS = [
    (2.02e-3, 6.48e-4, 14.9, 0.87, 4777),
    (2.67e-3, 4.86e-3, 12.21, 0.68, 3042),
    (3.05e-3, 1.74e-2, 12.22, 0.64, 3013),
]


def noisy(parameters, relative=0.003, seed=0, frequency=FREQUENCY):
    rng = np.random.default_rng(seed)
    clean = circuit_impedance(frequency, *parameters)
    noise = rng.standard_normal((2, len(frequency)))
    return clean + relative * np.abs(clean) * (noise[0] + 1j * noise[1])


@pytest.mark.parametrize("truth", THESIS)
def test_exact_spectrum_gives_its_parameters_back(truth):
    fit = fit_circuit(FREQUENCY, circuit_impedance(FREQUENCY, *truth))
    np.testing.assert_allclose(fit.values, truth, rtol=1e-4)
    assert fit.circuit == "R-(CPE|(R-W))"
    assert fit.rms_relative_residual < 1e-6


def test_noise_is_covered_by_the_standard_deviations():
    truth = THESIS[1]
    fits = [fit_circuit(FREQUENCY, noisy(truth, seed=seed)) for seed in range(15)]
    scores = np.array([(fit.values - truth) / fit.std for fit in fits])
    assert np.sqrt(np.mean(scores**2)) == pytest.approx(1, abs=0.35)


def test_inductance_of_the_leads_is_found_and_its_crossing():
    truth = (*THESIS[1], 2e-6)
    fit = fit_circuit(FREQUENCY, circuit_impedance(FREQUENCY, *truth))
    assert fit.circuit == "L-R-(CPE|(R-W))"
    np.testing.assert_allclose(fit.values, truth, rtol=1e-3)
    assert fit.names == NAMES
    assert fit.r_zero_crossing_ohm > truth[0]


def test_zero_crossing_is_linear_between_points_and_needs_no_order():
    impedance = np.array([4.0 - 3j, 2.0 - 1j, 1.0 + 1j])
    assert zero_crossing([1.0, 10.0, 100.0], impedance) == pytest.approx(1.5)
    assert zero_crossing([100.0, 10.0, 1.0], impedance[::-1]) == pytest.approx(1.5)
    assert np.isnan(zero_crossing([1.0, 10.0], impedance[:2]))


def test_a_parameter_at_its_limit_has_no_standard_deviation():
    impedance = circuit_impedance(FREQUENCY, 2e-3, 5e-3, 12.0, 0.9, 1e12)
    fit = fit_circuit(FREQUENCY, impedance)
    assert "warburg_y0" in fit.at_bound
    assert np.isnan(fit.std[NAMES.index("warburg_y0")])


@pytest.mark.parametrize(
    ("frequency", "impedance", "reason"),
    [
        (FREQUENCY[:5], np.full(5, 1 - 1j), "5 points"),
        (FREQUENCY, np.full(61, np.nan + 0j), "not finite"),
        (FREQUENCY, np.full(61, -1 - 1j), "not positive"),
        (FREQUENCY, np.full(61, 1 + 1j), "no capacitive part"),
    ],
)
def test_refusals(frequency, impedance, reason):
    with pytest.raises(Refusal, match=reason):
        fit_circuit(frequency, impedance)


def test_kramers_kronig_leaves_the_noise_of_a_valid_spectrum():
    test = linear_kramers_kronig(FREQUENCY, noisy(THESIS[1]))
    assert test.rms_relative_residual == pytest.approx(0.003 * np.sqrt(2), rel=0.35)


def test_kramers_kronig_sees_a_cell_that_drifts():
    drift = np.geomspace(1.15, 1.0, 61)  # the slow points come last and see a changed cell
    clean = circuit_impedance(FREQUENCY, *THESIS[1])
    valid = linear_kramers_kronig(FREQUENCY, clean).rms_relative_residual
    moved = linear_kramers_kronig(FREQUENCY, clean.real + 1j * clean.imag * drift)
    assert moved.rms_relative_residual > 10 * valid


def test_kramers_kronig_refuses_too_few_points():
    with pytest.raises(Refusal, match="7 points"):
        linear_kramers_kronig(FREQUENCY[:7], np.ones(7))


def test_analysis_of_a_good_spectrum_has_nothing_to_note():
    found = analyse(FREQUENCY, circuit_impedance(FREQUENCY, *THESIS[1], 2e-7))
    assert found.notes == ()
    assert found.row["r_charge_transfer_ohm"] == pytest.approx(THESIS[1][1], rel=1e-3)
    assert "inductance_henry" not in found.row
    assert found.row["warburg_y0_std"] >= 0
    np.testing.assert_allclose(
        found.curve["fitted_real_ohm"], found.curve["impedance_real_ohm"], rtol=1e-3
    )


def test_analysis_notes_drift_misfit_and_what_is_not_determined():
    two_arcs = sum(circuit_impedance(FREQUENCY, 2e-3, 5e-3, t, 1.0, 1e12) for t in (0.2, 1e3))
    # Two narrow arcs alone are a valid spectrum: only their drift may be noted as such.
    assert linear_kramers_kronig(FREQUENCY, two_arcs).rms_relative_residual < 0.002
    turned = two_arcs.real + 1j * two_arcs.imag * np.geomspace(1.5, 1, 61)
    notes = " | ".join(analyse(FREQUENCY, turned).notes)
    for words in ("Kramers-Kronig", "misses the spectrum", "not determined"):
        assert words in notes


def spectrum(path):
    with gzip.open(path, "rt", errors="replace") as file:
        lines = file.read().splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith("Time Stamp"))
    places = [lines[start].split(";").index(name) for name in ("ActFreq", "Zreal1", "Zimg1")]
    rows = [line.split(";") for line in lines[start + 2 :] if line.count(";") > max(places)]
    frequency, real, imaginary = np.array([[float(row[k]) for k in places] for row in rows]).T
    return frequency, (real + 1j * imaginary) / 1000


def test_ohmic_resistance_of_panasonic_at_half_charge(shared):
    frequency, impedance = spectrum(shared / "campaigns/panasonic/raw/eis/25C/3541_EIS00007.csv.gz")
    fit = fit_circuit(frequency, impedance)
    assert fit.r_zero_crossing_ohm == pytest.approx(21.5e-3, rel=0.02)
    assert fit.rms_relative_residual < 0.02
    assert linear_kramers_kronig(frequency, impedance).rms_relative_residual < 0.003
