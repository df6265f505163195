"""Thermal constants of a cell from its logged temperature: recovered, scored, or a reason."""

import re

import numpy as np
import pytest
import strings
from sheets_facts import cell_facts, measured_test

from cellwright.circuits.heat import heat, temperature
from cellwright.circuits.model_file import simulate_model
from cellwright.identification.thermal import constants_of, thermal_columns, thermal_constants

BODY = {"heat_capacity_joule_per_kelvin": 900.0, "resistance_kelvin_per_watt": 1.4}
MODEL = strings.model("A")
CELL = cell_facts(strings.LOWER_VOLT, strings.UPPER_VOLT, rated=30.0)
SOC = np.linspace(0.0, 1.0, 9)
ENTROPIC = np.array([-4.0, -2.0, 0.0, 0.3, 0.4, 0.6, 0.7, 0.9, 1.1]) * 1e-4
TIME = np.arange(0.0, 6.5 * 3600.0, 10.0)
HOUR = TIME / 3600.0
CYCLE = np.select([HOUR < 0.5, HOUR < 2.3, HOUR < 3.0, HOUR < 4.8], [0.0, -15.0, 0.0, 15.0], 0.0)
PULSES = np.where((HOUR > 0.5) & (HOUR < 6.0) & (TIME % 1800 < 600), -25.0, 0.0)


def warmed(load, seed=0, *, name="capacity_25C", role="fit", noise=0.05, warms=True, soc=0.99):
    """A test of the cell that warms, its sensor 0.3 K above the chamber and noisy."""
    drawn = np.append(0.0, np.cumsum(load[:-1] * np.diff(TIME))) / 3600.0
    course = soc + drawn / MODEL["capacity_ampere_hour"]
    run = simulate_model(MODEL, None, TIME, load, course, 25.0 + 0.0 * TIME, hold="zero_order")
    celsius = np.full(len(TIME), 25.0)
    for _ in range(4):
        about = {"temperature_celsius": celsius}
        about["entropic_volt_per_kelvin"] = np.interp(course, SOC, ENTROPIC)
        watt = heat(load, run.voltage_volt, run.ocv_volt, **about)
        celsius = temperature(TIME, warms * watt, 25.0, **BODY)
    random = np.random.default_rng(seed)
    series = {"test_time_second": TIME, "current_ampere": load, "voltage_volt": run.voltage_volt}
    series["charge_ampere_hour"] = drawn
    series["surface_temperature_celsius"] = celsius + 0.3 + noise * random.normal(size=len(TIME))
    return measured_test(series, name, "drive", celsius=25.0, soc=soc, role=role)


def found_of(*tests):
    return thermal_constants(CELL, MODEL, tests, split_rest_second=120.0)


@pytest.mark.parametrize("seed", range(4))
def test_charge_beside_discharge_tells_the_constants_and_the_entropic_coefficient(seed):
    found = found_of(warmed(CYCLE, seed)).content
    for name, unit in (("heat_capacity", "joule_per_kelvin"), ("resistance", "kelvin_per_watt")):
        std = found[f"{name}_std_{unit}"]
        assert abs(found[f"{name}_{unit}"] - BODY[f"{name}_{unit}"]) < 4 * std
        assert std < 0.03 * BODY[f"{name}_{unit}"]
    told = np.interp(found["entropic"]["soc"], SOC, ENTROPIC)
    middle = slice(1, -1)
    off = np.array(found["entropic"]["volt_per_kelvin"]) - told
    np.testing.assert_allclose(off[middle], 0.0, atol=3e-5)
    assert found["ambient_offset_kelvin"] == pytest.approx(0.3, abs=0.03)
    assert (found["reason"], found["tests"]) == (None, ["capacity_25C"])


