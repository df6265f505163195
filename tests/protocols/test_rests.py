"""Every rest of a record: truth recovered within its intervals, and each reason by name."""

import numpy as np
import pytest

from cellwright.protocols.rests import chamber_or_cell, example, rests_of
from cellwright.series.steps import segment

R = np.array([0.004, 0.003])
TAU = np.array([60.0, 550.0])
LOAD = 720.0
NOISE = 2e-4


def record(seed=0, *, sign=-1, rest=2400.0, tau=TAU, r=R, noise=NOISE, grain=0.0, step=2.0):
    """Rest, 5 A for 720 s, rest, of a cell of RC pairs: (time, current, voltage)."""
    load, after = np.arange(10.0, 10.0 + LOAD, 1.0), np.arange(0.0, rest, step)
    time = np.concatenate([[0.0, 5.0, 9.99], load, 10 + LOAD + 0.01 + after])
    current = np.where((time >= 10) & (time < 10 + LOAD), 5.0 * sign, 0.0)
    since, off = np.clip(time - 10, 0, LOAD), np.clip(time - 10 - LOAD, 0, None)
    pairs = r * (1 - np.exp(-since[:, None] / tau)) * np.exp(-off[:, None] / tau)
    voltage = 3.7 + 0.002 * current + 5.0 * sign * pairs.sum(axis=1)
    voltage += noise * np.random.default_rng(seed).normal(size=len(time))
    return time, current, np.round(voltage / grain) * grain if grain else voltage


def rests(time, current, voltage, **settings):
    charge = np.concatenate([[0.0], np.cumsum(current[:-1] * np.diff(time))]) / 3600
    steps = segment(time, current, voltage, charge, rated_capacity_ampere_hour=10.0)
    return rests_of(time, current, voltage, 0.5 + charge / 10, steps, **settings)


def only(rests_fitted):
    """The chosen row of the only rest, as a dict."""
    (row,) = np.flatnonzero(rests_fitted.rows["chosen"])
    return {name: values[row] for name, values in rests_fitted.rows.items()}


@pytest.mark.parametrize(("sign", "direction"), [(-1, "discharge"), (1, "charge")])
def test_both_pairs_are_recovered_after_either_direction(sign, direction):
    row = only(rests(*record(sign=sign)))
    assert (row["direction"], row["load"], row["exponentials"]) == (direction, "CC", 2)
    assert row["current_before_ampere"] == pytest.approx(5.0 * sign, rel=1e-3)
    assert row["load_second"] == pytest.approx(LOAD, abs=2)
    assert row["soc"] == pytest.approx(0.5 + sign * 0.1, abs=1e-3)
    assert abs(row["tau1_second"] - TAU[0]) < 3.5 * row["tau1_std_second"]
    assert abs(row["tau2_second"] - TAU[1]) < 3.5 * row["tau2_std_second"]
    assert abs(row["ocv_volt"] - 3.7) < 3.5 * row["ocv_std_volt"]
    assert np.sign(row["a_volt"]) == np.sign(row["b_volt"]) == sign
    assert [row["r1_ohm"], row["r2_ohm"]] == pytest.approx(R, rel=0.08)
    assert row["r_squared"] > 0.98
    assert row["reason"] == ""


@pytest.mark.slow
def test_intervals_cover():
    """a, b, tau1, tau2 and the OCV lie within 1.96 deviations in 95 % of 60 records."""
    truth = -5 * R * (1 - np.exp(-LOAD / TAU))
    wanted = dict(zip(("a_volt", "b_volt"), truth, strict=True))
    wanted |= {"tau1_second": TAU[0], "tau2_second": TAU[1], "ocv_volt": 3.7}
    inside = []
    for seed in range(60):
        rows = rests(*record(seed, step=5.0)).rows
        two = int(np.flatnonzero(rows["exponentials"] == 2)[0])
        inside.append([_covered(rows, two, name, value) for name, value in wanted.items()])
    assert np.abs(np.mean(inside, axis=0) - 0.95).max() < 0.085


def _covered(rows, row, name, value):
    stem, unit = name.rsplit("_", 1)
    return abs(rows[name][row] - value) < 1.96 * rows[f"{stem}_std_{unit}"][row]


def test_a_third_time_constant_is_said_and_chosen():
    result = rests(*record(tau=np.array([6.0, 60, 700]), r=np.array([0.006, 0.003, 0.003])))
    assert result.rows["exponentials"].tolist() == [2, 3]
    assert result.rows["chosen"].tolist() == [False, True]
    row = only(result)
    assert "three time constants are visible (" in row["reason"]
    for name, value in (("fast_tau", 6), ("tau1", 60), ("tau2", 700)):
        assert abs(row[f"{name}_second"] - value) < 3.5 * row[f"{name}_std_second"]
    assert result.rows["r_squared"][1] > result.rows["r_squared"][0]


def test_two_of_them_alone_mistake_the_fast_one_in_the_cold():
    """Why a third is fitted: a pair that grows faster than the others pulls tau1 down."""
    cold = np.array([8.0, 90, 1000])
    taus = [
        rests(*record(tau=cold, r=np.array([fast, 0.003, 0.003]))).rows for fast in (0.001, 0.02)
    ]
    two = [rows["tau1_second"][rows["exponentials"] == 2][0] for rows in taus]
    three = [rows["tau1_second"][rows["exponentials"] == 3][0] for rows in taus]
    assert two[1] < 0.5 * two[0]
    assert three == pytest.approx([90, 90], rel=0.25)


