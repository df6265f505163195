"""Battery Data Format 1.3: every spelling and container gives the same numbers."""

import io
import json

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyarrow import feather, parquet

from cellwright import formats
from cellwright.refusal import Refusal

TIME, CURRENT, VOLTAGE = [0.0, 10.0, 20.0], [0.0, -1.5, -1.5], [3.7, 3.65, 3.6]
SERIES = ("test_time_second", "current_ampere", "voltage_volt")


def read(data):
    return formats.read(data, name="file")


def csv(columns):
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    return "\n".join(lines).encode() + b"\n"


def series(labels=("Test Time / s", "Current / A", "Voltage / V"), **more):
    return dict(zip(labels, (TIME, CURRENT, VOLTAGE), strict=True)) | more


def with_columns(more):
    return read(csv(series() | more))


@pytest.mark.parametrize(
    "labels",
    [
        ("Test Time / s", "Current / A", "Voltage / V"),
        ("test_time_second", "current_ampere", "voltage_volt"),
        ("test_time_s", "current_a", "voltage_v"),
        ("test_time_s", "current_A", "voltage_V"),
    ],
)
def test_labels_of_all_three_kinds(labels):
    reading = read(csv(series(labels)))
    assert reading.instrument == "bdf"
    for name, values in zip(SERIES, (TIME, CURRENT, VOLTAGE), strict=True):
        np.testing.assert_array_equal(reading.columns[name], values)


def test_short_names_say_their_units():
    labels = ("test_time_min", "current_mA", "voltage_mV")
    columns = dict(zip(labels, ([0.0, 1.0], [100.0, 200.0], [3700.0, 3600.0]), strict=True))
    found = read(csv(columns)).columns
    np.testing.assert_allclose(found["test_time_second"], [0, 60])
    np.testing.assert_allclose(found["current_ampere"], [0.1, 0.2])
    np.testing.assert_allclose(found["voltage_volt"], [3.7, 3.6])


def of_parquet(columns):
    buffer = io.BytesIO()
    parquet.write_table(pa.table(columns), buffer)
    return buffer.getvalue()


def of_arrow(columns):
    buffer = io.BytesIO()
    feather.write_feather(pa.table(columns), buffer)
    return buffer.getvalue()


def rows(columns):
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


CONTAINERS = {
    "csv": csv,
    "Parquet": of_parquet,
    "Arrow": of_arrow,
    "JSON, an object of lists": lambda c: json.dumps(c).encode(),
    "JSON, a list of rows": lambda c: json.dumps(rows(c), indent=1).encode(),
    "JSON, a row a line": lambda c: "\n".join(map(json.dumps, rows(c))).encode(),
}


@pytest.mark.parametrize("kind", CONTAINERS)
def test_all_containers_give_the_same(kind):
    columns = series(cycle_count=[1, 1, 2], step_id=[4, 5, 5])
    reading = read(CONTAINERS[kind](columns))
    assert reading.instrument == "bdf"
    for name, values in zip(SERIES, (TIME, CURRENT, VOLTAGE), strict=True):
        np.testing.assert_array_equal(reading.columns[name], values)
    assert reading.columns["cycle_count"].tolist() == [1, 1, 2]
    assert reading.columns["step_index"].tolist() == [4, 5, 5]
    assert reading.notes == ()


@pytest.mark.parametrize("kind", CONTAINERS)
@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_a_damaged_container_is_refused_or_right(kind, data):
    """Cut anywhere, or with a byte that is another: an own error, never a foreign one."""
    content = CONTAINERS[kind](series())
    place = data.draw(st.integers(0, len(content) - 1))
    byte = bytes([data.draw(st.integers(0, 255))])
    for damaged in (content[:place], content[:place] + byte + content[place + 1 :]):
        try:
            reading = read(damaged)
        except Refusal:
            continue
        assert set(reading.columns) <= {*SERIES, "unix_time_second"}


JSON_REFUSED = {
    "text": (series(**{"Voltage / V": [3.7, "x", 3.6]}), r"row 2 of data: .*'x'"),
    "truth": (series(**{"Voltage / V": [3.7, True, 3.6]}), r"row 2 of data: .*found True"),
    "lengths": (series(**{"Voltage / V": [3.7]}), r"different lengths: \[1, 3\]"),
    "no table": ({"Test Time / s": 4}, "no table"),
}


@pytest.mark.parametrize("what", JSON_REFUSED)
def test_json_that_is_no_table_is_refused(what):
    document, message = JSON_REFUSED[what]
    with pytest.raises(Refusal, match=message):
        read(json.dumps(document).encode())


def test_what_is_not_read_is_said():
    reading = with_columns({"Power / W": [0.0] * 3, "strain": [1.0] * 3})
    assert reading.notes == ("columns that are not read: Power / W, strain",)


def test_step_index_of_version_1_3_counts_rows_and_is_no_step():
    long = {"Test Time / s": range(6), "Current / A": [1.0] * 6, "Voltage / V": [3.7] * 6}
    reading = read(csv(long | {"Step Index / 1": [1, 2, 3, 1, 2, 3]}))
    assert "step_index" not in reading.columns
    assert reading.notes == ("'Step Index / 1' counts the rows of a step: it is no step number",)
    reading = read(csv(long | {"Step Index / 1": [1, 1, 1, 2, 2, 2]}))  # as files wrote it before
    assert reading.columns["step_index"].tolist() == [1, 1, 1, 2, 2, 2]


