"""The autoregressive form: there and back, recovery, its bias under noise, refusals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cellwright.circuits.cell import simulate
from cellwright.circuits.circuit import rc_circuit
from cellwright.numerics.lags import HOLDS, lag_weights
from cellwright.refusal import Refusal
from pulse_methods.autoregressive import (
    circuit_of_coefficients,
    track,
)

STEP = 1.0
CURRENT = np.repeat(np.random.default_rng(1).normal(size=300), 20) * 3.0
TIME = np.arange(6000) * STEP
R0, R, TAU = 0.02, np.array([0.01, 0.015]), np.array([5.0, 80.0])


def coefficients_of_circuit(r0_ohm, r_ohm, tau_second, step_second, *, hold):
    """The recurrence of a circuit, (2m + 1,) c_1…c_m, d_0…d_m: the way back."""
    steps = np.full(len(tau_second), float(step_second))
    pole, before, after = lag_weights(steps, np.asarray(tau_second, float), hold=hold)
    denominator = np.poly(pole)
    numerator = r0_ohm * denominator
    for j, r in enumerate(r_ohm):
        rest = np.poly(np.delete(pole, j))
        numerator = numerator + r * np.convolve([after[j], before[j]], rest)
    return np.concatenate([-denominator[1:], numerator])


def voltage(pairs, hold="zero_order", r0=R0, current=CURRENT):
    circuit = rc_circuit(r0, R[:pairs], TAU[:pairs])
    return simulate(circuit, TIME[: len(current)], current, 3.7, hold=hold)


@settings(deadline=None, max_examples=40)
@given(st.floats(1.5, 20), st.floats(3, 30), st.floats(1e-3, 0.1), st.sampled_from(HOLDS))
def test_there_and_back(fast, ratio, r0, hold):
    tau = np.array([fast, fast * ratio])
    coefficients = coefficients_of_circuit(r0, R, tau, STEP, hold=hold)
    back = circuit_of_coefficients(coefficients, STEP, hold=hold, n_rc=2)
    np.testing.assert_allclose(
        [back.r0_ohm, *back.r_ohm, *back.tau_second], [r0, *R, *tau], rtol=1e-6
    )


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("pairs", [1, 2])
def test_the_simulation_obeys_the_recurrence(pairs, hold):
    y = voltage(pairs, hold) - 3.7
    c = coefficients_of_circuit(R0, R[:pairs], TAU[:pairs], STEP, hold=hold)
    past = sum(c[i] * y[pairs - 1 - i : len(y) - 1 - i] for i in range(pairs))
    drive = sum(c[pairs + i] * CURRENT[pairs - i : len(y) - i] for i in range(pairs + 1))
    np.testing.assert_allclose(past + drive, y[pairs:], atol=1e-14)


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("pairs", [1, 2])
def test_recovery_without_noise(pairs, hold):
    estimate = track(CURRENT, voltage(pairs, hold), 3.7, n_rc=pairs)
    circuit = circuit_of_coefficients(estimate.coefficient[-1], STEP, hold=hold, n_rc=pairs)
    assert circuit.r0_ohm == pytest.approx(R0, rel=1e-6)
    np.testing.assert_allclose(circuit.r_ohm, R[:pairs], rtol=1e-4)
    np.testing.assert_allclose(circuit.tau_second, TAU[:pairs], rtol=1e-4)


def test_noise_shortens_the_time_constants():
    """The bias that the page states: past voltages are regressors, and noisy."""
    rng, content = np.random.default_rng(2), {}
    for noise in (1e-4, 1e-3):
        volt = voltage(2) + noise * rng.normal(size=len(TIME))
        last = track(CURRENT, volt, 3.7, n_rc=2).coefficient[-1]
        content[noise] = circuit_of_coefficients(last, STEP, hold="zero_order", n_rc=2)
    assert content[1e-4].tau_second[1] < 80.0
    assert content[1e-3].tau_second[1] < 0.5 * content[1e-4].tau_second[1]
    assert content[1e-3].r0_ohm == pytest.approx(R0, rel=0.01)


@pytest.mark.parametrize(
    ("coefficient", "message"),
    [
        ([1.0, -0.9, 0.02, 0.0, 0.0], "complex"),
        ([1.01, 0.02, 0.0], "between 0 and 1"),
        ([-0.5, 0.02, 0.0], "between 0 and 1"),
        ([1.0, -0.25, 0.02, 0.0, 0.0], "coincide"),
        ([np.nan, 0.02, 0.0], "not finite"),
        ([0.5, 0.02], "2 coefficients"),
    ],
)
def test_coefficients_of_no_circuit_are_refused(coefficient, message):
    pairs = 2 if len(coefficient) == 5 else 1
    with pytest.raises(Refusal, match=message):
        circuit_of_coefficients(coefficient, STEP, hold="zero_order", n_rc=pairs)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"current_ampere": CURRENT[1:]}, "both"),
        ({"current_ampere": 0 * CURRENT}, "nothing moves"),
        ({"voltage_volt": np.full(6000, np.nan)}, "not finite"),
        ({"n_rc": 3}, "1 and 2"),
        ({"current_ampere": CURRENT[:4], "voltage_volt": CURRENT[:4]}, "too few"),
    ],
)
def test_refusals(change, message):
    given = {"current_ampere": CURRENT, "voltage_volt": voltage(1), "ocv_volt": 3.7} | change
    record = [given.pop(name) for name in ("current_ampere", "voltage_volt", "ocv_volt")]
    with pytest.raises(Refusal, match=message):
        track(*record, **given)
