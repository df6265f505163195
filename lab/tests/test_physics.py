"""Porous-electrode cells by PyBaMM; needs the laboratory's own environment."""

import numpy as np
import pytest

pytest.importorskip("pybamm", reason="the virtual laboratory's environment is not installed")

from virtual_lab import chamber, electrodes, physics, protocols
from virtual_lab.chamber import Chamber, steady
from virtual_lab.physics import DEMO_CELLS, porous, simulate
from virtual_lab.protocols import Step


def test_ageing_takes_capacity_as_stated():
    fresh, aged, odd = (porous.stoichiometry(DEMO_CELLS[name])["Q"] for name in ("C1", "C2", "C3"))
    assert aged / fresh == pytest.approx(0.85, abs=0.01)
    assert odd / fresh == pytest.approx(0.93, abs=0.01)


@pytest.mark.parametrize("name", DEMO_CELLS)
def test_open_circuit_voltage_falls_from_cutoff_to_cutoff(name):
    cell = DEMO_CELLS[name]
    volt = porous.open_circuit_volt(cell, np.linspace(0, porous.stoichiometry(cell)["Q"], 500))
    assert volt[[0, -1]] == pytest.approx([4.2, 2.5], abs=1e-4)
    assert (np.diff(volt) < 0).all()


def test_soc_is_the_inverse_of_voltage():
    cell = DEMO_CELLS["C1"]
    soc = porous.soc_at(cell, 3.7)
    assert porous.rested_volt(cell, np.array([soc])) == pytest.approx(3.7, abs=1e-4)


def test_a_cccv_charge_nearly_fills_the_window():
    for cell in DEMO_CELLS.values():
        assert 0.97 < porous.window_soc(cell, 1.0) < 1.0


def test_a_rested_cell_shows_its_open_circuit_voltage():
    (rest,) = simulate.run(
        [protocols.rest(60.0)], DEMO_CELLS["C2"], ambient_celsius=25, initial_soc=0.5
    )
    expected = porous.rested_volt(DEMO_CELLS["C2"], np.array([0.5]))[0]
    assert rest.voltage(np.array([30.0])) == pytest.approx(expected, abs=2e-4)


def test_equal_cells_in_parallel_share_equally_and_behave_as_one():
    steps = [protocols.rest(10.0), protocols.Step("current", -10.0, 120.0, 5.0)]
    cell, second = DEMO_CELLS["C1"], np.array([1.0, 60.0, 119.0])
    together = simulate.run_pair(
        steps, (cell, cell), wire_ohm=(0.0, 0.0), initial_soc=(0.5, 0.5), ambient_celsius=25
    )[1]
    steps[1] = steps[1]._replace(value=-5.0)
    alone = simulate.run(steps, cell, ambient_celsius=25, initial_soc=0.5)[1]
    np.testing.assert_allclose(together.branches[0](second), -5.0, atol=1e-4)
    np.testing.assert_allclose(together.voltage(second), alone.voltage(second), atol=2e-4)


def test_the_branch_with_more_wire_takes_less():
    steps = [protocols.Step("current", -10.0, 30.0, 5.0)]
    cell = DEMO_CELLS["C1"]
    (step,) = simulate.run_pair(
        steps, (cell, cell), wire_ohm=(0.0, 0.01), initial_soc=(0.5, 0.5), ambient_celsius=25
    )
    low, high = (abs(branch(np.array([1.0]))[0]) for branch in step.branches[::-1])
    assert low < 0.95 * high
    assert low + high == pytest.approx(10.0, abs=1e-9)


def test_an_array_of_one_instant_gives_an_array_of_one():
    (found,) = simulate.run(
        [Step("current", -5.0, 60.0, 1.0)], DEMO_CELLS["C1"], chamber=steady(25.0), initial_soc=0.5
    )
    for quantity in (found.current, found.voltage, found.temperature, found.charge, found.soc):
        assert np.shape(quantity(np.array([30.0]))) == (1,)


HOUR = 3600.0
MILLIVOLT = 1e-3


def cell_of(chemistry, capacity_ampere_hour=5.0, *, entropy=0.0, lli=0.0):
    rating = electrodes.usual_rating(chemistry, capacity_ampere_hour)
    return physics.Cell(
        lli, 0.0, 0.0, 0.001, 1.0, capacity_ampere_hour, None, "", chemistry, rating, entropy
    )


def rest(second):
    return Step("current", 0.0, second, 30.0)


@pytest.mark.parametrize("chemistry", electrodes.CHEMISTRIES)
def test_both_generators_know_one_voltage_at_rest(chemistry):
    """The rested cell of PyBaMM shows the electrodes' voltage; LFP half its hysteresis below."""
    cell = cell_of(chemistry, lli=0.1)
    window = electrodes.window(chemistry, cell.rating, lli=0.1)
    gap = 0.010 if chemistry == "LFP" else 0.0
    for soc in (0.15, 0.85):
        (shown,) = simulate.run([rest(60.0)], cell, chamber=chamber.steady(25), initial_soc=soc)
        expected = electrodes.open_circuit_volt(chemistry, window, porous.window_soc(cell, soc))
        assert float(shown.voltage(30.0)) == pytest.approx(expected - gap, abs=MILLIVOLT)


