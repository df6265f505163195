"""The writers: what was written is what the pipeline's readers find, in the same bytes."""

import gzip
import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cellwright import formats
from virtual_lab import instruments
from virtual_lab.instruments import faults, measurement
from virtual_lab.instruments.text import Written, rows_of

# Reader, and what the file holds beside time, current and voltage.
SURFACE, AMBIENT = "surface_temperature_celsius", "ambient_temperature_celsius"
NET = "net_capacity_ampere_hour"
SERIES = {
    "arbin": ("arbin", {SURFACE, AMBIENT, NET, "step_index", "unix_time_second"}),
    "bdf": ("bdf", {SURFACE, AMBIENT, "step_count"}),
    "parquet": ("bdf", {SURFACE, AMBIENT, "step_count", "unix_time_second"}),
    "bitrode": ("bitrode", {"step_index"}),
    "digatron": ("digatron", {SURFACE, NET, "step_index", "unix_time_second"}),
    "digatron_german": ("digatron", {SURFACE, NET, "step_index", "unix_time_second"}),
    "plett": ("plett", {NET, "step_index"}),
}
SPECTRA = {"eis": "bdf", "digatron_eis": "digatron"}
OWN = {
    "test_time_second": "time_second",
    "voltage_volt": "voltage_volt",
    SURFACE: "surface_celsius",
    AMBIENT: "ambient_celsius",
    "step_index": "step",
    "step_count": "step",
}
each_series = pytest.mark.parametrize("name", SERIES)
each_spectrum = pytest.mark.parametrize("name", SPECTRA)


@pytest.fixture
def shown(ideal):
    return measurement.measured(ideal, seed=5)


@pytest.fixture
def spectrum():
    frequency = np.logspace(3, -2, 26)
    impedance = 2e-3 + 1e-3 / (1 + 2j * np.pi * frequency * 0.05) + 2e-4 / (1j * frequency) ** 0.5
    return {
        "frequency_hertz": frequency,
        "real_ohm": impedance.real,
        "imaginary_ohm": impedance.imag,
        "surface_celsius": np.full(26, 25.3),
    }


def _read(name, columns, **how):
    return formats.read(instruments.WRITERS[name](columns, **how), name="file")


def test_every_writer_is_tested():
    assert SERIES.keys() | SPECTRA.keys() == instruments.WRITERS.keys()


@each_series
def test_series_comes_back(shown, name):
    reader, more = SERIES[name]
    found = _read(name, shown)
    assert (found.instrument, found.kind) == (reader, "series")
    assert more <= found.columns.keys()
    for column in found.columns.keys() & OWN.keys():
        own = shown[OWN[column]]
        np.testing.assert_allclose(found.columns[column], own, atol=1e-9, err_msg=column)
    sign = -1 if name == "plett" else 1
    current = sign * shown["current_ampere"]
    np.testing.assert_allclose(found.columns["current_ampere"], current, atol=1e-9)


@each_series
@pytest.mark.parametrize("discharge_positive", [False, True])
def test_counter_counts_charge_whatever_the_sign_of_the_current(shown, name, discharge_positive):
    found = _read(name, shown, discharge_positive=discharge_positive).columns
    sign = -1 if discharge_positive else 1
    current = sign * shown["current_ampere"]
    np.testing.assert_allclose(found["current_ampere"], current, atol=1e-9)
    net = shown["charged_ampere_hour"] - shown["discharged_ampere_hour"]
    np.testing.assert_allclose(found.get(NET, net), net, atol=1.1e-4)


@each_series
def test_absolute_time_runs_with_the_test(shown, name):
    found = _read(name, shown).columns
    if "unix_time_second" in found:
        since = found["unix_time_second"] - instruments.UNIX_START_SECOND
        np.testing.assert_allclose(since, shown["time_second"], atol=1.0)


@each_series
def test_current_without_sign_trouble_has_no_negative_zero(shown, name):
    if name != "parquet":
        text = gzip.decompress(instruments.WRITERS[name](shown)).decode()
        assert "-0.000," not in text


@each_series
def test_same_content_gives_same_bytes(shown, name):
    write = instruments.WRITERS[name]
    assert write(shown) == write(dict(shown))


@each_series
def test_missing_numbers_stay_missing(shown, name):
    spoilt, done = faults.no_values(shown, seed=1, channel="voltage_volt", value=np.nan)
    found = _read(name, spoilt).columns["voltage_volt"]
    assert np.flatnonzero(np.isnan(found)).tolist() == [row["row"] for row in done]


def test_packing_carries_no_time(shown):
    with gzip.GzipFile(fileobj=io.BytesIO(instruments.bdf_csv(shown))) as file:
        file.read()
        assert file.mtime == 0


