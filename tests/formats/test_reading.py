"""Bytes → columns: what is read, in which unit, and every way to be refused."""

import gzip
import io

import numpy as np
import pyarrow as pa
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from pyarrow import parquet

from cellwright import formats
from cellwright.formats.physics import charge_by_clock_and_counter
from cellwright.refusal import Refusal

BDF = b"Test Time / s,Current / A,Voltage / V\n0,0,3.7\n1,-1,3.6\n2,-1,3.59\n"
PLETT = (
    b"time, step, current, voltage, chgAh, disAh\n1.0, 1, 0.5, 3.5, 0, 0\n2.0, 1, 0.5, 3.4, 0, 0"
)
ARBIN = b"Data_Point,Test_Time(s),Step_Index,Current(A),Voltage(V)\n1,0,1,0,3\n2,1,1,1,3.1"
BITRODE = (
    b"No,1.0,1,1,1,1,3,1.0,0.00,3.147,0.0,0.00,0.00,REST, ,\r\n"
    b"No,2.0,1,1,1,1,3,2.0,-9.00,3.100,0.0,0.00,0.00,DCHG, ,\r\n"
)
DIGATRON = (
    "\r\n\r\nMeasurement ID,576\r\nComment,25°C\r\n\r\n"
    "Time Stamp,Step,Status,Prog Time,Voltage,Current,Temperature,Capacity,\r\n"
    ",,,,[V],[A],[C],[Ah],\r\n"
    "11/19/2018 8:38:27 PM,3,PAU,25:00:01.500,4.1,0,10.5,0,\r\n"
    "11/19/2018 8:38:27 PM,3,MSG,25:00:01.500,hello,,,,\r\n"
    "11/19/2018 8:39:27 PM,3,DCH,25:01:01.500,4.0,-1,10.6,-0.02,\r\n"
).encode("latin-1")
SPECTRUM = (
    b"\r\n\r\nMeasurement ID;1\r\n"
    b"Time Stamp;Prog Time;Zreal1;Zimg1;ActFreq;VRelativ;mvIdeal;AAmplitude;Temp45;\r\n"
    b";;[EIS];[EIS];[EIS];[EIS];[EIS];[EIS];[C1];\r\n"
    b"x;0:0:1;20;5;1000;1;10;0.485;26;\r\n"
    b"x;0:0:2;30;-5;1;1;10;0.329;26;\r\n"
    b"x;0:0:3;40;-20;0.01;1;10;0.2236;26;\r\n"
)
LABVIEW = (
    b"LabVIEW Measurement\t\r\nWriter_Version\t2\r\nSeparator\tTab\r\nDecimal_Separator\t.\r\n"
    b"Multi_Headings\tNo\r\nX_Columns\tOne\r\nTime_Pref\tAbsolute\r\nDescription\t"
    b"Clolumns are: time, Current, Voltage, Power, Battery Temp, and Chamber Temp\r\n"
    b"Date\t1903/12/31\r\nTime\t19:00:00\r\n***End_of_Header***\t\r\n\t\r\n"
    b"0.000000\t0.013707\t3.201500\t0.043908\t20.238127\t20.068987\r\n"
    b"0.889429\t-5.895600\t2.977200\t-17.552000\t20.240593\t20.073305\r\n"
    b"0.972502\t3.400000E+38\t3.107100\t0.025504\t20.270275\t20.076712\r\n"
)
SEGMENT = (  # a second header, whose row of names tells nothing, and a clock that was set
    b"\t\r\nChannels\t5\t\t\t\t\t\r\nDate\t2023/09/06\t2023/09/06\t\r\n"
    b"Time\t15:36:28.1036934852600097656\t15:36:28.1\t\r\n***End_of_Header***\t\t\t\t\t\t\r\n"
    b"X_Value\tUntitled\tUntitled 1\tUntitled 2\tUntitled 3\tUntitled 4\tComment\r\n"
)
SEGMENTED = LABVIEW.replace(b"\t\r\n0.000000", SEGMENT + b"0.000000")
NAMED = SEGMENTED.replace(
    b"Untitled\tUntitled 1\tUntitled 2\tUntitled 3\tUntitled 4",
    b"Current (mA)\tVoltage\tnoise\tCell Temperature\tChamber",
)


