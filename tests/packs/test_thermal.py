"""Temperatures of a pack's cells: a cell alone, neighbours, heat that is neither made nor lost."""

import numpy as np
import pytest
import truth
from scipy.integrate import solve_ivp
from wirings import parallel, series

from cellwright.packs import kernel, simulate
from cellwright.packs.cells import pack_cells
from cellwright.packs.network import network_of
from cellwright.packs.phases import Phase, run_phases
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.steps import ocv_volt, start
from cellwright.packs.thermal import Thermal, heat_of, thermal_modes, warmed
from cellwright.refusal import Refusal

TIME = np.arange(0.0, 1800.0, 2.0)
LOAD = np.where(TIME % 600 < 400, -4.0, 1.0)
ENERGY = 30000.0


def warm_model(name="A", celsius=(15.0, 25.0, 45.0)):
    """The true cell at several temperatures, its resistances by an Arrhenius law."""
    document = truth.model(name)
    (condition,), conditions = document["members"][0]["conditions"], []
    for value in celsius:
        factor = np.exp(ENERGY / 8.314462618 * (1 / (value + 273.15) - 1 / 298.15))
        branches = [
            branch | {"r_ohm": (factor * np.array(branch["r_ohm"])).tolist()}
            for branch in condition["branches"]
        ]
        r0 = (factor * np.array(condition["r0_ohm"])).tolist()
        at = {"ambient_temperature_celsius": value, "r0_ohm": r0, "branches": branches}
        conditions.append(condition | at)
    member = document["members"][0] | {"conditions": conditions}
    return document | {"members": [member]}


CELLS = pack_cells(
    [warm_model("A"), warm_model("B"), warm_model("C")],
    temperature_celsius=[15.0, 25.0, 35.0, 45.0],
)
CONSTANTS = {"heat_capacity_joule_per_kelvin": 45.0, "resistance_kelvin_per_watt": 8.0}
STRING = series(*"ABC")


def run_of(wiring=STRING, load=LOAD, rows=slice(None), **around):
    """The three cells under a load, from 90 % at 20 °C where nothing else is said."""
    setting = {"initial_soc": 0.9, "ambient_celsius": 20.0} | around
    return simulate_pack(TIME[rows], load[rows], CELLS, wiring, **setting)


@pytest.mark.parametrize("entropic", [0.0, 2e-4])
@pytest.mark.parametrize("hold", ["first_order", "zero_order"])
def test_a_cell_alone_keeps_the_balance_of_its_heat(hold, entropic):
    """By an independent solver: what its overpotential and entropy make, stored or given away."""
    cells = pack_cells([warm_model()], temperature_celsius=np.arange(15.0, 46.0, 5.0))
    thermal = Thermal(**CONSTANTS, entropic_volt_per_kelvin=entropic)
    setting = {"initial_soc": 0.9, "ambient_celsius": 20.0, "thermal": thermal, "hold": hold}
    run = simulate_pack(TIME, LOAD, cells, series("A"), **setting)
    # The OCV moves with the temperature by the coefficient, around 25 degC.
    celsius = run.temperature_celsius[:, 0]
    over = run.voltage_volt - truth.ocv_at(run.soc[:, 0]) - entropic * (celsius - 25.0)
    heat = LOAD * (over + entropic * (celsius + 273.15))

    def rate(t, warm):
        made = heat[min(np.searchsorted(TIME, t, side="right"), len(TIME) - 1)]
        lost = (warm - 20.0) / CONSTANTS["resistance_kelvin_per_watt"]
        return (made - lost) / CONSTANTS["heat_capacity_joule_per_kelvin"]

    true = solve_ivp(rate, (0, TIME[-1]), [20.0], t_eval=TIME, max_step=2.0).y[0]
    assert np.ptp(true) > 2.0
    assert np.abs(celsius - true).max() < 0.1


