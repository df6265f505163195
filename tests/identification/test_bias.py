"""Bias correction: the thesis' worked example, recovery of known coefficients, refusals."""

import numpy as np
import pytest
import truth

from cellwright.circuits.model_file import simulate_model
from cellwright.identification import borrowed
from cellwright.refusal import Refusal

SOC = np.linspace(0.1, 0.9, 9)
SHIFT = np.array([0.02, 0.05, 0.09, 0.15])
R0_TRUE = np.array([0.5, 0.03, 0.01, -0.02])
OCV_TRUE = np.array([0.03, 0.4, 0.03, 0.004])


def published(a2):
    """Coefficients of table 4.5, resistance in milliohm."""
    return [23.0, a2 * 0.507, a2 * 0.0107, -a2 * 5.87e-4]


@pytest.mark.parametrize(("a2", "milliohm"), [(0.17, 0.829282), (1.7, 0.976610)])
def test_worked_example_of_the_thesis(a2, milliohm):
    """Eq. 4.6 gives 0.82927 with a2 = 0.17; table 4.5 prints 1.7 (erratum)."""
    assert borrowed.quadratic_bias(0.188, 0.5, published(a2)) == pytest.approx(milliohm, abs=6e-6)


def changes(noise=0.0):
    rng = np.random.default_rng(1)
    r0 = np.array([borrowed.quadratic_bias(s, SOC, R0_TRUE) for s in SHIFT])
    ocv = np.array([borrowed.quadratic_bias(s, SOC, OCV_TRUE) for s in SHIFT])
    rp = np.outer(SHIFT, np.full(9, 0.27))
    return [values + noise * rng.normal(size=values.shape) for values in (r0, rp, ocv)]


def test_calibration_recovers_the_coefficients():
    calibration = borrowed.calibrate(SHIFT, SHIFT, SOC, *changes())
    np.testing.assert_allclose(calibration.r0, R0_TRUE, atol=1e-9)
    np.testing.assert_allclose(calibration.ocv, OCV_TRUE, atol=1e-9)
    assert calibration.polarisation == pytest.approx(0.27)
    assert calibration.r0_left_out_ohm < 1e-9
    assert calibration.cells == 4


def test_the_left_out_error_tells_the_noise():
    calibration = borrowed.calibrate(SHIFT, SHIFT, SOC, *changes(noise=1e-3))
    assert 0.6e-3 < calibration.polarisation_left_out_ohm < 1.5e-3
    assert calibration.r0_left_out_ohm > 0.6e-3


@pytest.mark.parametrize(
    ("shifts", "reason"), [([0.1, 0.2], "2 cell.s. beside"), ([0.1, 0.1, 0.1], "too much alike")]
)
def test_calibration_refuses(shifts, reason):
    flat = np.zeros((len(shifts), 9))
    with pytest.raises(Refusal, match=reason):
        borrowed.calibrate(shifts, shifts, SOC, flat, flat, flat)


def test_peaks_match_by_order_or_by_nearness():
    by_order = borrowed.match_peaks([3.5, 3.7], [3.68, 3.85])
    np.testing.assert_array_equal(by_order, [[0, 0], [1, 1]])
    nearest = borrowed.match_peaks([3.5, 3.7, 3.9], [3.53, 3.94])
    np.testing.assert_array_equal(nearest, [[0, 0], [2, 1]])
    main, mean = borrowed.peak_shift([3.5, 3.7, 3.9], [1.0, 9.0, 4.0], [3.53, 3.94])
    assert main == pytest.approx(0.04)
    assert mean == pytest.approx(0.035)
    with pytest.raises(Refusal, match="no IC peak of the cell lies within"):
        borrowed.match_peaks([3.5], [4.1])
    with pytest.raises(Refusal, match="shows no IC peak"):
        borrowed.match_peaks([3.5], [])


def test_biased_model_is_the_reference_plus_the_bias():
    calibration = borrowed.calibrate(SHIFT, SHIFT, SOC, *changes())
    reference = truth.model()
    model = borrowed.biased_model(
        reference, calibration, cell="B", main_shift_volt=0.05, mean_shift_volt=0.04, capacity=1.8
    )
    entry = model["members"][0]["conditions"][0]
    expected = truth.R0 + borrowed.quadratic_bias(0.05, truth.KNOTS, R0_TRUE)
    np.testing.assert_allclose(entry["r0_ohm"], expected)
    total = np.sum([b["r_ohm"] for b in entry["branches"]], axis=0)
    np.testing.assert_allclose(total, truth.R.sum(axis=0) + 0.27 * 0.04)
    assert (model["cell"], model["kind"], model["capacity_ampere_hour"]) == ("B", "bias", 1.8)
    assert reference == truth.model()


