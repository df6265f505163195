"""A whole spectrum: Kramers-Kronig test, drift, relaxation times, thermometers, what is noted."""

from functools import partial

import numpy as np
import pytest
from spectra import FREQUENCY, NOISE, THESIS, analyse, measured, noisy, thesis_impedance

from cellwright import formats
from cellwright.protocols.impedance import analysis
from cellwright.protocols.impedance.circuits import circuit_impedance
from cellwright.protocols.impedance.drt import peaks, relaxation_times
from cellwright.protocols.impedance.trust import (
    linear_kramers_kronig,
    rested_temperature,
    temperature_offsets,
    trusted_points,
)
from cellwright.refusal import Refusal

TWO_ARCS = "R-(CPE|R)-(CPE|R)"
TWO = [2e-3, 10.0, 0.95, 3e-3, 100.0, 0.9, 5e-3]  # tops at 6.4 and 0.34 Hz


def drifting(share=0.15):
    """The slowest points, which are measured last, see a cell that has changed."""
    clean = thesis_impedance(THESIS)
    late = np.clip((0.04 - FREQUENCY) / 0.03, 0, 1)
    return noisy(clean.real * (1 - share * late) + 1j * clean.imag * (1 + share * late))


def test_kramers_kronig_leaves_the_noise_of_a_valid_spectrum():
    residual = linear_kramers_kronig(FREQUENCY, noisy(thesis_impedance(THESIS)))
    assert np.sqrt(np.mean(np.abs(residual) ** 2)) == pytest.approx(NOISE * np.sqrt(2), rel=0.35)


def test_kramers_kronig_refuses_too_few_points():
    with pytest.raises(Refusal, match="7 points"):
        linear_kramers_kronig(FREQUENCY[:7], np.ones(7))


def test_points_of_a_valid_spectrum_are_all_kept_in_any_order():
    clean = noisy(thesis_impedance(THESIS))
    for order in (np.arange(61), np.arange(61)[::-1], np.random.default_rng(0).permutation(61)):
        result = trusted_points(FREQUENCY[order], clean[order], drift_tolerance=0.01)
        assert result.keep.all()
        assert not result.notes


def test_a_noisy_spectrum_is_not_taken_for_a_drifting_one():
    result = trusted_points(
        FREQUENCY, noisy(thesis_impedance(THESIS), relative=0.02), drift_tolerance=0.01
    )
    assert result.keep.all()


def test_slow_points_that_drift_are_left_out_with_the_reason(monkeypatch):
    spectrum = drifting()
    result = trusted_points(FREQUENCY, spectrum, drift_tolerance=0.01)
    assert not result.keep[:3].any()
    assert result.keep[FREQUENCY > 0.05].all()
    assert "Kramers-Kronig" in result.notes[0]
    assert "drifted" in result.notes[0]
    kept = analyse(FREQUENCY, spectrum).row
    all_points = partial(analysis.trusted_spectrum, drift_tolerance=1.0)
    monkeypatch.setattr(analysis, "trusted_spectrum", all_points)
    bent = analyse(FREQUENCY, spectrum).row
    true = THESIS[1]
    assert abs(kept["r_charge_transfer_ohm"] - true) < abs(bent["r_charge_transfer_ohm"] - true)


def test_inductive_points_are_modelled_or_cut():
    spectrum = noisy(thesis_impedance(THESIS, henry=2e-6))
    modelled, cut = (analyse(FREQUENCY, spectrum, inductance=how) for how in ("model", "cut"))
    assert modelled.row["circuit"] == "L-R-(CPE|(R-W))"
    assert modelled.row["inductance_henry"] == pytest.approx(2e-6, rel=0.05)
    assert modelled.row["points_fitted"] == 61
    assert cut.row["circuit"] == "R-(CPE|(R-W))"
    assert cut.row["points_fitted"] < 61
    assert np.isnan(cut.row["inductance_henry"])
    assert "inductance of the leads" in cut.notes[0]
    assert cut.row["r_zero_crossing_ohm"] == modelled.row["r_zero_crossing_ohm"]


