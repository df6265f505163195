"""The measurement chain: clock, counters, noise, resolution, faults."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from virtual_lab import measurement


@given(duration=st.floats(0.5, 5000.0), period=st.floats(0.2, 60.0), seed=st.integers(0, 2**31))
def test_clock_runs_forward_and_ends_with_the_step(duration, period, seed):
    times = measurement.sample_times(
        duration, period_second=period, random=np.random.default_rng(seed)
    )
    assert (np.diff(times) > 0).all()
    assert times[0] > 0
    assert times[-1] == pytest.approx(duration, abs=0.0005)


def test_clock_is_late_as_in_the_thesis():
    times = measurement.sample_times(600.0, period_second=0.5, random=np.random.default_rng(0))
    waits = np.diff(times)[4:-1]
    assert waits.min() == pytest.approx(0.51, abs=0.002)
    assert waits.max() == pytest.approx(0.58, abs=0.002)


def test_a_step_is_sampled_densely_where_it_begins(ideal):
    begins = ideal["time_second"][np.flatnonzero(np.diff(ideal["step"])) + 1]
    np.testing.assert_allclose(begins, [60.01, 3660.01])


def test_counters_count_what_flowed(ideal):
    assert ideal["discharged_ampere_hour"][-1] == pytest.approx(2.0, rel=1e-9)
    assert ideal["charged_ampere_hour"][-1] == pytest.approx(0.25, rel=1e-9)
    assert (np.diff(ideal["discharged_ampere_hour"]) >= 0).all()


def test_instrument_shows_noise_in_its_own_steps(ideal):
    shown = measurement.measured(ideal, seed=2)
    chain = measurement.CHAIN
    steps = shown["voltage_volt"] / chain.voltage_resolution_volt
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    error = shown["voltage_volt"] - ideal["voltage_volt"]
    expected = np.hypot(chain.voltage_noise_volt, chain.voltage_resolution_volt / 12**0.5)
    assert error.std() == pytest.approx(expected, rel=0.05)
    assert abs(error.mean()) < 4 * expected / error.size**0.5


def test_rest_shows_no_current(ideal):
    shown = measurement.measured(ideal, seed=2)
    assert (shown["current_ampere"][ideal["step"] == 1] == 0.0).all()
    assert shown["current_ampere"][ideal["step"] == 2].std() > 0.0002


def test_seed_decides_everything(ideal):
    first, again, other = (measurement.measured(ideal, seed=s) for s in (2, 2, 3))
    assert (first["voltage_volt"] == again["voltage_volt"]).all()
    assert (first["voltage_volt"] != other["voltage_volt"]).any()


def test_spikes_are_single_samples(ideal):
    spoilt = measurement.with_spikes(ideal, seed=4, count=2, size_volt=0.06)
    moved = spoilt["voltage_volt"] - ideal["voltage_volt"]
    assert sorted(np.round(moved[moved != 0], 6)) == [-0.06, 0.06]


def test_repeats_are_whole_rows_twice(ideal):
    spoilt = measurement.with_repeats(ideal, seed=4, count=4)
    assert spoilt["step"].size == ideal["step"].size + 4
    assert (np.diff(spoilt["time_second"]) == 0).sum() == 4
    assert np.unique(spoilt["time_second"]).size == ideal["time_second"].size


def test_gap_leaves_counters_running(ideal):
    spoilt = measurement.with_gap(ideal, begin_second=1000.0, end_second=1600.0)
    hole = np.argmax(np.diff(spoilt["time_second"]))
    assert spoilt["time_second"][hole + 1] - spoilt["time_second"][hole] > 600
    counted = np.diff(spoilt["discharged_ampere_hour"])[hole]
    assert counted == pytest.approx(2.0 * 600 / 3600, rel=0.01)
