"""Fit of a circuit: truth within its errors, from any start, refusals."""

import numpy as np
import pytest
from pulse_train import CURRENT, NOISE, TIME, TRUE, fitted, noisy, voltage

from cellwright.numerics.lags import HOLDS
from cellwright.numerics.statistics import correlation_factor, is_white, parameter_covariance
from cellwright.refusal import Refusal
from pulse_methods.pulse import fit_circuit


def distance(fit, other):
    """Largest difference of two fits, in standard deviations."""
    return np.abs((fit.values - other.values) / other.std).max()


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("values", [TRUE[:1], TRUE[[0, 1, 3]], TRUE], ids=["0RC", "1RC", "2RC"])
def test_without_noise_the_circuit_is_found(hold, values):
    fit = fitted(voltage(values, hold), hold=hold, n_rc=(len(values) - 1) // 2)
    np.testing.assert_allclose(fit.values, values, rtol=1e-6)
    np.testing.assert_allclose(voltage(fit.values, hold), voltage(values, hold), atol=1e-8)


def test_three_pairs_are_found():
    values = np.array([0.02, 0.01, 0.012, 0.015, 1.0, 12.0, 150.0])
    np.testing.assert_allclose(fitted(voltage(values), n_rc=3).values, values, rtol=1e-5)


def test_true_time_steps():
    time = np.cumsum(np.random.default_rng(5).exponential(0.2, 4000))
    volt = voltage(time=time, hold="first_order")
    fit = fit_circuit(time, CURRENT, volt, 3.7, hold="first_order")
    np.testing.assert_allclose(fit.values, TRUE, rtol=1e-6)


@pytest.mark.slow
def test_random_starts_end_in_the_same_optimum():
    volt, rng = noisy(1), np.random.default_rng(2)
    best = fitted(volt)
    for _ in range(30):
        other = fitted(volt, start=10 ** rng.uniform(-0.7, 2.9, 2))
        assert distance(other, best) < 0.01


@pytest.mark.slow
def test_errors_at_the_cramer_rao_bound_and_intervals_cover():
    """250 cells of random parameters under white noise, each with its own bound."""
    rng, errors = np.random.default_rng(3), []
    for _ in range(250):
        values = 10 ** np.array([*rng.uniform(-2, -1, 3), rng.uniform(0, 0.9), rng.uniform(1.5, 2)])
        volt = voltage(values) + NOISE * rng.normal(size=len(TIME))
        fit = fitted(volt)
        errors.append((fit.values - values) / fit.std)
    errors = np.array(errors)
    np.testing.assert_allclose(errors.std(axis=0), 1.0, atol=0.14)
    assert 0.93 < np.mean(np.abs(errors) < 1.96) < 0.97
    assert (np.abs(np.mean(np.abs(errors) < 1.96, axis=0) - 0.95) < 0.035).all()


def test_covariance_is_the_inverse_of_the_fisher_information():
    """Sensitivities by differences of the simulation, which shares no line with the fit's."""
    fit = fitted(noisy(4))
    steps = 1e-5 * np.diag(fit.values)
    columns = [voltage(fit.values + s) - voltage(fit.values - s) for s in steps]
    jacobian = np.array(columns) / (2 * steps.diagonal()[:, None])
    fisher = jacobian @ jacobian.T / (fit.rmse_volt**2 * len(TIME) / (len(TIME) - 5))
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(fisher), rtol=1e-3, atol=1e-14)
    np.testing.assert_allclose(np.diag(fit.correlation), 1.0)


@pytest.mark.slow
def test_errors_that_remember_widen_the_deviations_so_that_they_cover():
    from scipy.signal import lfilter

    rng, errors, widening = np.random.default_rng(6), [], []
    for _ in range(100):
        coloured = lfilter([NOISE], [1.0, -0.95], rng.normal(size=len(TIME)))
        fit = fitted(voltage() + coloured)
        errors.append((fit.values - TRUE) / fit.std)
        widening.append(fit.widening)
    covered = np.mean(np.abs(errors) < 1.96, axis=0)
    assert (covered > 0.85).all()
    # R0 is told by steps, tau2 by slow changes: the same memory costs the latter more.
    assert np.mean(widening, axis=0)[4] > 2 * np.mean(widening, axis=0)[0]


def test_widening_of_a_mean_is_the_correlation_factor():
    """For a constant sensitivity the sandwich is the factor that the other fits use."""
    walk = np.convolve(np.random.default_rng(7).normal(size=20040), np.ones(41), "valid")
    residual = walk - walk.mean()
    power = residual @ residual
    gram, ones = np.array([[float(len(walk))]]), np.ones((1, len(walk)))
    white = parameter_covariance(gram, power, len(walk))
    wide = parameter_covariance(gram, power, len(walk), sensitivity=ones, residual=residual)
    np.testing.assert_allclose(wide / white, correlation_factor(residual), rtol=0.02)
    assert not is_white(residual[1:] @ residual[:-1], power, len(walk))


def test_a_bound_holds_is_named_and_has_no_deviation():
    fit = fitted(noisy(8), bounds={"r1_ohm": (0.0, 0.008)})
    assert fit.at_bound == ("r1_ohm",)
    assert fit.values[1] == pytest.approx(0.008, rel=1e-9)
    assert np.isnan(fit.std[1])
    assert np.isfinite(np.delete(fit.std, 1)).all()
    assert "r1_ohm lies at the bound" in fit.verdict


