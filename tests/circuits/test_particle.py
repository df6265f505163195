"""A particle with charge transfer: limits that are known, exact derivatives, its file."""

import numpy as np
import pytest
from one_particle import CAPACITY, GRID, OCV, a_particle, a_record
from scipy.integrate import solve_ivp

from cellwright.circuits import particle
from cellwright.circuits.particle import layout, of_document, run, to_document
from cellwright.numerics.statistics import rms
from cellwright.refusal import Refusal


def volt_of(cell, record, soc=None, **settings):
    """Simulation of a record; soc: at its start, where nothing counts the charge."""
    if soc is not None:
        record[2][0] = soc
    return run(cell, *record, capacity_ampere_hour=CAPACITY, **settings)


def test_kernel_and_its_twin_say_the_same(monkeypatch):
    cell = a_particle()
    by_kernel = volt_of(cell, a_record(), derivatives=True)
    monkeypatch.setattr(particle, "function", lambda *names, **types: None)
    by_twin = volt_of(cell, a_record(), derivatives=True)
    np.testing.assert_allclose(by_twin.voltage_volt, by_kernel.voltage_volt, rtol=0, atol=1e-12)
    largest = np.abs(by_kernel.by).max(axis=0)
    assert (np.abs(by_twin.by - by_kernel.by) <= 1e-10 * largest + 1e-16).all()


@pytest.mark.parametrize("name", layout(2))
def test_derivatives_are_those_of_differences(name):
    cell, record = a_particle(), a_record()
    by = volt_of(cell, record, derivatives=True).by
    place = layout(2)[name]
    for k in range(place.start, place.stop):
        step = 1e-5 * max(1.0, abs(cell.vector[k]))
        sides = []
        for sign in (1, -1):
            vector = cell.vector.copy()
            vector[k] += sign * step
            sides.append(volt_of(cell._replace(vector=vector), record).voltage_volt)
        difference = (sides[0] - sides[1]) / (2 * step)
        # An OCV table has kinks: a row of a hundred may lie on one.
        off = np.abs(difference - by[:, k]) / max(np.abs(difference).max(), 1e-9)
        assert np.quantile(off, 0.98) < 1e-3


def test_at_rest_it_shows_the_ocv_of_its_counted_charge():
    """All that flows in ends up in the sphere: after a long rest the surface is the mean."""
    time = np.append(np.arange(0.0, 1800.0, 1.0), np.geomspace(1801.0, 4e5, 200))
    current = np.where(time < 1800.0, -1.5, 0.0)
    # The last loaded row and the first at rest lie a second apart, with a straight line between.
    passed = np.append(0.0, np.cumsum((current[1:] + current[:-1]) / 2 * np.diff(time)))
    soc = 0.8 + passed / 3600.0 / CAPACITY
    found = volt_of(a_particle(), (time, current, soc, 25.0))
    assert found.surface_soc[-1] == pytest.approx(soc[-1], abs=1e-7)
    assert found.voltage_volt[-1] == pytest.approx(np.interp(soc[-1], GRID, OCV), abs=1e-6)


def test_after_a_charge_it_rests_higher_than_after_a_discharge():
    """By both half gaps of the hysteresis at that SoC, once the loads were long enough."""
    half_gap = np.array([0.02, 0.02, 0.01, 0.01, 0.01])
    voltages = []
    for sign, start in ((-1.0, 0.7), (1.0, 0.3)):
        time = np.append(np.arange(0.0, 2161.0, 10.0), np.geomspace(2200.0, 4e5, 200))
        current = np.where(time < 2160.5, sign * 1.0, 0.0)
        soc = start + sign * np.minimum(time, 2160.0) / 3600.0 / CAPACITY
        cell = a_particle(hysteresis_volt=half_gap)
        voltages.append(volt_of(cell, (time, current, soc, 25.0)).voltage_volt[-1])
    discharged, charged = voltages
    ocv = np.interp([0.5, 0.5], GRID, OCV)
    assert charged - discharged == pytest.approx(0.02, abs=3e-4)
    assert (charged + discharged) / 2 == pytest.approx(ocv[0], abs=3e-4)


def test_settled_charge_transfer_follows_butler_volmer():
    time, current = np.arange(0.0, 600.0, 1.0), np.full(600, -3.0)
    cell = a_particle(double_layer_farad=np.log(1e-3))
    over = volt_of(cell, (time, current, np.full(600, 0.5), 25.0)).overpotential_volt[0]
    scale = 2.0 * 8.314462618 * 298.15 / 96485.33212
    assert over[-1] == pytest.approx(-scale * np.arcsinh(0.02 * 3.0 / scale), rel=1e-9)


