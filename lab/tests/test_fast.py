"""The fast generator: one cell against solutions on paper, conservation and its own refinement."""

import numpy as np
import pytest

from virtual_lab import fast
from virtual_lab.behaviour import Rating
from virtual_lab.chamber import Chamber, steady
from virtual_lab.fast.parameters import diffusion_chain
from virtual_lab.protocols import Step

RATING = Rating(5.0, 2.5, 4.2)
LOW, RISE = 3.2, 0.9
SOC = np.linspace(0, 1, 101)
R0, R, TAU = 0.02, (0.01, 0.015), (5.0, 120.0)
STRAIGHT = fast.Cell(RATING, LOW + RISE * SOC, 5.0, R0, R, TAU)
PLAIN = STRAIGHT._replace(pair_r_ohm=(), pair_tau_second=())
FLAT = PLAIN._replace(ocv_volt=np.full(11, 3.6))
CURVED = 3.3 + 0.7 * SOC - 0.3 * np.exp(-20 * SOC) + 0.05 * np.tanh(10 * (SOC - 0.5))
THERMAL = {
    "heat_capacity_joule_per_kelvin": 70.0,
    "core_resistance_kelvin_per_watt": 2.0,
    "surface_resistance_kelvin_per_watt": 5.0,
}
ROOM = steady(25.0)


def current(ampere, second, **ends):
    return Step("current", ampere, second, 1.0, **ends)


def pairs(ampere, second):
    """Voltage of the two pairs under a constant current."""
    return sum(ampere * r * (1 - np.exp(-second / tau)) for r, tau in zip(R, TAU, strict=True))


def one(steps, cell, chamber=ROOM, **settings):
    """Behaviour of a protocol's last step."""
    return fast.run(steps, cell, chamber=chamber, **settings)[-1]


def profile(second, ampere):
    return Step("profile", np.column_stack([second, ampere]), second[-1], 1.0)


def drive(second=600):
    """A rough load, one point a second."""
    random = np.random.default_rng(1)
    ampere = np.convolve(random.normal(-1.0, 8.0, second + 5), np.ones(5) / 5, "valid")
    return profile(np.arange(second + 1.0), ampere)


def test_constant_current_and_rest_are_those_on_paper():
    ampere, second = -5.0, 900.0
    load, rest = fast.run(
        [current(ampere, second), current(0.0, 1800.0)], STRAIGHT, chamber=ROOM, initial_soc=0.9
    )
    t = np.random.default_rng(0).uniform(0, second, 2000)
    soc = 0.9 + ampere * t / 3600 / 5
    np.testing.assert_allclose(load.soc(t), soc, atol=1e-12)
    expected = LOW + RISE * soc + R0 * ampere + pairs(ampere, t)
    np.testing.assert_allclose(load.voltage(t), expected, atol=1e-6)
    t = np.random.default_rng(0).uniform(0, 1800.0, 2000)
    left = pairs(ampere, t + second) - pairs(ampere, t)
    np.testing.assert_allclose(rest.voltage(t), LOW + RISE * load.soc(second) + left, atol=1e-6)


def test_first_instant_shows_the_ohmic_drop_alone():
    load = one([current(0.0, 10.0), current(-5.0, 10.0)], STRAIGHT, initial_soc=0.5)
    assert load.voltage(0.0) - (LOW + RISE / 2) == pytest.approx(-5.0 * R0, abs=1e-12)
    assert load.current(0.0) == -5.0


def test_straight_current_is_that_on_paper():
    slope, second = -0.05, 60.0
    load = one([profile(np.array([0, second]), np.array([0, slope * second]))], STRAIGHT)
    t = np.linspace(0, second, 777)
    expected = LOW + RISE * (1 + slope * t**2 / 2 / 18000) + R0 * slope * t
    for r, tau in zip(R, TAU, strict=True):
        expected += r * slope * (t - tau * (1 - np.exp(-t / tau)))
    np.testing.assert_allclose(load.voltage(t), expected, atol=1e-6)
    np.testing.assert_allclose(load.charge(t), slope * t**2 / 7200, atol=1e-12)


def test_charge_is_the_integral_of_the_current():
    load = one([drive()], STRAIGHT)
    t = np.arange(0.0, 600.0, 0.37)
    second, ampere = drive().value.T
    whole = np.concatenate([[0], np.cumsum((ampere[1:] + ampere[:-1]) / 7200)])
    k = t.astype(int)
    part = (t - k) * (ampere[k] + load.current(t)) / 7200
    np.testing.assert_allclose(load.charge(t), whole[k] + part, atol=1e-12)
    np.testing.assert_allclose(load.soc(second), 1 + whole / 5, atol=1e-12)