def test_equal_bounds_fix_a_parameter():
    fit = fitted(noisy(8), bounds={"tau2_second": (40.0, 40.0), "r0_ohm": (0.02, 0.02)})
    assert (fit.values[[0, 4]] == [0.02, 40.0]).all()
    assert not fit.at_bound
    assert not fit.verdict
    assert fit.std[2] < fitted(noisy(8)).std[2]


def test_a_pair_that_is_not_there_is_not_told():
    fit = fitted(noisy(9, values=TRUE[[0, 1, 3]]))
    assert "told" in fit.verdict or "bound" in fit.verdict or "acts at once" in fit.verdict


@pytest.mark.parametrize("seed", range(4))
def test_a_slow_pair_in_a_short_record_is_not_told(seed):
    """A pulse and 40 s of rest, tau 3000 s: only R2/tau2, one over the capacitance, is told."""
    values, rows = np.array([0.02, 0.01, 0.15, 2.0, 3000.0]), slice(0, 300)
    limits = {"tau2_second": (10.0, 1e5)}
    record = TIME[rows], CURRENT[rows], noisy(seed, values=values)[rows], 3.7
    fit = fit_circuit(*record, hold="zero_order", bounds=limits)
    assert "tau2_second cannot be told" in fit.verdict
    if "tau2_second" in fit.at_bound:
        assert np.isnan(fit.std[[2, 4]]).all()
    else:
        assert "r2_ohm and tau2_second are told only as their ratio" in fit.verdict


def test_two_pairs_of_nearly_one_time_constant_are_told_as_a_sum():
    values = np.array([0.02, 0.01, 0.01, 10.0, 12.0])
    verdicts = [fitted(noisy(seed, values=values)).verdict for seed in range(20)]
    assert any("r1_ohm and r2_ohm are told only as their sum" in said for said in verdicts)


def test_samples_slower_than_tau_leave_the_pair_at_the_step():
    rows = slice(None, None, 100)
    volt = voltage(TRUE[[0, 1, 3]])[rows]
    fit = fit_circuit(TIME[rows], CURRENT[rows], volt, 3.7, hold="zero_order", n_rc=1)
    assert "tau1_second is no longer than 20 s" in fit.verdict
    assert np.isnan(fit.std[1:]).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"current": CURRENT[:-1]}, "all must be"),
        ({"time": TIME[:1], "current": CURRENT[:1], "volt": CURRENT[:1]}, "1 sample"),
        ({"time": TIME[:5], "current": CURRENT[48:53], "volt": CURRENT[:5]}, "5 samples for 5"),
        ({"volt": np.where(TIME == 0, np.nan, 3.7)}, "not finite"),
        ({"time": TIME[::-1]}, "runs back"),
        ({"time": 0 * TIME}, "same time stamp"),
        ({"current": 0 * TIME + 2.0}, "throughout"),
        ({"ocv": np.ones(3)}, "OCV has shape"),
        ({"hold": "linear"}, "zero_order"),
        ({"n_rc": 7}, "0 to 4"),
        ({"start": [1.0]}, "2 time constants"),
        ({"bounds": {"r9_ohm": (0, 1)}}, "r9_ohm"),
        ({"bounds": {"tau1_second": (5, 1)}}, "must ascend"),
        ({"bounds": {"tau1_second": (20, 20), "tau2_second": (20, 20)}}, "at one value"),
    ],
)
def test_refusals(change, message):
    columns = {"time": TIME, "current": CURRENT, "volt": voltage(), "ocv": 3.7} | change
    record = [columns.pop(name) for name in ("time", "current", "volt", "ocv")]
    with pytest.raises(Refusal, match=message):
        fit_circuit(*record, **({"hold": "zero_order"} | columns))


def test_a_time_constant_at_its_bound_is_no_place_to_stop():
    """A step that a bound shortens must neither end the search nor leave the resistances behind."""
    from lmfit import Parameters, minimize

    time = np.concatenate([np.arange(0, 10, 0.5), 10 + np.arange(0, 40, 0.5)])
    current = np.where(time < 10, -5.0, 0.0)
    current[0] = 0.0
    names, limits = ("r0", "r1", "r2", "tau1", "tau2"), {"tau1_second": (0.2, 150.0)}
    limits["tau2_second"] = limits["tau1_second"]
    for slow in (60.0, 300.0, 3000.0):
        truth = np.array([0.031, 0.004, 0.0002 * slow, 15.0, slow])
        noise = 5e-4 * np.random.default_rng(int(slow)).normal(size=len(time))
        volt = voltage(truth, time=time, current=current) + noise
        fit = fit_circuit(time, current, volt, 3.7, hold="zero_order", bounds=limits)

        def residual(now, volt=volt):
            values = [now[name].value for name in names]
            return voltage(np.array(values), time=time, current=current) - volt

        start = Parameters()
        for name, value in zip(names, (0.03, 0.005, 0.02, 5.0, 100.0), strict=True):
            high = 150.0 if name.startswith("tau") else 1.0
            start.add(name, value, min=0.2 if name.startswith("tau") else 0.0, max=high)
        rmse = np.sqrt(np.mean(minimize(residual, start).residual ** 2))
        own = np.sqrt(np.mean((voltage(fit.values, time=time, current=current) - volt) ** 2))
        assert own == pytest.approx(fit.rmse_volt, rel=1e-3)
        assert own <= rmse * (1 + 1e-4)
