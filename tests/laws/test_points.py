"""The points over temperature: only what is comparable is put side by side."""

import pytest

from cellwright.laws.points import Point, capacity_points, enough, fresh, resistance_points


def pulse(soc, ohm, celsius=25.0, rate=1.0, delay=10.0, direction="discharge", cycle=None):
    return {
        "soc": soc,
        "resistance_ohm": ohm,
        "ambient_temperature_celsius": celsius,
        "c_rate": rate,
        "delay_second": delay,
        "direction": direction,
        "cycle": cycle,
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
    found = resistance_points(rows, delay_second=(10.0,))
    assert [(p.temperature_celsius, p.value) for p in found] == [
        (0.0, pytest.approx(0.070)),
        (25.0, pytest.approx(0.025)),
    ]
    assert {(p.quantity, p.unit) for p in found} == {("resistance at 50 % SoC, 10 s", "Ohm")}


def test_delays_are_followed_one_by_one_and_charges_left_out():
    rows = [pulse(0.5, 0.02, delay=0.0), pulse(0.5, 0.03), pulse(0.5, 9.0, direction="charge")]
    found = resistance_points(rows)
    assert [(p.quantity[-12:], p.value) for p in found] == [
        ("first sample", 0.02),
        (" % SoC, 10 s", 0.03),
    ]


def test_a_temperature_without_a_pulse_near_half_charge_is_absent():
    assert resistance_points([pulse(0.3, 0.03), pulse(0.9, 0.02)]) == []
    (point,) = resistance_points([pulse(0.41, 0.03)])
    assert point.value == 0.03


def test_the_rate_that_is_asked_for_is_preferred():
    rows = [pulse(0.5, 0.02, rate=4.0), pulse(0.5, 0.03, rate=0.95), pulse(0.5, 0.05, rate=0.2)]
    assert [p.value for p in resistance_points(rows)] == [0.03]
    assert [p.value for p in resistance_points(rows, c_rate=5.0)] == [0.02]


def test_capacities_of_one_rate_are_one_quantity():
    rows = [discharge(1.9, 1.00, 25), discharge(1.5, 0.96, 0), discharge(2.0, 0.05, 25)]
    found = capacity_points([*rows, discharge(2.1, 1.0, 25, direction="charge")])
    assert [(p.quantity, p.temperature_celsius, p.value) for p in found] == [
        ("capacity at 0.96C", 0, 1.5),
        ("capacity at 0.05C", 25, 2.0),
        ("capacity at 0.96C", 25, 1.9),
    ]


def test_age_does_not_pass_for_temperature():
    rows = [discharge(2.0, 1, 25), discharge(1.4, 1, 0, cycle=500), discharge(1.9, 1, 40, cycle=0)]
    assert [row["capacity_ampere_hour"] for row in fresh([*rows, discharge(7, 1, None)])] == [
        2.0,
        1.9,
    ]
    assert fresh([]) == []


def test_quantities_need_enough_temperatures():
    points = [Point("R", "Ohm", celsius, 1.0) for celsius in (0, 25, 40)]
    points += [Point("Q", "Ah", celsius, 1.0) for celsius in (0, 25, 25)]
    assert {point.quantity for point in enough(points)} == {"R"}
    assert len(enough(points, temperatures=2)) == 6
