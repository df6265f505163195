"""Tests of a cell by temperature, and how its resistance moves with temperature."""

import numpy as np
import pytest
import truth
from sheets_facts import cell_facts, measured_test

from cellwright.circuits.temperature import resistance_factor
from cellwright.identification.identify import activation_of, at_activation_energy, data_of
from cellwright.records.record import cell_temperature, records_by_temperature

CELL = cell_facts()
TABLE = {"soc": truth.OCV_SOC.tolist(), "ocv_volt": truth.OCV_VOLT.tolist()}
BASIS = {
    "capacity_ampere_hour": truth.CAPACITY_AMPERE_HOUR,
    "ocv": [TABLE | {"ambient_temperature_celsius": 25.0}],
}
TIME, CURRENT = truth.drive(np.random.default_rng(1), 3000)
SOC = truth.soc_of(TIME, CURRENT, 1.0)


def made(name, kind="drive", *, celsius=25.0, role="fit", soc=1.0, surface=None, factor=1.0):
    noise = np.random.default_rng([2, *name.encode()]).normal(0, 5e-4, len(TIME))
    series = {
        "test_time_second": TIME,
        "current_ampere": CURRENT,
        "voltage_volt": truth.voltage(TIME, CURRENT, SOC, resistance_factor=factor) + noise,
        "charge_ampere_hour": (SOC - 1.0) * truth.CAPACITY_AMPERE_HOUR,
    }
    series |= {} if surface is None else {"surface_temperature_celsius": surface}
    return measured_test(series, name, kind, celsius=celsius, role=role, soc=soc)


def grouped(*tests):
    return records_by_temperature(list(tests), BASIS, CELL, split_rest_second=120.0)


def names_of(group):
    return tuple(record.test for record in group.records)


def test_groups_are_cold_first_and_within_two_kelvin():
    conditions, notes = grouped(
        made("c", celsius=25.0), made("a", celsius=-10.0), made("b", celsius=24.0)
    )
    assert [(one.celsius, names_of(one)) for one in conditions] == [
        (-10.0, ("a",)),
        (24.0, ("b", "c")),
    ]
    assert notes == []
    for group in conditions:
        assert all((record.resistance_factor == 1.0).all() for record in group.records)


def test_pulses_displace_drives_and_take_capacity_tests_with_them():
    (pulsed,), _ = grouped(made("d"), made("h", "hppc"), made("q", "capacity"))
    assert (set(names_of(pulsed)), pulsed.pulsed) == ({"h", "q"}, True)
    (driven,), _ = grouped(made("d"), made("q", "capacity"))
    assert (names_of(driven), driven.pulsed) == (("d",), False)
    (loaded,), _ = grouped(made("q", "capacity"))
    assert (names_of(loaded), loaded.pulsed) == (("q",), False)


def test_capacity_tests_alone_serve_no_temperature_of_a_cell_with_pulses_or_drives():
    groups, _ = grouped(made("h", "hppc"), made("q", "capacity", celsius=0.0))
    assert [names_of(group) for group in groups] == [("h",)]


