"""Fit of circuits: table 3.1 recovered, poor starts, kernel and twin, constraints, refusals."""

import itertools

import numpy as np
import pytest
from spectra import CONDITIONS, FREQUENCY, NAMES, THESIS, analyse, measured, noisy, thesis_impedance

from cellwright.native import function
from cellwright.protocols.impedance import fit as fits
from cellwright.protocols.impedance.analysis import zero_crossing
from cellwright.protocols.impedance.arcs import (
    arcs,
    characteristic_frequency,
    contract,
    why_inseparable,
)
from cellwright.protocols.impedance.candidates import compare, criterion_of, least
from cellwright.protocols.impedance.circuits import circuit_impedance, parse, parse_constraints
from cellwright.protocols.impedance.fit import (
    TYPES,
    Problem,
    fit_circuit,
    search,
    search_by_numpy,
)
from cellwright.refusal import Refusal

# Thesis 3.2: its stated errors of Rs, Rct, T, P, Y0.
STATED = np.array([0.02, 0.018, 0.13, 0.061, 0.072])
POOR = {"r_ohmic_ohm": 1.0, "r_charge_transfer_ohm": 1.0, "cpe_t": 1.0, "cpe_p": 0.5}
POOR |= {"warburg_y0": 1.0}


def values(fit):
    fitted = dict(zip(fit.names, fit.values, strict=True))
    return np.array([fitted[name] for name in NAMES])


@pytest.fixture(scope="module")
def table():
    """The 45 spectra: every condition of table 3.1 three times, noise of 0.3 % of the modulus."""
    pairs = itertools.product(CONDITIONS, range(3))
    return [
        (truth, noisy(thesis_impedance(truth), seed=seed)) for seed, (truth, _) in enumerate(pairs)
    ]


def best(candidates, *, criterion):
    return candidates[least(criterion_of(candidates, criterion))]


def test_the_45_spectra_of_table_3_1_are_recovered_within_its_errors(table):
    fitted = [(fit_circuit(FREQUENCY, spectrum), truth) for truth, spectrum in table]
    errors = np.array([values(fit) / truth - 1 for fit, truth in fitted])
    assert errors.shape == (45, 5)
    assert (np.abs(errors) < STATED).all()
    # Far better as a rule: the noise allows 0.14, 0.3, 1.4, 0.4 and 1.2 % (Cramér and Rao).
    assert (np.sqrt(np.mean(errors**2, axis=0)) < [0.002, 0.004, 0.02, 0.005, 0.02]).all()


def test_no_spectrum_fails_from_a_poor_start_alone(table):
    for _, spectrum in table:
        good = fit_circuit(FREQUENCY, spectrum)
        poor = fit_circuit(FREQUENCY, spectrum, starts=1, start=POOR)
        assert poor.rms_relative_residual <= good.rms_relative_residual * (1 + 1e-9)


def test_random_starts_a_hundredfold_off_fail_never_beside_the_spectrums_own(table):
    random = np.random.default_rng(2)
    for truth, spectrum in table:
        factors = np.exp(random.uniform(-1, 1, 5) * np.log([100, 100, 100, 2, 100]))
        start = dict(zip(NAMES, np.array(truth) * factors, strict=True))
        fit = fit_circuit(FREQUENCY, spectrum, start=start)
        best = fit_circuit(FREQUENCY, spectrum)
        assert fit.rms_relative_residual == pytest.approx(best.rms_relative_residual, rel=1e-9)


