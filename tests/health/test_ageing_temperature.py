"""Fade, temperature and daily cycle: truth recovered, intervals honest, nothing from nothing."""

import numpy as np
import pytest

from cellwright.health.ageing import cycle_temperature, law_rows, reading_noise
from cellwright.numerics.lines import coloured_line
from cellwright.numerics.periods import periods
from cellwright.numerics.statistics import t_interval
from cellwright.refusal import Refusal


def record(count=29, *, slope=0.0025, fade=0.01, swing=4.0, noise=0.0, memory=0.0, seed=0, lag=0.0):
    """Discharges of a 20 Ah cell every 3.5 h in a room that swings once a day."""
    random, hour = np.random.default_rng(seed), 3.5 * np.arange(count)
    room = 24 + swing / 2 * np.cos(2 * np.pi * (hour - 8) / 24)
    cell = 24 + swing / 2 * np.cos(2 * np.pi * (hour - 8 - lag) / 24)
    draws = random.standard_normal(count)
    for k in range(1, count):
        draws[k] = memory * draws[k - 1] + np.sqrt(1 - memory**2) * draws[k]
    faded = 1 - fade * np.arange(count) / max(count - 1, 1)
    share = faded * (1 + slope * (cell - 24) + noise * draws)
    unknown = np.full(count, np.nan)
    return {
        "cycle": np.arange(1.0, count + 1),
        "direction": np.full(count, "discharge"),
        "start_time_second": 3600 * hour,
        "duration_second": np.full(count, 3600.0),
        "c_rate": np.ones(count),
        "capacity_ampere_hour": 20 * share,
        "energy_watt_hour": 74 * share,
        "coulombic_efficiency": np.full(count, 0.999),
        "room_temperature_celsius": room,
        "temperature_start_celsius": unknown,
        "temperature_mean_celsius": unknown,
    }


def test_the_thesis_example():
    """29 cycles, 4 K: about 1 % of 20 Ah (thesis 3.1); the fade is what is left."""
    summary, *_ = cycle_temperature(record(noise=1e-4))
    assert summary["temperature_source"] == "room"
    assert summary["slope_percent_per_kelvin"] == pytest.approx(0.25, abs=0.01)
    assert summary["swing_kelvin"] == pytest.approx(4, abs=0.2)
    assert summary["loss_percent"] == pytest.approx(1.0, abs=0.1)
    assert summary["best_period_hour"] == pytest.approx(24, abs=1.5)
    assert summary["daily_percent"] == pytest.approx(0.5, abs=0.03)
    assert summary["daily_false_alarm"] < 0.01
    assert summary["daily_left_percent"] < 0.05
    assert summary["daily_peak_hour"] == pytest.approx(8, abs=0.5)
    slope = next(r for r in law_rows(summary, test="room") if r["parameter"] == "temperature_slope")
    assert (slope["unit"], slope["law"]) == ("%/degC", "fade and temperature")
    assert slope["value"] == summary["slope_percent_per_kelvin"]


@pytest.mark.slow
@pytest.mark.parametrize("memory", [0.0, 0.6, 0.9])
def test_the_interval_covers_as_often_as_it_says_whatever_the_memory(memory):
    place, hits = np.arange(29.0), []
    for seed in range(120):
        rows = record(noise=0.002, memory=memory, seed=seed)
        columns = np.column_stack([np.ones(29), place, rows["room_temperature_celsius"] - 24])
        line = coloured_line(columns, rows["capacity_ampere_hour"], place)
        low, high = t_interval(line.values[2], line.std[2], line.degrees_of_freedom)
        hits.append(low <= 0.05 <= high)
    assert 0.9 <= np.mean(hits) <= 0.99


def test_a_cell_that_follows_its_room_late():
    summary, *_ = cycle_temperature(record(lag=1.5, noise=1e-4))
    assert summary["slope_percent_per_kelvin"] == pytest.approx(0.25, rel=0.1)
    assert summary["daily_left_percent"] < 0.05


def with_charges(rows, *, swing=4.0, reading=0.0, seed=0):
    """The same record with a charge after each discharge; the room is read with an error [K]."""
    hour = rows["start_time_second"] / 3600
    every = np.interp(np.arange(2 * len(hour)) / 2, np.arange(len(hour)), hour)
    every[-1] += 1.75
    room = 24 + swing / 2 * np.cos(2 * np.pi * (every - 8) / 24)
    room += reading * np.random.default_rng(seed + 1000).standard_normal(len(room))
    doubled = {name: np.repeat(column, 2) for name, column in rows.items()}
    doubled["direction"][1::2] = "charge"
    doubled |= {"start_time_second": 3600 * every, "room_temperature_celsius": room}
    return doubled


