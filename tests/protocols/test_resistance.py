"""Pulse resistance of a made cell with closed-form truth, and of measured ones."""

import numpy as np
import pandas as pd
import pytest
from counted import counted, measured, series_of
from hypothesis import given, settings
from hypothesis import strategies as st

from cellwright.protocols.resistance import pulse_resistance
from cellwright.refusal import Refusal
from cellwright.series.steps import Steps, segment

R0, R1, TAU = 0.020, 0.015, 8.0


def truth(delay):
    """Resistance of the made cell at a delay after the edge, in closed form [ohm]."""
    return R0 + R1 * (1 - np.exp(-delay / TAU))


def pulse(*, level=-5.0, base=0.0, seconds=15.0, step=0.1, noise=0.0, grain=0.0, lead=60.0, seed=3):
    """One pulse on a load that had settled: the answer of one RC pair is exact."""
    time = np.arange(0, lead + seconds + 60, step)
    edge, end = lead - step, lead + seconds - step  # the edge lies just after these samples
    on = (time > edge + 1e-9) & (time <= end + 1e-9)
    current = np.where(on, level, base)
    up = np.where(time > edge, 1 - np.exp(-(time - edge) / TAU), 0)
    down = np.where(time > end, 1 - np.exp(-(time - end) / TAU), 0)
    voltage = 3.7 + base * (R0 + R1) + (level - base) * (R1 * (up - down) + R0 * on)
    voltage = voltage + np.random.default_rng(seed).normal(0, noise, len(time))
    return time, current, np.round(voltage / grain) * grain if grain else voltage


def measure(time, current, voltage, *, rated=3.0, delays=(0, 1, 10), soc=None):
    charge = counted(time, current)
    steps = segment(time, current, voltage, charge, rated_capacity_ampere_hour=rated)
    soc = 0.5 + charge / rated if soc is None else soc
    about = {"rated_capacity_ampere_hour": rated, "delay_second": delays}
    return pulse_resistance(series_of(time, current, voltage), soc, steps, **about)


@pytest.mark.parametrize("level", [-5.0, 3.0])
def test_known_resistance_at_every_delay(level):
    rows = measure(*pulse(level=level)).rows
    assert np.allclose(rows["actual_delay_second"], [0.1, 1, 10])
    assert np.allclose(rows["resistance_ohm"], truth(np.array([0.1, 1, 10])), rtol=1e-6)
    assert set(rows["direction"]) == {"charge" if level > 0 else "discharge"}
    assert np.allclose(rows["soc"], 0.5)
    assert np.allclose(rows["c_rate"], abs(level) / 3)


def test_a_current_read_coarsely_says_so_and_its_interval_holds_what_it_hides():
    time, current, voltage = pulse(level=-2.34)
    rows = measure(time, np.round(current, 1), voltage).rows
    off = np.abs(rows["resistance_ohm"] - truth(rows["actual_delay_second"]))
    assert np.all(off <= 2 * rows["resistance_std_ohm"])
    assert np.all(np.char.find(rows["doubt"], "read so coarsely") >= 0)


@pytest.mark.parametrize("noisy", [True, False])
def test_what_the_noise_leaves_open_is_no_doubt_of_a_small_resistance(noisy):
    """0.3 mOhm of 3 Ah are those of no cell; a noise of 3 mV at 5 A leaves 2 mOhm open."""
    time, current, voltage = pulse(level=-5.0)
    noise = 0.003 * np.random.default_rng(2).standard_normal(len(time))
    voltage = 3.7 + 0.0003 * current + noise * noisy
    rows = measure(time, current, voltage).rows
    said = np.char.find(rows["doubt"], "of another size") >= 0
    assert not said.any() if noisy else said.all()


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_step_whose_current_does_not_step_is_refused_and_divides_by_nothing():
    time, current, voltage = pulse(level=-5.0)
    steps = segment(time, current, voltage, 0 * time, rated_capacity_ampere_hour=3.0)
    about = {"rated_capacity_ampere_hour": 3.0, "delay_second": (0, 1)}
    with pytest.raises(Refusal, match="current does not step into the pulse"):
        pulse_resistance(series_of(time, 0 * current, voltage), 0 * time, steps, **about)
    # Back at what was before it within the pulse: no ratio there, the others stay.
    row = int(np.flatnonzero(current)[40])
    current[row] = 0.0
    found = pulse_resistance(series_of(time, current, voltage), 0 * time, steps, **about)
    assert np.allclose(found.rows["resistance_ohm"], truth(np.array([0.1, 1])), rtol=1e-3)