def test_the_step_of_the_program_is_step_id():
    reading = with_columns({"Step ID": [7, 7, 8], "Step Index / 1": [1, 2, 1]})
    assert reading.columns["step_index"].tolist() == [7, 7, 8]
    assert reading.notes == ("columns that are not read: Step Index / 1",)
    reading = with_columns({"Step Record Index / 1": [1, 2, 1], "step_count": [1, 1, 2]})
    assert reading.columns["step_count"].tolist() == [1, 1, 2]
    assert reading.notes == ("columns that are not read: Step Record Index / 1",)


@pytest.mark.parametrize("label", ["Temperature T1 / degC", "Surface Temperature T1 / degC",
                                   "temperature_t1_celsius", "Surface Temperature / degC",
                                   "surface_temperature_t1_celsius"])  # fmt: skip
def test_a_thermometer_by_all_its_names(label):
    columns = with_columns({label: [25.0, 26.0, 27.0]}).columns
    assert columns["surface_temperature_celsius"].tolist() == [25, 26, 27]


def test_the_surface_comes_before_an_unnamed_channel():
    both = {"Temperature T1 / degC": [40.0] * 3, "Surface Temperature / degC": [25.0] * 3,
            "Temperature T2 / degC": [30.0] * 3}  # fmt: skip
    reading = with_columns(both)
    assert reading.columns["surface_temperature_celsius"].tolist() == [25] * 3
    assert reading.columns["surface_temperature_2_celsius"].tolist() == [30] * 3
    assert reading.columns["surface_temperature_1_celsius"].tolist() == [40] * 3
    assert reading.notes == ()


SCOPES = ("", "Schedule ", "Cycle ", "Step ")


@pytest.mark.parametrize("scope", SCOPES)
def test_counters_of_every_scope(scope):
    """Two cycles of 1 A; those of a cycle or step begin anew, and are put together."""
    current = np.array([*[1.0] * 10, *[-1.0] * 10] * 2)
    charge = np.cumsum(np.maximum(current, 0)) / 360
    discharge = np.cumsum(np.maximum(-current, 0)) / 360
    if scope:
        charge[20:] -= charge[19]
        discharge[20:] -= discharge[19]
    table = {
        "Test Time / s": 10.0 * np.arange(40),
        "Current / A": current,
        "Voltage / V": 3.7 + 0 * current,
        f"{scope}Charging Capacity / Ah": charge,
        f"{scope}Discharging Capacity / Ah": discharge,
    }
    reading = read(csv({label: values.tolist() for label, values in table.items()}))
    assert reading.sign == 1
    expected = np.cumsum(current) / 360
    np.testing.assert_allclose(reading.columns["net_capacity_ampere_hour"], expected, atol=1e-12)


def test_counters_of_one_scope_alone_are_taken_together():
    more = {"Charging Capacity / Ah": [0.0, 0.1, 0.2], "Cycle Charging Capacity / Ah": [0.0] * 3,
            "Cycle Discharging Capacity / Ah": [0.0, 0.1, 0.2]}  # fmt: skip
    reading = with_columns(more)
    assert "net_capacity_ampere_hour" not in reading.columns
    assert reading.notes == (f"columns that are not read: {', '.join(more)}",)


def test_the_two_of_a_pair_are_preferred_that_never_begin_anew():
    more = {"Cycle Charging Capacity / Ah": [0.0] * 3, "Charging Capacity / Ah": [0.0] * 3,
            "Cycle Discharging Capacity / Ah": [0.0] * 3,
            "Discharging Capacity / Ah": [0.0, 0.1, 0.2]}  # fmt: skip
    reading = with_columns(more)
    np.testing.assert_allclose(reading.columns["net_capacity_ampere_hour"], [0, -0.1, -0.2])
    assert reading.notes == (
        "columns that are not read: Cycle Charging Capacity / Ah, Cycle Discharging Capacity / Ah",
    )


def test_names_from_before_version_1():
    table = {"test_time_millisecond": [0, 1000, 2000], "current_ampere": CURRENT,
             "voltage_volt": VOLTAGE, "cycle_dimensionless": [1, 1, 2],
             "date_time_millisecond": [1719933538046, 1719933539046, 1719933540046]}  # fmt: skip
    columns = read(of_parquet(table)).columns
    np.testing.assert_allclose(columns["test_time_second"], [0, 1, 2])
    np.testing.assert_allclose(np.diff(columns["unix_time_second"]), 1.0)
    assert columns["cycle_count"].tolist() == [1, 1, 2]


def test_dates_of_parquet_are_a_time():
    stamps = pa.array([1_700_000_000_000 + k for k in (0, 500, 1000)], pa.timestamp("ms"))
    columns = read(of_parquet(series() | {"Unix Time / s": stamps})).columns
    np.testing.assert_allclose(np.diff(columns["unix_time_second"]), 0.5)


def test_what_is_no_count_is_left_out_and_said():
    """2π for 1, of a package that took the unit of a count for that of an angle."""
    reading = with_columns({"cycle_count": [6.283185307179586] * 3})
    assert "cycle_count" not in reading.columns
    assert reading.notes == ("cycle_count is left out: 6.28319 is no count",)
