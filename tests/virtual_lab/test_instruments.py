"""The writers: what was written is what the pipeline's readers find, in the same bytes."""

import gzip
import io

import numpy as np
import pytest

from cellwright.formats import arbin, bdf
from virtual_lab import instruments, measurement


@pytest.fixture
def shown(ideal):
    return measurement.measured(ideal, seed=5)


def _packed_and_unpacked(columns, write, read):
    return read(gzip.decompress(write(columns)))


@pytest.mark.parametrize(
    ("write", "read"),
    [(instruments.arbin_csv, arbin.read), (instruments.bdf_csv, bdf.read)],
)
def test_text_comes_back(shown, write, read):
    found = _packed_and_unpacked(shown, write, read)
    for name, own in [
        ("test_time_second", "time_second"),
        ("current_ampere", "current_ampere"),
        ("voltage_volt", "voltage_volt"),
        ("surface_temperature_celsius", "surface_celsius"),
        ("ambient_temperature_celsius", "ambient_celsius"),
    ]:
        np.testing.assert_allclose(found[name], shown[own], atol=1e-9, err_msg=name)


def test_parquet_comes_back(shown):
    found = bdf.read(instruments.bdf_parquet(shown))
    np.testing.assert_array_equal(found["voltage_volt"], shown["voltage_volt"])
    assert found["unix_time_second"][0] > 1.7e9


@pytest.mark.parametrize("write", [instruments.arbin_csv, instruments.bdf_csv])
def test_discharge_may_be_positive(shown, write):
    read = arbin.read if write is instruments.arbin_csv else bdf.read
    data = gzip.decompress(write(shown, discharge_positive=True))
    np.testing.assert_allclose(read(data)["current_ampere"], -shown["current_ampere"], atol=1e-9)
    assert b"-0.000," not in data


@pytest.mark.parametrize(
    "write", [instruments.arbin_csv, instruments.bdf_csv, instruments.bdf_parquet]
)
def test_same_content_gives_same_bytes(shown, write):
    assert write(shown) == write(dict(shown))


def test_packing_carries_no_time(shown):
    with gzip.GzipFile(fileobj=io.BytesIO(instruments.bdf_csv(shown))) as file:
        file.read()
        assert file.mtime == 0


def test_arbin_steps_count_their_own_time(shown):
    rows = gzip.decompress(instruments.arbin_csv(shown)).decode().splitlines()
    assert len({row.count(",") for row in rows}) == 1
    own, step = np.loadtxt(rows[1:], delimiter=",", usecols=(3, 4), unpack=True)
    assert all(own[step == k][0] == 0 for k in (1, 2, 3))


def test_spectrum_comes_back():
    columns = {
        "frequency_hertz": np.array([1000.0, 1.0]),
        "real_ohm": np.array([0.01, 0.03]),
        "imaginary_ohm": np.array([-0.0001, -0.002]),
    }
    found = bdf.read(instruments.spectrum_csv(columns))
    np.testing.assert_allclose(found["impedance_imaginary_ohm"], columns["imaginary_ohm"])
