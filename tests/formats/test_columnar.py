"""Parquet and Arrow with the labels of a csv give what the csv gives."""

from io import BytesIO

import numpy as np
import pandas as pd
import pytest

from cellwright import formats
from cellwright.refusal import Refusal

ROWS = 300
TIME = 10.0 * np.arange(ROWS)
VOLT = 3.7 + 0.1 * np.sin(TIME / 500) / 3
AMPERE = np.where(np.arange(ROWS) % 100 < 50, 1.25, -1.25)
PLAIN = {"Time [s]": TIME, "Current [A]": AMPERE, "Voltage [V]": VOLT}
TABLES = {
    "plain": PLAIN,
    "units": {"Time (min)": TIME / 60, "I (mA)": 1e3 * AMPERE, "U (mV)": 1e3 * VOLT},
    "short numbers": {"Time [s]": TIME.astype("f4"), "Current [A]": AMPERE.astype("f4")}
    | {"Voltage [V]": VOLT.astype("f4")},
    "states": {"Time": TIME, "Current (A)": np.abs(AMPERE), "Voltage (V)": VOLT}
    | {"Mode": np.where(AMPERE > 0, "charge", "discharge")},
    "dates": {"Date Time": pd.Timestamp("2024-02-29 23:59:50") + pd.to_timedelta(TIME, "s")}
    | {"Current (A)": AMPERE, "Voltage (V)": VOLT},
    "blanks": PLAIN | {"Temperature [C]": np.where(TIME < 100, np.nan, 25.5)},
}


def written(frame, kind):
    file = BytesIO()
    (frame.to_parquet if kind == "parquet" else frame.to_feather)(file)
    return file.getvalue()


def read(data, **how):
    return formats.read(data, name="file", **how)


@pytest.mark.parametrize("kind", ["parquet", "feather"])
@pytest.mark.parametrize("table", TABLES)
def test_a_table_is_read_as_its_csv(table, kind):
    frame = pd.DataFrame(TABLES[table])
    found, wanted = read(written(frame, kind)), read(frame.to_csv(index=False).encode())
    assert (
        (found.instrument, found.sign) == (wanted.instrument, wanted.sign) == ("table", wanted.sign)
    )
    assert found.columns.keys() == wanted.columns.keys()
    for name, values in found.columns.items():
        np.testing.assert_allclose(values, wanted.columns[name], rtol=1e-6)
    np.testing.assert_allclose(found.columns["current_ampere"], AMPERE, rtol=1e-12)
    np.testing.assert_allclose(found.columns["test_time_second"], TIME, rtol=1e-12)


def test_a_spectrum_in_parquet():
    hertz = np.geomspace(1e3, 1, 10)
    ohm = 0.02 + 0.01 / (1 + 1j * hertz / 50)
    frame = pd.DataFrame(
        {"Freq (Hz)": hertz, "Z' (mOhm)": 1e3 * ohm.real, "-Z'' (mOhm)": -1e3 * ohm.imag}
    )
    np.testing.assert_allclose(
        read(written(frame, "parquet")).columns["impedance_imaginary_ohm"], ohm.imag
    )


def test_labels_of_the_battery_data_format_stay_its_own():
    frame = pd.DataFrame({"Test Time / s": TIME, "Current / A": AMPERE, "Voltage / V": VOLT})
    assert read(written(frame, "parquet")).instrument == "bdf"
    with pytest.raises(Refusal, match="no column 'Voltage / V'"):
        read(written(frame.drop(columns="Voltage / V"), "parquet"))
    with pytest.raises(Refusal, match="no column 'Test Time / s'"):
        read(written(pd.DataFrame(PLAIN), "parquet"), instrument="bdf")


@pytest.mark.parametrize("kind", ["parquet", "feather"])
def test_what_is_not_read_is_named_and_what_is_no_number_refused(kind):
    frame = pd.DataFrame(PLAIN)
    lists = frame.assign(Curve=[[1.0, 2.0]] * ROWS)
    assert read(written(lists, kind)).notes == ("columns that are not read: Curve",)
    with pytest.raises(Refusal, match=r"column 'Voltage \[V\]' holds list"):
        read(written(lists.rename(columns={"Voltage [V]": "V", "Curve": "Voltage [V]"}), kind))
    long = frame.assign(Mode="x" * 10_000)
    with pytest.raises(Refusal, match="column 'Mode' holds a text of 10000 letters"):
        read(written(long, kind))


def test_a_few_bytes_that_are_many_rows_are_refused():
    import pyarrow as pa
    from pyarrow import parquet

    count = 40_000_000
    column = pa.array(np.zeros(count, "i1"))
    file = BytesIO()
    parquet.write_table(pa.table([column] * 3, ["Time [s]", "Current [A]", "Voltage [V]"]), file)
    with pytest.raises(Refusal, match="unpacks to more than"):
        read(file.getvalue())
