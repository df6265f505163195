"""The measurement chain: clock, counters, noise, resolution, lag and delay."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from virtual_lab import chamber
from virtual_lab.behaviour import Behaviour
from virtual_lab.instruments import measurement
from virtual_lab.instruments.chain import CHAIN, TYPICAL, Chain, sample_times


@given(duration=st.floats(0.5, 5000.0), period=st.floats(0.2, 60.0), seed=st.integers(0, 2**31))
def test_clock_runs_forward_and_ends_with_the_step(duration, period, seed):
    times = sample_times(duration, period_second=period, random=np.random.default_rng(seed))
    assert (np.diff(times) > 0).all()
    assert times[0] > 0
    assert times[-1] == pytest.approx(duration, abs=0.000501)  # read to a millisecond


def test_clock_is_late_as_in_the_thesis():
    times = sample_times(600.0, period_second=0.5, random=np.random.default_rng(0))
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
    chain = CHAIN
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


CLOCKS = st.sampled_from(["late", "jittery", "steady"])


@given(
    clock=CLOCKS,
    duration=st.floats(0.5, 5000.0),
    period=st.floats(0.2, 60.0),
    seed=st.integers(0, 2**31),
)
def test_every_clock_runs_forward_and_ends_with_the_step(clock, duration, period, seed):
    random = np.random.default_rng(seed)
    times = sample_times(duration, period_second=period, random=random, clock=clock)
    assert (np.diff(times) > 0).all()
    assert times[0] > 0
    assert times[-1] == pytest.approx(duration, abs=0.000501)  # read to a millisecond
    assert np.diff(times, prepend=0.0).max() < 1.5 * period + 0.1


def test_jittery_clock_stays_beside_its_grid():
    random = np.random.default_rng(0)
    times = sample_times(900.0, period_second=1.0, random=random, clock="jittery")
    assert times[0] == 0.06
    beside = (times - np.round(times))[1:-1]
    assert np.abs(beside).max() <= 0.0801
    assert np.abs(beside).max() > 0.07
    assert abs(beside.mean()) < 0.01


def test_steady_clock_stays_on_its_grid():
    random = np.random.default_rng(0)
    times = sample_times(900.0, period_second=60.0, random=random, clock="steady")
    np.testing.assert_allclose(times, 60.0 * np.arange(1, 16), atol=0.0045)


def _loaded(current_ampere, duration_second, **more):
    return Behaviour(
        duration_second,
        current=lambda second: np.full(np.shape(second), current_ampere),
        voltage=lambda second: 3.6 + 0.01 * current_ampere + 0 * second,
        temperature=lambda second: 25.0 + 0.001 * second,
        **more,
    )


def _noted(chain, behaviours=None, **more):
    behaviours = behaviours or [_loaded(0.0, 600.0), _loaded(-2.0, 3600.0), _loaded(1.0, 900.0)]
    periods = [5.0] * len(behaviours)
    how = {"periods_second": periods, "seed": 1, "chamber": chamber.steady(25.0)} | more
    return measurement.record(behaviours, chain=chain, **how)


def test_gain_and_offset_are_in_current_voltage_and_counters():
    chain = CHAIN._replace(
        current_gain=0.02, current_offset_ampere=0.1, voltage_gain=0.001, voltage_offset_volt=0.005
    )
    shown = _noted(chain)
    rest, load = shown["step"] == 1, shown["step"] == 2
    assert (shown["current_ampere"][rest] == 0).all()
    np.testing.assert_allclose(shown["current_ampere"][load], -2 * 1.02 + 0.1)
    np.testing.assert_allclose(shown["voltage_volt"][load], 3.58 * 1.001 + 0.005)
    assert shown["discharged_ampere_hour"][-1] == pytest.approx(1.94, rel=1e-9)
    assert shown["charged_ampere_hour"][-1] == pytest.approx(1.12 * 0.25, rel=1e-9)


def test_a_closed_relay_shows_offset_and_noise_at_rest():
    chain = CHAIN._replace(
        rest_is_open=False, current_offset_ampere=0.05, current_noise_ampere=0.002
    )
    ideal = _noted(chain)
    assert ideal["charged_ampere_hour"][ideal["step"] == 1][-1] == pytest.approx(0.05 / 6)
    shown = measurement.measured(ideal, seed=3, chain=chain)
    at_rest = shown["current_ampere"][shown["step"] == 1]
    assert at_rest.std() == pytest.approx(0.002, rel=0.25)
    assert at_rest.mean() == pytest.approx(0.05, abs=0.001)


def test_branches_have_sensors_of_their_own():
    halves = tuple([lambda second: np.full(np.shape(second), -1.0)] * 2)
    chain = CHAIN._replace(branch_gain=(0.01, 0.0), branch_offset_ampere=(0.0, 0.2))
    shown = _noted(chain, [_loaded(-2.0, 60.0, branches=halves)])
    np.testing.assert_allclose(shown["branch_1_current_ampere"], -1.01)
    np.testing.assert_allclose(shown["branch_2_current_ampere"], -0.8)
    np.testing.assert_allclose(shown["current_ampere"], -2.0)


def test_sensor_on_the_surface_lags():
    warmer = Behaviour(7200.0, *[lambda second: 0.0 * second] * 2, lambda s: 25 + s / 600)
    chain = CHAIN._replace(surface_lag_second=60.0)
    shown = _noted(chain, [warmer])
    late = shown["time_second"] > 1200
    behind = 25 + shown["time_second"] / 600 - shown["surface_celsius"]
    np.testing.assert_allclose(behind[late], 0.1, atol=1e-3)


def test_slow_noise_forgets_at_its_own_pace():
    chain = CHAIN._replace(
        voltage_noise_volt=0.0, voltage_slow_noise_volt=0.01, voltage_slow_noise_second=20.0
    )
    flat = [_loaded(0.0, 400_000.0)]
    ideal = _noted(chain, flat, periods_second=[4.0])
    error = measurement.measured(ideal, seed=2, chain=chain)["voltage_volt"] - 3.6
    assert error.std() == pytest.approx(0.01, rel=0.05)
    for lag, wait in ((1, 4.045), (5, 5 * 4.045)):
        found = np.corrcoef(error[:-lag], error[lag:])[0, 1]
        assert found == pytest.approx(np.exp(-wait / 20.0), abs=0.03)


def test_slow_noise_leaves_the_white_noise_as_it_was(ideal):
    slow = CHAIN._replace(voltage_slow_noise_volt=0.01)
    plain, both = (measurement.measured(ideal, seed=2, chain=c) for c in (CHAIN, slow))
    assert (plain["current_ampere"] == both["current_ampere"]).all()
    assert (plain["voltage_volt"] != both["voltage_volt"]).any()


def test_the_chamber_is_read_where_it_is():
    around = chamber.stepped((20.0, 10.0), rest_second=1000.0, hold_second=2000.0)
    shown = _noted(CHAIN, [_loaded(0.0, 4000.0)], chamber=around)
    time = shown["time_second"]
    np.testing.assert_allclose(shown["ambient_celsius"][time < 1000], 20.0)
    np.testing.assert_allclose(shown["ambient_celsius"][time > 1600], 10.0)
    assert np.interp(1300, time, shown["ambient_celsius"]) == pytest.approx(15.0, abs=0.05)


@pytest.mark.parametrize("chain", [CHAIN, Chain(current_gain=0.01)])
def test_a_long_test_is_counted_by_the_cells_own_charge(chain):
    def cell(ampere, second):
        return _loaded(ampere, second, charge=lambda s: ampere * s / 3600)

    pair = [cell(-1.0, 7200.0), cell(0.0, 600.0), cell(1.0, 7200.0), cell(0.0, 600.0)]
    shown = _noted(chain, pair * 50, periods_second=[60.0] * 200)
    expected = 100.0 * (1 + chain.current_gain)
    assert shown["charged_ampere_hour"][-1] == pytest.approx(expected, rel=1e-12)
    assert shown["discharged_ampere_hour"][-1] == pytest.approx(expected, rel=1e-12)
    assert (np.diff(shown["discharged_ampere_hour"]) >= 0).all()


@pytest.mark.parametrize("name", TYPICAL)
def test_typical_instruments_show_their_own_steps(name):
    chain = TYPICAL[name]
    shown = measurement.measured(_noted(chain), seed=2, chain=chain)
    for channel_name, step in (
        ("voltage_volt", chain.voltage_resolution_volt),
        ("current_ampere", chain.current_resolution_ampere),
        ("surface_celsius", chain.temperature_resolution_celsius),
    ):
        counts = shown[channel_name] / step
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    at_rest = shown["current_ampere"][shown["step"] == 1]
    assert (at_rest == 0).all() == chain.rest_is_open


def _pieces(*functions):
    return [lambda second, f=f: f(np.asarray(second, float)) for f in functions]


STEP = _pieces(lambda t: 0 * t, lambda t: 1 + 0 * t, lambda t: 0.25 + 0 * t)
RAMP = _pieces(lambda t: 0 * t, lambda t: 3 * t)


@pytest.mark.parametrize("tau", [0.01, 0.5, 20.0])
def test_low_pass_of_steps_is_exponential_at_any_sampling(tau):
    second = np.array([5.0, 10.0, 10.004, 10.7, 13.0, 25.0, 29.99, 30.0, 30.1, 60.0])
    shown = measurement.reading(STEP, np.array([10.0, 20.0, 30.0]), second, lag_second=tau)
    expected = -np.expm1(-np.clip(second - 10, 0, None) / tau)
    expected += 0.75 * np.expm1(-np.clip(second - 30, 0, None) / tau)
    np.testing.assert_allclose(shown, expected, atol=1e-8)


@pytest.mark.parametrize("tau", [0.1, 2.0])
def test_low_pass_of_a_ramp_lags_behind(tau):
    second = np.linspace(9.0, 40.0, 57)
    shown = measurement.reading(RAMP, np.array([10.0, 30.0]), second, lag_second=tau)
    since = np.clip(second - 10, 0, None)
    expected = 3 * (since - tau + tau * np.exp(-since / tau))
    np.testing.assert_allclose(shown, expected, atol=3e-3 * 3 * tau)


@pytest.mark.parametrize("delay", [-0.3, 0.3])
def test_delay_reads_another_instant(delay):
    second = np.array([0.1, 9.9, 10.0, 10.2, 10.4, 20.0, 39.9])
    shown = measurement.reading(RAMP, np.array([10.0, 30.0]), second, delay_second=delay)
    expected = 3 * np.clip(np.clip(second - delay, 0, 40) - 10, 0, None)
    np.testing.assert_allclose(shown, expected, atol=1e-12)


def test_a_step_is_seen_late_by_the_delay():
    second = np.array([10.0, 10.29, 10.31])
    shown = measurement.reading(STEP, np.array([10.0, 20.0, 30.0]), second, delay_second=0.3)
    np.testing.assert_array_equal(shown, [0, 0, 1])
    early = measurement.reading(STEP, np.array([10.0, 20.0, 30.0]), second - 0.6, delay_second=-0.3)
    np.testing.assert_array_equal(early, [0, 0, 1])
