"""The physics behind the campaign; needs the laboratory's own environment."""

import numpy as np
import pytest

pytest.importorskip("pybamm", reason="the virtual laboratory's environment is not installed")

from virtual_lab import parallel, physics, protocols, simulate
from virtual_lab.cells import CELLS
from virtual_lab.chamber import steady
from virtual_lab.protocols import Step


def test_ageing_takes_capacity_as_stated():
    fresh, aged, odd = (physics.stoichiometry(CELLS[name])["Q"] for name in ("C1", "C2", "C3"))
    assert aged / fresh == pytest.approx(0.85, abs=0.01)
    assert odd / fresh == pytest.approx(0.93, abs=0.01)


@pytest.mark.parametrize("name", CELLS)
def test_open_circuit_voltage_falls_from_cutoff_to_cutoff(name):
    cell = CELLS[name]
    volt = physics.open_circuit_volt(cell, np.linspace(0, physics.stoichiometry(cell)["Q"], 500))
    assert volt[[0, -1]] == pytest.approx([4.2, 2.5], abs=1e-4)
    assert (np.diff(volt) < 0).all()


def test_soc_is_the_inverse_of_voltage():
    cell = CELLS["C1"]
    soc = physics.soc_at(cell, 3.7)
    assert physics.rested_volt(cell, np.array([soc])) == pytest.approx(3.7, abs=1e-4)


def test_a_cccv_charge_nearly_fills_the_window():
    for cell in CELLS.values():
        assert 0.97 < physics.window_soc(cell, 1.0) < 1.0


def test_a_rested_cell_shows_its_open_circuit_voltage():
    (rest,) = simulate.run([protocols.rest(60.0)], CELLS["C2"], ambient_celsius=25, initial_soc=0.5)
    expected = physics.rested_volt(CELLS["C2"], np.array([0.5]))[0]
    assert rest.voltage(np.array([30.0])) == pytest.approx(expected, abs=2e-4)


def test_equal_cells_in_parallel_share_equally_and_behave_as_one():
    steps = [protocols.rest(10.0), protocols.Step("current", -10.0, 120.0, 5.0)]
    cell, second = CELLS["C1"], np.array([1.0, 60.0, 119.0])
    together = parallel.run(
        steps, (cell, cell), wire_ohm=(0.0, 0.0), initial_soc=(0.5, 0.5), ambient_celsius=25
    )[1]
    steps[1] = steps[1]._replace(value=-5.0)
    alone = simulate.run(steps, cell, ambient_celsius=25, initial_soc=0.5)[1]
    np.testing.assert_allclose(together.branches[0](second), -5.0, atol=1e-4)
    np.testing.assert_allclose(together.voltage(second), alone.voltage(second), atol=2e-4)


def test_the_branch_with_more_wire_takes_less():
    steps = [protocols.Step("current", -10.0, 30.0, 5.0)]
    cell = CELLS["C1"]
    (step,) = parallel.run(
        steps, (cell, cell), wire_ohm=(0.0, 0.01), initial_soc=(0.5, 0.5), ambient_celsius=25
    )
    low, high = (abs(branch(np.array([1.0]))[0]) for branch in step.branches[::-1])
    assert low < 0.95 * high
    assert low + high == pytest.approx(10.0, abs=1e-9)


def test_an_array_of_one_instant_gives_an_array_of_one():
    (found,) = simulate.run(
        [Step("current", -5.0, 60.0, 1.0)], CELLS["C1"], chamber=steady(25.0), initial_soc=0.5
    )
    for quantity in (found.current, found.voltage, found.temperature, found.charge, found.soc):
        assert np.shape(quantity(np.array([30.0]))) == (1,)