def test_of_a_split_record_the_even_blocks_are_not_used():
    (group,), _ = grouped(made("s", role="split"))
    np.testing.assert_array_equal(group.records[0].used, TIME // 1500 % 2 == 0)


def test_what_cannot_be_used_is_said():
    bad = made("bad")
    bad.series["voltage_volt"][3] = np.nan
    (group,), notes = grouped(made("good"), bad)
    assert names_of(group) == ("good",)
    (note,) = notes
    assert note.startswith("not fitted: bad: ")
    assert "row 3 of voltage_volt is nan" in note


def test_the_temperature_of_a_cell_is_its_surface_s_else_the_chamber_s():
    surface = np.linspace(20.0, 30.0, len(TIME))
    cases = [
        (made("a", surface=surface), surface, "the surface's measured"),
        (made("a", celsius=5.0), 5.0, "the chamber's"),
        (made("a", celsius=None), 25.0, "25 °C, for want of any"),
        (made("a", surface=np.where(TIME == 5, np.nan, 20.0)), 25.0, "the chamber's"),
    ]
    for test, celsius, source in cases:
        celsius_and_source = cell_temperature(test.facts, test.series)
        np.testing.assert_array_equal(celsius_and_source[0], np.broadcast_to(celsius, len(TIME)))
        assert celsius_and_source[1] == source


def test_a_bridged_gap_has_a_temperature_too():
    test = made("h", "hppc", surface=np.linspace(20.0, 30.0, len(TIME)))
    kept = (TIME < 800) | (TIME > 2000)
    cut = test._replace(series={name: values[kept] for name, values in test.series.items()})
    (group,), _ = grouped(cut)
    (record,) = group.records
    assert len(record.celsius) == len(record.soc) >= kept.sum() + 4
    assert (record.celsius[800:804] == record.celsius[799]).all()


def data_for(group):
    ocv = truth.ocv_at(truth.OCV_SOC)
    settings = {"capacity_ampere_hour": truth.CAPACITY_AMPERE_HOUR, "spacing": 0.1}
    return data_of(group.records, ocv, **settings)


def activation(*tests):
    conditions, _ = grouped(*tests)
    capacity = truth.CAPACITY_AMPERE_HOUR
    return conditions, activation_of(conditions, data_for, capacity_ampere_hour=capacity)


def test_the_activation_energy_is_found_between_temperatures():
    kelvins = {celsius: resistance_factor(celsius, 25.0, 35e3) for celsius in (0.0, 10.0, 25.0)}
    tests = [made(f"t{c}", celsius=c, factor=factor) for c, factor in kelvins.items()]
    _, activation_energy = activation(*tests)
    np.testing.assert_allclose(activation_energy[0], 35e3, rtol=0.05)
    assert "35 at 0 °C" in activation_energy[1]


@pytest.mark.slow
@pytest.mark.parametrize("energy", [0.0, 10e3, 20e3, 30e3, 50e3])
def test_the_activation_energy_is_found_from_the_cell_s_own_warming(energy):
    surface = 25.0 + 10.0 * np.sin(TIME / 700.0)
    factor = resistance_factor(surface, 25.0, energy)
    groups, activation_energy = activation(made("a", surface=surface, factor=factor))
    assert activation_energy[0] == [energy]
    found = f"{energy / 1e3:.0f} kJ/mol, from the cell's own warming by 19 K"
    assert found in activation_energy[1]
    (record,) = at_activation_energy(groups[0], energy).records
    np.testing.assert_allclose(record.resistance_factor, factor)
    assert groups[0].records[0].resistance_factor.max() == 1.0


def test_a_temperature_of_a_few_rows_takes_the_energy_of_its_neighbours():
    cold, warm = (
        made("a", celsius=0.0, factor=resistance_factor(0.0, 25.0, 35e3)),
        made("c", celsius=25.0),
    )
    few = made("b", celsius=10.0)
    few = few._replace(series={name: values[297:305] for name, values in few.series.items()})
    _, activation_energy = activation(cold, few, warm)
    _, without = activation(cold, warm)
    np.testing.assert_allclose(activation_energy[0], without[0][0])
    assert activation(few, cold)[1] == ([None, None], "")


def test_a_cell_that_keeps_its_temperature_shows_none():
    _, activation_energy = activation(made("a", surface=np.full(len(TIME), 25.0)))
    assert activation_energy == ([None], "")


@pytest.mark.parametrize("scale", [0.5, 1.0])
def test_resistance_that_does_not_fall_with_temperature_has_no_activation_energy(scale):
    """An energy below zero is an error of the fit, not a property."""
    _, activation_energy = activation(made("a", celsius=0.0, factor=scale), made("b", celsius=25.0))
    np.testing.assert_allclose(activation_energy[0], 0.0, atol=500.0)