@pytest.mark.parametrize("chemistry", electrodes.CHEMISTRIES)
def test_data_sheet_is_met_and_the_cold_takes_capacity(chemistry):
    cell = cell_of(chemistry)
    down = Step("current", -2.5, 3 * HOUR, 10.0, until_volt=cell.rating.lower_cutoff_volt)
    taken = []
    for celsius in (25, -10):
        (step,) = simulate.run([down], cell, chamber=chamber.steady(celsius))
        taken.append(-float(step.charge(step.duration_second)))
    assert taken[0] == pytest.approx(5.0, rel=0.03)
    assert 0.5 * taken[0] < taken[1] < 0.99 * taken[0]


def test_charge_and_soc_are_those_of_the_current():
    cell = cell_of("LFP")
    steps = [rest(60.0), Step("current", -5.0, 600.0, 1.0), Step("current", 2.5, 300.0, 1.0)]
    _, down, up = simulate.run(steps, cell, chamber=chamber.steady(25), initial_soc=0.6)
    full = porous.full_charge_ampere_hour(cell)
    assert float(down.charge(600.0)) == pytest.approx(-5.0 / 6, rel=1e-6)
    assert float(up.charge(300.0)) == pytest.approx(2.5 / 12, rel=1e-6)
    assert float(up.soc(300.0)) == pytest.approx(0.6 + (2.5 / 12 - 5 / 6) / full, rel=1e-6)


def test_lfp_rests_on_the_branch_it_came_by():
    cell = cell_of("LFP")
    tenth = 0.1 * porous.full_charge_ampere_hour(cell)
    lasting = tenth / 2.5 * HOUR
    there = [Step("current", -2.5, lasting, 10.0), rest(4 * HOUR)]
    back = [Step("current", 2.5, lasting, 10.0), rest(4 * HOUR)]
    found = simulate.run([*there, *there, *back], cell, chamber=chamber.steady(25), initial_soc=0.7)
    after_discharge, after_charge = (float(found[k].voltage(4 * HOUR)) for k in (1, 5))
    # Dreyer's 20 mV, less what a tenth of the capacity leaves of a turn: exp(−decay·Δy/2).
    window = electrodes.window("LFP", cell.rating)
    left = np.exp(-physics.LFP_DECAY * tenth / window.positive_ampere_hour / 2)
    assert after_charge - after_discharge == pytest.approx(0.020 * (1 - left), abs=0.0005)


def test_a_stepped_chamber_moves_the_rested_cell_by_its_entropy():
    cell = cell_of("LMO", 32.0, entropy=1.0)
    second = np.array([0.0, HOUR, 1.25 * HOUR, 4 * HOUR, 4.25 * HOUR])
    around = Chamber(second, np.array([20.0, 20.0, 5.0, 5.0, -15.0]))
    (step,) = simulate.run([rest(8 * HOUR)], cell, chamber=around, initial_soc=0.3)
    seen = np.array([0.9, 3.9, 7.9]) * HOUR
    assert step.temperature(seen) == pytest.approx([20.0, 5.0, -15.0], abs=0.1)
    window = electrodes.window("LMO", cell.rating)
    entropy = electrodes.entropic_volt_per_kelvin("LMO", window, porous.window_soc(cell, 0.3))
    shift = np.diff(step.voltage(seen))
    assert shift == pytest.approx(entropy * np.array([-15.0, -20.0]), abs=0.2 * MILLIVOLT)
    assert 0.015 < shift.sum() < 0.035


def test_a_line_of_equal_temperatures_is_a_steady_chamber():
    cell, steps = physics.DEMO_CELLS["C1"], [rest(60.0), Step("current", -5.0, 300.0, 5.0)]
    level = Chamber(np.array([0.0, 100.0, 1000.0]), np.full(3, 10.0))
    old = simulate.run(steps, cell, ambient_celsius=10, initial_soc=0.5)[1]
    new = simulate.run(steps, cell, chamber=level, initial_soc=0.5)[1]
    second = np.array([0.1, 1.0, 100.0, 299.0])
    np.testing.assert_allclose(new.voltage(second), old.voltage(second), atol=2e-5)


@pytest.mark.parametrize("chemistry", electrodes.CHEMISTRIES)
def test_impedance_starts_at_the_ohmic_part_and_grows_in_the_cold(chemistry):
    cell, frequency = cell_of(chemistry), np.array([1e6, 1.0, 0.01])
    warm, cold = (
        simulate.spectrum(cell, frequency, ambient_celsius=celsius, soc=0.5) for celsius in (25, 0)
    )
    assert warm[0].real > cell.contact_resistance_ohm
    for spectrum in (warm, cold):
        assert (np.diff(spectrum.real) > 0).all()
        assert (spectrum[1:].imag < 0).all()
    assert (cold.real > warm.real).all()
    larger = cell_of(chemistry, 50.0)._replace(contact_resistance_ohm=0.0001)
    tenth = simulate.spectrum(larger, frequency, ambient_celsius=25, soc=0.5)
    np.testing.assert_allclose(10 * tenth, warm, rtol=0.01)


def test_lmo_has_the_charge_transfer_of_the_thesis():
    """Table 3.1, 50 %, 20 °C: 0.65 mΩ for 32 Ah; the arc lies between 10 kHz and 1 Hz."""
    spectrum = simulate.spectrum(
        cell_of("LMO", 32.0), np.array([1e6, 1.0]), ambient_celsius=20, soc=0.5
    )
    assert np.diff(spectrum.real)[0] == pytest.approx(0.648e-3, rel=0.05)