def read(data: bytes, **kw) -> formats.Reading:
    return formats.read(data, name="some.csv", **kw)


def bdf_with(header: str = "Test Time / s,Current / A,Voltage / V", *rows: str) -> bytes:
    return "\n".join([header, *(rows or ("0,0,3.7", "1,1,3.8", "2,1,3.81"))]).encode()


@pytest.mark.parametrize(
    ("data", "instrument", "kind"),
    [
        (BDF, "bdf", "series"),
        (PLETT, "plett", "series"),
        (BITRODE, "bitrode", "series"),
        (DIGATRON, "digatron", "series"),
        (SPECTRUM, "digatron", "impedance"),
        (ARBIN, "arbin", "series"),
        (LABVIEW, "labview", "series"),
    ],
)  # fmt: skip
def test_each_instrument_is_recognised(data, instrument, kind):
    found = read(data)
    assert (found.instrument, found.kind) == (instrument, kind)
    assert read(data, instrument=instrument).kind == kind


@pytest.mark.parametrize("pack", [gzip.compress, zstandard.ZstdCompressor().compress, lambda d: d])
def test_compression_is_told_by_content(pack):
    assert read(pack(BDF)).columns["current_ampere"].tolist() == [0, -1, -1]


def test_parquet_reads_like_csv():
    table = pa.table({"Test Time / s": [0, 1], "Voltage / V": [3.7, None], "Current / A": [0.0, 1]})
    buffer = io.BytesIO()
    parquet.write_table(table, buffer)
    columns = read(buffer.getvalue()).columns
    assert columns["test_time_second"].dtype == float
    assert np.isnan(columns["voltage_volt"][1])


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=30))
def test_numbers_survive_to_the_last_bit(currents):
    rows = [f"{k},{c!r},3.7" for k, c in enumerate(currents)]
    found = read(bdf_with("Test Time / s,Current / A,Voltage / V", *rows))
    np.testing.assert_array_equal(found.columns["current_ampere"], currents)


@pytest.mark.parametrize(
    ("header", "factor"),
    [
        ("Test Time / ms,Current / mA,Voltage / mV", 1e-3),
        ("test_time_millisecond,current_milliampere,voltage_millivolt", 1e-3),
        ("Test Time / s;Current / A;Voltage / V", 1.0),
    ],
)
def test_units_come_from_the_header(header, factor):
    row = ";" if ";" in header else ","
    data = bdf_with(header, *(row.join(r) for r in (("0", "0", "3700"), ("1000", "500", "3800"))))
    data = data if factor != 1 else data.replace(b"3700", b"3.7").replace(b"3800", b"3.8")
    columns = read(data).columns
    assert columns["test_time_second"][1] == pytest.approx(1000 * factor)
    assert columns["current_ampere"][1] == pytest.approx(500 * factor)


def test_optional_channels_branches_and_counters():
    header = (
        "Test Time / s,Current / A,Voltage / V,Charging Capacity / Ah,Discharging Capacity / Ah,"
        "Branch 1 Current / A,Surface Temperature T1 / K,Surface Temperature T2 / degC,strain,"
        "Cycle Count / 1"
    )
    columns = read(
        bdf_with(header, "0,1,3.7,0.5,0,0.4,298.15,,9,1", "1,-1,3.7,0,0.1,1,299.15,,9,2")
    )
    columns = columns.columns
    assert columns["surface_temperature_celsius"].tolist() == pytest.approx([25, 26])
    assert "surface_temperature_2_celsius" not in columns, "a channel without a number"
    assert columns["branch_1_current_ampere"].tolist() == [0.4, 1]
    assert columns["net_capacity_ampere_hour"].tolist() == pytest.approx([0.5, 0.4])  # a reset
    assert columns["cycle_count"].dtype == np.int64
    assert "strain" not in columns