def test_the_kernel_and_its_twin_find_the_same(table, monkeypatch):
    if function("impedance_search", *TYPES) is None:
        pytest.skip("no compiled kernels here")
    for circuit in ("R-(CPE|(R-W))", "L-R-(CPE|R)-(C|(R-FLW))", "R-(CPE|(R-FSW))", "R-(CPE|R)-G"):
        spectrum = table[20][1]
        compiled = fit_circuit(FREQUENCY, spectrum, circuit=circuit, starts=2)
        with monkeypatch.context() as patch:
            patch.setattr(fits, "search", search_by_numpy)
            plain = fit_circuit(FREQUENCY, spectrum, circuit=circuit, starts=2)
        assert compiled.rms_relative_residual == pytest.approx(
            plain.rms_relative_residual, rel=1e-10
        )
        spectra = [circuit_impedance(circuit, FREQUENCY, one.values) for one in (compiled, plain)]
        np.testing.assert_allclose(*spectra, rtol=1e-8)
    fine = np.geomspace(1e-2, 1e3, 150)  # more than one block of the kernel
    both = (FREQUENCY, spectrum), (fine, noisy(thesis_impedance(THESIS, fine)))
    compiled = [fit_circuit(*one).values for one in both]
    monkeypatch.setattr(fits, "search", search_by_numpy)
    for one, values in zip(both, compiled, strict=True):
        np.testing.assert_allclose(values, fit_circuit(*one).values, rtol=1e-10)


@pytest.mark.parametrize("exponent", [0.3, 0.7, 1.0])
def test_the_kernels_slopes_are_the_circuits_over_any_frequency(exponent):
    frequency = np.geomspace(1e-9, 1e12, 100)
    circuit = parse("L-R-(CPE|(R-W))")
    logs = np.log([1e-12, 0.02, 1.5, exponent, 0.012, 300.0])
    measured = circuit_impedance(circuit, frequency, np.exp(logs)) * (1 + 0.1j)
    free = np.arange(len(logs))
    # Limits that hold every parameter: what is looked at is the point itself.
    around = logs - 1e-9, logs + 1e-9
    problem = Problem(circuit, frequency, measured, 1 / np.abs(measured), free, 0.0 * logs, *around)
    (x,), _, rows = search(problem, logs[None], enough=1)
    error, slopes = problem.jacobian(x)
    expected = np.vstack([error, slopes])
    found = rows[:, :100] + 1j * rows[:, 100:]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_exact_spectrum_gives_its_parameters_back():
    fit = fit_circuit(FREQUENCY, thesis_impedance(THESIS))
    np.testing.assert_allclose(values(fit), THESIS, rtol=1e-6)
    assert fit.circuit == "R-(CPE|(R-W))"
    assert fit.rms_relative_residual < 1e-8


def test_noise_is_covered_by_the_standard_deviations():
    clean = thesis_impedance(THESIS)
    fitted = [fit_circuit(FREQUENCY, noisy(clean, seed=seed)) for seed in range(60)]
    places = [fitted[0].names.index(name) for name in NAMES]
    scores = np.array([(values(fit) - THESIS) / fit.std[places] for fit in fitted])
    np.testing.assert_allclose(np.sqrt(np.mean(scores**2, axis=0)), 1, atol=0.3)


def test_correlations_are_those_of_repeated_measurements():
    clean = thesis_impedance(THESIS)
    fitted = [fit_circuit(FREQUENCY, noisy(clean, seed=seed)) for seed in range(150)]
    seen = np.corrcoef(np.array([fit.values for fit in fitted]).T)
    np.testing.assert_allclose(fitted[0].correlation, seen, atol=0.25)


@pytest.mark.parametrize("circuit", ["R-(CPE|R)-(CPE|(R-W))", "R-(C|(R-FLW))", "L-R-G-(C|R)"])
def test_other_circuits_are_recovered_from_their_own_starts(circuit):
    truth = {
        "R-(CPE|R)-(CPE|(R-W))": [2e-3, 0.5, 0.9, 2e-3, 20.0, 0.85, 6e-3, 2000.0],
        "R-(C|(R-FLW))": [2e-3, 2.0, 3e-3, 4e-3, 5.0],
        "L-R-G-(C|R)": [1e-7, 2e-3, 5e-3, 3.0, 1.0, 2e-3],
    }[circuit]
    fit = fit_circuit(FREQUENCY, circuit_impedance(circuit, FREQUENCY, truth), circuit=circuit)
    np.testing.assert_allclose(fit.values, truth, rtol=1e-3)


