"""Rests in a chamber that steps: shifts found beside a relaxation, refusals named."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from cellwright.protocols.ocv.steps import (
    cell_temperature,
    chamber_shifts,
    extrapolated,
    joined_rests,
    plateaus_of,
)
from cellwright.refusal import Refusal

HOUR = 3600.0
LEVELS = np.arange(20.0, -21.0, -5.0)


def chamber(rest_hour=10.0, dwell_hour=2.0, back=True, levels=LEVELS):
    """Time [s] and temperature of a cell [°C] that follows its chamber with half an hour's lag."""
    levels = [*levels, levels[0]] if back else list(levels)
    hours = rest_hour + dwell_hour * (len(levels) - 1) + dwell_hour * back
    time = np.arange(0.0, hours * HOUR, 60.0)
    celsius, change = np.full(len(time), levels[0]), rest_hour
    for before, after in pairwise(levels):
        since = np.maximum(time / HOUR - change, 0)
        celsius = celsius + (after - before) * (1 - np.exp(-since / 0.45))
        change += dwell_hour
    return time, celsius


def record(slope=-8e-4, relaxing_volt=0.0, tau_hour=6.0, noise_volt=2e-4, **protocol):
    time, celsius = chamber(**protocol)
    random = np.random.default_rng(7)
    voltage = 3.8 + slope * (celsius - celsius[0])
    voltage = voltage + relaxing_volt * np.exp(-time / HOUR / tau_hour)
    shown = celsius + random.normal(0, 0.05, len(time))
    return time, voltage + random.normal(0, noise_volt, len(time)), shown


def steps(*rests):
    first, last = np.transpose(rests)
    return SimpleNamespace(kind=["rest"] * len(rests), first_row=first, last_row=last)


def series_of(*columns):
    names = ("test_time_second", "voltage_volt", "surface_temperature_celsius")
    return dict(zip(names, columns, strict=True))


def shifts(columns):
    time = columns[0]
    return chamber_shifts(series_of(*columns), np.full(len(time), 0.3), steps((0, len(time) - 1)))


@pytest.mark.parametrize("relaxing_volt", [0.0, 0.004, -0.004])
@pytest.mark.parametrize("slope", [-8e-4, 2e-4])
def test_shift_is_found_within_its_uncertainty_beside_a_relaxation(relaxing_volt, slope):
    rows = shifts(record(slope=slope, relaxing_volt=relaxing_volt)).rows
    away = [row for row in rows if not row["returned"]]
    assert len(away) == len(LEVELS)
    for row in away:
        kelvin = row["temperature_celsius"] - row["reference_temperature_celsius"]
        std = np.hypot(row["noise_std_volt"], row["relaxation_std_volt"])
        assert abs(row["shift_volt"] - slope * kelvin) < 3.5 * std + 5e-5
    assert rows[-1]["returned"]
    assert abs(rows[-1]["shift_volt"]) < 3e-4


def test_a_relaxation_left_in_would_have_been_seen():
    columns = record(relaxing_volt=0.006)
    last = next(r for r in reversed(shifts(columns).rows) if not r["returned"])
    at_rest = columns[1][540:600].mean()
    naive = last["voltage_volt"] - at_rest
    truth = -8e-4 * (last["temperature_celsius"] - last["reference_temperature_celsius"])
    assert abs(naive - truth) > 5e-4
    assert abs(last["shift_volt"] - truth) < abs(naive - truth) / 2


def test_without_a_return_the_uncertainty_is_larger():
    with_return = shifts(record(relaxing_volt=0.003)).rows[8]
    without = shifts(record(relaxing_volt=0.003, back=False)).rows[8]
    assert without["relaxation_std_volt"] >= with_return["relaxation_std_volt"]


def test_rests_are_joined_and_counted_and_the_first_without_steps_is_named():
    time, voltage, celsius = record()
    n = len(time)
    time = np.append(time, time[-1] + 100 + time)
    soc = np.repeat([0.9, 0.2], n)
    parts = steps((0, 99), (101, n - 1), (n, n + 800), (n + 801, 2 * n - 1))
    assert joined_rests(parts) == [(0, 99), (101, 2 * n - 1)]
    parts = steps((0, 99), (101, n - 1), (n + 1, 2 * n - 1))
    twice = series_of(time, np.tile(voltage, 2), np.tile(celsius, 2))
    step_shifts = chamber_shifts(twice, soc, parts)
    assert {(row["rest"], row["soc"]) for row in step_shifts.rows} == {(1, 0.9), (2, 0.2)}
    assert len(step_shifts.notes) == 1
    assert "none away from the first" in step_shifts.notes[0]


def test_a_short_first_rest_is_refused_with_its_length():
    with pytest.raises(Refusal, match=r"2\.\d h at the first temperature; wanted 3\.0 h"):
        shifts(record(rest_hour=2.2))


def test_no_rest_and_no_step_are_refused():
    columns = record(levels=[20.0, 20.0])
    with pytest.raises(Refusal, match="none away from the first"):
        shifts(columns)
    nothing = SimpleNamespace(kind=["CC"], first_row=[0], last_row=[9])
    with pytest.raises(Refusal, match="no rest in the record"):
        chamber_shifts(series_of(*columns), np.zeros(len(columns[0])), nothing)


def test_temperature_is_the_surface_then_the_chamber():
    surface, around = np.array([1.0]), np.array([2.0])
    both = {"surface_temperature_celsius": surface, "ambient_temperature_celsius": around}
    assert cell_temperature(both) == surface
    both["surface_temperature_celsius"] = np.array([np.nan])
    assert cell_temperature(both) == around
    with pytest.raises(Refusal, match="no temperature was recorded"):
        cell_temperature({})


def test_plateaus_leave_the_way_between_out():
    time, celsius = chamber()
    plateaus = plateaus_of(time, celsius)
    assert len(plateaus) == len(LEVELS) + 1
    assert np.allclose([p.celsius for p in plateaus[:-1]], LEVELS, atol=0.4)
    assert plateaus_of(time[:5], celsius[:5]) == []


def test_an_exponential_is_carried_on():
    time = np.arange(0, 20 * HOUR, 60.0)
    volt = 3.0 + 0.01 * np.exp(-time / (4 * HOUR))
    used = [(60, 600)]
    carried, std, _ = extrapolated(time, volt, used, np.array([15 * HOUR]), known_until=10 * HOUR)
    assert carried[0] == pytest.approx(3.0 + 0.01 * np.exp(-15 / 4), abs=6e-5)
    assert std[0] >= 0.01 * (np.exp(-10 / 4) - np.exp(-15 / 4)) / np.sqrt(3) * 0.9