@pytest.mark.parametrize("name", ["bdf", "parquet"])
def test_branches_come_back(shown, name):
    half = {f"branch_{k}_current_ampere": k / 3 * shown["current_ampere"] for k in (1, 2)}
    found = _read(name, shown | half).columns
    for column, own in half.items():
        np.testing.assert_allclose(found[column], own, atol=5.1e-4)
    turned = _read(name, shown | half, discharge_positive=True).columns
    np.testing.assert_array_equal(
        turned["branch_2_current_ampere"], -found["branch_2_current_ampere"]
    )


@pytest.mark.parametrize("name", ["arbin", "bdf", "bitrode", "digatron"])
def test_cycles_come_back(shown, name):
    cycle = np.where(shown["step"] > 1, 2, 1)
    np.testing.assert_array_equal(
        _read(name, shown | {"cycle": cycle}).columns["cycle_count"], cycle
    )


def test_arbin_steps_count_their_own_time(shown):
    rows = gzip.decompress(instruments.arbin_csv(shown)).decode().splitlines()
    assert len({row.count(",") for row in rows}) == 1
    own, step = np.loadtxt(rows[1:], delimiter=",", usecols=(3, 4), unpack=True)
    assert all(own[step == k][0] == 0 for k in (1, 2, 3))


def _bitrode_rows(shown, **how):
    text = gzip.decompress(instruments.bitrode_csv(shown, **how)).decode()
    return [row.split(",") for row in text.splitlines()]


def test_bitrode_counts_within_a_step_and_names_its_mode(shown):
    rows = _bitrode_rows(shown)[1:]
    last = {row[6]: row for row in rows}
    assert [last[k][13] for k in "123"] == ["REST", "DCHG", "CHRG"]
    assert [last[k][14] for k in "123"] == ["S", "S", "S"]
    assert [float(last[k][11]) for k in "123"] == pytest.approx([0.0, -2.0, 0.25], abs=1e-3)
    assert float(last["2"][12]) == pytest.approx(-2.0 * 3.58, rel=1e-3)
    assert sum(row[14] == "S" for row in rows) == 3


def test_bitrode_may_come_without_its_names(shown):
    assert _bitrode_rows(shown, header=False) == _bitrode_rows(shown)[1:]
    with_names, bare = (_read("bitrode", shown, header=h).columns for h in (True, False))
    for column, values in with_names.items():
        np.testing.assert_array_equal(bare[column], values)


def test_digatron_writes_as_its_computer_is_set(shown):
    english = gzip.decompress(instruments.digatron_csv(shown))
    german = gzip.decompress(instruments.digatron_german_csv(shown))
    assert b"\r\n3/" not in english
    assert b"\r\n03/04/2024 8:00:00 AM,1,PAU,00:00:00.010,00:00:00.000," in english
    assert b"\r\n04.03.2024 08:00:00;1;PAU;00:00:00.010;00:00:00.000;" in german
    assert english.count(b"\n") == english.count(b"\r\n")


@each_spectrum
def test_spectrum_comes_back(spectrum, name):
    found = _read(name, spectrum)
    assert (found.instrument, found.kind) == (SPECTRA[name], "impedance")
    for part in ("real", "imaginary"):
        own = spectrum[f"{part}_ohm"]
        np.testing.assert_allclose(found.columns[f"impedance_{part}_ohm"], own, atol=5.1e-8)
    frequency = spectrum["frequency_hertz"]
    np.testing.assert_allclose(found.columns["frequency_hertz"], frequency, rtol=5e-4)
    np.testing.assert_allclose(found.columns[SURFACE], 25.3)


@each_spectrum
def test_spectrum_needs_no_temperature(spectrum, name):
    del spectrum["surface_celsius"]
    assert SURFACE not in _read(name, spectrum).columns


def test_digatron_amplitudes_prove_its_unit(spectrum):
    rows = instruments.digatron_spectrum_csv(spectrum).decode().splitlines()
    header = next(k for k, row in enumerate(rows) if "Prog Time" in row)
    names = rows[header].split(";")
    table = [dict(zip(names, row.split(";"), strict=True)) for row in rows[header + 2 :]]
    for row in table:
        relative, ideal, ampere = (float(row[n]) for n in ("VRelativ", "mvIdeal", "AAmplitude"))
        assert relative * ideal / ampere == pytest.approx(float(row["Betrag"]), rel=1e-3)
        assert ampere <= 2.0


NUMBERS = st.floats(-1e6, 1e6, allow_subnormal=False) | st.integers(-20000, 20000).map(
    lambda k: k / 20000
)


@given(values=arrays(float, st.integers(1, 40), elements=NUMBERS), decimals=st.integers(0, 6))
def test_numbers_are_written_as_python_would(values, decimals):
    found = rows_of([Written("x", values, decimals)]).decode().splitlines()
    assert found == [f"{value:.{decimals}f}" for value in values]