@pytest.mark.parametrize(("ampere", "limit"), [(-2.5, 3.4), (2.5, 4.0)])
def test_limit_is_found_in_time(ampere, limit):
    load = one([current(ampere, 2e4, until_volt=limit)], PLAIN, initial_soc=0.5)
    soc = (limit - R0 * ampere - LOW) / RISE
    assert load.duration_second == pytest.approx((soc - 0.5) * 18000 / ampere, abs=1e-4)
    assert load.voltage(load.duration_second) == pytest.approx(limit, abs=1e-8)


def test_step_beyond_its_limit_ends_at_once():
    load = one([current(-50.0, 100.0, until_volt=3.3)], PLAIN, initial_soc=0.5)
    assert load.duration_second == pytest.approx(0.001)


def test_held_voltage_lets_the_current_fall_as_on_paper():
    charge = current(2.5, 2e4, until_volt=4.0)
    hold = Step("hold", 4.0, 36000.0, 30.0, until_ampere=0.25)
    held = one([charge, hold], PLAIN, initial_soc=0.5)
    tau = R0 * 18000 / RISE
    assert held.duration_second == pytest.approx(tau * np.log(10), rel=1e-3)
    t = np.linspace(0, held.duration_second, 500)
    np.testing.assert_allclose(held.current(t), 2.5 * np.exp(-t / tau), atol=2e-3)
    np.testing.assert_allclose(held.voltage(t), 4.0, atol=1e-6)


def test_resistances_follow_arrhenius():
    energy = 40e3
    cold = STRAIGHT._replace(r0_activation_joule_per_mole=energy)
    volt = [one([current(-5.0, 1.0)], cold, steady(c)).voltage(0.0) for c in (25.0, -10.0)]
    factor = np.exp(energy / 8.314462618 * (1 / 263.15 - 1 / 298.15))
    assert (LOW + RISE - volt[1]) / (LOW + RISE - volt[0]) == pytest.approx(factor, rel=1e-9)


def test_pairs_slow_down_in_the_cold():
    cold = STRAIGHT._replace(
        pair_activation_joule_per_mole=(40e3, 0.0), pair_tau_activation_joule_per_mole=(20e3, 0.0)
    )
    r, tau = (np.exp(e / 8.314462618 * (1 / 273.15 - 1 / 298.15)) for e in (40e3, 20e3))
    expected = STRAIGHT._replace(
        pair_r_ohm=(R[0] * r, R[1]), pair_tau_second=(TAU[0] * tau, TAU[1])
    )
    t = np.linspace(0, 60, 100)
    found = one([current(-5.0, 60.0)], cold, steady(0.0)).voltage(t)
    np.testing.assert_allclose(found, one([current(-5.0, 60.0)], expected).voltage(t), atol=1e-9)


def test_open_circuit_and_capacity_follow_the_chamber():
    chamber = Chamber(np.array([0.0, 1000.0]), np.array([25.0, 5.0]))
    entropic = PLAIN._replace(entropic_volt_per_kelvin=2e-4, capacity_per_kelvin=0.004)
    rest = one([current(0.0, 1000.0)], entropic, chamber, initial_soc=0.5)
    np.testing.assert_allclose(rest.voltage(500.0), LOW + RISE / 2 - 2e-4 * 10, atol=1e-7)
    load = one([current(-5.0, 1800.0)], entropic, chamber, begin_second=2000.0)
    assert load.soc(1800.0) == pytest.approx(1 - 0.5 / (1 - 0.08), abs=1e-9)
    assert load.temperature(0.0) == 5.0


def test_asymmetry_and_kinetics():
    odd = FLAT._replace(charge_asymmetry=0.2, kinetic_share=0.6, exchange_current_ampere=2.0)
    for ampere, r in ((-5.0, R0), (5.0, 1.2 * R0), (-1e-3, R0)):
        x = r / R0 * ampere
        expected = 0.4 * R0 * x + 0.6 * R0 * 4.0 * np.arcsinh(x / 4.0)
        found = one([current(ampere, 1.0)], odd, initial_soc=0.5).voltage(1.0) - 3.6
        assert found == pytest.approx(expected, abs=1e-9)


def test_asymmetry_within_a_straight_current():
    """Between two points of a profile the current changes its sign: the kink stays sharp."""
    odd = FLAT._replace(charge_asymmetry=0.5)
    t = np.linspace(0, 1, 11)
    load = one([profile(np.array([0.0, 1.0]), np.array([-5.0, 5.0]))], odd, initial_soc=0.5)
    ampere = 10 * t - 5
    expected = 3.6 + R0 * ampere * np.where(ampere > 0, 1.5, 1.0)
    np.testing.assert_allclose(load.voltage(t), expected, atol=1e-9)