def test_a_rest_shorter_than_the_slow_time_constant():
    row = only(rests(*record(rest=650.0, tau=np.array([60.0, 6000.0]), noise=5e-4)))
    assert "two time constants are not told" in row["reason"] or "drifting" in row["reason"]
    assert row["drift_volt"] != 0


@pytest.mark.parametrize("grain", [3e-4, 1e-3])
def test_a_coarse_logger_is_no_bias(grain):
    row = only(rests(*record(grain=grain, noise=grain / 3)))
    assert row["noise_volt"] >= 0.25 * grain
    assert row["ocv_volt"] == pytest.approx(3.7, abs=max(4 * row["ocv_std_volt"], grain / 3))
    assert row["a_volt"] == pytest.approx(-0.02, rel=0.15)


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"grain": 1e-3, "r": R / 6, "noise": 1e-5}, "quantised: "),
        ({"noise": 2e-3}, "mV allows no R² above 0."),
        ({"r": R / 40, "noise": 5e-4}, "too small for the noise"),
    ],
)
def test_what_keeps_r_squared_below_its_limit_is_said(settings, reason):
    row = only(rests(*record(**settings)))
    assert row["r_squared"] < 0.98
    assert reason in row["reason"]
    if settings["noise"] == 2e-3:
        assert row["noise_volt"] == pytest.approx(2e-3, rel=0.15)


def test_a_hole_in_the_rest_does_not_move_the_answer():
    time, current, voltage = record(3)
    kept = (time < 1200) | (time > 1400)
    row = only(rests(time[kept], current[kept], voltage[kept]))
    assert abs(row["tau2_second"] - TAU[1]) < 3.5 * row["tau2_std_second"]


def test_after_a_gap_there_is_no_rest_to_fit():
    time, current, voltage = record()
    kept = (time < 1000) | (time > 1800)
    result = rests(time[kept], current[kept], voltage[kept])
    assert len(result.rows["rest"]) == 0
    assert result.notes == ("no rest after a load lasts 600 s: no depolarisation",)
    assert example(result.rows, time, voltage)["time_second"].size == 0


def test_true_time_stamps_count():
    """Every other sample of the rest dropped at random: the same time constants."""
    time, current, voltage = record(5, noise=5e-5)
    kept = (time < 740) | (np.random.default_rng(1).random(len(time)) < 0.5)
    row = only(rests(time[kept], current[kept], voltage[kept]))
    assert row["tau1_second"] == pytest.approx(TAU[0], rel=0.05)
    assert row["tau2_second"] == pytest.approx(TAU[1], rel=0.05)


def test_a_first_sample_of_the_edge_is_left_out():
    time, current, voltage = record(noise=5e-5, step=1.0)
    first = int(np.flatnonzero(time > 10 + LOAD)[0])
    voltage[first] -= 0.018
    row = only(rests(time, current, voltage))
    assert row["delay_second"] > 1.0
    assert row["a_volt"] == pytest.approx(-0.02, rel=0.05)


@pytest.mark.parametrize("ahead", [1, 3])
def test_last_samples_that_show_the_next_load_are_left_out(ahead):
    """The clock of the voltage is ahead of that of the current by so many samples."""
    time, current, voltage = record(noise=5e-5, step=1.0)
    expected = only(rests(time, current, voltage))
    last = int(np.flatnonzero(current == 0)[-1])
    voltage[last - ahead + 1 : last + 1] -= 0.03
    row = only(rests(time, current, voltage))
    assert row["samples"] == expected["samples"] - ahead
    assert row["ocv_volt"] == pytest.approx(expected["ocv_volt"], abs=2e-4)


def test_a_rest_ends_where_the_chamber_moves():
    time, current, voltage = record(noise=5e-5)
    warm = np.where(time > 2000, 15.0, 20.0)
    moved = voltage + np.where(time > 2000, 0.02, 0.0)
    row = only(rests(time, current, moved, temperature_celsius=warm))
    assert row["temperature_celsius"] == 20.0
    assert row["rest_second"] < 2000 - 730 + 5
    assert row["ocv_volt"] == pytest.approx(3.7, abs=5e-4)
    early = rests(time, current, voltage, temperature_celsius=np.where(time > 900, 15.0, 20.0))
    assert early.notes == ("1 × temperature moves by 3 K within the first 600 s",)


def test_a_leak_is_no_load():
    time, current, voltage = record()
    weak = rests(time, current * 0.01, voltage)
    assert len(weak.rows["rest"]) == 0


def test_the_chamber_tells_before_the_cell():
    cell, chamber = np.ones(3), np.zeros(3)
    both = {"surface_temperature_celsius": cell, "ambient_temperature_celsius": chamber}
    assert chamber_or_cell(both) is chamber
    assert chamber_or_cell({"surface_temperature_celsius": cell}) is cell
    assert chamber_or_cell({}) is None


def test_the_example_is_the_fit():
    time, current, voltage = record(noise=5e-5)
    result = rests(time, current, voltage)
    curve = example(result.rows, time, voltage)
    assert np.sqrt(np.mean((curve["voltage_volt"] - curve["fitted_volt"]) ** 2)) < 1e-4
    assert curve["soc"][0] == result.rows["soc"][0]
