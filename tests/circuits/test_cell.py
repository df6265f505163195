"""Fast simulation: its twin, the simulation of every kind, and a general solver agree."""

import numpy as np
import pytest
import truth
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from cellwright.circuits import cell as fast
from cellwright.circuits.cell import Tables, simulate_counted
from cellwright.circuits.model_file import simulate_model
from cellwright.numerics.lags import HOLDS
from cellwright.refusal import Refusal

GRID = np.linspace(0.0, 1.0, 101)
R0 = 0.03 + 0.01 * np.cos(3 * GRID)
OCV = 3.2 + 0.8 * GRID + 0.1 * np.sin(6 * GRID)
R = np.array([0.02 - 0.005 * GRID, 0.015 + 0.01 * GRID**2, 0.01 + 0 * GRID, 0.002 + 0 * GRID])
TAU = np.array([8.0, 150.0, 1.5, 3000.0])
CURRENT = np.repeat(np.random.default_rng(2).uniform(-4, 2.5, 80), 20)
COUNTED = {"initial_soc": 0.8, "capacity_ampere_hour": 2.0}


def tables(pairs=2, *, moves=False):
    tau = TAU[:pairs, None] * (1 + 0.5 * GRID) if moves else TAU[:pairs]
    return Tables(OCV, R0, R[:pairs], tau)


def steps(kind):
    rng = np.random.default_rng(3)
    return {
        "uniform": 0.5,
        "true": rng.exponential(0.5, len(CURRENT) - 1),
        "long": rng.exponential(60.0, len(CURRENT) - 1),
        "edges": np.where(rng.random(len(CURRENT) - 1) < 0.1, 0.0, 0.5),
    }[kind]


@pytest.fixture
def twin(monkeypatch):
    def run(simulation, *inputs, **settings):
        with monkeypatch.context() as patch:
            patch.setattr(fast, "function", lambda *_types, **_result: None)
            return simulation(*inputs, **settings)

    return run


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("moves", [False, True])
@pytest.mark.parametrize("pairs", [0, 1, 2, 4])
@pytest.mark.parametrize("kind", ["uniform", "true", "long", "edges"])
def test_compiled_and_numpy_agree(twin, hold, moves, pairs, kind):
    inputs = tables(pairs, moves=moves), steps(kind), CURRENT
    run = simulate_counted(*inputs, hold=hold, **COUNTED)
    slow = twin(simulate_counted, *inputs, hold=hold, **COUNTED)
    np.testing.assert_allclose(run, slow, rtol=0, atol=1e-12)


@pytest.mark.parametrize("length", [1, 2, 511, 512, 513, 1024, 1025])
def test_the_blocks_of_the_kernel_leave_no_seam(twin, length):
    for step in (0.5, np.linspace(0.1, 1.0, length - 1)):
        inputs = tables(), step, CURRENT[:length]
        run = simulate_counted(*inputs, hold="first_order", **COUNTED)
        slow = twin(simulate_counted, *inputs, hold="first_order", **COUNTED)
        np.testing.assert_allclose(run, slow, rtol=0, atol=1e-12)


@pytest.mark.parametrize("hold", HOLDS)
def test_a_model_file_gives_the_same_voltage_either_way(hold):
    time, current = truth.drive(np.random.default_rng(4), 3000)
    size = {"initial_soc": 0.95, "capacity_ampere_hour": truth.CAPACITY_AMPERE_HOUR}
    parameters = [np.interp(GRID, truth.KNOTS, course) for course in (truth.R0, *truth.R)]
    cell_tables = Tables(truth.OCV_VOLT, parameters[0], np.array(parameters[1:]), truth.TAU)
    run, soc = simulate_counted(cell_tables, 1.0, current, hold=hold, **size)
    whole = simulate_model(truth.model(), "2RC", time, current, soc, 25.0, hold=hold)
    np.testing.assert_allclose(run, whole.voltage_volt, rtol=0, atol=1e-12)


def test_ten_pairs_run_compiled_as_by_their_lags(twin):
    """As many as a distribution of relaxation times has."""
    rng = np.random.default_rng(6)
    r, tau = rng.uniform(0, 0.01, (10, len(GRID))), np.geomspace(0.2, 5000, 10)
    for taus in (tau, tau[:, None] + 0 * GRID):
        inputs = Tables(OCV, R0, r, taus), steps("true"), CURRENT
        run = simulate_counted(*inputs, hold="first_order", **COUNTED)
        slow = twin(simulate_counted, *inputs, hold="first_order", **COUNTED)
        np.testing.assert_allclose(run, slow, rtol=0, atol=1e-12)