def test_hysteresis_is_that_on_paper():
    lags = FLAT._replace(
        hysteresis_volt=0.02, hysteresis_per_soc=30.0, hysteresis_instant_volt=0.004
    )
    down, still, up = fast.run(
        [current(-5.0, 360.0), current(0.0, 100.0), current(0.5, 3600.0)], lags, chamber=ROOM
    )
    h = -1 + 2 * np.exp(-30 * 0.1)
    assert down.voltage(360.0) == pytest.approx(3.6 - 5 * R0 + 0.02 * h - 0.004, abs=1e-7)
    assert still.voltage(50.0) == pytest.approx(3.6 + 0.02 * h - 0.004, abs=1e-9)
    h = 1 + (h - 1) * np.exp(-30 * 0.1)
    assert up.voltage(3600.0) == pytest.approx(3.6 + 0.5 * R0 + 0.02 * h + 0.004, abs=1e-7)


def test_a_small_current_does_not_turn_the_instant_hysteresis():
    lags = FLAT._replace(hysteresis_instant_volt=0.004)
    small = one([current(5.0, 10.0), current(-0.04, 10.0)], lags, initial_soc=0.5)
    assert small.voltage(5.0) == pytest.approx(3.604 - 0.04 * R0, abs=1e-9)


def test_instant_hysteresis_turns_within_a_millisecond():
    """In a profile too: at C/100 = 0.05 A of a current that runs from -1 A to 1 A in 100 s."""
    lags = FLAT._replace(hysteresis_instant_volt=0.004)
    ramp = profile(np.array([0.0, 100.0]), np.array([-1.0, 1.0]))
    load = one([ramp], lags, initial_soc=0.5)
    t = np.array([52.499, 52.502])
    expected = 3.6 + R0 * load.current(t) + [-0.004, 0.004]
    np.testing.assert_allclose(load.voltage(t), expected, atol=1e-9)


def test_leak_and_lost_charge():
    leaky = FLAT._replace(leak_ampere=0.01, coulombic_efficiency=0.99)
    rest, charge = fast.run(
        [current(0.0, 36000.0), current(5.01, 360.0)], leaky, chamber=ROOM, initial_soc=0.5
    )
    assert rest.soc(36000.0) == pytest.approx(0.5 - 0.1 / 5, abs=1e-12)
    assert rest.charge(36000.0) == 0.0
    assert charge.soc(360.0) == pytest.approx(0.48 + 0.99 * 0.5 / 5, abs=1e-12)
    assert charge.charge(360.0) == pytest.approx(0.501, abs=1e-12)


def test_drift_runs_with_the_clock_of_the_test():
    drifts = FLAT._replace(r0_drift_per_hour=0.1)
    load = one([current(-5.0, 3600.0)], drifts, begin_second=3600.0)
    np.testing.assert_allclose(load.voltage([0.0, 3600.0]), 3.6 - 5 * R0 * np.array([1.1, 1.2]))


def test_no_heat_out_of_nothing():
    """Behind thick walls all energy that does not come back is heat in the cell."""
    walled = STRAIGHT._replace(**THERMAL | {"surface_resistance_kelvin_per_watt": 1e9})
    steps = [current(-10.0, 300.0), drive(), current(10.0, 300.0), current(0.0, 3600.0)]
    behaviours = fast.run(steps, walled, chamber=ROOM, initial_soc=0.6)
    energy = 0.0
    for behaviour in behaviours:
        t = np.linspace(0, behaviour.duration_second, 200_001)
        watt = behaviour.current(t) * behaviour.voltage(t)
        energy += np.sum((watt[1:] + watt[:-1]) / 2) * (t[1] - t[0])
    soc = behaviours[-1].soc(3600.0)
    stored = 18000 * (LOW * (soc - 0.6) + RISE / 2 * (soc**2 - 0.36))
    heat = 70.0 * (behaviours[-1].temperature(3600.0) - 25.0)
    assert heat > 50
    assert energy - stored == pytest.approx(heat, rel=2e-3)


def test_a_rising_entropy_cools_on_discharge():
    """dU/dT > 0: the discharge takes T·dU/dT·charge up as heat, the charge gives it back."""
    adiabatic = THERMAL | {"surface_resistance_kelvin_per_watt": 1e9}
    cool = FLAT._replace(r0_ohm=1e-9, entropic_volt_per_kelvin=3e-4, **adiabatic)
    down, up = fast.run([current(-5.0, 600.0), current(5.0, 600.0)], cool, chamber=ROOM)
    expected = -5.0 * 600 * 298.15 * 3e-4 / 70
    assert down.temperature(600.0) - 25 == pytest.approx(expected, rel=0.01)
    assert up.temperature(600.0) == pytest.approx(25.0, abs=0.02)


