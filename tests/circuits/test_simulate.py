"""Simulation of a record: holds, parameters that follow the SoC, many cells, every refusal.

What each kind of branch does is held in test_circuit.py.
"""

import numpy as np
import pytest
import truth
from scipy.integrate import solve_ivp

import cellwright as cw
from cellwright.circuits.cell import overpotentials, sensitivities, simulate
from cellwright.circuits.circuit import Branch, rc_circuit
from cellwright.numerics.lags import lag
from cellwright.refusal import Refusal

CIRCUIT = rc_circuit(0.02, [0.01, 0.03], [5.0, 200.0])


def test_first_order_hold_is_exact_on_a_ramp():
    time = np.array([0.0, 1.0, 4.0, 4.5, 30.0])
    expected = time - 7.0 * -np.expm1(-time / 7.0)
    np.testing.assert_allclose(
        lag(np.diff(time), 7.0, time, hold="first_order"), expected, atol=1e-13
    )


def test_parameters_per_sample_follow_the_state_of_charge():
    time = np.linspace(0, 100, 2001)
    r = np.linspace(0.01, 0.02, 2001)
    slow = overpotentials(rc_circuit(0 * r, [r], [1e-3]), time, np.ones(2001), hold="first_order")
    np.testing.assert_allclose(slow[1, 10:], r[10:], atol=1e-5)


@pytest.mark.slow
def test_a_general_solver_gives_the_same_voltage():
    """Parameters over SoC, the tolerance of the solver far below what is asked of us."""
    time = np.arange(0.0, 1200.0)
    current = -2.0 + 1.5 * np.sin(0.05 * time) - np.sin(0.31 * time)
    grid = np.linspace(0.0, 1.0, 101)
    r0, *r = 0.03 + 0.01 * np.cos(3 * grid), 0.02 - 0.005 * grid, 0.015 + 0.01 * grid**2
    ocv, tau = 3.2 + 0.8 * grid + 0.1 * np.sin(6 * grid), np.array([8.0, 150.0])

    def slope(t, state):
        ampere = np.interp(t, time, current)
        ohm = np.array([np.interp(state[0], grid, one) for one in r])
        return [ampere / 7200.0, *((ohm * ampere - state[1:]) / tau)]

    solution = solve_ivp(slope, time[[0, -1]], [0.8, 0, 0], "LSODA", time, rtol=1e-10, atol=1e-12)
    soc = solution.y[0]
    own, ohmic, *pairs = (np.interp(soc, grid, one) for one in (ocv, r0, *r))
    run = simulate(rc_circuit(ohmic, pairs, tau), time, current, own, hold="first_order")
    wanted = own + ohmic * current + solution.y[1:].sum(axis=0)
    np.testing.assert_allclose(run, wanted, rtol=0, atol=1e-5)


def test_a_single_sample_shows_what_acts_at_once():
    assert simulate(CIRCUIT, [5.0], [2.0], 3.7, hold="first_order") == pytest.approx([3.74])
    moving = rc_circuit(np.array([0.02]), [np.array([0.01])], [np.array([5.0])])
    assert simulate(moving, [5.0], [2.0], 3.7, hold="zero_order") == pytest.approx([3.74])


def _diffusion():
    return Branch("diffusion", {"soc_per_ampere": 0.01, "tau_second": 100.0})


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"hold": "second_order"}, "hold of the current is 'second_order'"),
        ({"test_time_second": [0.0, 2.0, 1.0]}, "the clock runs back after row 1"),
        ({"current_ampere": [0.0, np.nan, 1.0]}, "not finite"),
        ({"current_ampere": [0.0, 1.0]}, "all must be"),
        ({"test_time_second": [], "current_ampere": []}, "holds no sample"),
        (
            {"circuit": (Branch("CPE", {"q": 1.0}),)},
            "branch kind 'CPE' is unknown; known are R, R_two_way, RC, RC_two_way, ",
        ),
        ({"circuit": (Branch("RC", {"r_ohm": 1.0}),)}, "it takes r_ohm, tau_second"),
        ({"circuit": rc_circuit(0.1, [0.1], [0.0])}, "time constant is zero"),
        ({"circuit": rc_circuit(np.nan, [], [])}, "r_ohm of branch R is not finite"),
        (
            {"circuit": rc_circuit(np.ones(2), [], [])},
            r"r_ohm of branch R has shape \(2,\); it must be",
        ),
        ({"circuit": (_diffusion(),)}, "shifts the SoC, but no OCV"),
    ],
)
def test_refusals(change, reason):
    given = {
        "circuit": CIRCUIT,
        "test_time_second": [0.0, 1.0, 2.0],
        "current_ampere": [0.0, 1.0, 1.0],
        "hold": "first_order",
    } | change
    hold = given.pop("hold")
    with pytest.raises(Refusal, match=reason):
        overpotentials(*given.values(), hold=hold)


def test_sensitivities_refuse_what_simulation_refuses():
    with pytest.raises(Refusal, match="'CPE' is unknown"):
        sensitivities((Branch("CPE", {}),), [0.0, 1.0], [0.0, 1.0], hold="zero_order")


