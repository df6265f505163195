"""The points over temperature: only what is comparable is put side by side."""

import numpy as np
import pytest
from pulse_rows import pulse

from cellwright.laws.points import (
    Point,
    capacity_points,
    first_check_up,
    impedance_points,
    level_means,
    mean_per_temperature,
    rate_classes,
    resistance_points,
    with_enough_temperatures,
)


def spectrum(soc, celsius, ohmic, transfer, std=1e-4):
    return {
        "soc": soc,
        "ambient_temperature_celsius": celsius,
        "cycle": None,
        "r_ohmic_ohm": ohmic,
        "r_ohmic_ohm_std": 1e-5,
        "r_charge_transfer_ohm": transfer,
        "r_charge_transfer_ohm_std": std,
    }


def discharge(size, rate, celsius, direction="discharge", cycle=None):
    return {
        "capacity_ampere_hour": size,
        "c_rate": rate,
        "ambient_temperature_celsius": celsius,
        "direction": direction,
        "cycle": cycle,
    }


def test_resistance_is_interpolated_to_half_charge_at_each_temperature():
    rows = [pulse(0.4, 0.030), pulse(0.6, 0.020), pulse(0.55, 0.080, 0.0), pulse(0.45, 0.060, 0.0)]
    points, _ = resistance_points(rows, delay_second=(10.0,))
    assert [p.temperature_celsius for p in points] == [0.0, 25.0]
    assert [p.value for p in points] == pytest.approx([0.070, 0.025])
    assert {(p.quantity, p.unit) for p in points} == {("resistance at 50 % SoC, 10 s", "Ohm")}
    assert points[1].std == pytest.approx(np.hypot(1.5e-4, 1e-4))


def test_delays_and_directions_are_followed_one_by_one():
    rows = [pulse(0.5, 0.02, delay=0.0), pulse(0.5, 0.03), pulse(0.5, 0.04, direction="charge")]
    points, _ = resistance_points(rows)
    assert [(p.quantity, p.value) for p in points] == [
        ("resistance at 50 % SoC, first sample", 0.02),
        ("resistance at 50 % SoC, 10 s", 0.03),
        ("charge resistance at 50 % SoC, 10 s", 0.04),
    ]


def test_every_state_of_charge_is_a_quantity_of_one_family():
    rows = [pulse(soc, 0.03, celsius) for soc in (0.2, 0.5, 0.8) for celsius in (0, 20)]
    points, _ = resistance_points(rows, soc=(0.2, 0.5, 0.8))
    assert {(p.soc, p.family) for p in points} == {(s, "resistance, 10 s") for s in (0.2, 0.5, 0.8)}
    assert len({p.quantity for p in points}) == 3


@pytest.mark.parametrize(("socs", "found"), [((0.3, 0.9), 0), ((0.41,), 0), ((0.46,), 1)])
def test_a_temperature_without_a_pulse_near_is_absent(socs, found):
    assert len(resistance_points([pulse(soc, 0.03) for soc in socs])[0]) == found


def test_the_rate_nearest_to_one_c_is_preferred():
    rows = [pulse(0.5, 0.02, rate=4.0), pulse(0.5, 0.03, rate=0.95), pulse(0.5, 0.05, rate=0.2)]
    assert [p.value for p in resistance_points(rows)[0]] == [0.03]


def test_currents_are_not_mixed_where_one_reaches_three_temperatures():
    rows = [pulse(0.5, 0.03, celsius, rate=1.5) for celsius in (10, 25, 45)]
    points, notes = resistance_points([*rows, pulse(0.5, 0.09, 0, rate=0.5)])
    assert [p.temperature_celsius for p in points] == [10, 25, 45]
    assert notes == ["resistance at 50 % SoC, 10 s: no pulse at 1.5C at 0 °C, left out"]


def test_currents_that_must_be_mixed_are_said():
    rows = [pulse(0.5, 0.03, 10 * k, rate=rate) for k, rate in enumerate((0.5, 1.0, 2.0))]
    points, notes = resistance_points(rows)
    assert len(points) == 3
    assert "pulses of 0.5C to 2C at different temperatures" in notes[0]