def test_several_tests_are_averaged_by_their_deviations():
    rows = found_of(warmed(CYCLE, 1), warmed(CYCLE, 2, name="again", noise=0.5))
    one, two = rows.rows
    mean = rows.content["resistance_kelvin_per_watt"]
    values = [row["resistance_kelvin_per_watt"] for row in (one, two)]
    assert min(values) <= mean <= max(values)
    assert abs(mean - values[0]) < abs(mean - values[1])
    assert rows.content["tests"] == ["capacity_25C", "again"]


def test_tests_that_contradict_each_other_are_less_sure_than_each_alone():
    """A test whose surface saw a third less of the heat: each row owns up to the difference."""
    alone = found_of(warmed(CYCLE, 1)).rows[0]["heat_capacity_std_joule_per_kelvin"]
    rows = found_of(warmed(CYCLE, 1), warmed(CYCLE, 2, name="again", warms=0.7)).rows
    sizes = [row["heat_capacity_joule_per_kelvin"] for row in rows]
    apart = abs(sizes[0] - sizes[1])
    assert apart > 10 * alone
    for row in rows:
        assert 0.5 * apart < row["heat_capacity_std_joule_per_kelvin"] < apart


def test_a_test_that_took_no_part_is_met_within_its_noise():
    drive = np.where((HOUR > 0.5) & (HOUR < 2.5), np.where(TIME % 300 < 150, -30.0, 6.0), 0.0)
    found = found_of(warmed(CYCLE), warmed(drive, 5, name="drive", role="validation"))
    row = found.rows[-1]
    assert (row["test"], row["use"]) == ("drive", "scored")
    assert row["moved_kelvin"] > 0.5
    assert row["rmse_kelvin"] < 0.1


@pytest.mark.parametrize(
    ("test", "reason"),
    [
        (
            lambda: warmed(CYCLE, warms=False),
            "heat explains|falls with heat|within",
        ),
        (lambda: warmed(PULSES, noise=0.3), "wanted within 30%|explains|not within|falls with"),
        (lambda: warmed(0.0 * CYCLE), "holds no heat"),
    ],
)
def test_what_does_not_tell_the_constants_says_why(test, reason):
    found = found_of(test())
    assert found.content["resistance_kelvin_per_watt"] is None
    assert found.content["reason"].startswith("capacity_25C: ")
    assert re.search(reason, found.content["reason"]), found.content["reason"]


def test_a_temperature_that_stands_still_or_has_gaps_tells_nothing():
    still, gaps = (of_surface(change) for change in (lambda t: 25.0 + 0.0 * t, with_gap))
    for test, reason in ((still, "heat explains 0%|falls with heat|not within"), (gaps, "1 rows")):
        found = found_of(test).content
        assert found["resistance_kelvin_per_watt"] is None
        assert re.search(reason, found["reason"]), found["reason"]


def of_surface(change):
    test = warmed(CYCLE)
    surface = change(test.series["surface_temperature_celsius"])
    return test._replace(series=test.series | {"surface_temperature_celsius": surface})


def with_gap(celsius):
    return np.where(np.arange(len(celsius)) == 7, np.nan, celsius)


def test_without_a_logged_temperature_nothing_is_known():
    test = warmed(CYCLE)
    series = {n: v for n, v in test.series.items() if not n.startswith("surface")}
    found = found_of(test._replace(series=series))
    assert "no test of role fit has a logged surface temperature" in found.content["reason"]
    assert (found.rows, found.content["tests"]) == ([], [])
    assert constants_of([found.content]) == {}
    assert thermal_columns([found.content]) is None
    assert thermal_columns([None]) is None


def test_the_constants_of_a_packs_cells_in_their_order():
    known = found_of(warmed(CYCLE)).content
    columns = thermal_columns([known | {"resistance_kelvin_per_watt": 2.0}, known])
    assert columns["resistance_kelvin_per_watt"][0] == 2.0
    assert columns["entropic_volt_per_kelvin"].shape == (2, 9)
    assert constants_of([known])["A"][0] == known["heat_capacity_joule_per_kelvin"]
