"""The march of PyBaMM's models by implicit steps, beside PyBaMM's own adaptive solver."""

import numpy as np
import pytest

pytest.importorskip("pybamm", reason="the virtual laboratory's environment is not installed")

from virtual_lab import physics
from virtual_lab.chamber import steady
from virtual_lab.physics import DEMO_CELLS, march, porous, simulate
from virtual_lab.protocols import Step, charge, hold, rest

CELL = DEMO_CELLS["C1"]
SECOND = np.arange(0.0, 61.0)
LOAD = np.column_stack([SECOND, np.round(-6.0 + 5.0 * np.sin(SECOND), 3)])


def test_the_march_is_within_a_millivolt_of_the_adaptive_solver():
    steps = [
        rest(10.0),
        Step("profile", LOAD, 60.0, 1.0, until_volt=2.5),
        Step("current", -5.0, 60.0, 1.0, until_volt=2.5),
        rest(120.0),
    ]
    around = {"chamber": steady(10.0), "initial_soc": 0.6}
    marched, solved = march.run(steps, CELL, **around), simulate.run(steps, CELL, **around)
    for one, other, step in zip(marched, solved, steps, strict=True):
        second = np.arange(1.0, step.duration_second)
        # At whole seconds, and where an instrument's jittering clock may take a sample.
        for late, most in ((0.0, 2e-4), (0.08, 1.5e-3), (-0.08, 1.5e-3)):
            off = one.voltage(second + late) - other.voltage(second + late)
            assert np.sqrt(np.mean(off**2)) < most
        np.testing.assert_allclose(one.temperature(second), other.temperature(second), atol=0.01)
    end = [behaviours[-1].soc(120.0) for behaviours in (marched, solved)]
    assert end[0] == pytest.approx(end[1], abs=1e-5)


def test_more_finite_volumes_change_the_voltage_by_less_than_a_millivolt():
    steps = [Step("profile", LOAD, 60.0, 1.0), Step("current", -5.0, 300.0, 10.0)]
    around = {"chamber": steady(25.0), "initial_soc": 0.6}
    coarse = march.run(steps, CELL._replace(volumes=(15, 25)), **around)
    fine = march.run(steps, CELL._replace(volumes=(30, 60)), **around)
    for one, other, end in zip(coarse, fine, (60.0, 300.0), strict=True):
        second = np.linspace(1.0, end, 100)
        np.testing.assert_allclose(one.voltage(second), other.voltage(second), atol=1e-3)


def test_a_charge_ends_at_the_cutoff_and_is_held_until_the_current_is_small():
    steps = [charge(CELL.rating, 0.5), hold(CELL.rating, until_c_rate=0.2)]
    up, held = march.run(steps, CELL, chamber=steady(25.0), initial_soc=0.93)
    assert float(up.voltage(up.duration_second)) == pytest.approx(4.2, abs=1e-4)
    assert held.voltage(np.linspace(1.0, held.duration_second, 9)) == pytest.approx(4.2, abs=1e-4)
    assert float(held.current(held.duration_second)) == pytest.approx(1.0, abs=1e-3)


def test_a_resistance_in_series_adds_its_voltage():
    steps = [Step("current", -5.0, 20.0, 1.0)]
    around = {"chamber": steady(25.0), "initial_soc": 0.6}
    series = (np.array([0.0, 9.0, 11.0]), np.array([0.0, 0.0, 0.01]))
    plain, more = (march.run(steps, CELL, series=one, **around)[0] for one in ((), series))
    second = np.array([5.0, 19.0])
    added = more.voltage(second) - plain.voltage(second)
    np.testing.assert_allclose(added, [0.0, -0.05], atol=1e-5)


def _after(inside, *, celsius=25.0, steps=None):
    cell = CELL._replace(inside=inside)
    steps = steps or [Step("current", -10.0, 300.0, 10.0)]
    return march.run(steps, cell, chamber=steady(celsius), initial_soc=0.6)[-1]


def test_a_core_is_hotter_than_the_can():
    plain, two = (_after(physics.Inside(core_kelvin_per_watt=k)) for k in (0.0, 5.0))
    end = np.array([300.0])
    rise = [float(one.temperature(end)[0]) - 25.0 for one in (plain, two)]
    assert rise[0] > 3.0
    assert 0.2 * rise[0] < rise[1] < 0.8 * rise[0]


@pytest.mark.parametrize(
    ("changes", "celsius", "second"),
    [
        ({"diffusivity_negative": 0.3}, 25.0, 300.0),
        ({"diffusivity_positive": 0.5}, 25.0, 300.0),
        # Later its own heat makes the cell the faster again.
        ({"kinetics_joule_per_mole": 25e3}, 10.0, 10.0),
    ],
)
def test_slower_physics_lowers_the_voltage_under_load(changes, celsius, second):
    plain = _after(physics.Inside(), celsius=celsius).voltage(second)
    slow = _after(physics.Inside(**changes), celsius=celsius).voltage(second)
    assert slow < plain - 2e-3


def test_a_steeper_activation_changes_nothing_at_25_degrees():
    instant = [Step("current", -5.0, 0.5, 0.1)]
    plain, steep = (
        _after(physics.Inside(kinetics_joule_per_mole=k), steps=instant) for k in (0.0, 25e3)
    )
    assert steep.voltage(0.4) == pytest.approx(float(plain.voltage(0.4)), abs=2e-5)


def test_hysteresis_parts_the_open_circuit_voltage_after_charge_and_discharge():
    cell = CELL._replace(inside=physics.Inside(hysteresis_volt=0.015))
    middle = float(porous.rested_volt(cell, np.array([0.6]))[0])
    discharged = march.run([rest(10.0)], cell, chamber=steady(25.0), initial_soc=0.6)[0]
    assert float(discharged.voltage(5.0)) == pytest.approx(middle - 0.015, abs=1e-3)