def test_a_class_of_rates_ends_at_a_gap():
    rows = [pulse(0.5, 0.03, rate=rate) for rate in (0.99, 1.0, 1.02, 2.0, 0.0)]
    assert {rate: len(members) for rate, members in rate_classes(rows).items()} == {1.0: 3, 2.0: 1}


def test_spectra_give_both_resistances_with_their_errors():
    rows = [spectrum(0.5, 25, 0.02, 0.01), spectrum(0.505, 0, 0.03, 0.1), spectrum(None, 0, 1, 1)]
    points, notes = impedance_points(rows)
    assert {p.quantity for p in points} == {
        "ohmic resistance at 50 % SoC, impedance",
        "charge-transfer resistance at 50 % SoC, impedance",
    }
    assert {p.std for p in points} == {1e-5, 1e-4}
    assert notes == []


@pytest.mark.parametrize(
    "change", [{"r_charge_transfer_ohm_std": 0.02}, {"charge_transfer_told": False}]
)
def test_what_a_spectrum_does_not_determine_is_left_out_and_counted(change):
    rows = [spectrum(0.5, 25, 0.02, 0.01) | change, spectrum(0.5, 0, 0.03, 0.1)]
    points, notes = impedance_points(rows)
    assert [p.temperature_celsius for p in points if p.quantity.startswith("charge")] == [0]
    assert len(points) == 3
    assert notes == ["charge-transfer resistance, impedance: 1 of 2 spectra do not determine it"]


def test_states_of_charge_within_the_tolerance_are_one():
    found = level_means([0.1, 0.11, 0.2, 0.5], apart=0.02)
    assert list(found) == [0.1, 0.11, 0.2, 0.5]
    assert list(found.values()) == pytest.approx([0.105, 0.105, 0.2, 0.5])


def test_capacities_of_one_rate_are_one_quantity():
    rows = [discharge(1.9, 1.00, 25), discharge(1.5, 0.96, 0), discharge(2.0, 0.05, 25)]
    points = capacity_points([*rows, discharge(2.1, 1.0, 25, direction="charge")])
    assert [(p.quantity, p.temperature_celsius, p.value) for p in points] == [
        ("capacity at 0.96C", 0, 1.5),
        ("capacity at 0.05C", 25, 2.0),
        ("capacity at 0.96C", 25, 1.9),
    ]


def test_age_does_not_pass_for_temperature():
    rows = [discharge(2.0, 1, 25), discharge(1.4, 1, 0, cycle=500), discharge(1.9, 1, 40, cycle=0)]
    young = first_check_up([*rows, discharge(7, 1, None)])
    assert [row["capacity_ampere_hour"] for row in young] == [2.0, 1.9]
    assert first_check_up([]) == []


def test_repeats_at_one_temperature_are_one_point():
    points = [Point("R", "Ohm", 0.0, value, 0.03) for value in (1.0, 1.1, 1.2)]
    points += [Point("R", "Ohm", 25.0, 0.5), Point("Q", "Ah", 0.0, 2.0)]
    points = mean_per_temperature(points)
    assert [(p.quantity, p.temperature_celsius) for p in points] == [("R", 0), ("R", 25), ("Q", 0)]
    assert points[0].value == pytest.approx(1.1)
    assert points[0].std == pytest.approx(0.03 / np.sqrt(3))
    assert np.isnan(points[1].std)


def test_quantities_need_enough_temperatures():
    points = [Point("R", "Ohm", celsius, 1.0) for celsius in (0, 25, 40)]
    points += [Point("Q", "Ah", celsius, 1.0) for celsius in (0, 25, 25)]
    assert {point.quantity for point in with_enough_temperatures(points)} == {"R"}
    assert len(with_enough_temperatures(points, temperatures=2)) == 6


def test_a_point_has_the_doubts_of_its_tests_by_name():
    rows = [pulse(0.45, 0.002) | {"test": "t", "doubt": "drifts"}, pulse(0.55, 0.003)]
    points, _ = resistance_points(rows, delay_second=(10.0,), soc=(0.5,))
    assert [point.doubts for point in points] == [("t: drifts",)]
