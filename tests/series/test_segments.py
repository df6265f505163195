"""Segmentation of made records with known steps, and of measured ones."""

import time as clock

import numpy as np
import pandas as pd
import pytest
from counted import counted, measured
from hypothesis import given
from hypothesis import strategies as st

from cellwright.refusal import Refusal
from cellwright.series.steps import assumed_rating, segment, silent_before

R0, R1, TAU = 0.020, 0.015, 30.0
LETTER = {"rest": ".", "CC": "C", "CV": "V", "CCCV": "B", "pulse": "p", "dynamic": "D"}


def record(*stretches, step=1.0, ocv=3.7):
    """A cell of one resistance and one RC pair under stretches of (seconds, ampere), exact."""
    current = np.concatenate([np.full(round(s / step), a) for s, a in stretches])
    time = np.arange(len(current)) * step
    decay = np.exp(-step / TAU)
    slow = np.zeros(len(current))
    for k in range(1, len(current)):
        slow[k] = decay * slow[k - 1] + R1 * (1 - decay) * current[k]
    voltage = ocv + R0 * current + slow
    return time, current, voltage, counted(time, current)


def word(steps):
    return "".join(LETTER[kind] for kind in steps.kind)


def held_charge():
    """Constant current to 4.2 V, then the voltage held while the current decays, then rest."""
    time = np.arange(0, 6000, 10.0)
    current = np.where(time < 3000, 1.0, np.exp(-(time - 3000) / 600))
    voltage = np.where(time < 3000, 3.6 + 0.2e-3 * time, 4.2)
    current[time < 100], current[time > 5000] = 0.0, 0.0
    voltage[time < 100] = 3.55
    return time, current, voltage, counted(time, current)


def test_pulse_train_with_set_point_discharge():
    data = record((600, 0), (10, -5), (40, 0), (10, 3.75), (1000, -1), (600, 0))
    steps = segment(*data, rated_capacity_ampere_hour=3.0)
    assert word(steps) == ".p.pC."
    assert steps.first_row.tolist() == [0, 600, 610, 650, 660, 1660]
    assert np.allclose(steps.current_mean_ampere, [0, -5, 0, 3.75, -1, 0], atol=1e-9)
    assert steps.voltage_before_volt[1] == data[2][599]


def test_steps_tile_the_record_and_its_charge():
    data = record((300, 0), (10, -5), (600, 0), (900, -1), (300, 0))
    steps = segment(*data, rated_capacity_ampere_hour=3.0)
    assert steps.first_row[0] == 0
    assert steps.last_row[-1] == len(data[0]) - 1
    assert np.array_equal(steps.first_row[1:], steps.last_row[:-1] + 1)
    assert np.isclose(steps.charge_ampere_hour.sum(), data[3][-1])


def test_charge_with_held_voltage_is_one_step():
    steps = segment(*held_charge(), rated_capacity_ampere_hour=2.0)
    assert word(steps) == ".B."
    assert abs(steps.cv_first_row[1] - 300) <= 2


def test_held_voltage_on_its_own():
    time = np.arange(0, 2000, 5.0)
    current = np.where(time < 200, 0, -np.exp(-(time - 200) / 400))
    voltage = np.where(time < 200, 3.0, 2.5)
    steps = segment(time, current, voltage, counted(time, current), rated_capacity_ampere_hour=2.0)
    assert word(steps) == ".V"


def test_step_down_of_a_fast_charge_is_an_edge():
    steps = segment(*record((200, 0), (400, 4), (400, 3), (200, 0)), rated_capacity_ampere_hour=2.0)
    assert word(steps) == ".CC."


def test_pulses_on_a_running_discharge():
    """Thesis S7: a short pulse every 15 s on a discharge is no dynamic load."""
    train = [(15, -1), (0.2, -6)] * 40
    steps = segment(*record((60, 0), *train, (60, 0), step=0.1), rated_capacity_ampere_hour=3.0)
    assert np.count_nonzero(steps.kind == "pulse") >= 39
    assert "dynamic" not in steps.kind


@pytest.mark.parametrize("seconds", [1, 8, 120])
def test_chain_of_many_levels_is_one_dynamic_step(seconds):
    rng = np.random.default_rng(0)
    chain = [(seconds, a) for a in rng.uniform(-6, 2, 30)]
    steps = segment(*record((900, 0), *chain, (900, 0)), rated_capacity_ampere_hour=3.0)
    assert word(steps) == ".D."


def test_noise_at_rest_and_under_load_makes_no_steps():
    time, current, voltage, charge = record((600, 0), (1200, -1.5), (600, 0))
    rng = np.random.default_rng(1)
    noisy = current + rng.normal(0, 0.004, len(current)) + (rng.random(len(current)) < 0.03) * 0.1
    voltage = voltage + rng.normal(0, 0.0015, len(voltage))
    assert word(segment(time, noisy, voltage, charge, rated_capacity_ampere_hour=3.0)) == ".C."


def test_rise_of_the_output_belongs_to_the_pulse():
    time, current, voltage, charge = record((60, 0), (10, 5), (60, 0), step=0.1)
    current[600:604] = [2.0, 3.5, 4.3, 4.8]
    steps = segment(time, current, voltage, charge, rated_capacity_ampere_hour=3.0)
    assert word(steps) == ".p."
    assert steps.first_row[1] == 600