def test_a_parameter_at_its_limit_has_no_standard_deviation():
    impedance = thesis_impedance((2e-3, 5e-3, 12.0, 0.9, 1e12))
    fit = fit_circuit(FREQUENCY, impedance)
    assert fit.at_bound == ("warburg_y0",)
    assert np.isnan(fit.std[fit.names.index("warburg_y0")])


def test_fixed_and_tied_parameters_keep_what_they_are_told():
    fixed, tied = parse_constraints(["cpe1_p = 0.9", "r3_ohm = 2 * r2_ohm"])
    truth = [2e-3, 0.5, 0.9, 2e-3, 20.0, 0.85, 4e-3]
    circuit = "R-(CPE|R)-(CPE|R)"
    spectrum = noisy(circuit_impedance(circuit, FREQUENCY, truth))
    fit = fit_circuit(FREQUENCY, spectrum, circuit=circuit, fixed=fixed, tied=tied)
    fitted = dict(zip(fit.names, fit.values, strict=True))
    assert fitted["cpe1_p"] == pytest.approx(0.9, rel=1e-12)
    assert fitted["r3_ohm"] == pytest.approx(2 * fitted["r2_ohm"], rel=1e-12)
    assert fitted["r2_ohm"] == pytest.approx(2e-3, rel=0.03)
    assert fit.free == 5
    assert np.isnan(fit.std[fit.names.index("cpe1_p")])
    tied_pair = [fit.names.index(name) for name in ("r2_ohm", "r3_ohm")]
    assert fit.correlation[tuple(tied_pair)] == pytest.approx(1)


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"fixed": {"r9_ohm": 1.0}}, "no parameter"),
        ({"fixed": {"cpe_t": -1.0}}, "not above zero"),
        ({"tied": {"cpe_t": ("cpe_p", 1.0), "cpe_p": ("cpe_t", 1.0)}}, "itself tied"),
    ],
)
def test_what_a_circuit_cannot_be_told_is_refused(settings, reason):
    with pytest.raises(Refusal, match=reason):
        fit_circuit(FREQUENCY, thesis_impedance(THESIS), **settings)


@pytest.mark.parametrize("text", ["cpe_p", "cpe_p = ", "2 * r1_ohm = r2_ohm", "a = 2 * 3"])
def test_a_constraint_of_another_form_is_refused(text):
    with pytest.raises(Refusal, match="constraint"):
        parse_constraints([text])


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


def test_zero_crossing_is_linear_between_points_and_needs_no_order():
    impedance = np.array([4.0 - 3j, 2.0 - 1j, 1.0 + 1j])
    assert zero_crossing([1.0, 10.0, 100.0], impedance) == pytest.approx(1.5)
    assert zero_crossing([100.0, 10.0, 1.0], impedance[::-1]) == pytest.approx(1.5)
    assert np.isnan(zero_crossing([1.0, 10.0], impedance[:2]))


def test_arcs_are_found_with_their_characteristic_frequency():
    fast, slow = arcs("R-(CPE|R)-((R-W)|C)")
    assert (fast.t, fast.p, fast.r) == (1, 2, (3,))
    assert (slow.p, slow.r) == (None, (4,))
    top = characteristic_frequency(slow, [0, 0, 0, 0, 2.0, 1.0, 5.0])
    assert top == pytest.approx(1 / (2 * np.pi * 10))


def test_contract_columns_of_two_arcs_are_those_of_the_slower():
    truth = [2e-3, 20.0, 0.85, 6e-3, 0.5, 0.9, 1e-3]
    circuit = "R-(CPE|R)-(CPE|R)"
    row = contract(
        fit_circuit(FREQUENCY, circuit_impedance(circuit, FREQUENCY, truth), circuit=circuit)
    )
    assert row["r_ohmic_ohm"] == pytest.approx(2e-3, rel=1e-3)
    assert row["r_charge_transfer_ohm"] == pytest.approx(6e-3, rel=1e-3)
    assert row["cpe_p"] == pytest.approx(0.85, rel=1e-3)
    assert np.isnan(row["warburg_y0"])
    assert np.isnan(row["inductance_henry"])