@pytest.mark.parametrize("lag", [0.5, 1.0, 2.0])
def test_a_lag_takes_nothing_from_the_slope(lag):
    """dT/dt beside T would take (2π lag/24 h)²: 2, 7 and 27 % of it."""
    summary, *_ = cycle_temperature(with_charges(record(lag=lag, noise=5e-5)))
    limits = [summary[f"slope_{end}_percent_per_kelvin"] for end in ("lower", "upper")]
    assert limits[0] < 0.25 < limits[1]
    assert summary["slope_percent_per_kelvin"] == pytest.approx(0.25, rel=0.04)
    assert summary["daily_left_percent"] < 0.02


def test_a_cell_that_has_lost_much_has_the_same_slope():
    summary, *_ = cycle_temperature(record(fade=0.3, noise=1e-5))
    assert summary["slope_percent_per_kelvin"] == pytest.approx(0.25, rel=5e-3)
    assert summary["loss_percent"] == pytest.approx(30, rel=0.05)


@pytest.mark.slow
def test_readings_with_an_error_do_not_shrink_the_slope():
    hits = []
    for seed in range(8):
        rows = with_charges(record(noise=2e-4, seed=seed), reading=0.3, seed=seed)
        room = rows["room_temperature_celsius"]
        assert reading_noise(rows["start_time_second"] / 3600, room) == pytest.approx(0.3, rel=0.35)
        summary, *_ = cycle_temperature(rows)
        limits = [summary[f"slope_{end}_percent_per_kelvin"] for end in ("lower", "upper")]
        hits.append(limits[0] <= 0.25 <= limits[1])
    assert sum(hits) >= 7


def test_a_reading_worse_than_the_movement_tells_no_slope():
    rows = with_charges(record(swing=0.7, noise=1e-3), swing=0.7, reading=0.25)
    summary, *_ = cycle_temperature(rows)
    assert np.isnan(summary["slope_percent_per_kelvin"])
    assert "read to" in summary["reason"]


def test_capacities_are_carried_to_the_mean_temperature():
    _, cycles, _ = cycle_temperature(record(fade=0.0, noise=1e-5))
    carried = cycles["capacity_at_reference_ampere_hour"]
    assert np.ptp(carried) < 0.01 * np.ptp(cycles["capacity_ampere_hour"])


def test_a_constant_temperature_is_not_excited():
    summary, *_ = cycle_temperature(record(swing=0.1, noise=1e-3))
    assert np.isnan(summary["slope_percent_per_kelvin"])
    assert "not excited" in summary["reason"]
    assert summary["loss_percent"] == pytest.approx(1.0, abs=0.5)


def test_without_a_temperature_the_daily_cycle_is_still_found():
    rows = record(noise=3e-4)
    rows["room_temperature_celsius"] = np.full(29, np.nan)
    summary, *_ = cycle_temperature(rows)
    assert "no temperature was recorded" in summary["reason"]
    assert summary["daily_false_alarm"] < 0.01
    rows = {row["parameter"]: row for row in law_rows(summary, test="room")}
    assert rows["daily_amplitude"]["value"] == summary["daily_percent"]
    assert "temperature_slope" not in rows


@pytest.mark.slow
def test_without_a_daily_cycle_none_is_found():
    chances = [
        cycle_temperature(record(slope=0.0, noise=1e-3, memory=0.7, seed=k))[0] for k in range(8)
    ]
    assert np.mean([summary["daily_false_alarm"] < 0.05 for summary in chances]) < 0.35
    assert np.mean([summary["false_alarm"] < 0.05 for summary in chances]) < 0.35


def test_a_short_record_tells_no_daily_cycle():
    summary, *_ = cycle_temperature(record(12))
    assert np.isnan(summary["daily_percent"])
    assert "a daily cycle needs two days" in summary["reason"]


def test_a_wild_cycle_and_one_without_its_charge_are_set_aside():
    rows = record(noise=1e-4)
    capacity, efficiency = rows["capacity_ampere_hour"].copy(), rows["coulombic_efficiency"].copy()
    capacity[[0, 12]] = 21.0, 12.0
    efficiency[0] = np.nan
    rows |= {"capacity_ampere_hour": capacity, "coulombic_efficiency": efficiency}
    summary, cycles, _ = cycle_temperature(rows)
    assert summary["set_aside"] == 3
    # The second as well: it began where the first, whose charge nobody knows, had ended.
    assert np.flatnonzero(~cycles["used"]).tolist() == [0, 1, 12]
    assert summary["slope_percent_per_kelvin"] == pytest.approx(0.25, abs=0.01)


def test_too_few_cycles_are_refused():
    with pytest.raises(Refusal, match=r"0 complete discharge\(s\) after a complete cycle"):
        cycle_temperature(record(1))


def test_sparse_values_tell_no_daily_cycle():
    hour = 12.0 * np.arange(20)
    assert "needs three a day" in periods(hour, hour, np.ones((20, 1))).reason