def test_a_weak_load_polarises_as_an_rc_pair_whatever_the_rows():
    """Small currents make the kinetics linear: R0 + R·(1 − exp(−t/RC)), at rows far apart too."""
    current, ohm, farad = -1e-4, 0.02, 15.0
    for step in (0.01, 0.1, 1.0):
        time = np.append(0.0, np.arange(1, 60) * step)
        record = time, np.full(60, current), np.full(60, 0.5), 25.0
        over = volt_of(a_particle(), record).overpotential_volt[0]
        # In the first row nothing has flowed yet, and its current holds from there on.
        expected = current * ohm * (1.0 - np.exp(-time / (ohm * farad)))
        np.testing.assert_allclose(over, expected, rtol=2e-5, atol=1e-14)


def test_charge_transfer_solves_its_equation():
    """Against a general solver, on loads that turn from charge to discharge, in the cold."""
    edges = np.arange(0.0, 300.0, 5.0)
    time = np.sort(np.concatenate([edges, edges + 1e-6, edges + 1.0]))
    current = np.repeat(np.random.default_rng(3).normal(-1.0, 3.0, 61), 3)[2:-1]
    found = volt_of(a_particle(), (time, current, np.full(180, np.nan), -10.0), soc=0.5)
    warmth = 1.0 / 263.15 - 1.0 / 298.15
    bent = 5e3 * warmth**2 / (1.0 / 248.15 - 1.0 / 298.15)
    ohm = 0.02 * np.exp((50e3 * warmth + bent) / 8.314462618)
    farad = 15.0 * np.exp(2e3 * warmth / 8.314462618)
    scale = 2.0 * 8.314462618 * 263.15 / 96485.33212

    def rise(at, u):
        return (np.interp(at, time, current) - scale / ohm * np.sinh(u / scale)) / farad

    settings = {"t_eval": time, "max_step": 0.1, "rtol": 1e-9, "atol": 1e-12}
    wanted = solve_ivp(rise, (0.0, time[-1]), [0.0], method="LSODA", **settings).y[0]
    assert np.abs(wanted).max() > 2.0 * scale
    np.testing.assert_allclose(found.overpotential_volt[0], wanted, rtol=0, atol=2e-6)


def test_rows_of_a_second_are_short_enough():
    """Against the same straight lines between rows in 64 steps each, as the surface runs empty."""
    rows, finer = 900, 64
    time = np.arange(0.0, rows)
    changes = np.random.default_rng(4).normal(0.0, 1.0, rows // 9)
    current = np.interp(time, time[::9], np.clip(np.cumsum(changes), -3.0, 5.0) - 3.0)
    fine = np.linspace(0.0, rows - 1.0, finer * (rows - 1) + 1)
    cell = a_particle(diffusion_per_second=-7.0, transfer_ohm=np.linspace(-2.0, -5.0, 10))
    volt, wanted = (
        volt_of(cell, (at, np.interp(at, time, current), np.full(len(at), np.nan), 0.0), soc=0.55)
        for at in (time, fine)
    )
    off = volt.voltage_volt - wanted.voltage_volt[::finer]
    assert (volt.surface_soc < 0.1).sum() > 50
    assert rms(off) < 1e-4


def test_cold_resistance_follows_arrhenius():
    over = [
        volt_of(
            a_particle(r0_bend_joule_per_mole=0.0),
            (np.arange(3.0), np.full(3, -1.0), np.full(3, 0.5), celsius),
        ).overpotential_volt[1, -1]
        for celsius in (25.0, 0.0)
    ]
    warmth = 1.0 / 273.15 - 1.0 / 298.15
    assert over[1] / over[0] == pytest.approx(np.exp(12e3 / 8.314462618 * warmth), rel=1e-12)


def test_a_particle_survives_its_file():
    cell = a_particle()
    again = of_document(to_document(cell, np.full(len(cell.vector), 0.1)))
    np.testing.assert_allclose(again.vector, cell.vector, rtol=1e-14)
    np.testing.assert_array_equal(again.ocv_volt, cell.ocv_volt)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("r0_ohm", [0.02, -0.01, 0.02, 0.02], "r0_ohm of the particle.*4 positive numbers"),
        ("transfer_scale", None, "transfer_scale of the particle is None; wanted 1 positive"),
        ("missing", [0.0], "missing of the particle.*wanted 2 numbers"),
        ("ocv_shift_volt", [np.nan] * 16, "ocv_shift_volt of the particle.*16 numbers"),
    ],
)
def test_a_file_that_no_cell_has_is_refused(name, value, message):
    document = to_document(a_particle()) | {name: value}
    with pytest.raises(Refusal, match=message):
        of_document(document)


def test_an_unknown_temperature_is_refused():
    time, current, soc, celsius = a_record()
    celsius[7] = np.nan
    with pytest.raises(Refusal, match="1 temperatures are not known"):
        volt_of(a_particle(), (time, current, soc, celsius))