def test_c_rates_under_ampere_are_told_by_their_roundness_and_their_answer():
    time, current, voltage = pulse(level=-7.5)  # 1.5C of 5 Ah
    (said,) = set(measure(time, current / 5, voltage, rated=5.0).rows["doubt"])
    volt = f"{25 * truth(0.55):.2g} V"
    asks = "does the file hold C-rates in place of ampere?"
    assert said == f"1C would move the voltage by {volt} at once: {asks}"
    assert not any(measure(time, current, voltage, rated=5.0).rows["doubt"])
    # A round current of a cell whose resistance is usual says nothing.
    time, current, voltage = pulse(level=-1.0)
    assert not any(measure(time, current, voltage, rated=3.3).rows["doubt"])


def test_pulse_on_a_running_discharge_is_referred_to_it():
    rows = measure(*pulse(level=-6.0, base=-1.0)).rows
    assert np.allclose(rows["resistance_ohm"], truth(np.array([0.1, 1, 10])), rtol=1e-6)
    assert np.allclose(rows["c_rate"], 5 / 3)


@pytest.mark.parametrize(
    ("base", "level", "direction"),
    [
        (0.9, 0.34, "falling charge"),
        (-0.9, -0.34, "falling discharge"),
        (0.34, 0.9, "charge"),
        (-0.34, -0.9, "discharge"),
        (0.9, -0.34, "discharge"),
        (-0.9, 0.34, "charge"),
    ],
)
def test_direction_is_what_flows_and_a_falling_load_is_neither(base, level, direction):
    rows = measure(*pulse(base=base, level=level)).rows
    assert set(rows["direction"]) == {direction}
    assert np.allclose(rows["current_ampere"], level)
    assert np.allclose(rows["resistance_ohm"], truth(np.array([0.1, 1, 10])), rtol=1e-6)


def test_two_pieces_of_one_unsteady_load_tell_no_resistance():
    """samsung30q: a charge of 0.30 A was cut in two; its second piece is 3 mA lower."""
    time, current, voltage = pulse(level=0.3)
    cut = int(np.searchsorted(time, 65.0))
    current[cut:][current[cut:] > 0] -= 0.003
    whole = segment(time, current, voltage, 0 * time + 1e-3 * time, rated_capacity_ampere_hour=3.0)
    steps = Steps(*(np.repeat(column, [1, 2, 1]) for column in whole))
    steps.last_row[1], steps.first_row[2] = cut - 1, cut
    steps.end_time_second[1] = steps.start_time_second[2] = time[cut - 1]
    about = {"rated_capacity_ampere_hour": 3.0, "delay_second": (0, 1)}
    found = pulse_resistance(series_of(time, current, voltage), 0 * time, steps, **about)
    assert found.rows["direction"].tolist() == ["charge", "charge"]
    assert np.allclose(found.rows["resistance_ohm"], truth(np.array([0.1, 1])))
    assert found.notes == ("2 × current does not step into the pulse",)


def test_instantaneous_waits_for_nine_tenths_of_the_current():
    time, current, voltage = pulse()
    current[600], voltage[600] = -2.0, voltage[599] - 2.0 * R0
    rows = measure(time, current, voltage, delays=(0,)).rows
    assert np.isclose(rows["actual_delay_second"][0], 0.2)
    assert np.isclose(rows["resistance_ohm"][0], truth(0.2))


