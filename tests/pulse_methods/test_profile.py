"""Profile likelihood: as the covariance where all is told, open where the data do not end it."""

import numpy as np
import pytest
from pulse_train import CURRENT, NOISE, TIME, noisy, voltage

from cellwright.refusal import Refusal
from pulse_methods.pulse import fit_circuit, profile_interval

HOLD = {"hold": "zero_order"}


def short(values, rows, seed, **given):
    volt = voltage(np.array(values)) + NOISE * np.random.default_rng(seed).normal(size=len(TIME))
    record = TIME[rows], CURRENT[rows], volt[rows], 3.7
    return record, fit_circuit(*record, **HOLD, **given)


@pytest.mark.parametrize("name", ["r0_ohm", "r2_ohm", "tau1_second", "tau2_second"])
def test_where_all_is_told_the_profile_is_the_covariance(name):
    record = TIME, CURRENT, noisy(1), 3.7
    fit = fit_circuit(*record, **HOLD)
    interval = profile_interval(record, fit, name, **HOLD)
    index = fit.names.index(name)
    ends = fit.values[index] + 1.96 * fit.std[index] * np.array([-1, 1])
    np.testing.assert_allclose([interval.lower, interval.upper], ends, atol=0.25 * fit.std[index])


@pytest.mark.slow
def test_profiles_cover():
    inside = []
    for seed in range(30):
        record, fit = short([0.02, 0.01, 8.0], slice(0, 400), seed, n_rc=1)
        interval = profile_interval(record, fit, "tau1_second", **HOLD)
        inside.append(interval.lower < 8.0 < interval.upper)
    assert np.mean(inside) > 0.87


def test_a_time_constant_longer_than_the_rest_is_open_above():
    """A pulse and its 40 s rest: tau2 of 600 s is told from below only, and the words say so."""
    limits = {"tau2_second": (5.0, 1e5)}
    record, fit = short([0.02, 0.01, 0.03, 2.0, 600.0], slice(0, 300), 3, bounds=limits)
    interval = profile_interval(record, fit, "tau2_second", **HOLD, bounds=limits)
    assert np.isfinite(interval.lower)
    assert np.isnan(interval.upper)
    assert "tau2_second cannot be told: its profile is open above" in interval.words


def test_refusals():
    record = TIME, CURRENT, noisy(6), 3.7
    fit = fit_circuit(*record, **HOLD)
    with pytest.raises(Refusal, match="no profile of c1_farad"):
        profile_interval(record, fit, "c1_farad", **HOLD)
    with pytest.raises(Refusal, match="above zero"):
        profile_interval(record, fit._replace(values=0 * fit.values), "r1_ohm", **HOLD)