def test_no_shift_is_the_reference_itself():
    calibration = borrowed.calibrate(SHIFT, SHIFT, SOC, *changes())
    model = borrowed.biased_model(
        truth.model(), calibration, cell="B", main_shift_volt=0.0, mean_shift_volt=0.0, capacity=2.0
    )
    np.testing.assert_allclose(model["members"][0]["conditions"][0]["r0_ohm"], truth.R0)


def test_scaled_reference():
    model = borrowed.scaled_reference(truth.model(), cell="B", capacity=1.5, resistance_ratio=1.3)
    entry = model["members"][0]["conditions"][0]
    np.testing.assert_allclose(entry["r0_ohm"], 1.3 * truth.R0)
    np.testing.assert_allclose(entry["branches"][1]["r_ohm"], 1.3 * truth.R[1])
    assert model["kind"] == "scaled"
    with pytest.raises(Refusal, match="not positive"):
        borrowed.scaled_reference(truth.model(), cell="B", capacity=1.5, resistance_ratio=0.0)


EVERYTHING = [
    {"kind": "kinetic", "r_ohm": [0.03] * 5, "tau_second": [1e-3] * 5, "scale_volt": [0.05] * 5},
    {"kind": "RC", "r_ohm": [0.0, 0.01, 0.0, 0.01, 0.02], "tau_second": [60.0] * 5},
    {"kind": "hysteresis", "m_volt": [0.01] * 5, "charge_ampere_hour": [0.06] * 5},
    {"kind": "diffusion", "soc_per_ampere": [0.01] * 5, "tau_second": [900.0] * 5},
]


def whole():
    """A reference whose chosen member has every kind that is identified, and a scaled OCV."""
    model = truth.model()
    entry = model["members"][0]["conditions"][0] | {"ocv_scale": {"missing": 0.01, "stretch": 0.02}}
    more = {"model": "all", "conditions": [entry | {"branches": EVERYTHING}]}
    return model | {"members": [*model["members"], more], "chosen": "all"}


@pytest.mark.parametrize("member", ["2RC", "all"])
def test_a_cell_of_another_size_runs_the_same_at_the_same_rate(member):
    """k times the capacity, a k-th of the resistance, k times the current: the same voltage."""
    time, current = truth.drive(np.random.default_rng(1), 4000)
    soc = truth.soc_of(time, current)
    larger = borrowed.scaled_reference(
        whole(), cell="B", capacity=3 * truth.CAPACITY_AMPERE_HOUR, resistance_ratio=1 / 3
    )
    one = simulate_model(whole(), member, time, current, soc, 25.0).voltage_volt
    other = simulate_model(larger, member, time, 3 * current, soc, 25.0).voltage_volt
    np.testing.assert_allclose(other, one, rtol=0, atol=1e-12)


def test_the_bias_moves_fast_and_slow_resistance_and_nothing_else():
    calibration = borrowed.calibrate(SHIFT, SHIFT, SOC, *changes())
    model = borrowed.biased_model(
        whole(), calibration, cell="B", main_shift_volt=0.05, mean_shift_volt=0.04, capacity=2.0
    )
    entry = model["members"][1]["conditions"][0]
    kinetic, slow, hysteresis, diffusion = entry["branches"]
    fast_before = truth.R0 + 0.03
    ratio = 1 + borrowed.quadratic_bias(0.05, truth.KNOTS, R0_TRUE) / fast_before
    np.testing.assert_allclose(entry["r0_ohm"], ratio * truth.R0)
    np.testing.assert_allclose(kinetic["r_ohm"], ratio * 0.03)
    np.testing.assert_allclose(slow["r_ohm"], [0, 0.01 + 0.0108, 0, 0.01 + 0.0108, 0.02 + 0.0108])
    assert kinetic["scale_volt"] == EVERYTHING[0]["scale_volt"]
    assert (hysteresis, diffusion) == (EVERYTHING[2], EVERYTHING[3])
    assert entry["ocv_scale"] == {"missing": 0.01, "stretch": 0.02}


def test_no_resistance_falls_below_a_tenth():
    calibration = borrowed.calibrate(SHIFT, SHIFT, SOC, *changes())
    far = calibration._replace(r0=-100 * R0_TRUE, polarisation=-10.0)
    model = borrowed.biased_model(
        whole(), far, cell="B", main_shift_volt=0.1, mean_shift_volt=0.1, capacity=2.0
    )
    entry = model["members"][1]["conditions"][0]
    np.testing.assert_allclose(entry["r0_ohm"], 0.1 * truth.R0)
    np.testing.assert_allclose(entry["branches"][1]["r_ohm"], [0.0, 1e-3, 0.0, 1e-3, 2e-3])