def test_voltage_that_moves_before_the_current():
    """lgm50: the last rest sample holds the voltage of the pulse already."""
    time, current, voltage = pulse()
    current[600] = 0.0
    rows = measure(time, current, voltage, delays=(10,)).rows
    assert np.isclose(rows["voltage_before_volt"][0], 3.7)
    assert np.isclose(rows["resistance_ohm"][0], truth(10), rtol=0.01)


def test_sparse_rest_before_does_not_shift_the_edge():
    time, current, voltage = pulse()
    kept = (time >= 59.95) | (np.arange(len(time)) % 400 == 0)
    rows = measure(time[kept], current[kept], voltage[kept]).rows
    assert np.allclose(rows["resistance_ohm"], truth(np.array([0.1, 1, 10])), rtol=1e-6)


def test_stated_deviation_is_that_of_the_error():
    resistances = [
        measure(*pulse(noise=0.001, grain=0.0005, seed=seed), delays=(10,)).rows
        for seed in range(60)
    ]
    error = np.array([rows["resistance_ohm"][0] - truth(10) for rows in resistances])
    stated = np.array([rows["resistance_std_ohm"][0] for rows in resistances])
    assert 0.75 < np.std(error) / stated.mean() < 1.25
    assert np.mean(np.abs(error) < 2 * stated) > 0.85


def test_ends_of_the_pulse_are_counted_as_reasons():
    resistances = measure(*pulse(seconds=5.0), delays=(0, 10, 30))
    assert resistances.rows["delay_second"].tolist() == [0]
    assert resistances.notes == ("1 × pulse ends before 10 s", "1 × pulse ends before 30 s")


def test_coarse_sampling_gives_no_early_delay():
    resistances = measure(*pulse(seconds=60, step=10.0), delays=(1, 10, 30))
    assert resistances.rows["delay_second"].tolist() == [10, 30]
    assert "later than 1 s" in resistances.notes[0]


def test_current_that_is_not_held_gives_no_late_delay():
    time, current, voltage = pulse()
    falls = (time > 65) & (current < 0)
    current[falls] *= np.exp(-(time[falls] - 65) / 10)
    voltage[falls] = voltage[np.argmax(falls) - 1]
    resistances = measure(time, current, voltage)
    assert resistances.rows["delay_second"].tolist() == [0, 1]
    assert "not held until 10 s" in resistances.notes[0]


@settings(max_examples=20, deadline=None)
@given(sign=st.sampled_from([-1, 1]), size=st.floats(0.1, 50))
def test_sign_and_size_of_the_cell(sign, size):
    time, current, voltage = pulse()
    mirrored = 3.7 + sign * (voltage - 3.7)
    rows = measure(time, sign * size * current, mirrored, rated=3.0 * size).rows
    assert np.allclose(size * rows["resistance_ohm"], truth(np.array([0.1, 1, 10])))


def test_refusals():
    time, current, voltage = pulse()
    with pytest.raises(Refusal, match="has no pulse"):
        measure(time, 0 * current, voltage)
    with pytest.raises(Refusal, match="voltage does not move with the current"):
        measure(time, current, 3.7 - 0.1 * (voltage - 3.7))


@pytest.mark.parametrize(
    ("place", "ten"), [("25C", 37.3), ("10C", 52.0), ("0C", 79.7), ("n10C", 129.8)]
)
def test_published_panasonic(shared, place, ten):
    path = shared / f"campaigns/panasonic/raw/hppc/hppc_{place}.parquet"
    soc = 1 + pd.read_parquet(path)["Net Capacity / Ah"].to_numpy() / 2.9  # it has holes
    rows = measure(*measured(path)[:3], rated=2.9, soc=soc, delays=(10,)).rows
    half = (np.abs(rows["c_rate"] - 1) < 0.05) & (np.abs(rows["soc"] - 0.5) < 0.02)
    assert np.allclose(1e3 * rows["resistance_ohm"][half], ten, rtol=0.005)


