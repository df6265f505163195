"""What contradicts a record beside its current and voltage: dates, two thermometers, pauses."""

import numpy as np
import pytest

from cellwright.series.beside import pace_drifts
from cellwright.series.cleaning import clean
from cellwright.series.doubts import Doubt

RATED, OHM, PER_AMPERE_HOUR = 3.0, 0.04, 0.3


@pytest.mark.parametrize("rate", [-0.15, -0.05, 0.0, 0.05, 0.15])
def test_a_clock_that_drifts_is_told_by_the_pace_of_its_rows(rate):
    """Each 10 s, and at the edges of a load another row; a pace that is set anew is no drift."""
    true = np.unique(np.concatenate([10.0 * np.arange(800), [2003.0, 5003.0]]))
    share = true / true[-1]
    assert pace_drifts(true * (1 + 0.5 * rate * share)) == (rate != 0)
    assert not pace_drifts(np.cumsum(np.where(np.arange(800) < 400, 10.0, 10.0 * (1 + rate))))
    assert not pace_drifts(np.geomspace(1.0, 1e5, 800))
    scattered = np.random.default_rng(1).uniform(0.5, 1.5, 800)
    assert not pace_drifts(np.cumsum(10.0 * scattered * (1 + rate * np.linspace(0, 1, 800))))


def record(lost=0, closed_up=True, pause=True):
    """A 3 Ah cell, 10 s a row: rest, discharge at C/2 with a pause of one row, rest.

    lost : rows of the discharge that are missing after the pause; with `closed_up` the clock goes
    on over them as if they had never been.
    """
    current = np.repeat([0.0, -1.5, 0.0], [60, 600, 180])
    current[300] = 0.0 if pause else -1.5
    time = 10.0 * np.arange(len(current))
    charge = np.cumsum(current) * 10 / 3600
    voltage = np.round(4.1 + PER_AMPERE_HOUR * charge + OHM * current, 4)
    kept = np.r_[0:301, 301 + lost : len(time)]
    if closed_up:
        time[301 + lost :] -= 10.0 * lost
    names = ("test_time_second", "current_ampere", "voltage_volt")
    return {name: c[kept] for name, c in zip(names, (time, current, voltage), strict=True)}


def flags(columns, **about):
    cleaned = clean(columns, rated_capacity_ampere_hour=RATED, **about).columns
    return Doubt(int(np.bitwise_or.reduce(cleaned.get("doubt", np.zeros(1, int)).astype(int))))


def test_a_pause_alone_is_none():
    assert not flags(record())


@pytest.mark.parametrize("closed_up", [True, False])
def test_a_load_that_went_on_unseen_over_a_pause(closed_up):
    """A tenth of the discharge moves the voltage by 75 mV, which no pause does."""
    assert flags(record(60, closed_up)) & Doubt.GAP


def test_a_cell_that_relaxed_over_a_pause_is_right():
    columns = record()
    columns["voltage_volt"][301:400] += 0.02 * np.exp(-np.arange(99) / 30)
    assert not flags(columns)


@pytest.mark.parametrize(("rate", "wrong"), [(1.0, False), (1.005, False), (1.05, True)])
def test_a_clock_that_runs_otherwise_than_its_dates(rate, wrong):
    columns = record()
    dates = 1.7e9 + np.rint(columns["test_time_second"] * rate)
    assert bool(flags(columns | {"unix_time_second": dates}) & Doubt.DATES) == wrong


def test_dates_that_were_set_back_by_an_hour_say_nothing_of_the_clock():
    columns = record()
    dates = 1.7e9 + columns["test_time_second"]
    dates[400:] += 3600.0
    assert not flags(columns | {"unix_time_second": dates}) & Doubt.DATES


def warmed():
    """Temperatures of a cell warmed by its load to 33 °C, and of the air around it at 25 °C."""
    columns = record(pause=False)
    time = columns["test_time_second"]
    surface = 25.0 + 8.0 * np.clip((time - 600) / 6000, 0, 1)
    return columns, surface, 25.0 + 0.3 * np.sin(time / 50)


def test_thermometers_of_cell_and_chamber_exchanged():
    columns, surface, air = warmed()
    named = ("surface_temperature_celsius", "ambient_temperature_celsius")
    right = columns | dict(zip(named, (surface, air), strict=True))
    wrong = columns | dict(zip(named, (air, surface), strict=True))
    assert not flags(right, ambient_temperature_celsius=25.0)
    assert flags(wrong, ambient_temperature_celsius=25.0) == Doubt.EXCHANGED


def test_a_chamber_that_warms_its_cell_is_right():
    columns, surface, _ = warmed()
    air = 25.0 + 12.0 * np.clip((columns["test_time_second"] - 600) / 3000, 0, 1)
    named = {"surface_temperature_celsius": surface, "ambient_temperature_celsius": air}
    assert not flags(columns | named) & Doubt.EXCHANGED


def test_thermometers_that_are_never_near_each_other():
    columns, surface, air = warmed()
    named = {"surface_temperature_celsius": surface, "ambient_temperature_celsius": air - 40}
    assert flags(columns | named, ambient_temperature_celsius=25.0) == Doubt.CHAMBER