def test_digatron_series_clock_and_messages():
    columns = read(DIGATRON).columns
    assert columns["test_time_second"].tolist() == [90001.5, 90061.5]
    assert np.diff(columns["unix_time_second"]).tolist() == [60]
    assert columns["net_capacity_ampere_hour"].tolist() == [0, -0.02]


def test_digatron_spectrum_is_in_ohm():
    columns = read(SPECTRUM).columns
    assert columns["impedance_real_ohm"].tolist() == pytest.approx([0.02, 0.03, 0.04])
    assert columns["impedance_imaginary_ohm"].tolist() == pytest.approx([0.005, -0.005, -0.02])


def test_labview_channels_are_told_by_the_description():
    columns = read(LABVIEW).columns
    assert columns["test_time_second"].tolist() == [0, 0.889429, 0.972502]
    assert columns["current_ampere"].tolist() == [0.013707, -5.8956, 3.4e38]
    assert columns["surface_temperature_celsius"][0] == 20.238127
    assert columns["ambient_temperature_celsius"][0] == 20.068987
    assert "unix_time_second" not in columns, "the clock was not set"


def test_labview_second_header_tells_the_date():
    columns = read(SEGMENTED).columns
    assert columns["voltage_volt"].tolist() == [3.2015, 2.9772, 3.1071]
    assert columns["unix_time_second"][0] == pytest.approx(1694014588.1037, abs=1e-3)


def test_labview_names_and_units_of_channels_come_before_the_description():
    columns = read(NAMED).columns
    assert columns["current_ampere"][:2].tolist() == pytest.approx([13.707e-6, -5.8956e-3])
    assert columns["voltage_volt"].tolist() == [3.2015, 2.9772, 3.1071]
    assert columns["surface_temperature_celsius"][0] == 20.238127


def test_labview_decimal_comma():
    body = LABVIEW.replace(b"Decimal_Separator\t.", b"Decimal_Separator\t,")
    start = body.index(b"0.000000")
    columns = read(body[:start] + body[start:].replace(b".", b",")).columns
    assert columns["voltage_volt"].tolist() == [3.2015, 2.9772, 3.1071]


def test_labview_power_that_repeats_the_current_is_no_reading():
    """Measured: one channel wired to the other in the steps between set points."""
    assert read(LABVIEW.replace(b"-17.552000", b"-5.895600")).columns["voltage_volt"].size == 3


