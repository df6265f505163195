"""Look-up of a model file: in range, between temperatures, and marked where extrapolated."""

import copy

import numpy as np
import pytest
import truth

from cellwright.circuits.model_file import circuit_at, member_of, simulate_model
from cellwright.circuits.temperature import ocv_at
from cellwright.refusal import Refusal


def conditions(*pairs):
    """Conditions of the true cell at (celsius, scale) each."""
    return [truth.model(celsius=c, scale=s)["members"][0]["conditions"][0] for c, s in pairs]


def values(sampled, name="r_ohm"):
    """A parameter of all branches that have it (branches, n), the ohmic resistance first."""
    return np.array([b.parameters[name] for b in sampled.circuit if name in b.parameters])


def test_the_model_file_simulates_the_true_cell():
    time, current = truth.drive(np.random.default_rng(1))
    soc = truth.soc_of(time, current, 0.95)
    run = simulate_model(truth.model(), None, time, current, soc, 25.0)
    np.testing.assert_allclose(run.voltage_volt, truth.voltage(time, current, soc), atol=1e-12)
    np.testing.assert_array_equal(run.extrapolated, (soc < 0.1) | (soc > 0.9))
    assert not run.outside_temperature.any()
    assert run.overpotential_volt.shape == (3, len(time))


def test_between_temperatures_resistance_follows_arrhenius():
    kelvin = np.array([273.15, 283.15, 298.15])
    scale = np.exp(3000 * (1 / kelvin - 1 / 298.15))
    sampled = circuit_at(conditions((25, 1.0), (0, scale[0])), np.full(1, 0.5), 10.0)
    expected = scale[1] * np.array([truth.R0[2], *truth.R[:, 2]])
    np.testing.assert_allclose(values(sampled)[:, 0], expected, rtol=1e-4)
    np.testing.assert_allclose(values(sampled, "tau_second")[:, 0], truth.TAU)


def test_outside_the_measured_range_resistance_follows_the_law_and_is_marked():
    soc, warm = np.array([0.5, 0.05, 0.95]), np.array([60.0, 25.0, 10.0])
    sampled = circuit_at(conditions((0, 2.0), (25, 1.0)), soc, warm)
    np.testing.assert_array_equal(sampled.outside_temperature, [True, False, False])
    np.testing.assert_array_equal(sampled.outside_soc, [False, True, True])
    found, steepest = values(sampled)[0, :2], 2.0 ** (-(1 / 298.15 - 1 / 333.15) / 3.0697e-4)
    assert truth.R0[2] * steepest < found[0] < 0.9 * truth.R0[2]
    assert found[1] == pytest.approx(truth.R0[0])


def test_a_resistance_of_zero_stays_harmless():
    entry = conditions((25, 1.0), (0, 0.0))
    assert np.isfinite(values(circuit_at(entry, np.full(1, 0.5), 10.0))).all()


def test_one_condition_of_unknown_temperature_serves_any():
    entry = conditions((25, 1.0))
    entry[0]["ambient_temperature_celsius"] = None
    sampled = circuit_at(entry, np.full(1, 0.5), np.nan)
    np.testing.assert_allclose(values(sampled)[0], truth.R0[2])
    with pytest.raises(Refusal, match="a temperature is not known"):
        circuit_at(entry * 2, np.full(1, 0.5), 25.0)


def test_ocv_shift_belongs_to_the_model():
    shifted = copy.deepcopy(truth.model())
    shifted["members"][0]["conditions"][0]["ocv_shift_volt"] = [0.01] * 5
    time = np.arange(3.0)
    args = (None, time, 0 * time, 0 * time + 0.5, 25.0)
    change = simulate_model(shifted, *args).voltage_volt - simulate_model(truth.model(), *args)[0]
    np.testing.assert_allclose(change, 0.01)


def test_ocv_between_temperatures_lies_between_the_tables():
    tables = [
        {"soc": [0, 1], "ocv_volt": [3.0 + d, 4.0 + d], "ambient_temperature_celsius": t}
        for d, t in ((0.0, 25), (0.02, 0))
    ]
    ocv_volt = ocv_at(tables, np.full(3, 0.5), np.array([-20.0, 12.0, 25.0]))
    assert ocv_volt[0] == pytest.approx(3.52)
    assert 3.505 < ocv_volt[1] < 3.515
    assert ocv_volt[2] == pytest.approx(3.5)


def test_a_member_that_is_not_there_is_named():
    with pytest.raises(Refusal, match="no member '3RC'; it has 2RC"):
        member_of(truth.model(), "3RC")
    with pytest.raises(Refusal, match="nothing measured"):
        circuit_at([], np.zeros(1), 25.0)