def test_temperatures_of_neighbours_are_those_of_an_independent_solver():
    rng = np.random.default_rng(7)
    conductance = rng.uniform(0.0, 0.5, (4, 4))
    conductance = conductance + conductance.T
    capacity, resistance = rng.uniform(30, 60, 4), rng.uniform(5, 20, 4)
    modes = thermal_modes(Thermal(capacity, resistance, conductance), 4)
    celsius, heat = rng.uniform(20, 40, 4), rng.uniform(0, 3, 4)

    def rates(_, t):
        exchanged = [conductance[k] @ (t - t[k]) for k in range(4)]
        return (heat - (t - 22.0) / resistance + exchanged) / capacity

    true = solve_ivp(rates, (0, 500), celsius, rtol=1e-10, atol=1e-10).y[:, -1]
    np.testing.assert_allclose(warmed(modes, celsius, heat, 22.0, 500.0), true, atol=1e-6)
    halfway = warmed(modes, celsius, heat, 22.0, 180.0)
    np.testing.assert_allclose(warmed(modes, halfway, heat, 22.0, 320.0), true, atol=1e-6)


def test_heat_between_cells_without_a_way_out_is_neither_made_nor_lost():
    thermal = Thermal(np.array([40.0, 50.0, 60.0]), np.inf, 0.3)
    modes, celsius = thermal_modes(thermal, 3), np.array([20.0, 30.0, 45.0])
    heat = np.array([1.0, 0.0, 2.0])
    after = warmed(modes, celsius, heat, 25.0, 300.0)
    assert modes.capacity @ (after - celsius) == pytest.approx(900.0)
    late = warmed(modes, celsius, 0.0 * heat, 25.0, 1e7)
    np.testing.assert_allclose(late, modes.capacity @ celsius / modes.capacity.sum())


def test_the_cell_in_the_middle_of_a_row_gets_warmest_and_carries_more():
    thermal = Thermal(**CONSTANTS, between_watt_per_kelvin=0.2)
    run = run_of(parallel(*"ABC"), 3 * LOAD, thermal=thermal)
    np.testing.assert_allclose(run.temperature_celsius[:, 0], run.temperature_celsius[:, 2])
    apart = Thermal(45.0, np.array([8.0, 100.0, 8.0]), 0.01)
    run = run_of(parallel(*"ABC"), 3 * LOAD, thermal=apart)
    assert run.temperature_celsius[-1, 1] > run.temperature_celsius[-1, 0] + 1.0
    first_discharge = slice(150, 200)
    assert (run.cell_current_ampere[first_discharge, 1] < -4.0).all()


def test_an_ambient_that_changes_moves_the_parameters():
    ambient = np.linspace(15.0, 45.0, len(TIME))
    warmer, cold = run_of(ambient_celsius=ambient), run_of(ambient_celsius=15.0)
    assert warmer.voltage_volt[0] == pytest.approx(cold.voltage_volt[0], abs=2e-3)
    discharge = LOAD < 0
    assert (warmer.voltage_volt[discharge][50:] > cold.voltage_volt[discharge][50:]).all()
    np.testing.assert_allclose(warmer.temperature_celsius[:, 1], ambient)


def test_an_ambient_is_followed_as_step_by_step_and_its_flicker_is_not(monkeypatch):
    ambient = 20.0 + 4.0 * np.sin(np.linspace(0.0, 6.0, len(TIME)))
    flicker = 0.1 * (np.arange(len(TIME)) % 2)

    def run(celsius):
        return run_of(ambient_celsius=celsius).voltage_volt

    np.testing.assert_allclose(run(20.0 + flicker), run(20.05), rtol=0, atol=1e-12)
    followed = run(ambient), run(np.round(ambient, 1) + flicker)
    most = simulate.FLICKER_KELVIN * np.abs(run(17.0) - run(16.0)).max()
    monkeypatch.setattr(simulate, "FLICKER_KELVIN", 0.0)
    exact = run(ambient)
    for volt in followed:
        assert np.abs(volt - exact).max() < most


def test_phases_warm_the_cells_too():
    thermal = Thermal(**CONSTANTS, between_watt_per_kelvin=0.2)
    setting = {"initial_soc": 0.9, "ambient_celsius": 20.0, "thermal": thermal}
    done = run_phases([Phase("drive", (TIME, LOAD))], CELLS, series(*"ABC"), **setting)
    straight = run_of(thermal=thermal)
    np.testing.assert_allclose(done.temperature_celsius, straight.temperature_celsius, atol=1e-9)


