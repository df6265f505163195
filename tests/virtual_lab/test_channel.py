"""A sensor that is late or slow, against the answers of theory; nothing depends on sampling."""

import numpy as np
import pytest

from virtual_lab import channel


def _pieces(*functions):
    return [lambda second, f=f: f(np.asarray(second, float)) for f in functions]


STEP = _pieces(lambda t: 0 * t, lambda t: 1 + 0 * t, lambda t: 0.25 + 0 * t)
RAMP = _pieces(lambda t: 0 * t, lambda t: 3 * t)


@pytest.mark.parametrize("tau", [0.01, 0.5, 20.0])
def test_low_pass_of_steps_is_exponential_at_any_sampling(tau):
    second = np.array([5.0, 10.0, 10.004, 10.7, 13.0, 25.0, 29.99, 30.0, 30.1, 60.0])
    shown = channel.reading(STEP, np.array([10.0, 20.0, 30.0]), second, lag_second=tau)
    expected = -np.expm1(-np.clip(second - 10, 0, None) / tau)
    expected += 0.75 * np.expm1(-np.clip(second - 30, 0, None) / tau)
    np.testing.assert_allclose(shown, expected, atol=1e-8)


@pytest.mark.parametrize("tau", [0.1, 2.0])
def test_low_pass_of_a_ramp_lags_behind(tau):
    second = np.linspace(9.0, 40.0, 57)
    shown = channel.reading(RAMP, np.array([10.0, 30.0]), second, lag_second=tau)
    since = np.clip(second - 10, 0, None)
    expected = 3 * (since - tau + tau * np.exp(-since / tau))
    np.testing.assert_allclose(shown, expected, atol=3e-3 * 3 * tau)


@pytest.mark.parametrize("delay", [-0.3, 0.3])
def test_delay_reads_another_instant(delay):
    second = np.array([0.1, 9.9, 10.0, 10.2, 10.4, 20.0, 39.9])
    shown = channel.reading(RAMP, np.array([10.0, 30.0]), second, delay_second=delay)
    expected = 3 * np.clip(np.clip(second - delay, 0, 40) - 10, 0, None)
    np.testing.assert_allclose(shown, expected, atol=1e-12)


def test_a_step_is_seen_late_by_the_delay():
    second = np.array([10.0, 10.29, 10.31])
    shown = channel.reading(STEP, np.array([10.0, 20.0, 30.0]), second, delay_second=0.3)
    np.testing.assert_array_equal(shown, [0, 0, 1])
    early = channel.reading(STEP, np.array([10.0, 20.0, 30.0]), second - 0.6, delay_second=-0.3)
    np.testing.assert_array_equal(early, [0, 0, 1])
