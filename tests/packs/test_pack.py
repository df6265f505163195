"""Cells of a parallel group identified from branch currents."""

import gzip

import numpy as np
import pytest

from cellwright.packs.cells import rc_cells
from cellwright.packs.identify import identify_branches, rest_offset
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.wiring import star_of
from cellwright.refusal import Refusal

TIME = np.cumsum(np.random.default_rng(1).exponential(5.0, 300))


def test_refusals():
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
    true = rc_cells(
        ocv_volt=np.array([3.2 + 0.9 * grid + 0.2 * np.tanh(8 * grid)] * 2),
        r0_ohm=np.array([0.30 - 0.1 * grid, 0.15 + 0.0 * grid]),
        r_ohm=np.array([[0.10 + 0 * grid], [0.05 + 0 * grid]]),
        tau_second=np.full((2, 1, 201), 300.0),
        capacity_ampere_hour=np.array([1.7, 1.9]),
    )
    up = np.arange(0.0, 30000.0, 10.0)
    total = np.where(up < 50, 0.0, np.where(up < 24000, 0.5, 0.5 * np.exp((24000 - up) / 1500)))
    star = star_of(true.names)
    run = simulate_pack(up, total, true, star, initial_soc=0.0)
    noise = np.random.default_rng(3).normal(0, 1e-3, len(up))
    branches = run.cell_current_ampere + np.outer(noise, [1.0, -1.0])
    identified = identify_branches(up, branches, run.voltage_volt)
    assert identified.fit_rmse_volt < 2e-3
    time = np.arange(0.0, 12000.0, 10.0)
    load = np.where(time % 4000 < 3000, -0.8, 0.2)
    start = run.soc[-1]
    truly = simulate_pack(time, load, true, star, initial_soc=start)
    again = simulate_pack(time, load, identified.cells, star, initial_soc=1.0)
    error = again.cell_current_ampere - truly.cell_current_ampere
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
    cells = identified.cells
    np.testing.assert_allclose(cells.capacity_ampere_hour, [1.83, 1.93], rtol=0.06)
    rows = slice(fit.argmax(), None, 2)
    run = simulate_pack(time[rows], total[rows], cells, star_of(cells.names), initial_soc=0.0)
    score = ((time > 33370) & (time < 59770))[rows]
    current_error = (run.cell_current_ampere - branch[rows])[score]
    assert np.sqrt(np.mean(current_error**2)) < 0.018
    assert np.sqrt(np.mean((run.voltage_volt - volt[rows])[score] ** 2)) < 0.032