@pytest.mark.parametrize(
    ("place", "cell", "published"),
    [("25C", 1, 36.2), ("45C", 8, 29.4), ("45C", 9, 47.2), ("10C", 15, 38.4), ("0C", 24, 53.7)],
)
def test_published_lgm50(shared, place, cell, published):
    path = shared / f"campaigns/lgm50/raw/pulses/{place}/Cell{cell}_SoC5.csv.gz"
    rows = measure(*measured(path)[:3], rated=5.0, delays=(10,)).rows
    assert np.isclose(1e3 * rows["resistance_ohm"][0], published, rtol=0.01)


@pytest.mark.parametrize("name", ["sample_hppc_pulse", "multipulse_hppc"])
def test_published_samsung30t(shared, name):
    columns = measured(shared / f"campaigns/samsung30t_pybop/raw/{name}.csv.gz", -1)
    rows = measure(*columns[:3], delays=(0, 1, 10)).rows
    assert set(rows["direction"][:3]) == {"discharge"}
    assert np.allclose(1e3 * rows["resistance_ohm"][:3], [7.34, 12.9, 20.7], rtol=0.003)
    assert np.all((rows["current_ampere"] > 0) == (rows["direction"] == "charge"))


def test_a_channel_of_two_ranges_has_the_digit_of_its_usual_step(shared):
    """panasonic: steps of 0.64 and of 0.5 mV in one record; most rows repeat the one before."""
    path = shared / "campaigns/panasonic/raw/hppc/hppc_25C.parquet"
    rows = measure(*measured(path)[:3], rated=2.9, delays=(10,)).rows
    hidden_ohm = np.sqrt(2 / 12) * 0.64e-3 / np.abs(rows["current_ampere"])
    assert np.all(rows["resistance_std_ohm"] > 0.9 * hidden_ohm)


def test_long_loads_serve_where_there_is_no_pulse(shared):
    columns = measured(shared / "campaigns/dmegc/raw/R1/pulses.csv.gz", -1)
    rows = measure(*columns[:3], rated=2.6, delays=(10,)).rows
    assert len(rows["soc"]) == 11
    assert np.all((rows["resistance_ohm"] > 0.03) & (rows["resistance_ohm"] < 0.06))


@pytest.mark.parametrize("level", [-5.0, 5.0])
@pytest.mark.parametrize("rested", [20.0, 40.0, 120.0])
def test_relaxation_that_goes_on_in_a_pulse_is_taken_off(level, rested):
    """A load of ten minutes ends some seconds before the pulse; the cell has two RC pairs."""
    pairs = ((0.012, 20.0), (0.010, 300.0))
    time = np.arange(0.0, 60 + 600 + rested + 15, 0.1)
    edges = (60.0 - 0.1, 660.0 - 0.1, 660.0 + rested - 0.1)

    def response(since):
        on = since > 1e-9
        part = sum(r * -np.expm1(-np.maximum(since, 0) / tau) for r, tau in pairs)
        return np.where(on, R0 + part, 0.0)

    jumps = (-2.5, 2.5, level)
    current = sum(jump * (time > edge + 1e-9) for jump, edge in zip(jumps, edges, strict=True))
    voltage = 3.7 + sum(
        jump * response(time - edge) for jump, edge in zip(jumps, edges, strict=True)
    )
    voltage = voltage + np.random.default_rng(4).normal(0, 2e-4, len(time))
    rows = measure(time, current, voltage, rated=5.0).rows
    last = rows["delay_second"] == 10
    true = float(response(np.array([10.0]))[0])
    found, std = rows["resistance_ohm"][last][-1], rows["resistance_std_ohm"][last][-1]
    assert abs(found - true) < 2 * std + 2e-5
    assert abs(found - true) < 0.01 * true
    # The wrong number it would be without.
    assert np.sign(rows["relaxation_ohm"][last][-1]) == np.sign(level)