def test_charge_transfer_and_diffusion_that_look_alike_are_said_to():
    assert why_inseparable(fit_circuit(FREQUENCY, noisy(thesis_impedance(THESIS)))) == ""
    truth = (3e-3, 1.7e-2, 12.0, 0.62, 100.0)  # the arc's top lies at 2 Hz
    for above, words in ((20, "correlated"), (50, "warburg_y0 is not told")):
        fast = FREQUENCY[above < FREQUENCY]
        assert words in why_inseparable(fit_circuit(fast, noisy(thesis_impedance(truth, fast))))


def test_evidence_prefers_the_circuit_that_made_the_spectrum():
    circuits = ["R-(CPE|(R-W))", "R-(CPE|R)-(CPE|(R-W))", "R-(CPE|(R-FSW))"]
    simple = compare(FREQUENCY, noisy(thesis_impedance(THESIS)), circuits, starts=8)
    truth = [2e-3, 0.5, 0.9, 2e-3, 20.0, 0.85, 6e-3, 2000.0]
    spectrum = noisy(circuit_impedance(circuits[1], FREQUENCY, truth))
    double = compare(FREQUENCY, spectrum, circuits, starts=8)
    assert best(simple, criterion="bic").circuit == circuits[0]
    for criterion in ("bic", "cross_validation"):
        assert best(double, criterion=criterion).circuit == circuits[1]
    assert double[1].cross_validation_residual == pytest.approx(np.sqrt(2) * 0.003, rel=0.3)


@pytest.mark.parametrize("choose", ["circuit", "bic", "cross_validation"])
def test_constraints_count_when_circuits_are_compared(choose):
    spectrum = noisy(thesis_impedance(THESIS))
    given, other = "R-(CPE|(R-W))", "R-(CPE|R)"
    about = {"candidates": [other], "constraints": ["cpe_p = 0.7"], "choose": choose}
    found = analyse(FREQUENCY, spectrum, circuit=given, **about)
    ours = next(row for row in found.candidates if row["circuit"] == given)
    free = compare(FREQUENCY, spectrum, [given])[0]
    assert ours["free_parameters"] == free.fit.free - 1
    assert ours["cross_validation_residual"] > free.cross_validation_residual
    if found.row["circuit"] == given:
        assert found.row["cpe_p"] == pytest.approx(0.7, rel=1e-12)


def test_a_candidate_that_is_no_circuit_has_a_reason_and_is_never_best():
    fitted = compare(FREQUENCY, thesis_impedance(THESIS), ["R-X", "R-(CPE|(R-W))"], starts=2)
    assert "where an element" in fitted[0].reason
    assert best(fitted, criterion="bic").circuit == "R-(CPE|(R-W))"
    with pytest.raises(Refusal, match="R-X"):
        best(fitted[:1], criterion="bic")
    with pytest.raises(Refusal, match="known: bic"):
        best(fitted, criterion="aic")


# published.md: real part where Im = 0, of the Panasonic cell [mΩ].
PUBLISHED = {
    "25C": {"100": 21.1, "050": 21.5, "020": 22.2},
    "10C": {"100": 22.1, "050": 22.7, "020": 23.5},
    "0C": {"100": 23.9, "050": 24.7, "020": 25.6},
    "n10C": {"100": 27.3, "050": 28.0, "025": 28.7},
}


def test_ohmic_resistance_of_panasonic_is_within_two_percent_of_what_is_published(shared):
    campaign = shared / "campaigns/panasonic"
    lines = (campaign / "config/tests.tsv").read_text(encoding="utf-8").splitlines()
    head = lines[0].split("\t")
    rows = [dict(zip(head, line.split("\t"), strict=True)) for line in lines[1:]]
    files = {row["test"]: row["file"] for row in rows}
    for celsius, expected in PUBLISHED.items():
        for soc, milliohm in expected.items():
            path = campaign / files[f"eis_{celsius}_soc{soc}"]
            assert 1e3 * zero_crossing(*measured(path)) == pytest.approx(milliohm, rel=0.02)
