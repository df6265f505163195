"""Parallel groups: Kirchhoff, symmetries, stability; identification from branch currents."""

import gzip

import numpy as np
import pytest
import truth
from hypothesis import given, settings
from hypothesis import strategies as st

from cellwright.bias.scaled import scaled_reference
from cellwright.packs import parallel
from cellwright.packs.identify import identify_branches, rest_offset
from cellwright.packs.parallel import Group, group_of, simulate_parallel
from cellwright.refusal import Refusal

CELLS = (
    truth.model("A"),
    scaled_reference(truth.model(), cell="B", capacity=1.6, resistance_ratio=1.7),
    scaled_reference(truth.model(), cell="C", capacity=2.3, resistance_ratio=0.8),
)
TIME = np.cumsum(np.random.default_rng(1).exponential(5.0, 300))
LOAD = np.repeat(np.random.default_rng(2).uniform(-6, 4, 15), 20)


def group(*cells):
    return group_of(cells, temperature_celsius=25.0)


@settings(deadline=None, max_examples=20)
@given(st.lists(st.floats(0.1, 0.9), min_size=3, max_size=3), st.floats(0, 0.05))
def test_branch_currents_sum_to_the_total(soc, wire):
    run = simulate_parallel(TIME, LOAD, group(*CELLS), initial_soc=soc, wire_resistance_ohm=wire)
    np.testing.assert_allclose(run.branch_current_ampere.sum(axis=1), LOAD, rtol=0, atol=1e-9)


def test_the_order_of_the_cells_does_not_matter():
    order, soc, wire = [2, 0, 1], np.array([0.4, 0.5, 0.6]), np.array([0.0, 0.01, 0.02])
    run = simulate_parallel(TIME, LOAD, group(*CELLS), initial_soc=soc, wire_resistance_ohm=wire)
    turned = simulate_parallel(
        TIME,
        LOAD,
        group(*(CELLS[k] for k in order)),
        initial_soc=soc[order],
        wire_resistance_ohm=wire[order],
    )
    np.testing.assert_allclose(
        turned.branch_current_ampere, run.branch_current_ampere[:, order], atol=1e-9
    )


def test_two_identical_cells_are_one_of_double_capacity_and_half_resistance():
    one = simulate_parallel(TIME, LOAD / 2, group(CELLS[0]), initial_soc=0.6)
    two = simulate_parallel(TIME, LOAD, group(CELLS[0], CELLS[0]), initial_soc=0.6)
    np.testing.assert_allclose(two.voltage_volt, one.voltage_volt, atol=1e-9)
    np.testing.assert_allclose(two.branch_current_ampere[:, 1], LOAD / 2, atol=1e-9)


def test_one_cell_alone_is_the_single_cell_simulation():
    time = np.arange(0.0, 4000.0, 0.5)
    current = np.where(time % 400 < 200, -1.0, 0.3)
    run = simulate_parallel(time, current, group(CELLS[0]), initial_soc=0.9)
    alone = truth.voltage(time, current, run.soc[:, 0], hold="zero_order")
    assert np.abs(run.voltage_volt - alone)[current == -1].mean() < 1e-3


def test_unequal_cells_equalise_at_rest():
    time = np.linspace(0, 3e5, 4000)
    run = simulate_parallel(time, 0 * time, group(*CELLS), initial_soc=[0.3, 0.5, 0.7])
    assert run.branch_current_ampere[0, 0] > 0.1 > -0.1 > run.branch_current_ampere[0, 2]
    np.testing.assert_allclose(run.branch_current_ampere[-1], 0, atol=1e-4)
    capacity = group(*CELLS).capacity_ampere_hour
    stored = run.soc[-1] @ capacity - [0.3, 0.5, 0.7] @ capacity
    assert stored == pytest.approx(0, abs=1e-9)
    assert np.ptp(run.soc[-1]) < 1e-3


def test_a_stiff_group_with_long_steps_stays_calm():
    """Milliohm cells, a steep OCV and steps of ten minutes, where an explicit form explodes."""
    grid = np.linspace(0, 1, 201)
    stiff = Group(
        ocv_volt=np.array([3.0 + 1.2 * grid] * 2),
        r0_ohm=np.full((2, 201), 1e-3),
        r_ohm=np.zeros((2, 1, 201)),
        tau_second=np.ones((2, 1, 201)),
        capacity_ampere_hour=np.array([2.0, 3.0]),
    )
    time = np.arange(0.0, 20000.0, 600.0)
    run = simulate_parallel(time, 0 * time, stiff, initial_soc=[0.4, 0.6])
    assert np.all(np.diff(np.abs(run.branch_current_ampere[:, 0])) <= 1e-9)
    np.testing.assert_allclose(run.soc[-1], 0.52, atol=1e-6)


