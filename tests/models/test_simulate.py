"""Simulation: exact at constant current, against scipy's filter, and by its symmetries."""

import numpy as np
import pytest
import truth
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cellwright.models.circuit import Branch, impedance, rc_circuit
from cellwright.models.kernels import HOLDS, lag
from cellwright.models.simulate import overpotentials, simulate
from cellwright.refusal import Refusal

CURRENTS = arrays(float, 40, elements=st.floats(-5, 5))
STEPS = arrays(float, 39, elements=st.floats(0, 100))
CIRCUIT = rc_circuit(0.02, [0.01, 0.03], [5.0, 200.0])


@pytest.mark.parametrize("hold", HOLDS)
def test_constant_current_is_the_closed_form(hold):
    time = np.cumsum(np.random.default_rng(1).exponential(3.0, 500))
    run = simulate(CIRCUIT, time, np.full(500, 2.0), 3.7, hold=hold)
    age = time - time[0]
    rise = 0.01 * -np.expm1(-age / 5.0) + 0.03 * -np.expm1(-age / 200.0)
    np.testing.assert_allclose(run, 3.7 + 2.0 * (0.02 + rise), rtol=0, atol=1e-13)


def test_zero_order_hold_is_scipys_filter_on_a_uniform_grid():
    from scipy.signal import lfilter

    current = np.random.default_rng(2).normal(size=1000)
    decay = np.exp(-0.1 / 5.0)
    expected = lfilter([0.0, 1 - decay], [1.0, -decay], current)
    np.testing.assert_allclose(
        lag(np.full(999, 0.1), 5.0, current, hold="zero_order"), expected, atol=1e-13
    )


def test_first_order_hold_is_exact_on_a_ramp():
    time = np.array([0.0, 1.0, 4.0, 4.5, 30.0])
    expected = time - 7.0 * -np.expm1(-time / 7.0)
    np.testing.assert_allclose(
        lag(np.diff(time), 7.0, time, hold="first_order"), expected, atol=1e-13
    )


def test_a_step_refined_without_changing_the_current_changes_nothing():
    time, current = np.array([0.0, 10.0, 10.0, 60.0]), np.array([1.0, 1.0, -2.0, -2.0])
    fine = np.array([0.0, 4.0, 10.0, 10.0, 11.0, 60.0])
    run = overpotentials(CIRCUIT, time, current, hold="first_order")
    finer = overpotentials(CIRCUIT, fine, np.array([1, 1, 1, -2, -2, -2.0]), hold="first_order")
    np.testing.assert_allclose(run[:, -1], finer[:, -1], atol=1e-14)


@settings(deadline=None, max_examples=40)
@given(CURRENTS, CURRENTS, STEPS, st.sampled_from(HOLDS))
def test_superposition_and_sign_symmetry(first, second, steps, hold):
    time = np.concatenate([[0.0], np.cumsum(steps)])

    def over(current):
        return overpotentials(CIRCUIT, time, current, hold=hold)

    np.testing.assert_allclose(over(first) + over(second), over(first + second), atol=1e-12)
    np.testing.assert_allclose(over(-first), -over(first), atol=1e-15)


@settings(deadline=None, max_examples=40)
@given(st.floats(-5, 5), STEPS)
def test_the_hold_does_not_matter_at_constant_current(current, steps):
    time = np.concatenate([[0.0], np.cumsum(steps)])
    runs = [overpotentials(CIRCUIT, time, np.full(40, current), hold=hold) for hold in HOLDS]
    np.testing.assert_allclose(*runs, atol=1e-13)


def test_parameters_per_sample_follow_the_state_of_charge():
    time = np.linspace(0, 100, 2001)
    r = np.linspace(0.01, 0.02, 2001)
    slow = overpotentials(rc_circuit(0 * r, [r], [1e-3]), time, np.ones(2001), hold="first_order")
    np.testing.assert_allclose(slow[1, 10:], r[10:], atol=1e-5)


def test_impedance_has_the_circuits_limits_and_response():
    found = impedance(CIRCUIT, [1e-9, 1e9, 0.02])
    np.testing.assert_allclose(found[:2], [0.06, 0.02], atol=1e-6)
    time = np.arange(0, 3000, 0.02)
    wave = np.exp(2j * np.pi * 0.02 * time)
    over = overpotentials(CIRCUIT, time, wave.real, hold="first_order").sum(axis=0)
    measured = 2 * np.mean((over * wave.conj())[len(time) // 3 * 2 :])
    assert abs(measured - found[2]) < 2e-5
    assert found[2].imag < 0


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"hold": "second_order"}, "hold of the current is 'second_order'"),
        ({"test_time_second": [0.0, 2.0, 1.0]}, "time runs back after sample 1"),
        ({"current_ampere": [0.0, np.nan, 1.0]}, "not finite"),
        ({"current_ampere": [0.0, 1.0]}, "both must be"),
        (
            {"circuit": (Branch("CPE", {"q": 1.0}),)},
            "branch kind 'CPE' is unknown; known are R, RC",
        ),
        ({"circuit": (Branch("RC", {"r_ohm": 1.0}),)}, "it takes r_ohm, tau_second"),
        ({"circuit": rc_circuit(0.1, [0.1], [0.0])}, "time constant is zero"),
    ],
)
def test_refusals(change, reason):
    given = {
        "circuit": CIRCUIT,
        "test_time_second": [0.0, 1.0, 2.0],
        "current_ampere": [0.0, 1.0, 1.0],
        "hold": "first_order",
    } | change
    hold = given.pop("hold")
    with pytest.raises(Refusal, match=reason):
        overpotentials(*given.values(), hold=hold)


def test_the_true_cell_returns_to_its_ocv():
    time, current = truth.drive(np.random.default_rng(3), 1500)
    soc = truth.soc_of(time, current)
    rest = np.concatenate([time, [time[-1] + 1, time[-1] + 1e5]])
    soc = np.append(soc, [soc[-1]] * 2)
    end = truth.voltage(rest, np.append(current, [0.0, 0.0]), soc)[-1]
    assert end == pytest.approx(np.interp(soc[-1], truth.OCV_SOC, truth.OCV_VOLT), abs=1e-9)
