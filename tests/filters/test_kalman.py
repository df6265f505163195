"""The filter's recursion: kernel and twin alike, the textbook's on a linear cell, its algebra."""

import numpy as np
import pytest
import truth
from truth import stated, with_branch

from cellwright.circuits.circuit import KINDS
from cellwright.filters import kalman
from cellwright.filters.bank import bank_of
from cellwright.filters.estimate import Start
from cellwright.filters.kalman import acquire
from cellwright.filters.plant import Noise, plant_of
from cellwright.native import function
from cellwright.refusal import Refusal

NOISE = Noise(window=50)


def record(seed=1, seconds=150):
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.choice([0.0, 0.1, 1.0, 3.0], seconds))
    current = np.repeat(rng.uniform(-3, 2, seconds // 10), 10)
    soc = truth.soc_of(time, current, 0.7)
    return time, current, truth.voltage(time, current, soc) + rng.normal(size=seconds) * 0.002


def prepared(model, noise=NOISE, *, hold="first_order", **tracked):
    plant = plant_of(bank_of(model, None, 25.0), *record(), noise, hold=hold, **tracked)
    return plant, noise, acquire(plant, Start(0.4, c_rate=0.5), noise)[0]


@pytest.mark.parametrize("hold", ["first_order", "zero_order"])
@pytest.mark.parametrize(
    "noise",
    [
        NOISE,
        Noise(error_second=0.0, fast_second=0.0, error_soc=0.0, window=50),
        Noise(adaptive=False),
        Noise(window=400),
        Noise(considered=True),
    ],
)
@pytest.mark.parametrize("tracked", [{}, {"track_ohmic": True}, {"track_capacity": True}])
def test_kernel_is_its_numpy_twin(hold, noise, tracked):
    if function("kalman") is None:
        pytest.skip("no C compiler")
    given = prepared(stated(), noise, hold=hold, **tracked)
    np.testing.assert_allclose(kalman.run(*given), kalman.run_by_numpy(*given), rtol=0, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_kernel_is_its_twin_for_every_kind_of_branch(kind):
    given = prepared(with_branch(kind), track_capacity=True, track_ohmic=True)
    np.testing.assert_allclose(kalman.run(*given), kalman.run_by_numpy(*given), rtol=0, atol=1e-12)


@pytest.mark.parametrize("points", [51, 101, 201, 334])
def test_the_usual_gain_is_that_of_all_points_from_empty_to_full(points):
    """Rounding of the grid leaves neither of its ends out."""
    bank = bank_of(stated(), None, 25.0, points=points)
    first = bank.elements[0]
    rising = first._replace(gain=np.where(bank.soc < 0.0, 9.0, bank.soc))
    bank = bank._replace(elements=(rising, *bank.elements[1:]))
    plant = plant_of(bank, *record(), NOISE, hold="first_order")
    assert plant.usual_gain[0] == pytest.approx(0.5, abs=1e-12)


def many():
    """A member with ten pairs of which some are kinetics, hysteresis and diffusion."""
    model = with_branch("diffusion")
    branches = model["members"][0]["conditions"][0]["branches"]
    for kind in ("hysteresis", *["kinetic"] * 3, *["RC"] * 6):
        branches.append(with_branch(kind)["members"][0]["conditions"][0]["branches"][-1])
    for second, branch in zip(np.geomspace(0.5, 4000.0, 9), branches[-9:], strict=True):
        branch["tau_second"] = [second] * len(truth.KNOTS)
    return model


@pytest.mark.parametrize("c_rate", [0.0, 1.0])
def test_kernel_is_its_twin_for_a_member_with_many_states(c_rate):
    """From rest the kernel leaves out the covariance of what is known for all time."""
    plant, noise, _ = prepared(many(), track_capacity=True, track_ohmic=True)
    assert plant.size > 20
    state = acquire(plant, Start(0.4, c_rate=c_rate), noise)[0]
    given = plant, noise, state
    np.testing.assert_allclose(kalman.run(*given), kalman.run_by_numpy(*given), rtol=0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("lengths", [3, 2000])
def test_kernel_is_its_twin_however_many_lengths_its_steps_have(lengths):
    """Weights are kept by the length of a step; more lengths than are kept take turns."""
    rng = np.random.default_rng(4)
    time = np.cumsum(rng.choice(rng.uniform(0.05, 20.0, lengths), 500))
    columns = time, rng.uniform(-3, 2, 500), 3.6 + 0.02 * rng.normal(size=500)
    plant = plant_of(bank_of(many(), None, 25.0), *columns, NOISE, hold="first_order")
    given = plant, NOISE, acquire(plant, Start(0.4), NOISE)[0]
    np.testing.assert_allclose(kalman.run(*given), kalman.run_by_numpy(*given), rtol=0, atol=1e-12)


def test_a_correction_does_not_move_the_slope_at_once():
    """One voltage cannot tell SoC from model error; a slope that jumps with the SoC would."""
    plant, noise, state = prepared(stated())
    slopes = []
    for moved in (0.0, 0.01):
        there = kalman.predict(
            state._replace(mean=state.mean + np.eye(plant.size)[0] * moved), plant, 1, noise
        )
        slopes.append(kalman.output(there, plant, 1, noise)[1][0])
    assert slopes[1] == pytest.approx(slopes[0], rel=1e-3)


def test_on_a_straight_ocv_it_is_the_textbooks_kalman_filter():
    """Batch least squares over all samples gives the same SoC and variance as the recursion."""
    model = stated()
    model["ocv"][0]["ocv_volt"] = (3.0 + np.array(model["ocv"][0]["soc"])).tolist()
    noise = Noise(error_second=0.0, error_soc=0.0, adaptive=False, resistance_error=0.0)
    noise = noise._replace(soc_walk=(0.0, 0.0), skew_second=0.0, fast_second=0.0)
    noise = noise._replace(least_error_volt=0.0)
    plant, _, state = prepared(model, noise)
    state = kalman.State(
        np.array([0.5, 0, 0]), np.diag([0.04, 0, 0]), 0.0, 0.0, np.empty((0, 3)), 0.5, 0.0, 0.04
    )
    estimated = kalman.run(plant, noise, state)
    n, variance = len(estimated) - 1, noise.sensor_volt**2 + (2 * 0.01) ** 2
    assert estimated[-1, 1] == pytest.approx(1.0 / (1.0 / 0.04 + n / variance), rel=1e-9)


def test_covariance_stays_symmetric_and_positive():
    plant, noise, state = prepared(stated(), track_capacity=True, track_ohmic=True)
    for k in range(1, 150):
        state, _, variance = kalman.update(kalman.predict(state, plant, k, noise), plant, k, noise)
        assert variance > 0
        eigenvalues = np.linalg.eigvalsh((state.covariance + state.covariance.T) / 2)
        assert eigenvalues[0] > -1e-15 * eigenvalues[-1]
        np.testing.assert_allclose(state.covariance, state.covariance.T, atol=1e-18)


def test_predict_and_update_leave_the_state_they_are_given_alone():
    plant, noise, state = prepared(stated())
    before = state.mean.copy(), state.covariance.copy()
    kalman.update(kalman.predict(state, plant, 1, noise), plant, 1, noise)
    np.testing.assert_array_equal(state.mean, before[0])
    np.testing.assert_array_equal(state.covariance, before[1])


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"time": [0.0, 2.0, 1.0]}, "the clock runs back after row 1"),
        ({"voltage": [3.0, np.nan, 3.0]}, "not finite"),
        ({"current": [0.0, 1.0]}, "all must be"),
        ({"time": [], "current": [], "voltage": []}, "no sample"),
    ],
)
def test_refusals(change, reason):
    given = {"time": [0.0, 1.0, 2.0], "current": [0.0] * 3, "voltage": [3.0] * 3} | change
    with pytest.raises(Refusal, match=reason):
        plant_of(bank_of(stated(), None, 25.0), *given.values(), NOISE, hold="first_order")


def test_too_many_states_are_refused():
    model = with_branch("diffusion")
    branches = model["members"][0]["conditions"][0]["branches"]
    branches += [branches[-1]] * 5
    with pytest.raises(Refusal, match="at most 32"):
        prepared(model)
