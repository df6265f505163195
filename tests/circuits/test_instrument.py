"""What a member corrects of a record, by arithmetic; whole voltages in tests/effects/test_model."""

import re

import numpy as np
import pytest

from cellwright.circuits import instrument
from cellwright.circuits.circuit import Branch

TIME = np.array([0.0, 3600.0, 7200.0, 10800.0])
CURRENT = np.array([0.0, -1.0, 1.0, 0.0])
SOC = np.array([0.5, 0.5, 0.4, 0.5])  # of 10 Ah, the old current flowing until the next row


def test_a_member_without_blocks_leaves_a_record_as_it_is():
    record = instrument.corrected({}, 10.0, TIME, CURRENT, SOC, 25.0)
    assert record == (CURRENT, CURRENT, SOC)
    assert instrument.as_read({}, TIME, CURRENT, CURRENT, hold="zero_order") is CURRENT
    assert instrument.capacity_factor({}) == 1.0
    assert instrument.words_of({}) == []


def test_charge_is_counted_without_offset_losses_and_leak():
    counting = {"leak_ampere": 0.2, "lost_share_of_charge": 0.1, "capacity_relative": 0.25}
    member = {"reading": {"current_offset_ampere": 0.1}, "counting": counting}
    current, charging, soc = instrument.corrected(member, 10.0, TIME, CURRENT, SOC, 25.0)
    np.testing.assert_allclose(current, [-0.1, -1.1, 0.9, -0.1])
    np.testing.assert_allclose(charging, [-0.3, -1.3, 0.61, -0.3])
    moved = [0.0, -0.1 - 0.2, -1.1 - 0.2, 0.9 * 0.9 - 0.2]
    np.testing.assert_allclose(soc, 0.5 + np.cumsum(moved) / 12.5)


def test_a_wrong_ammeter_counted_the_capacity_too():
    member = {"reading": {"current_gain_relative": 0.25}}
    current, _, soc = instrument.corrected(member, 10.0, TIME, CURRENT, SOC, 25.0)
    np.testing.assert_allclose(soc, SOC)
    np.testing.assert_allclose(current, 0.8 * CURRENT)
    assert instrument.capacity_factor(member) == pytest.approx(0.8)


def test_capacity_goes_with_temperature_and_kind_of_test():
    counting = {"capacity_relative": 0.1, "capacity_relative_per_kelvin": 0.01}
    member = {"counting": counting | {"capacity_test_relative": 0.0}}
    assert instrument.capacity_factor(member, 15.0) == pytest.approx(1.1 * 0.9)
    assert instrument.capacity_factor(member, np.nan) == pytest.approx(1.1)
    assert instrument.capacity_factor(member, 25.0, kind="capacity") == pytest.approx(1.0)
    # A straight line that would end at none: nothing divides by zero in the cold.
    steep = {"counting": {"capacity_relative_per_kelvin": 0.02}}
    cold = instrument.capacity_factor(steep, np.array([-25.0, -40.0]))
    np.testing.assert_allclose(cold, instrument.LEAST_CAPACITY)


def test_voltage_as_read_and_back():
    member = {"reading": {"voltage_offset_volt": 0.01, "voltage_gain_relative": 0.02}}
    volt = np.linspace(3.0, 4.0, 4)
    read = instrument.as_read(member, TIME, volt, 0.0 * volt, hold="zero_order")
    np.testing.assert_allclose(read, (volt + 0.01) * 1.02)
    np.testing.assert_allclose(instrument.true_volt(member, read), volt)


def test_a_delay_moves_an_edge_and_nothing_else():
    time, current = np.arange(6.0), np.array([0.0, 0.0, 1.0, 1.0, 1.0, 1.0])
    late = {"reading": {"voltage_delay_second": 0.5}}
    volt = instrument.as_read(late, time, 3.0 + current, current, hold="zero_order")
    np.testing.assert_allclose(volt, [3, 3, 3, 4, 4, 4])
    early = {"reading": {"voltage_delay_second": -0.5}}
    volt = instrument.as_read(early, time, 3.0 + current, current, hold="zero_order")
    np.testing.assert_allclose(volt, [3, 3, 4, 4, 4, 4])


def test_a_hysteresis_begins_on_the_side_of_the_load_before_the_record():
    circuit = (
        Branch("hysteresis", {"m_volt": np.full(4, 0.02), "charge_ampere_hour": np.full(4, 2.0)}),
        Branch("switch", {"m_volt": np.full(4, 0.01)}),
        Branch("R", {"r_ohm": np.full(4, 0.03)}),
    )
    member = {"history": {"near_end_soc": 0.1}}
    for soc, side in ((0.95, 1.0), (0.5, 0.0), (0.05, -1.0)):
        over_volt = instrument.with_history(
            *(member, circuit, np.zeros((3, 4)), (TIME, CURRENT), CURRENT),
            soc_at_start=soc,
            capacity_ampere_hour=10.0,
            hold="zero_order",
        )
        np.testing.assert_allclose(over_volt[0], side * 0.02 * np.exp([0, 0, -0.5, -1.0]))
        np.testing.assert_allclose(over_volt[1], 0.01 * np.append(side, [-1, 1, 1]))
        assert not over_volt[2].any()


def test_own_heat_lowers_resistance():
    own = {"thermal_resistance_kelvin_per_watt": 5.0, "time_constant_second": 1.0}
    member = {"own_heat": own | {"activation_energy_joule_per_mole": 30e3}}
    circuit = (Branch("R", {"r_ohm": np.full(4, 0.03)}), Branch("switch", {"m_volt": 0.01}))
    heat = np.full(4, 2.0)
    steps = np.diff(TIME)
    warm = instrument.warmed_within(member, circuit, heat, steps, 25.0, hold="zero_order")
    settled = np.exp(30e3 / 8.314462618 * (1 / 308.15 - 1 / 298.15))
    np.testing.assert_allclose(warm[0].parameters["r_ohm"], 0.03 * np.array([1, *[settled] * 3]))
    assert warm[1].parameters == {"m_volt": 0.01}
    assert instrument.heating(member, circuit) == instrument.at_once(circuit) == [0]
    assert instrument.words_of(member)[0].startswith("the cell is warmer inside")


def test_every_number_of_a_block_is_said_in_words():
    """Each that the module's docstring names, without its id."""
    names = re.findall(r"(\w+_\w+) \[", instrument.__doc__)
    assert len(names) >= 13
    for name in names:
        (said,) = instrument.words_of({"reading": {name: -0.033}})
        assert "_" not in said, name
    counting = {"counting": {"capacity_relative": -0.033, "leak_ampere": 0.01}}
    assert instrument.words_of(counting) == [
        "the charge is not what was counted: capacity -3.3 % from the model's, a leak of 0.01 A"
    ]