def test_surface_warms_up_to_where_heat_leaves():
    warm = FLAT._replace(**THERMAL)
    load = one([current(-1.0, 5000.0)], warm)
    assert load.temperature(5000.0) - 25 == pytest.approx(R0 * 5.0, rel=1e-3)


def test_hidden_rise_lowers_resistances_unseen():
    hidden = FLAT._replace(
        r0_activation_joule_per_mole=30e3, rise_kelvin_per_watt=20.0, rise_tau_second=60.0
    )
    load = one([current(-5.0, 1000.0)], hidden)
    r = (3.6 - load.voltage(1000.0)) / 5
    rise = 20.0 * 25 * r
    factor = np.exp(30e3 / 8.314462618 * (1 / (298.15 + rise) - 1 / 298.15))
    assert r == pytest.approx(R0 * factor, rel=1e-6)
    assert load.temperature(1000.0) == 25.0


def everything():
    """A cell that has every effect."""
    return STRAIGHT._replace(
        ocv_volt=CURVED,
        entropic_volt_per_kelvin=2e-4 * (SOC - 0.5),
        r0_factor=1 + 0.5 * np.exp(-10 * SOC),
        pair_factor=(1 + 0.3 * SOC, 1.2 - 0.3 * SOC),
        r0_activation_joule_per_mole=20e3,
        pair_activation_joule_per_mole=(40e3, 30e3),
        pair_tau_activation_joule_per_mole=(10e3, 10e3),
        charge_asymmetry=0.1,
        kinetic_share=0.5,
        exchange_current_ampere=3.0,
        warburg_r_ohm=0.01,
        warburg_tau_second=600.0,
        hysteresis_volt=0.01,
        hysteresis_per_soc=50.0,
        leak_ampere=0.002,
        coulombic_efficiency=0.999,
        capacity_per_kelvin=0.003,
        rise_kelvin_per_watt=2.0,
        rise_tau_second=100.0,
        **THERMAL,
    )


@pytest.mark.parametrize("cell", [STRAIGHT, everything()], ids=["plain", "everything"])
def test_finer_internal_steps_change_nothing(cell):
    finer = fast.Grid(0.0005, 0.12, 10.0, 0.001, 1e-7, 1e-6, 0.01, 0.02, 0.005)
    load = drive(60)
    coarse, fine = (one([load], cell, steady(10.0), grid=g) for g in (fast.GRID, finer))
    t = np.random.default_rng(0).uniform(0, 60, 5000)
    off = coarse.voltage(t) - fine.voltage(t)
    assert np.sqrt(np.mean(off**2)) < 2e-5


def test_same_again():
    t = np.linspace(0, 30, 500)
    first, again = (one([drive(30)], everything()).voltage(t) for _ in range(2))
    assert (first == again).all()


@pytest.mark.parametrize("shape", ["planar", "spherical"])
def test_chain_is_diffusion(shape):
    share, tau = diffusion_chain(shape)
    assert share.sum() == pytest.approx(1.0, abs=1e-12)
    omega = np.geomspace(1e-2, 300, 50)
    x = np.sqrt(1j * omega)
    exact = {
        "planar": lambda: 3 * (1 / np.tanh(x) / x - 1 / x**2),
        "spherical": lambda: 5 * (np.tanh(x) / (x - np.tanh(x)) - 3 / x**2),
    }[shape]()
    found = (share / (1 + 1j * omega[:, None] * tau)).sum(1)
    np.testing.assert_allclose(np.abs(found - exact) / np.abs(exact), 0, atol=0.01)


def test_impedance_is_the_answer_to_a_sine():
    cell = everything()._replace(
        charge_asymmetry=0.0, hysteresis_volt=0.0, leak_ampere=0.0, coulombic_efficiency=1.0
    )
    frequency = 0.02
    t = np.arange(0.0, 1000.5, 0.5)
    ampere = 0.01 * np.sin(2 * np.pi * frequency * t)
    load = one([profile(t, ampere)], cell, steady(15.0), initial_soc=0.4)
    last = t[(t >= 750) & (t < 1000)]
    turn = np.exp(-2j * np.pi * frequency * last)
    found = (load.voltage(last) @ turn) / (load.current(last) @ turn)
    expected = fast.impedance(cell, np.array([frequency]), soc=0.4, celsius=15.0)[0]
    assert abs(found - expected) < 0.005 * abs(expected)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"r0_ohm": 0.0}, "must be positive"),
        ({"pair_tau_second": (5.0,)}, "time constant"),
        ({"pair_factor": (1.0,)}, "pair_factor has 1 of 2"),
        ({"warburg_r_ohm": 0.01}, "diffusion"),
    ],
)
def test_what_is_no_cell_is_refused(wrong, said):
    with pytest.raises(ValueError, match=said):
        one([current(0.0, 1.0)], STRAIGHT._replace(**wrong))