@pytest.mark.parametrize("pairs", [1, 2, 3])
@pytest.mark.parametrize("cells", [1, 4, 7])
def test_compiled_and_numpy_agree(monkeypatch, cells, pairs):
    """Also over the ends of the tables, where time constants move and where a step repeats."""
    rng, grid = np.random.default_rng(cells), np.linspace(0, 1, 51)
    many = Group(
        ocv_volt=3.2 + 0.8 * grid + 0.1 * np.sin(8 * grid) + 0.01 * rng.normal(size=(cells, 1)),
        r0_ohm=0.02 + 0.01 * rng.random((cells, 51)),
        r_ohm=0.01 + 0.01 * rng.random((cells, pairs, 51)),
        tau_second=rng.uniform(5, 500, (cells, pairs, 1)) * (1 + grid * (cells > 1)),
        capacity_ampere_hour=rng.uniform(1.5, 2.5, cells),
    )
    time = np.cumsum(np.repeat([1.0, 4.0, 0.5, 60.0], 150))
    load = cells * np.repeat(rng.uniform(-5, 2, 30), 20)
    setting = {"initial_soc": rng.uniform(0.1, 0.9, cells), "wire_resistance_ohm": 1e-3}
    run = simulate_parallel(time, load, many, **setting)
    monkeypatch.setattr(parallel, "function", lambda *_types: None)
    for one, other in zip(run, simulate_parallel(time, load, many, **setting), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)
    assert run.soc.min() < 0


def test_the_currents_of_a_thousand_cells_sum_to_the_total():
    cells = group(*CELLS)
    thousand = Group(*(np.repeat(table, 334, axis=0) for table in cells))
    run = simulate_parallel(TIME[:60], 1000 * LOAD[:60], thousand, initial_soc=0.5)
    total = run.branch_current_ampere.sum(axis=1)
    np.testing.assert_allclose(total, 1000 * LOAD[:60], rtol=0, atol=1e-9)


def test_refusals():
    with pytest.raises(Refusal, match="time runs back"):
        simulate_parallel(TIME[::-1], LOAD, group(*CELLS), initial_soc=0.5)
    bare = group(*CELLS)._replace(r0_ohm=np.zeros((3, 201)))
    with pytest.raises(Refusal, match="neither a resistance"):
        simulate_parallel(TIME, LOAD, bare, initial_soc=0.5)
    with pytest.raises(Refusal, match="without models"):
        group_of([])
    currents = np.ones((300, 2)) * 0.1
    with pytest.raises(Refusal, match="at least two cells"):
        identify_branches(TIME, currents[:, :1], TIME)
    with pytest.raises(Refusal, match="branch 2 is not charged"):
        identify_branches(TIME, currents * [1, -1], TIME)
    with pytest.raises(Refusal, match="not finite"):
        identify_branches(TIME, currents, TIME * np.nan)
    with pytest.raises(Refusal, match="no rest"):
        rest_offset(currents, currents.sum(axis=1), rest_ampere=0.01)


def test_cells_are_found_again_from_their_branch_currents():
    grid = np.linspace(0, 1, 201)
    true = Group(
        ocv_volt=np.array([3.2 + 0.9 * grid + 0.2 * np.tanh(8 * grid)] * 2),
        r0_ohm=np.array([0.30 - 0.1 * grid, 0.15 + 0.0 * grid]),
        r_ohm=np.array([[0.10 + 0 * grid], [0.05 + 0 * grid]]),
        tau_second=np.full((2, 1, 201), 300.0),
        capacity_ampere_hour=np.array([1.7, 1.9]),
    )
    up = np.arange(0.0, 30000.0, 10.0)
    total = np.where(up < 50, 0.0, np.where(up < 24000, 0.5, 0.5 * np.exp((24000 - up) / 1500)))
    run = simulate_parallel(up, total, true, initial_soc=0.0)
    noise = np.random.default_rng(3).normal(0, 1e-3, len(up))
    branches = run.branch_current_ampere + np.outer(noise, [1.0, -1.0])
    identified = identify_branches(up, branches, run.voltage_volt)
    assert identified.fit_rmse_volt < 2e-3
    time = np.arange(0.0, 12000.0, 10.0)
    load = np.where(time % 4000 < 3000, -0.8, 0.2)
    start = run.soc[-1]
    truly = simulate_parallel(time, load, true, initial_soc=start)
    again = simulate_parallel(time, load, identified.group, initial_soc=1.0)
    error = again.branch_current_ampere - truly.branch_current_ampere
    assert np.sqrt(np.mean(error**2)) < 0.02
    assert np.sqrt(np.mean((again.voltage_volt - truly.voltage_volt) ** 2)) < 0.02


def test_measured_pair(shared):
    """Weng's pair: fitted on the charge, scored on the discharge. Published: 18 mA, 32 mV."""
    with gzip.open(shared / "campaigns/weng/raw/parallel_C10.csv.gz") as file:
        time, total, volt, *branch = np.loadtxt(file, delimiter=",", skiprows=1).T
    branch = np.column_stack(branch)
    rest, fit = (time > 2000) & (time < 2990), (time > 2950) & (time < 33370)
    branch -= rest_offset(branch[rest], total[rest], rest_ampere=0.01)
    identified = identify_branches(time[fit], branch[fit], volt[fit])
    np.testing.assert_allclose(identified.group.capacity_ampere_hour, [1.83, 1.93], rtol=0.06)
    rows = slice(fit.argmax(), None, 2)
    run = simulate_parallel(time[rows], total[rows], identified.group, initial_soc=0.0)
    score = ((time > 33370) & (time < 59770))[rows]
    current_error = (run.branch_current_ampere - branch[rows])[score]
    assert np.sqrt(np.mean(current_error**2)) < 0.018
    assert np.sqrt(np.mean((run.voltage_volt - volt[rows])[score] ** 2)) < 0.032
