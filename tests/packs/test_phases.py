"""A pack through phases: where each ends, by which cell, and what is held at a limit."""

import numpy as np
import pytest
from wirings import UNEQUAL, parallel, series

from cellwright.packs.cells import pack_cells
from cellwright.packs.phases import Phase, run_phases
from cellwright.packs.simulate import simulate_pack
from cellwright.refusal import Refusal

CELLS = pack_cells(UNEQUAL, temperature_celsius=25.0)
STRING, GROUP = series(*"ABC"), parallel(*"ABC")


def run(*phases, wiring=STRING, soc=0.9, **settings):
    return run_phases(phases, CELLS, wiring, initial_soc=soc, **settings)


def test_the_first_cell_at_its_limit_ends_a_discharge():
    done = run(Phase("rest", second=60.0), Phase("current", -2.0, lowest_cell_volt=3.2))
    rest, end = done.ends
    assert (rest["reason"], rest["second"], rest["cell"]) == ("time", 60.0, None)
    assert (end["reason"], end["cell"]) == ("cell voltage", "B")
    assert done.cell_voltage_volt[-1].min() == pytest.approx(3.2, abs=2e-6)
    assert done.test_time_second[-1] == end["second"]
    assert end["second"] % 1.0 != 0.0
    counted = 0.9 - 2.0 * (end["second"] - 60.0) / 3600 / CELLS.capacity_ampere_hour
    np.testing.assert_allclose(done.soc[-1], counted, atol=1e-9)
    assert (np.diff(done.test_time_second) >= 0).all()


def test_a_charge_holds_the_first_cell_at_its_limit_until_the_current_is_small():
    charge = Phase("current", 2.0, highest_cell_volt=4.0, held=True, least_ampere=0.05)
    done = run(charge, soc=0.5)
    (end,) = done.ends
    assert (end["reason"], end["held_cell"]) == ("current", "B")
    held = done.test_time_second >= end["held_from_second"]
    highest = done.cell_voltage_volt.max(axis=1)
    np.testing.assert_allclose(highest[held], 4.0, atol=1e-6)
    assert done.current_ampere[~held].min() == pytest.approx(2.0)
    assert (np.diff(done.current_ampere[held]) < 0).all()
    assert done.current_ampere[-1] == pytest.approx(0.05, abs=2e-6)


@pytest.mark.parametrize("wiring", [STRING, GROUP])
def test_constant_voltage_of_the_pack_is_met_and_ends_by_current_or_by_a_cell(wiring):
    volt = 11.8 if wiring is STRING else 3.93
    done = run(Phase("voltage", volt, least_ampere=0.3, second=20000.0), wiring=wiring, soc=0.7)
    np.testing.assert_allclose(done.voltage_volt, volt, atol=1e-7)
    assert done.ends[0]["reason"] == "current"
    assert abs(done.current_ampere[-1]) == pytest.approx(0.3, abs=2e-6)


def test_a_cell_at_its_limit_ends_a_constant_voltage():
    phase = Phase("voltage", 12.2, highest_cell_volt=[5.0, 4.06, 5.0], second=9000.0)
    (end,) = run(phase, soc=0.6).ends
    assert (end["reason"], end["cell"]) == ("cell voltage", "B")


def test_constant_power_is_met_and_ends_where_the_pack_cannot_give_it():
    done = run(Phase("power", -20.0, second=600.0))
    np.testing.assert_allclose(done.voltage_volt * done.current_ampere, -20.0, rtol=1e-7)
    assert done.ends[0]["reason"] == "time"
    for lost in (
        run(Phase("rest", second=1.0), Phase("power", -5000.0, second=60.0)),
        run(Phase("power", -5000.0, second=60.0)),
    ):
        assert lost.ends[-1]["reason"] == "power"
        assert lost.current_ampere[-1] == 0.0
    falling = run(Phase("power", -200.0, second=3000.0), soc=0.6)
    assert falling.ends[0]["reason"] == "power"
    assert falling.ends[0]["second"] > 1.0


def test_a_drive_is_what_simulate_pack_gives():
    time = np.arange(0.0, 300.0, 2.0)
    load = np.random.default_rng(5).uniform(-4, 2, len(time))
    done = run(Phase("drive", (time, load)), wiring=GROUP)
    straight = simulate_pack(time, load, CELLS, GROUP, initial_soc=0.9)
    np.testing.assert_allclose(done.test_time_second, time)
    np.testing.assert_allclose(done.voltage_volt, straight.voltage_volt, rtol=0, atol=1e-9)
    np.testing.assert_allclose(done.soc, straight.soc, rtol=0, atol=1e-12)


def test_current_circulates_in_a_group_after_its_cut_off():
    done = run(
        Phase("current", -6.0, lowest_volt=3.2),
        Phase("rest", second=900.0),
        wiring=GROUP,
        soc=[0.9, 0.8, 0.9],
    )
    resting = done.phase == 1
    assert done.ends[0]["reason"] == "pack voltage"
    assert np.abs(done.cell_current_ampere[resting].sum(axis=1)).max() < 1e-9
    flowing = np.abs(done.cell_current_ampere[resting])
    assert flowing[0].max() > 0.05
    assert flowing[-1].max() < 0.5 * flowing[0].max()


def test_a_soc_ends_a_phase():
    done = run(Phase("current", -1.0, lowest_soc=0.5, step_second=30.0))
    assert (done.ends[0]["reason"], done.ends[0]["cell"]) == ("soc", "B")
    assert done.soc[-1].min() == pytest.approx(0.5, abs=1e-6)


def test_a_limit_passed_at_once_ends_a_phase_where_it_begins():
    done = run(Phase("current", -2.0, lowest_cell_volt=3.99))
    assert (done.ends[0]["reason"], done.ends[0]["second"]) == ("cell voltage", 0.0)


def test_refusals():
    with pytest.raises(Refusal, match="no phase"):
        run()
    with pytest.raises(Refusal, match="of kind 'charge'"):
        run(Phase("charge", 1.0))
    with pytest.raises(Refusal, match="phase 1 of kind current has no end"):
        run(Phase("current", 1.0))
    with pytest.raises(Refusal, match="has no end"):
        run(Phase("current", 1.0, highest_volt=12.0, held=True))
    with pytest.raises(Refusal, match="drive of phase 1 has no two samples"):
        run(Phase("drive", ([0.0], [1.0])))
    with pytest.raises(Refusal, match="runs back"):
        run(Phase("drive", ([0.0, 2.0, 1.0], [1.0, 1.0, 1.0])))
    with pytest.raises(Refusal, match="steps of 0"):
        run(Phase("rest", second=10.0, step_second=0.0))