@pytest.mark.parametrize("relative", [0.0, 0.003, 0.01])
def test_relaxation_times_of_two_arcs(relative):
    spectrum = noisy(circuit_impedance(TWO_ARCS, FREQUENCY, TWO), relative=relative)
    distribution = relaxation_times(FREQUENCY, spectrum)
    rows = [row for row in peaks(distribution) if row["share"] > 0.1]
    assert (distribution.gamma_ohm >= 0).all()
    assert distribution.r_ohmic_ohm == pytest.approx(2e-3, rel=0.05)
    tops = [(1 / (r * t)) ** (1 / p) / (2 * np.pi) for t, p, r in (TWO[1:4], TWO[4:])]
    assert [row["resistance_ohm"] for row in rows] == pytest.approx([3e-3, 5e-3], rel=0.1)
    np.testing.assert_allclose([row["frequency_hertz"] for row in rows], tops, rtol=0.3)
    assert all(row["in_range"] for row in rows)


def test_more_noise_makes_a_smoother_distribution():
    clean = circuit_impedance(TWO_ARCS, FREQUENCY, TWO)
    strengths = [
        relaxation_times(FREQUENCY, noisy(clean, relative=relative)).strength
        for relative in (1e-3, 1e-2, 3e-2)
    ]
    assert sorted(strengths) == strengths


def test_analysis_of_a_good_spectrum_has_nothing_to_note():
    result = analyse(FREQUENCY, noisy(thesis_impedance(THESIS, henry=2e-7)))
    assert result.notes == ()
    assert result.row["r_charge_transfer_ohm"] == pytest.approx(THESIS[1], rel=0.02)
    assert result.row["arc_in_range"]
    assert result.row["charge_transfer_told"]
    assert np.isnan(result.row["temperature_celsius"])
    assert {row["parameter"] for row in result.parameters} >= {"inductance_henry", "cpe_p"}
    assert all(row[f"correlation_{row['parameter']}"] == 1 for row in result.parameters) or True
    (chosen,) = [row for row in result.candidates if row["chosen"]]
    assert chosen["circuit"] == "L-R-(CPE|(R-W))"
    assert chosen["delta_bic"] == 0


def test_a_circuit_that_misses_is_told_and_evidence_finds_the_better():
    truth = [2e-3, 0.5, 0.9, 6e-3, 500.0, 0.9, 6e-3]
    spectrum = noisy(circuit_impedance(TWO_ARCS, FREQUENCY, truth))
    plain = analyse(FREQUENCY, spectrum, candidates=(TWO_ARCS,), choose="circuit")
    notes = " | ".join(plain.notes)
    assert "misses the spectrum" in notes
    assert f"{TWO_ARCS} comes closest" in notes
    chosen = analyse(FREQUENCY, spectrum, candidates=(TWO_ARCS,), choose="bic")
    assert chosen.row["circuit"] == plain.row["preferred_circuit"] == TWO_ARCS
    assert chosen.row["r_charge_transfer_ohm"] == pytest.approx(6e-3, rel=0.03)
    assert chosen.notes == ()


@pytest.mark.parametrize(
    ("arcs", "moved"),
    [([0.5, 0.9, 6e-3, 500.0, 0.9], []), ([1.0, 0.9, 3e-3, 30.0, 0.9], ["charge transfer"])]
    + [([2.0, 0.8, 5e-3, 20.0, 0.9], ["charge transfer"])],
)
def test_a_misfit_is_a_doubt_of_the_resistances_that_it_moves_and_says_by_how_much(arcs, moved):
    """One arc and a tail for two arcs, 2 mΩ in front and 6 mΩ of the slower one."""
    spectrum = noisy(circuit_impedance(TWO_ARCS, FREQUENCY, [2e-3, *arcs, 6e-3]))
    row = analyse(FREQUENCY, spectrum, candidates=(TWO_ARCS,), choose="circuit").row
    assert row["rms_relative_residual"] > 2 * row["kramers_kronig_residual"]
    true = {"ohmic resistance": 2.0, "charge transfer": 6.0}
    for words, milliohm in true.items():
        name = f"r_{words.removesuffix(' resistance').replace(' ', '_')}_ohm"
        held = abs(row[name] - 1e-3 * milliohm) <= 2 * row[f"{name}_std"]
        assert held == (words not in moved)
        told = row["doubt"].partition(f"{words} is ")[2].partition(" mΩ")[0]
        assert bool(told) is (words in moved)
        assert not told or float(told) == pytest.approx(milliohm, rel=0.03)
    # Nothing to compare with: that it misses is all that is known.
    assert "no circuit tried comes closer" in analyse(FREQUENCY, spectrum).row["doubt"]


