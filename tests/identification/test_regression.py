"""The linear problem under an identification: its columns, its priors, its deviations."""

import numpy as np
import pytest
import truth
from synthetic import CAPACITY, data, diffusion, hysteresis, measured, with_target

from cellwright.circuits.cell import overpotentials, usual_slope
from cellwright.circuits.circuit import Branch
from cellwright.identification.columns import (
    Held,
    columns_of,
    damping,
    lead,
    ocv_of,
    on_table,
)
from cellwright.identification.regression import (
    covariance_of,
    named,
    solved,
    system_of,
)
from cellwright.numerics.linear import hats, solve
from cellwright.numerics.statistics import correlation_factor
from cellwright.refusal import Refusal

HELD = Held((8.0, 150.0), charge_ampere_hour=0.06)


@pytest.fixture(scope="module")
def ready():
    return data(*measured(1, extra=(hysteresis(),)))


@pytest.fixture(scope="module")
def system(ready):
    return system_of(columns_of(ready, HELD), ready.knots)


def stds_of(system, solution):
    return named(system, np.sqrt(np.diag(covariance_of(system, solution))))


def test_each_column_is_what_the_simulator_makes_of_its_branch(ready):
    (record,) = ready.records
    columns = dict(columns_of(ready, HELD).resistances)
    course = np.array([0.04, 0.02, 0.03, 0.01, 0.05])
    at = np.interp(record.soc, ready.knots, course)
    branches = {
        "r0": Branch("R", {"r_ohm": at}),
        "r1": Branch("RC", {"r_ohm": at, "tau_second": 8.0}),
        "r2": Branch("RC", {"r_ohm": at, "tau_second": 150.0}),
        "m": Branch("hysteresis", {"m_volt": at, "charge_ampere_hour": 0.06}),
    }
    args = (record.test_time_second, record.current_ampere)
    for name, branch in branches.items():
        (volt,) = overpotentials((branch,), *args, hold=ready.hold)
        np.testing.assert_allclose(columns[name] @ course, volt[record.used], rtol=0, atol=1e-12)


def test_the_lead_of_the_surface_is_that_of_the_diffusion_branch(ready):
    (record,) = ready.records
    branch = diffusion(2000.0)
    rate = branch.parameters["soc_per_ampere"] * CAPACITY * 3600.0
    assert rate == pytest.approx(2000.0 / 15.0)
    steady = record._replace(
        test_time_second=np.linspace(0, 2e4, len(record.soc)),
        current_ampere=np.full(len(record.soc), -1.0),
    )
    np.testing.assert_allclose(lead(ready, steady, 2000.0)[-1], -rate / 3600.0 / CAPACITY)


def test_the_scale_columns_are_the_change_of_the_ocv(ready):
    columns, step = columns_of(ready, HELD), 1e-6
    for index, name in enumerate(("missing", "stretch")):
        moved = columns_of(ready, HELD._replace(**{name: step}))
        change = (columns.target_volt - moved.target_volt) / step
        np.testing.assert_allclose(columns.scale[:, index], change, atol=0.02)


def test_an_ocv_goes_on_with_its_slope_outside_its_table(ready):
    at = np.array([-0.02, 0.0, 0.5, 1.0, 1.03])
    first, last = np.diff(truth.OCV_VOLT)[[0, -1]] / 0.01
    expected = truth.ocv_at(at) + [-0.02 * first, 0, 0, 0, 0.03 * last]
    np.testing.assert_allclose(ocv_of(ready, at), expected)
    slopes = usual_slope(ready.ocv_volt, at[[0, -1]])
    np.testing.assert_allclose(slopes, [first, last])
    held = Held((), missing=0.03, stretch=0.02)
    np.testing.assert_allclose(on_table(np.array([1.0, 0.0]), held), [0.97, -0.05])


def test_kinetics_fall_short_only_of_large_currents(ready):
    (record,) = ready.records
    shape = hats(record.soc, ready.knots)
    held = Held((), scale_volt=0.05, transfer_ohm=np.full(5, 0.04))
    factor = damping(record, shape, held)
    x = 0.04 * np.abs(record.current_ampere) / 0.05
    np.testing.assert_allclose(factor[x > 0], np.arcsinh(x[x > 0]) / x[x > 0])
    np.testing.assert_allclose(factor[x == 0], 1.0)
    np.testing.assert_array_equal(damping(record, shape, held._replace(transfer_ohm=None)), 1.0)


def test_deviations_are_those_of_repeated_noise(ready, system):
    """Noise as it is believed, 100 times: the scatter of the answers is the stated deviation."""
    rng, truth_of = np.random.default_rng(2), solved(system)
    clean = system.matrix @ truth_of.vector
    answers = []
    for _ in range(100):
        noisy = with_target(system, clean + 0.3 * rng.normal(size=len(clean)))
        answers.append(solved(noisy, factor=1 / 0.3**2))
    stds = stds_of(noisy, answers[0])
    for name in ("r0", "r1", "m"):
        scatter = np.std([one.values[name] for one in answers], axis=0)
        ratio = scatter / stds[name]
        assert (ratio < 1.3).all()
        assert np.mean(ratio) > 0.7
    assert solved(noisy).factor * 0.3**2 == pytest.approx(1.0, rel=0.2)


def test_where_data_are_silent_the_prior_goes_on_flat(ready):
    """Knots that no row touches take the value of their neighbours."""
    (record,) = ready.records
    half = ready._replace(records=(record._replace(used=record.used & (record.soc > 0.5)),))
    system = system_of(columns_of(half, HELD), half.knots)
    solution = solved(system)
    np.testing.assert_allclose(solution.values["r0"][2:], truth.R0[2:], rtol=0.05)
    np.testing.assert_allclose(solution.values["r0"][:2], solution.values["r0"][2], rtol=0.1)
    stds = stds_of(system, solution)["r0"]
    assert stds[0] > 5 * stds[3]