def solved(time, current):
    """The same cell by a general solver, its tolerance far below what is asked of us."""

    def slope(t, state):
        ampere = np.interp(t, time, current)
        r = [np.interp(state[0], GRID, one) for one in R[:2]]
        return [ampere / 7200.0, *((np.array(r) * ampere - state[1:]) / TAU[:2])]

    solution = solve_ivp(slope, time[[0, -1]], [0.8, 0, 0], "LSODA", time, rtol=1e-10, atol=1e-12)
    soc = solution.y[0]
    own = np.interp(soc, GRID, OCV) + np.interp(soc, GRID, R0) * current
    return own + solution.y[1:].sum(axis=0), soc


def test_a_general_solver_gives_the_same_voltage():
    time = np.arange(0.0, 1200.0)
    current = -2.0 + 1.5 * np.sin(0.05 * time) - np.sin(0.31 * time)
    run = simulate_counted(tables(), 1.0, current, hold="first_order", **COUNTED)
    voltage, soc = solved(time, current)
    np.testing.assert_allclose(run[0], voltage, rtol=0, atol=1e-5)
    np.testing.assert_allclose(run[1], soc, rtol=0, atol=1e-8)


@settings(deadline=None, max_examples=30)
@given(st.floats(0.0, 1.0), st.floats(-5, 5), st.sampled_from(HOLDS))
def test_constant_parameters_and_current_are_the_closed_form(soc, ampere, hold):
    flat = Tables(OCV, R0 * 0 + 0.02, R[:2] * 0 + 0.03, TAU[:2])
    time = np.cumsum(np.append(0, np.random.default_rng(1).exponential(5.0, 300)))
    endless = {"initial_soc": soc, "capacity_ampere_hour": 1e15}
    run, _ = simulate_counted(flat, np.diff(time), np.full(301, ampere), hold=hold, **endless)
    rise = 0.03 * sum(-np.expm1(-time / tau) for tau in TAU[:2])
    expected = np.interp(soc, GRID, OCV) + ampere * (0.02 + rise)
    np.testing.assert_allclose(run, expected, rtol=0, atol=1e-12)


def test_outside_the_table_the_ocv_goes_on_and_resistances_stay():
    def at_once(soc, ampere=0.0):
        size = {"initial_soc": soc, "capacity_ampere_hour": 2.0}
        return simulate_counted(tables(), 1.0, [ampere], hold="zero_order", **size)[0][0]

    slope = 100 * np.diff(OCV)[[0, -1]]
    expected = OCV[[0, 0, -1, -1]] + [-0.2 * slope[0], 0, 0, 0.3 * slope[1]]
    assert [at_once(soc) for soc in (-0.2, 0.0, 1.0, 1.3)] == pytest.approx(expected, abs=1e-12)
    assert at_once(1.3, 2.0) - at_once(1.3) == pytest.approx(2.0 * R0[-1], abs=1e-12)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"hold": "second_order"}, "hold of the current is 'second_order'"),
        ({"step": np.ones(5)}, "5 steps for 3 currents"),
        ({"step": [1.0, -1.0]}, "step is below zero"),
        ({"step": [1.0, np.nan]}, "step is below zero or not finite"),
        ({"current": [0.0, np.nan, 0.0]}, "current is not finite"),
        ({"current": []}, "0 currents"),
        ({"tables": tables()._replace(r0_ohm=R0[1:])}, "tables of 101 points"),
        ({"tables": tables()._replace(tau_second=np.array([1.0, 0.0]))}, "time constant is zero"),
        ({"capacity_ampere_hour": 0.0}, "capacity is 0.0 Ah"),
        ({"initial_soc": np.nan}, "SoC at the first sample is nan"),
    ],
)
def test_refusals(change, reason):
    settings = COUNTED | {
        "hold": "zero_order",
        "tables": tables(),
        "step": 1.0,
        "current": [0.0] * 3,
    }
    settings |= change
    inputs = [settings.pop(name) for name in ("tables", "step", "current")]
    with pytest.raises(Refusal, match=reason):
        simulate_counted(*inputs, **settings)


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("place", [0, 1, 510, 511, 512, -2, -1])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_current_that_is_not_finite_is_seen_wherever_it_stands(hold, place, value):
    current = CURRENT.copy()
    current[place] = value
    for step in (0.5, steps("edges")):
        with pytest.raises(Refusal, match="current is not finite"):
            simulate_counted(tables(), step, current, hold=hold, **COUNTED)
