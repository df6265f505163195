"""Readers on measured files: against other people's readings and published numbers."""

import numpy as np
import pytest

from cellwright import formats
from cellwright.formats.physics import charge_by_clock_and_counter
from cellwright.formats.unsaid_units import unit_by_pace


def reading(path):
    return formats.read(path.read_bytes(), name=path.name)


@pytest.mark.parametrize(
    ("file", "rows", "first_volt", "last_second"),
    [
        ("arbin/sample_data_arbin.csv", 13, 3.534595, 301.214),
        ("arbin/FastCharge_000025_CH8.csv", 248, 3.3011441, 1800.0104),
        ("arbin/2017-05-09_test-TC-contact_CH33.csv", 287, 3.298668384552002, 1022.8913),
        ("bitrode/1C-Discharge-Bitrode-data.csv.gz", 2287, 3.147, 66041.4),
        ("digatron/576_Charge1.csv", 130, 4.18748, 7569.592),
        ("bdf/legacy.bdf.parquet", 5000, 0.2412, 148781.953),
        ("labview/Prewait_K240.txt", 302, 3.6067, 300.191516),
    ],
)
def test_small_instrument_files(shared, file, rows, first_volt, last_second):
    columns = reading(shared / "formats" / file).columns
    assert columns["voltage_volt"].size == rows
    assert columns["voltage_volt"][0] == pytest.approx(first_volt, abs=1e-4)
    assert columns["test_time_second"][-1] == pytest.approx(last_second, abs=1e-3)


@pytest.mark.parametrize(
    ("celsius", "ampere_hour"), [(20, 2.20), (30, 2.22), (40, 2.23), (50, 2.23)]
)
def test_k2_discharge(shared, celsius, ampere_hour):
    """Published: charge of the 1C discharge."""
    file = shared / f"campaigns/k2lfp/raw/discharge/K2_discharge_{celsius}C.txt.gz"
    columns = reading(file).columns
    time, current = columns["test_time_second"], columns["current_ampere"]
    charge = -np.trapezoid(current, time) / 3600
    assert charge == pytest.approx(ampere_hour, abs=0.005)
    assert columns["ambient_temperature_celsius"].mean() == pytest.approx(celsius, abs=0.5)


@pytest.mark.parametrize(
    ("file", "milliohm"), [("25C/3541_EIS00007", 21.5), ("n10C/3740_EIS00007", 28.0)]
)
def test_panasonic_ohmic_resistance(shared, file, milliohm):
    """Published: real part where the imaginary part is zero, 50 % SoC."""
    columns = reading(shared / f"campaigns/panasonic/raw/eis/{file}.csv.gz").columns
    real, imaginary = columns["impedance_real_ohm"], columns["impedance_imaginary_ohm"]
    k = int(np.flatnonzero((imaginary[:-1] > 0) & (imaginary[1:] <= 0))[0])
    zero = np.interp(0, imaginary[[k + 1, k]], real[[k + 1, k]])
    assert 1e3 * zero == pytest.approx(milliohm, abs=0.06)


@pytest.mark.parametrize(
    "file",
    [
        "a123/raw/dynamic/A123_DYN_50_P25_s1.csv.gz",
        "a123/raw/ocv/A123_OCV_P25_S1.csv.gz",
        "panasonic/raw/hppc/hppc_25C.parquet",
        "lg_hg2_traps/raw/25degC/549_C20DisCh.csv.gz",
    ],
)
def test_clock_and_counter_agree(shared, file):
    columns = reading(shared / "campaigns" / file).columns
    names = ("test_time_second", "current_ampere", "net_capacity_ampere_hour")
    expected, seen = charge_by_clock_and_counter(*(columns[n] for n in names))
    assert expected / seen == pytest.approx(1, abs=0.01)


def test_leaf_with_and_without_header(shared):
    folder = shared / "campaigns/leaf/raw/hppc"
    for number in ("10C", "25C-2"):
        found = reading(folder / f"NissanLeaf-cell-Low-Current-HPPC-{number}.csv.gz")
        assert found.instrument == "bitrode"
        assert (
            2.9 < found.columns["voltage_volt"].min() < found.columns["voltage_volt"].max() < 4.25
        )


@pytest.mark.parametrize(
    ("apart", "unit"),
    [
        *((1.0, "s"), (0.1, "s"), (60.0, "s"), (10.0, "s"), (0.001, "s"), (1000.0, "s")),
        *((1 / 3600, "h"), (10 / 3600, "h"), (20 / 86400, "d"), (1 / 86400, "d"), (1 / 60, "")),
        *((0.37, "s"), (7.0, "s")),
    ],
)
def test_the_unit_of_a_clock_without_one_is_told_by_its_pace(apart, unit):
    clock = np.round(np.arange(200) * apart, 9)
    assert unit_by_pace(clock) == unit