def test_the_cost_is_lowest_at_the_solution(system):
    solution = solved(system)
    rng = np.random.default_rng(3)
    for _ in range(20):
        vector = solution.vector * (1 + 0.02 * rng.normal(size=len(solution.vector)))
        residual = system.target - system.matrix @ vector
        cost = solution.factor * residual @ residual + vector @ system.prior @ vector
        assert cost >= solution.cost
    parts = named(system, solution.vector)
    assert list(parts) == ["shift", "scale", "r0", "r1", "r2", "m"]
    assert sum(len(part) for part in parts.values()) == len(solution.vector)


def test_a_resistance_at_zero_has_no_deviation(ready):
    """Where the cell has no slow part, knots of the slow pair end at their bound."""
    (record,) = ready.records
    volt = truth.ocv_at(record.soc) + 0.03 * record.current_ampere
    noise = np.random.default_rng(4).normal(0, 1e-3, len(volt))
    ohmic = ready._replace(records=(record._replace(voltage_volt=volt + noise),))
    system = system_of(columns_of(ohmic, Held((8.0,))), ohmic.knots)
    solution = solved(system)
    np.testing.assert_allclose(solution.values["r0"], 0.03, rtol=0.03)
    zero = solution.values["r1"] == 0
    assert zero.any()
    np.testing.assert_array_equal(np.isnan(stds_of(system, solution)["r1"]), zero)


def test_a_current_of_the_wrong_sign_is_refused(ready):
    (record,) = ready.records
    turned = ready._replace(records=(record._replace(current_ampere=-record.current_ampere),))
    with pytest.raises(Refusal, match="against the current's sign"):
        system_of(columns_of(turned, Held(())), turned.knots)


def test_correlation_factor_of_known_noise():
    rng = np.random.default_rng(12)
    white = rng.normal(size=20000)
    assert correlation_factor(white) < 1.1
    red = np.zeros(20000)
    for k in range(1, 20000):
        red[k] = 0.9 * red[k - 1] + white[k]
    assert correlation_factor(red) == pytest.approx(19.0, rel=0.3)
    assert correlation_factor(np.zeros(5)) == 1.0


def test_refusals(ready):
    (record,) = ready.records
    few = ready._replace(records=(record._replace(used=np.arange(len(record.soc)) < 10),))
    with pytest.raises(Refusal, match="10 rows cannot carry 6 parameters"):
        system_of(columns_of(few, HELD), few.knots)
    still = ready._replace(records=(record._replace(current_ampere=0 * record.soc),))
    with pytest.raises(Refusal, match="nothing in the data excites r0, r1, r2, m"):
        system_of(columns_of(still, HELD), still.knots)
    with pytest.raises(Refusal, match="1 parameters are not excited"):
        solve(np.diag([1.0, 0.0]), np.ones(2), 1)
    with pytest.raises(Refusal, match=r"apart \(rank\)"):
        solve(np.ones((2, 2)), np.ones(2), 1)


def test_counting_that_ends_below_zero_still_has_a_prior(ready):
    below = ready._replace(knots=np.array([-0.04, 0.0, 0.3, 0.9]))
    prior = system_of(columns_of(below, HELD), below.knots).prior
    assert np.isfinite(prior).all()
    assert np.linalg.eigvalsh(prior)[0] > 0


def scipys(gram, moment, signed):
    """Non-negative least squares by scipy, each signed parameter as two of either sign."""
    from scipy.optimize import nnls

    factor = np.linalg.cholesky(gram)
    both = np.hstack([factor.T, -factor.T[:, :signed]])
    solution = nnls(both, np.linalg.solve(factor, moment))[0]
    solution[:signed] -= solution[len(gram) :]
    return solution[: len(gram)]


@pytest.mark.parametrize("alike", [0.0, 3.0, 100.0])
def test_the_active_set_gives_what_scipys_solver_gives_wherever_it_begins(alike):
    rng = np.random.default_rng(6)
    for _ in range(50):
        matrix = rng.normal(size=(70, 40)) + alike * rng.normal(size=(70, 1))
        matrix /= np.linalg.norm(matrix, axis=0)
        gram, moment = matrix.T @ matrix, matrix.T @ rng.normal(size=70)
        expected = scipys(gram, moment, 3)
        for free in (None, np.zeros(40, bool), rng.random(40) < 0.5):
            vector = solve(gram, moment, 3, free=free)
            np.testing.assert_allclose(vector, expected, atol=1e-7 * np.abs(expected).max())
            np.testing.assert_array_equal(vector[3:] == 0, expected[3:] == 0)


def test_an_active_set_that_takes_turns_is_solved_one_by_one(monkeypatch):
    """Lags of a grid of time constants are so alike that exchanges of many go on for long.

    After one round in which signs are wrong only the way one by one is left.
    """
    monkeypatch.setattr("cellwright.numerics.linear.ROUNDS", 1)
    time, tau = np.arange(400.0), np.geomspace(2.0, 200.0, 18)
    matrix = 1.0 - np.exp(-time[:, None] / tau)
    target = matrix[:, [4, 13]] @ [0.6, 0.4] + np.random.default_rng(7).normal(0, 0.01, 400)
    gram, moment = matrix.T @ matrix, matrix.T @ target
    gram += np.diag(1e-6 * np.diag(gram))
    expected = scipys(gram, moment, 1)
    assert (np.linalg.solve(gram, moment)[1:] < 0).any()
    np.testing.assert_allclose(solve(gram, moment, 1), expected, atol=1e-7)