def test_the_true_cell_returns_to_its_ocv():
    time, current = truth.drive(np.random.default_rng(3), 1500)
    soc = truth.soc_of(time, current)
    rest = np.concatenate([time, [time[-1] + 1, time[-1] + 1e5]])
    soc = np.append(soc, [soc[-1]] * 2)
    end = truth.voltage(rest, np.append(current, [0.0, 0.0]), soc)[-1]
    assert end == pytest.approx(np.interp(soc[-1], truth.OCV_SOC, truth.OCV_VOLT), abs=1e-9)


def model_of_tests():
    """A model of 2 Ah, fitted from SoC 0.1 to 0.9 at 25 °C."""
    member = {"model": "R", "conditions": [{"soc": [0.1, 0.9], "r0_ohm": [0.02, 0.02]}]}
    member["conditions"][0] |= {"branches": [], "ambient_temperature_celsius": 25.0}
    ocv = [{"soc": [0.0, 1.0], "ocv_volt": [3.0, 4.2], "ambient_temperature_celsius": 25.0}]
    about = {"schema": "cellwright-model/2", "cell": "A", "capacity_ampere_hour": 2.0}
    return about | {"ocv": ocv, "members": [member], "chosen": "R"}


def simulated(ampere, hours, **how):
    time = np.arange(0.0, 3600 * hours + 1, 36.0)
    current = {"test_time_second": time, "current_ampere": np.full(len(time), ampere)}
    return cw.simulate(model_of_tests(), current, **how)


def test_a_simulation_says_where_it_leaves_its_model():
    """2 A of 2 Ah: empty after half an hour from SoC 0.5, with 1 % of it each 36 s."""
    assert simulated(-2.0, 0.25, initial_soc=0.8).notes == ()
    (measured,) = simulated(-2.0, 0.25, initial_soc=0.305).notes
    assert measured.startswith("In 5 of 26 samples, the first at 756 s, the SoC of 0.055 to 0.095")
    told = simulated(-2.0, 4.0, initial_soc=0.5).notes
    assert "leaves 0 to 1 at 1836 s" in told[0]
    assert "-3.5 to -0.01" in told[0]
    assert "The voltage falls to" in told[-1]
    warm, usual = simulated(-2.0, 0.25, initial_soc=0.8, temperature_celsius=85.0).notes
    assert "the temperature of 85 °C lies outside" in warm
    assert "One temperature was tested, 25 °C: at others resistances follow" in usual
    with pytest.raises(Refusal, match=r"found 298.15 to 298.15, wanted -60 to 150 .*in kelvin\?"):
        simulated(-2.0, 0.25, initial_soc=0.8, temperature_celsius=298.15)
    with pytest.raises(Refusal, match=r"found -80 to -80, wanted -60 to 150 °C$"):
        simulated(-2.0, 0.25, initial_soc=0.8, temperature_celsius=-80.0)


def test_of_a_cell_that_warmed_it_is_said_where_usual_energies_begin():
    model = model_of_tests()
    (condition,) = model["members"][0]["conditions"]
    condition |= {"activation_energy_joule_per_mole": 3e4, "activation_energy_kelvin": 12.0}
    load = {"test_time_second": [0.0, 60.0], "current_ampere": [-1.0] * 2}
    near, far = (
        cw.simulate(model, load, initial_soc=0.8, temperature_celsius=celsius).notes
        for celsius in (35.0, 40.0)
    )
    assert len(near) == 1
    assert "One temperature was tested" in far[1]
    condition["activation_energy_kelvin"] = None  # it holds everywhere
    assert len(cw.simulate(model, load, initial_soc=0.8, temperature_celsius=40.0).notes) == 1
    condition["activation_energy_joule_per_mole"] = 0.0
    _, held = cw.simulate(model, load, initial_soc=0.8, temperature_celsius=40.0).notes
    assert "states no change of its resistances over temperature" in held


def test_a_simulation_beyond_the_tests_says_how_the_model_erred_where_their_end_was_left_out():
    model, load = model_of_tests(), {"test_time_second": [0.0, 60.0], "current_ampere": [-1.0] * 2}
    (member,) = model["members"]
    cold = member["conditions"][0] | {"ambient_temperature_celsius": 0.0}
    model["members"] = [member | {"conditions": [*member["conditions"], cold]}]
    errors = {"rmse_volt": 0.026, "own_rmse_volt": 0.014, "model": "R", "beyond": True}
    model["left_out_temperatures"] = [
        errors | {"ambient_temperature_celsius": celsius} for celsius in (0.0, 25.0)
    ]
    notes = [
        cw.simulate(model, load, initial_soc=0.8, temperature_celsius=celsius).notes
        for celsius in (12.0, -20.0)
    ]
    assert notes[0] == ()
    assert len(notes[1]) == 2
    assert "0 °C is the coldest: R erred there by 26 mV RMS (SoC 5 to 95 %)" in notes[1][1]
    assert "and by 14 mV with it" in notes[1][1]


def test_a_cell_that_is_charged_to_full_is_not_beyond_it():
    assert simulated(2.0, 0.1, initial_soc=0.8).notes == ()
    assert all("leaves 0 to 1" not in n for n in simulated(0.001, 1.0, initial_soc=1.0).notes)