def test_compiled_and_numpy_agree_where_cells_warm(monkeypatch):
    thermal = Thermal(**CONSTANTS, between_watt_per_kelvin=0.2, initial_celsius=[18.0, 25.0, 60.0])
    arguments = parallel(*"ABC"), 3 * LOAD, slice(0, 150)
    run = run_of(*arguments, thermal=thermal)
    monkeypatch.setattr(kernel, "function", lambda *_types, **_result: None)
    for one, other in zip(run, run_of(*arguments, thermal=thermal), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)


def test_a_member_that_warms_by_itself_gives_way_to_the_best_of_the_others():
    document = truth.model()
    (plain,) = document["members"]
    heat = {"thermal_resistance_kelvin_per_watt": 5.0, "time_constant_second": 600.0}
    heat |= {"activation_energy_joule_per_mole": 3e4}
    warming = plain | {"model": "2RC+effects", "own_heat": heat}
    worse = plain | {"model": "1RC", "left_out_rmse_volt": 0.02}
    members = [warming, worse, plain | {"left_out_rmse_volt": 0.01}]
    document |= {"members": members, "chosen": "2RC+effects"}
    assert pack_cells([document], temperature_celsius=25.0).members == ("2RC",)
    with pytest.raises(Refusal, match="warms by a law of its own"):
        pack_cells([document], temperature_celsius=25.0, member="2RC+effects")


def test_refusals():
    def run(thermal, **changes):
        return run_of(rows=slice(0, 3), thermal=thermal, **changes)

    with pytest.raises(Refusal, match="no ambient temperature"):
        run(None, ambient_celsius=None)
    with pytest.raises(Refusal, match=r"heat capacity is 0 J/K"):
        run(Thermal(0.0, 8.0))
    with pytest.raises(Refusal, match=r"thermal resistance has shape \(2,\)"):
        run(Thermal(45.0, [8.0, 8.0]))
    with pytest.raises(Refusal, match="row of cells, or 3 × 3"):
        run(Thermal(45.0, 8.0, np.ones((2, 2))))
    with pytest.raises(Refusal, match="below zero"):
        run(Thermal(45.0, 8.0, -0.1))
    with pytest.raises(Refusal, match="not symmetric"):
        run(Thermal(45.0, 8.0, np.triu(np.ones((3, 3)))))
    with pytest.raises(Refusal, match="have to rise"):
        pack_cells([warm_model()], temperature_celsius=[25.0, 15.0])


def test_an_entropic_coefficient_over_soc_acts_at_the_soc_of_each_cell():
    soc = [0.9, 0.5, 0.2]
    row = [2e-4, -1e-4, 1e-4]
    flat = np.repeat(np.array(row)[:, None], 5, axis=1)
    run, same = (
        run_of(initial_soc=soc, thermal=Thermal(**CONSTANTS, entropic_volt_per_kelvin=value))
        for value in (row, flat)
    )
    np.testing.assert_allclose(same.temperature_celsius, run.temperature_celsius, atol=1e-12)
    table = np.array([[0.0, 0.0, 4e-4]] * 3)
    modes = thermal_modes(Thermal(**CONSTANTS, entropic_volt_per_kelvin=table), 3)
    state = start(
        CELLS, network_of(series(*"ABC"), CELLS.capacity_ampere_hour), [1.0, 0.75, 0.4], 25
    )
    state = state._replace(current_ampere=np.ones(3))
    watt = heat_of(CELLS, modes, state, ocv_volt(CELLS, state.soc, state.temperature_celsius))
    np.testing.assert_allclose(watt, 298.15 * np.array([4e-4, 2e-4, 0.0]), atol=1e-9)


@pytest.mark.parametrize("value", [[1e-4, 1e-4], [[1e-4]], np.nan])
def test_entropic_coefficients_of_another_shape_are_refused(value):
    with pytest.raises(Refusal, match="entropic coefficient"):
        thermal_modes(Thermal(**CONSTANTS, entropic_volt_per_kelvin=value), 3)