def test_an_arc_outside_the_frequencies_is_told():
    fast = np.geomspace(5, 1e3, 40)
    cold = (3e-3, 1.7e-2, 12.0, 0.62, 3000.0)  # its top lies at 2 Hz
    result = analyse(fast, noisy(thesis_impedance(cold, fast), relative=0.001))
    assert not result.row["arc_in_range"]
    assert any("outside the frequencies fitted" in note for note in result.notes)


def test_a_temperature_that_moves_during_the_spectrum_is_told():
    celsius = np.linspace(24, 27, 61)
    result = analyse(FREQUENCY, noisy(thesis_impedance(THESIS)), celsius=celsius)
    assert result.row["temperature_celsius"] == 25.5
    assert result.notes == ("temperature moved by 3.0 K during the spectrum",)


def test_a_rested_reading_waits_until_the_cells_own_heat_is_gone():
    time = np.arange(0, 7200.0, 60)
    current = np.where(time < 3600, -1.0, 0.0)
    celsius = 25 + 5 * np.exp(-np.clip(time - 3600, 0, None) / 300)
    read = rested_temperature(time, current, celsius)
    assert read == pytest.approx(25, abs=0.01)
    assert np.isnan(rested_temperature(time[:60], current[:60], celsius[:60]))
    assert np.isnan(rested_temperature(time, current, None))


def test_thermometers_that_differ_are_told_with_numbers():
    spectra = [(25, 26.7), (25, 26.9), (0, 2.0), (0, 2.2), (45, 46.0), (None, 3.0)]
    records = [(25, 25.6), (25, 25.8), (0, 0.5), (10, 10.7), (0, np.nan)]
    rows, (note,) = temperature_offsets(spectra, records)
    assert [row["ambient_temperature_celsius"] for row in rows] == [0, 25, 45]
    assert [row["offset_kelvin"] for row in rows[:2]] == pytest.approx([1.6, 1.1])
    assert rows[1]["offset_std_kelvin"] == pytest.approx(np.sqrt(0.02 / 2 + 0.02 / 2))
    assert np.isnan(rows[2]["offset_kelvin"])
    assert "differ" in note
    assert "+1.6 K at 0 °C" in note


def test_thermometers_that_agree_or_cannot_be_compared_are_told():
    assert "agree" in temperature_offsets([(25, 25.1)], [(25, 25.0)])[1][0]
    assert "cannot be checked" in temperature_offsets([(25, 25.1)], [(0, 0.0)])[1][0]
    rows, notes = temperature_offsets([(25, np.nan)], [(25, 25.0)])
    assert rows[0]["spectra"] == 0
    assert notes == ()


def test_panasonics_chamber_that_moved_is_seen_as_drift(shared):
    """25 °C, 30 %: the file's own temperature falls by 3 K between 1 and 0.01 Hz."""
    path = shared / "campaigns/panasonic/raw/eis/25C/3541_EIS00009.csv.gz"
    result = analyse(*measured(path))
    assert any("left out of the fit" in note for note in result.notes)
    assert result.row["points"] - result.row["points_fitted"] in range(2, 8)


def test_panasonics_spectra_read_warmer_than_its_pulses(shared):
    """The campaign's README: more than 2 K in the cold; the author corrected the records only."""
    campaign = shared / "campaigns/panasonic"
    lines = (campaign / "config/tests.tsv").read_text(encoding="utf-8").splitlines()
    rows = [dict(zip(lines[0].split("\t"), line.split("\t"), strict=True)) for line in lines[1:]]
    files = {row["test"]: campaign / row["file"] for row in rows if ";" not in row["file"]}
    read = {
        test: formats.read(files[test].read_bytes(), name=test).columns
        for test in ("eis_n10C_soc050", "hppc_n10C")
    }
    names = ("test_time_second", "current_ampere", "surface_temperature_celsius")
    record = rested_temperature(*[read["hppc_n10C"][name] for name in names])
    spectrum = float(np.median(read["eis_n10C_soc050"]["surface_temperature_celsius"]))
    (row,), (note,) = temperature_offsets([(-10, spectrum)], [(-10, record)])
    assert row["offset_kelvin"] == pytest.approx(2.1, abs=0.3)
    assert "differ" in note
