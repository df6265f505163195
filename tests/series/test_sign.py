"""The sign of the current from the data: right, or not told."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from cellwright import formats
from cellwright.formats import Reading
from cellwright.formats.fields import SERIES
from cellwright.refusal import Refusal
from cellwright.series import assemble
from cellwright.series.joining import charge_positive
from cellwright.series.sign import current_sign


def cell(current, *, dt=1.0, ohm=0.03, ah=2.0, soc=0.5, lag=0, noise=3e-4, seed=0):
    """Time, current and voltage of a cell whose voltage rises by 0.8 V over its charge."""
    time = dt * np.arange(current.size)
    charge = soc + np.cumsum(current) * dt / 3600 / ah
    drop = np.roll(ohm * current, lag)
    rng = np.random.default_rng(seed)
    return time, current, 3.3 + 0.8 * charge + drop + noise * rng.standard_normal(current.size)


def blocks(*levels, rows=600):
    return np.repeat(np.asarray(levels, dtype=float), rows)


def drive(seed=1, rows=3000):
    rng = np.random.default_rng(seed)
    return np.repeat(rng.normal(-1, 2, rows // 5), 5)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.sampled_from([-1, 0, 1, 2]), st.floats(0.1, 50))
def test_a_drive_tells_its_sign_either_way_round(seed, lag, scale):
    time, current, voltage = cell(drive(seed) * scale, ohm=0.03 / scale, ah=2 * scale, lag=lag)
    assert current_sign(time, current, voltage).sign == 1
    assert current_sign(time, -current, voltage).sign == -1


def test_trend_tells_where_nothing_steps():
    time, current, voltage = cell(blocks(-1, rows=2000), soc=1)
    sign = current_sign(time, current, voltage)
    assert sign.sign == 1
    assert sign.evidence > 0.95


def plain(seed):
    """A plain record of a chemistry: discharge, charge, cycles or pulses, and its true current.

    By other means than the search for the sign: an OCV with plateaus and ends, two RC pairs that
    are stepped finer than the rows, noise and digits of a common cycler.
    """
    random = np.random.default_rng(seed)
    soc = np.linspace(-0.05, 1.05, 400)
    empty, full = (
        np.exp(-np.clip(soc, 0.0, None) / 0.03),
        np.exp((np.clip(soc, None, 1.0) - 1) / 0.01),
    )
    ocv = {
        "nmc": 3.0 + 1.1 * soc - 0.05 * np.sin(6 * soc) - 0.35 * empty,
        "lfp": 3.3 + 0.03 * np.tanh((soc - 0.65) / 0.05) - 0.6 * empty + 0.25 * full,
        "lto": 2.35 + 0.12 * soc - 0.4 * empty + 0.3 * full,
        "sodium": 2.2 + 1.7 * soc,
        "sulphur": 2.1 + 0.25 * np.tanh(np.clip(soc - 0.75, 0.0, None) / 0.1) - 0.4 * empty,
    }[random.choice(["nmc", "lfp", "lto", "sodium", "sulphur"])]
    rate, ohm = np.exp(random.uniform(np.log([0.05, 2e-4]), np.log([3.0, 8e-2])))
    ampere, hours = 3.0 * rate, 1.0 / rate
    ohm = min(ohm, 0.2 / ampere)
    every = min(np.exp(random.uniform(np.log(0.1), np.log(300.0))), 3600 * hours / 12)
    rest, load = random.choice([0.0, 5 * every, 600.0]), 3600 * hours * random.uniform(0.3, 0.95)
    pulses = [(300, 0), (10, -ampere), (60, 0), (10, 0.75 * ampere), (60, 0), (load / 9, -ampere)]
    start, stretches = [
        (1.0, [(rest, 0), (load, -ampere), (rest, 0)]),
        (0.0, [(rest, 0), (load, ampere), (rest, 0)]),
        (1.0, [(rest, 0), (load, -ampere), (rest, 0), (load, ampere)]),
        (1.0, [(load, -ampere), (rest, 0), (load, ampere), (rest, 0)] * 3),
        (1.0, pulses * 5),
    ][random.integers(5)]
    every = min(every, 5.0) if len(stretches) > 20 else every
    fine = max(every / 3, 3600 * hours / 40_000)
    counts = [round(second / fine) for second, _ in stretches]
    current = np.repeat([float(level) for _, level in stretches], counts)
    charge = start + np.cumsum(current) * fine / 3600 / 3.0
    voltage = np.interp(charge, soc, ocv) + ohm * current
    for share, tau in ((0.6, 12.0), (0.5, 400.0)):
        pole = np.exp(-fine / tau)
        voltage = voltage + share * ohm * lfilter([1 - pole], [1, -pole], current)
    rows = slice(None, None, 3)
    noise = 10 ** random.uniform(-5, -3.3) * random.standard_normal(len(voltage[rows]))
    digit = random.choice([1e-5, 1e-4, 1e-3])
    read = np.round((voltage[rows] + noise) / digit) * digit
    return np.arange(len(read)) * 3 * fine, current[rows], read


@pytest.mark.parametrize("seed", range(60))
def test_a_plain_record_tells_its_sign_without_a_doubt(seed):
    """R0 of 0.2 to 80 mOhm, C/20 to 3C, a row each 0.1 to 300 s; of two conventions either."""
    time, current, voltage = plain(seed)
    for sign in (1, -1):
        shown = current_sign(time, sign * current, voltage)
        assert shown.sign == sign, shown
        columns = dict(zip(SERIES, (time, sign * current, voltage), strict=True))
        told = charge_positive(columns, default="charge_positive")
        assert "doubt" not in told.columns
        np.testing.assert_array_equal(told.columns["current_ampere"], current)


@pytest.mark.parametrize(
    "levels", [(0, -1, 0, 1, 0), (0, -1, -1, 0, 0.5, 0.5), (0, 2, 0, -1, -1, 0)]
)
def test_magnitudes_cannot_tell(levels):
    time, current, voltage = cell(blocks(*levels))
    assert current_sign(time, current, voltage).sign == 1
    assert current_sign(time, np.abs(current), voltage).sign == 0
    columns = {"test_time_second": time, "current_ampere": np.abs(current), "voltage_volt": voltage}
    for stated in (None, "charge_positive"):
        with pytest.raises(Refusal, match="never changes its sign"):
            charge_positive(columns, stated=stated, default="charge_positive")


def test_magnitudes_of_a_drive_cannot_tell():
    time, current, voltage = cell(drive())
    assert current_sign(time, np.abs(current), voltage).sign == 0


def test_a_current_that_is_never_positive_is_no_magnitude():
    """Discharges in the cold whose voltage rises while they warm the cell: the steps tell."""
    time, current, voltage = cell(blocks(0, -1, 0, -1, 0))
    later = (current < 0) & (time > time[len(time) // 2])
    voltage = voltage + np.where(later, 1e-3 * (time - time[later][0]), 0.0)
    columns = {"test_time_second": time, "current_ampere": current, "voltage_volt": voltage}
    signed = charge_positive(columns, default="charge_positive")
    assert signed.columns["current_ampere"].min() == current.min()
    with pytest.raises(Refusal, match="never changes its sign"):
        charge_positive(columns | {"current_ampere": np.abs(current)})


def test_noise_and_rest_cannot_tell():
    rng = np.random.default_rng(0)
    time, noise = np.arange(500.0), rng.standard_normal((2, 500))
    assert current_sign(time, noise[0], 3.7 + 1e-3 * noise[1]).sign == 0
    assert current_sign(time, np.zeros(500), 3.7 + 1e-3 * noise[1]).reason == "no current flows"


def series(current, sign=1):
    time, current, voltage = cell(current)
    counter = np.cumsum(current) / 3600
    return {
        "test_time_second": time,
        "current_ampere": sign * current,
        "voltage_volt": voltage,
        "branch_1_current_ampere": sign * current / 2,
        "net_capacity_ampere_hour": sign * counter,
    }


def test_branches_and_counter_turn_along():
    true = series(drive())
    turned = charge_positive(series(drive(), sign=-1)).columns
    for name, column in true.items():
        np.testing.assert_allclose(turned[name], column)


def test_counter_that_already_counts_charge_is_left():
    columns = series(drive(), sign=-1)
    columns["net_capacity_ampere_hour"] *= -1
    turned = charge_positive(columns, stated="discharge_positive").columns
    np.testing.assert_allclose(
        turned["net_capacity_ampere_hour"], series(drive())["net_capacity_ampere_hour"]
    )


def test_contradiction_of_the_sheet_is_refused():
    with pytest.raises(Refusal, match="says charge_positive, the voltage shows discharge_positive"):
        charge_positive(series(drive(), sign=-1), stated="charge_positive")


def test_contradiction_of_the_format_is_converted_and_noted():
    signed = charge_positive(series(drive(), sign=-1), default="charge_positive")
    assert "against the format's rule charge_positive" in signed.notes[0]
    np.testing.assert_allclose(signed.columns["current_ampere"], drive())


def test_silent_data_take_the_rule_or_are_refused():
    rng = np.random.default_rng(5)
    silent = series(np.zeros(500)) | {"current_ampere": 1e-3 * rng.standard_normal(500)}
    assert "taken as charge_positive" in charge_positive(silent, default="charge_positive").notes[0]
    assert charge_positive(silent, stated="discharge_positive").notes
    with pytest.raises(Refusal, match=r"cannot tell .* state current_sign"):
        charge_positive(silent)


def test_the_sign_of_no_current_does_not_matter():
    assert "does not matter" in charge_positive(series(np.zeros(100))).notes[0]


@pytest.mark.parametrize(
    ("files", "sign"),
    [
        (["a123/raw/dynamic/A123_DYN_50_P25_s1.csv.gz"], -1),
        ([f"a123/raw/dynamic/A123_DYN_50_P25_s{k}.csv.gz" for k in (2, 3)], -1),
        ([f"a123/raw/ocv/A123_OCV_P05_S{k}.csv.gz" for k in (1, 2, 3, 4)], 1),
        (["dmegc/raw/R1/random_02.csv.gz"], -1),
        (["dmegc/raw/R1/discharge_1C.csv.gz"], -1),
        (["leaf/raw/discharge/2C-Discharge-Bitrode-data.csv.gz"], 1),
        (["lgm50/raw/pulses/0C/Cell19_SoC5.csv.gz"], 1),
        (["lgm50/raw/pulses/10C/Cell13_SoC1.csv.gz"], 1),
        (["panasonic/raw/drive/udds_n10C.parquet"], 1),
        (["panasonic/raw/capacity/25C_end_2_charge.parquet"], 1),
        (["weng/raw/parallel_C10.csv.gz"], 1),
        (["nasa/raw/B0047_ageing.parquet"], 1),
        (["samsung30q/raw/discharge/S001_C10.csv.gz"], 1),
    ],
)  # fmt: skip
def test_measured_records(shared, files, sign):
    paths = [shared / "campaigns" / file for file in files]
    readings = [formats.read(path.read_bytes(), name=path.name) for path in paths]
    current = np.concatenate([reading.columns["current_ampere"] for reading in readings])
    np.testing.assert_allclose(assemble(readings).columns["current_ampere"], sign * current)


def reading(current, *, sign=0, start=0.0, volt=None):
    """A file of a cell that is charged and discharged; the voltage follows a positive charge."""
    time = start + 10.0 * np.arange(len(current))
    moved = np.cumsum(current) * 10.0 / 3600
    voltage = 3.6 + 0.1 * moved + 0.05 * np.asarray(current) if volt is None else volt
    columns = {"test_time_second": time, "current_ampere": current, "voltage_volt": voltage}
    return Reading(columns, "table", "series", (), sign)


LOAD = np.repeat([0.0, 1.0, 0.0, -1.0, 0.0], 100)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_files_own_counters_go_before_the_voltage(sign):
    """A half cell under control, or a held voltage, may move the other way."""
    found = assemble([reading(LOAD, sign=sign)])
    np.testing.assert_array_equal(found.columns["current_ampere"], sign * LOAD)
    assert any("voltage speaks against" in note for note in found.notes) == (sign < 0)


def test_files_of_opposite_signs_are_each_turned_by_their_own_counters():
    second = reading(LOAD, start=1e4)
    turned = reading(-LOAD, sign=-1, start=1e4, volt=second.columns["voltage_volt"])
    found = assemble([reading(LOAD, sign=1), turned])
    np.testing.assert_array_equal(found.columns["current_ampere"], [*LOAD, *LOAD])


def test_files_of_opposite_signs_without_counters_are_refused_by_their_number():
    second = reading(LOAD, start=1e4)
    turned = reading(-LOAD, start=1e4, volt=second.columns["voltage_volt"])
    with pytest.raises(Refusal, match="file 2 shows discharge_positive by its voltage, file 1 cha"):
        assemble([reading(LOAD), turned])


def test_a_sheet_against_the_counters_is_refused():
    with pytest.raises(Refusal, match="counters or step letters of file 1 show charge_positive"):
        assemble([reading(LOAD, sign=1)], stated_sign="discharge_positive")


def test_notes_of_a_reader_name_their_file():
    noted = reading(LOAD, sign=1)._replace(notes=("its last row was cut off",))
    found = assemble([noted, reading(LOAD, sign=1, start=1e4)])
    assert "file 1: its last row was cut off" in found.notes