def test_gap_and_file_joint_end_a_step():
    time, current, voltage, charge = record((400, 0), (400, -1))
    time[200:] += 5000
    files = (np.arange(800) >= 600).astype(int)
    steps = segment(
        time, current, voltage, charge, rated_capacity_ampere_hour=3.0, file_index=files
    )
    assert word(steps) == "..CC"
    assert steps.start_time_second[1] == time[200]


@pytest.mark.parametrize(("lost", "gaps"), [(230.0, 0), (900.0, 1)])
def test_a_slow_record_has_no_gap_where_its_tester_adds_rows_at_edges(lost, gaps):
    """Rows each 300 s, and one a few seconds before and after an interval of usual length."""
    time = np.concatenate([300.0 * np.arange(20), [5740.0], 5740.0 + lost + np.array([0.0, 5.0])])
    time = np.concatenate([time, time[-1] + 300.0 * np.arange(1, 20)])
    assert silent_before(time, 60.0).sum() == gaps


def test_slow_sampling_is_no_gap():
    time = np.append(np.arange(0, 100, 1.0), 100 + np.arange(0, 60000, 600.0))
    zero = np.zeros(len(time))
    current = np.where(time < 100, -1.0, 0.0)
    steps = segment(time, current, 3.7 + zero, zero, rated_capacity_ampere_hour=3.0)
    assert word(steps) == "p."


@given(sign=st.sampled_from([-1.0, 1.0]), size=st.floats(0.01, 100.0))
def test_size_and_sign_of_the_cell_do_not_matter(sign, size):
    time, current, voltage, charge = record((600, 0), (10, -5), (600, 0), (900, -1), (300, 0))
    mirrored = 3.7 + sign * (voltage - 3.7)
    steps = segment(
        time,
        sign * size * current,
        mirrored,
        sign * size * charge,
        rated_capacity_ampere_hour=3.0 * size,
    )
    assert word(steps) == ".p.C."
    assert steps.first_row.tolist() == [0, 600, 610, 1210, 2110]


def test_assumed_rating_needs_a_current():
    assert assumed_rating(np.array([0.0, -3.0]), np.array([0.0, -2.0])) == 2.0
    assert assumed_rating(np.array([0.0, -30.0]), np.array([0.0, -2.0])) == 10.0
    with pytest.raises(Refusal, match="no current flows"):
        segment(*record((100, 0)))


def test_refuses_few_rows_and_time_backwards():
    time, current, voltage, charge = record((100, 0), (100, -1))
    with pytest.raises(Refusal, match="at least 3"):
        segment(time[:2], current[:2], voltage[:2], charge[:2], rated_capacity_ampere_hour=1.0)
    with pytest.raises(Refusal, match="runs back"):
        segment(time[::-1], current, voltage, charge, rated_capacity_ampere_hour=1.0)


@pytest.mark.parametrize(
    ("path", "sign", "rated", "expected"),
    [
        ("panasonic/raw/ocv/C20_25C.parquet", 1, 2.9, ".C.C.."),
        ("panasonic/raw/drive/udds_0C.parquet", 1, 2.9, "D."),
        ("dmegc/raw/R1/pulses.csv.gz", -1, 2.6, "." + "C." * 11),
        ("dmegc/raw/R1/random_01.csv.gz", -1, 2.6, ".D"),
        ("lgm50/raw/rate/25C_1C.parquet", 1, 5.0, ".C.B."),
        ("lgm50/raw/pulses/25C/Cell1_SoC5.csv.gz", 1, 5.0, ".p."),
        ("weng/raw/parallel_C10.csv.gz", 1, 2.5, ".B.B.B."),
        ("hidden_examples/raw/r1/capacity_25C.csv.gz", 1, 5.0, ".B.B."),
        ("hidden_examples/raw/h04/capacity_25C.csv.gz", 1, 5.0, ".B.B."),
        ("hidden_examples/raw/r1/hppc_25C.csv.gz", 1, 5.0, "." + "C.p.p." * 9),
        ("hidden_examples/raw/r1/drive_25C.csv.gz", 1, 5.0, ".D."),
    ],
)
def test_measured_records(shared, path, sign, rated, expected):
    data = measured(shared / "campaigns" / path, sign)
    assert word(segment(*data, rated_capacity_ampere_hour=rated)) == expected


def test_measured_train_with_gaps_and_speed(shared):
    data = measured(shared / "campaigns/panasonic/raw/hppc/hppc_25C.parquet")
    begun = clock.perf_counter()
    steps = segment(*data, rated_capacity_ampere_hour=2.9)
    assert clock.perf_counter() - begun < 0.5
    assert word(steps).count("p") == 67
    assert word(steps).count("..") == 13


def test_dither_does_not_fall_to_pieces(shared):
    files = [f"A123_OCV_P25_S{k}.csv.gz" for k in (1, 2, 3, 4)]
    tables = [pd.read_csv(shared / "campaigns/a123/raw/ocv" / name) for name in files]
    index = np.repeat(np.arange(4), [len(table) for table in tables])
    table = pd.concat(tables)
    time = table["Test_Time(s)"].to_numpy() + 1e6 * index
    current, voltage = table["Current(A)"].to_numpy(), table["Voltage(V)"].to_numpy()
    charge = counted(time, current)
    steps = segment(
        time, current, voltage, charge, rated_capacity_ampere_hour=2.3, file_index=index
    )
    long = steps.kind[steps.duration_second > 3600]
    assert list(long[long != "rest"]) == ["CC", "CC", "dynamic"]
    assert len(steps.step) < 30