REFUSED = {
    "empty": (b"", "empty"),
    "blank": (b"\n \n", "empty"),
    "header only": (b"Test Time / s,Current / A,Voltage / V\n", "no row of data"),
    "one row": (bdf_with("Test Time / s,Current / A,Voltage / V", "0,1,3"), "1 row"),
    "text": (BDF.replace(b"-1,3.6\n", b"-1x,3.6\n"), "line 3: column 'Current / A': found '-1x'"),
    "words": (b"Test Time / s,Current / A,Voltage / V\n0,1,off\n1,1,off\n2,1,3\n", "found 'off'"),
    "short row": (BDF + b"3,-1\n4,-1,3.5\n", r"line 5: 2 fields where 3 are expected"),
    "long row": (BDF + b"3,-1,3.5,7\n", r"line 5: 4 fields where 3 are expected"),
    "cut gzip": (gzip.compress(BDF * 50)[:-20], "cut off"),
    "damaged gzip": (gzip.compress(BDF)[:12] + b"xxxxxxx" + gzip.compress(BDF)[19:], "damaged|cut"),
    "cut zstd": (zstandard.ZstdCompressor().compress(BDF * 50)[:-9], "cut off|damaged"),
    "not utf-8": (BDF.replace(b"3.6\n", b"3\xff6\n"), "line 3: column 'Voltage / V'"),
    "no voltage": (b"Test Time / s,Current / A\n0,1\n1,1\n", "no column 'Voltage / V'"),
    "nan only": (BDF.replace(b"3.7", b"").replace(b"3.6", b"nan").replace(b"3.59", b"NA"),
                 "voltage_volt holds no number"),
    "unknown unit": (BDF.replace(b"/ A", b"/ kA"), "unknown unit 'kA'"),
    "twice": (bdf_with("Test Time / s,Current / A,Current / mA,Voltage / V", "0,0,0,3", "1,0,0,3"),
              "say the same thing"),
    "time stands": (BDF.replace(b"\n1,", b"\n0,").replace(b"\n2,", b"\n0,"), "time never moves"),
    "zero volt": (bdf_with("Test Time / s,Current / A,Voltage / V", "0,1,0", "1,1,0"), "is 0 V"),
    "millivolt": (BDF.replace(b"/ V", b"/ mV"), "millivolt and volt"),
    "labview header": (b"LabVIEW Measurement\t\r\nWriter_Version\t2", "ends within its header"),
    "labview empty": (LABVIEW[: LABVIEW.index(b"0.000000")], "no row of data"),
    "labview no names": (LABVIEW.replace(b"are: ", b"are "), "channels without names"),
    "labview width": (LABVIEW.replace(b", Power", b""), "6 columns, where the header names 5"),
    "labview segments": (SEGMENTED + SEGMENT, "2 segments; a file with one"),
    "labview time columns": (LABVIEW.replace(b"X_Columns\tOne", b"X_Columns\tMulti"), "'Multi'"),
    "labview separator": (LABVIEW.replace(b"Separator\tTab", b"Separator\tComma"), "'Comma'"),
    "labview power": (LABVIEW.replace(b"-17.552", b"-17552"), "power is 1e.06 times current"),
    "labview no voltage": (LABVIEW.replace(b"Voltage", b"Pressure"), "no column 'voltage'"),
    "xlsx": (b"PK\x03\x04 .... xl/workbook.xml", "Excel workbook is cut off or damaged"),
    "ndax": (b"PK\x03\x04 .... data.ndc", "ndax archive is cut off or damaged"),
    "unknown": (b"a,b\n1,2\n", "of no instrument known here$"),
    "cut parquet": (b"PAR1" + b"x" * 50, "Parquet file is cut off"),
    "eis sign": (SPECTRUM.replace(b";-5;", b";5;").replace(b";-20;", b";20;"), r"-Im\(Z\)"),
    "eis in ohm": (SPECTRUM.replace(b";10;0.", b";10000;0."), "not in milliohm"),
    "digatron header": (b"\n\nMeasurement ID,5\nBattery", "ends within its header"),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_refusals_say_what_is_wrong(what):
    data, message = REFUSED[what]
    with pytest.raises(Refusal, match=r"^some\.csv: .*" + message):
        read(data)


def test_text_in_parquet_is_refused():
    table = pa.table({"Test Time / s": [0, 1], "Voltage / V": ["a", "b"], "Current / A": [0.0, 1]})
    buffer = io.BytesIO()
    parquet.write_table(table, buffer)
    with pytest.raises(Refusal, match=r"'Voltage / V' holds .*string, such as 'a'"):
        read(buffer.getvalue())


def test_unknown_reader_lists_the_known():
    with pytest.raises(Refusal, match="no reader for instrument 'nobody'; readers: bdf, arbin"):
        read(BDF, instrument="nobody")


def test_wrong_reader_is_refused_not_crashed():
    for instrument in formats.READERS:
        if instrument not in ("bdf", "table"):  # which reads time, current and voltage of anybody
            with pytest.raises(Refusal):
                read(BDF, instrument=instrument)


def counted(factor: float) -> bytes:
    time = np.arange(200.0)
    rows = (f"{t * factor},2,3.7,{round(t * 2 / 3600, 6)}" for t in time)
    return bdf_with("Test Time / s,Current / A,Voltage / V,Net Capacity / Ah", *rows)


@pytest.mark.parametrize("factor", [1000, 60, 1 / 60, 3600, 1 / 1000])
def test_clock_at_odds_with_counter_is_refused(factor):
    with pytest.raises(Refusal, match="the file's own charge counter"):
        read(counted(factor))


def test_clock_that_agrees_with_counter():
    columns = read(counted(1)).columns
    names = ("test_time_second", "current_ampere", "net_capacity_ampere_hour")
    expected, seen = charge_by_clock_and_counter(*(columns[n] for n in names))
    assert expected / seen == pytest.approx(1, abs=1e-3)


def test_chamber_that_was_not_connected_is_left_out():
    header = (
        "Test Time / s,Current / A,Voltage / V,Ambient Temperature / degC,"
        "Surface Temperature T1 / degC"
    )
    assert (
        "ambient_temperature_celsius"
        not in read(bdf_with(header, "0,0,3,0,25", "1,0,3,0,25")).columns
    )
    assert "ambient_temperature_celsius" in read(bdf_with(header, "0,0,3,0,1", "1,0,3,0,1")).columns


@pytest.mark.parametrize(
    ("dates", "seconds"),
    [
        (("\t09/20/2024 08:32:34.558", "09/20/2024 08:33:04.559"), 30.001),
        (("2010-09-02 23:59:40", "2010-09-03 00:00:10"), 30),
        (("1494377253.17", "1494377283.17"), 30),
        (("yesterday", "today"), None),
    ],
)
def test_dates_of_arbin(dates, seconds):
    header = "Data_Point,Test_Time(s),Date_Time,Step_Index,Current(A),Voltage(V)"
    columns = read(
        bdf_with(header, *(f"1,{30 * k},{d},1,0,3" for k, d in enumerate(dates)))
    ).columns
    assert ("unix_time_second" in columns) == (seconds is not None)
    if seconds:
        assert np.diff(columns["unix_time_second"])[0] == pytest.approx(seconds, abs=1e-3)


@given(st.lists(st.sampled_from([0.0, 0.001, -3.7, 3.7, 4000.0]), min_size=3, max_size=25))
def test_a_voltage_is_refused_by_its_median(values):
    rows = "".join(f"{k},0,{value}\n" for k, value in enumerate(values))
    text = b"Test Time / s,Current / A,Voltage / V\n" + rows.encode()
    middle = np.median(np.abs(values))
    if 0.01 <= middle <= 1000:
        columns = formats.read(text, name="x.bdf.csv").columns
        np.testing.assert_array_equal(columns["voltage_volt"], values)
        assert all(column.flags.writeable for column in columns.values())
    else:
        reason = "0 V in most rows" if middle == 0 else f"voltages around {middle:g} V"
        with pytest.raises(Refusal, match=reason):
            formats.read(text, name="x.bdf.csv")


def test_a_word_for_no_value_is_blank_and_said_by_its_line():
    rows = "".join(f"{k},-1,3.{k},25\n" for k in range(10, 20))
    text = "Test Time / s,Current / A,Voltage / V,Surface Temperature / degC\n" + rows
    text = text.replace("13,-1,3.13,25", "13, OverRange,3.13,25").replace("17,25", '17,"#DIV/0!"')
    text = text.replace("12,-1,3.12,25", "12,-1,3.12,n/a").replace(
        "15,-1,3.15,25", "15,-1,3.15,n/a"
    )
    found = formats.read(text.encode(), name="some.csv")
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found.columns["current_ampere"])), [3])
    surface = found.columns["surface_temperature_celsius"]
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(surface)), [2, 5, 7])
    assert found.notes == (
        "column 'Surface Temperature / degC': 'n/a' in 2 rows (line 4, 7) is no number and was "
        "left blank",
        "column 'Current / A': 'OverRange' in line 5 is no number and was left blank",
        "column 'Surface Temperature / degC': '#DIV/0!' in line 9 is no number and was left blank",
    )
