"""Relaxations: the thesis' example, recovery within errors, one where two are not told."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cellwright.protocols.relaxation import fit_relaxation
from cellwright.refusal import Refusal

# Thesis table 2.2 and fig. 2.3; its SSE and RMSE say 1794 degrees of freedom, so 1799 samples.
TIME = np.arange(1799.0)
RATES = np.array([0.01627, 0.001833])
THESIS = 3.683 - 0.01554 * np.exp(-RATES[0] * TIME) - 0.009265 * np.exp(-RATES[1] * TIME)
NOISE = 1.801e-4


def relaxed_voltage(fit, time):
    """Voltage of a fitted relaxation (n,) [V]."""
    return fit.ocv_volt + np.exp(-time[:, None] / fit.tau_second) @ fit.amplitude_volt


def noisy(seed, volt=THESIS):
    return volt + NOISE * np.random.default_rng(seed).normal(size=len(volt))


def test_the_thesis_example_has_its_goodness_of_fit():
    """Made from the parameters of table 2.2 and its RMSE, the fit has its SSE and R²."""
    fit = fit_relaxation(TIME, noisy(0))
    assert fit.sse_volt2 == pytest.approx(5.819e-5, rel=0.08)
    assert fit.r_squared == pytest.approx(0.9979, abs=1.5e-4)
    assert fit.rmse_volt == pytest.approx(NOISE, rel=0.05)
    assert fit.ocv_volt == pytest.approx(3.683, abs=1e-4)
    np.testing.assert_allclose(fit.amplitude_volt, [-0.01554, -0.009265], rtol=0.03)
    np.testing.assert_allclose(1 / fit.tau_second, RATES, rtol=0.04)
    assert not fit.verdict


@pytest.mark.slow
def test_intervals_cover():
    errors = []
    for seed in range(300):
        fit = fit_relaxation(TIME, noisy(seed))
        off = [fit.ocv_volt - 3.683, *(fit.tau_second - 1 / RATES)]
        errors.append(np.array(off) / [fit.ocv_std_volt, *fit.tau_std_second])
    covered = np.mean(np.abs(errors) < 1.96, axis=0)
    assert (np.abs(covered - 0.95) < 0.035).all()


@settings(deadline=None, max_examples=30)
@given(
    st.floats(2, 30), st.floats(5, 20), st.floats(1, 50), st.floats(1, 50), st.sampled_from([1, -1])
)
def test_without_noise_it_is_exact(fast, ratio, first, second, sign):
    time = np.arange(0.0, 3 * fast * ratio, fast / 8)
    parts, tau = np.array([first, second]) * 1e-3 * sign, np.array([fast, fast * ratio])
    fit = fit_relaxation(time, 3.5 + np.exp(-time[:, None] / tau) @ parts)
    assert fit.ocv_volt == pytest.approx(3.5, abs=1e-7)
    np.testing.assert_allclose(fit.tau_second, tau, rtol=1e-4)
    np.testing.assert_allclose(fit.amplitude_volt, parts, rtol=1e-3)


def test_two_exponentials_on_a_steady_clock_are_exact():
    fit = fit_relaxation(TIME + 1e6, THESIS)
    np.testing.assert_allclose(1 / fit.tau_second, RATES, rtol=1e-6)
    np.testing.assert_allclose(relaxed_voltage(fit, TIME), THESIS, atol=1e-9)
    assert fit.ahead_volt == pytest.approx(3.683 - THESIS[-1], abs=1e-8)


def test_mirror():
    up, down = fit_relaxation(TIME, noisy(1)), fit_relaxation(TIME, -noisy(1))
    assert up.ocv_volt == pytest.approx(-down.ocv_volt, abs=1e-8)
    np.testing.assert_allclose(up.tau_second, down.tau_second, rtol=1e-5)


def test_a_burst_of_samples_does_not_outvote_the_rest():
    """The logger's rate at first changes the OCV little, even where two exponentials are wrong."""

    def volt(time):
        return 3.6 - 0.02 / (1 + time / 20.0) ** 0.5

    even, burst = np.arange(1800.0), np.unique([*np.arange(0, 30, 0.02), *np.arange(1800.0)])
    plain, crowded = (fit_relaxation(time, volt(time)) for time in (even, burst))
    assert crowded.ocv_volt == pytest.approx(plain.ocv_volt, abs=5e-5)


def test_60_seconds_do_not_tell_two():
    fit = fit_relaxation(TIME[:60], noisy(2)[:60])
    assert len(fit.tau_second) == 1
    assert fit.verdict.startswith("two exponentials cannot be told (")


def test_noise_alone_tells_none():
    fit = fit_relaxation(TIME, noisy(3, np.full(len(TIME), 3.7)))
    assert "of that" in fit.verdict


def test_a_slower_tail_than_two_exponentials_is_said():
    fit = fit_relaxation(TIME, noisy(4, 3.6 - 0.02 / (1 + TIME / 20.0) ** 0.5))
    assert "a slower tail" in fit.verdict
    assert fit.drift_volt > 3 * fit.ocv_std_volt


def rests(path):
    """Rests of 20 min after the 10 min pulses: times, voltages."""
    columns = np.genfromtxt(path, delimiter=",", skip_header=1, encoding="utf-8")[:, :3]
    ends = np.flatnonzero((np.abs(columns[:-1, 1]) > 0.1) & (np.abs(columns[1:, 1]) < 0.01))
    for end in ends + 1:
        rest = columns[end : end + 119]
        if np.abs(rest[:, 1]).max() < 0.01 and len(rest) == 119:
            yield rest[:, 0], rest[:, 2]


@pytest.mark.parametrize("cell", ["R1", "R2"])
def test_measured_rests_of_dmegc(shared, cell):
    """Two exponentials are told in every rest, and what they leave is the instrument's 0.1 mV."""
    fit = [fit_relaxation(*r) for r in rests(shared / f"campaigns/dmegc/raw/{cell}/pulses.csv.gz")]
    assert len(fit) >= 10
    assert all(len(one.tau_second) == 2 for one in fit)
    assert np.median([one.rmse_volt for one in fit]) < 2e-4
    assert all(one.r_squared > 0.998 for one in fit)
    assert all((one.amplitude_volt < 0).all() for one in fit)


@pytest.mark.parametrize("cell", ["R1", "R2"])
def test_a_third_of_a_rest_tells_its_end_better_than_its_last_sample(shared, cell):
    kept, taken = [], []
    for time, volt in rests(shared / f"campaigns/dmegc/raw/{cell}/pulses.csv.gz"):
        fit = fit_relaxation(time[:40], volt[:40])
        kept.append(volt[39] - volt[-1])
        taken.append(relaxed_voltage(fit, time[-1:] - time[0])[0] - volt[-1])
    assert np.linalg.norm(taken) < 0.7 * np.linalg.norm(kept)


@pytest.mark.parametrize(
    ("time", "volt", "message"),
    [
        (TIME[:-1], THESIS, "all must be"),
        (TIME[:7], THESIS[:7], "7 sample"),
        (TIME, np.where(TIME == 5, np.nan, THESIS), "not finite"),
        (TIME[::-1], THESIS, "runs back"),
        (0 * TIME, THESIS, "stands still"),
        (TIME, 0 * TIME + 3.7, "nothing relaxes"),
        (np.append(TIME[:-1], 1e5), THESIS, "a gap"),
    ],
)
def test_refusals(time, volt, message):
    with pytest.raises(Refusal, match=message):
        fit_relaxation(time, volt)
