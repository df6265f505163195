"""Files that are no mistake of one kind: each is read right, or refused in its own sentence."""

import io
import json
import struct
import time
import tracemalloc
import zlib

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from scipy import sparse
from scipy.io import savemat

from cellwright import formats
from cellwright.formats import arrow_size, container
from cellwright.refusal import Refusal

ROWS = 200
TIME, CURRENT, VOLTAGE = np.arange(ROWS) * 10.0, -np.ones(ROWS), 3.6 - 1e-3 * np.arange(ROWS)
NAMES = ("Test Time / s", "Current / A", "Voltage / V")
COLUMNS = dict(zip(NAMES, (TIME.tolist(), CURRENT.tolist(), VOLTAGE.tolist()), strict=True))


def text(*more, end="\n", names=NAMES):
    """A table of text with one more column of ones for each further label."""
    lines = [",".join([*names, *more])]
    lines += [
        ",".join([f"{t:g}", f"{i:g}", f"{v:.4f}", *("1" for _ in more)])
        for t, i, v in zip(TIME, CURRENT, VOLTAGE, strict=True)
    ]
    return (end.join(lines) + end).encode()


def arrow(columns, names, kind="parquet"):
    table = pa.Table.from_arrays([pa.array(values) for values in columns], names=list(names))
    file = io.BytesIO()
    if kind == "parquet":
        parquet.write_table(table, file)
    else:
        with pa.ipc.new_file(file, table.schema) as writer:
            writer.write_table(table)
    return file.getvalue()


def whole(data):
    """What was read of a file that has all rows of the record."""
    found = formats.read(data, name="x")
    assert np.allclose(found.columns["test_time_second"], TIME)
    assert np.allclose(found.columns["voltage_volt"], VOLTAGE)
    return found


def refused(data):
    with pytest.raises(Refusal) as reason:
        formats.read(data, name="x")
    return str(reason.value)


@pytest.mark.parametrize("names", [NAMES, ("time (s)", "current (A)", "voltage (V)")])
@pytest.mark.parametrize("end", ["\n\r", "\r\n", "\n"])
def test_line_ends_in_any_order(names, end):
    whole(text(end=end, names=names))


def test_blank_lines_between_windows_line_ends_are_not_turned_ends():
    whole(text(end="\r\n").replace(b"\r\n", b"\r\n\r\n", 1))


def test_a_document_on_one_line_is_read_as_an_indented_one():
    many = 40_000
    columns = {
        "Test Time / s": np.arange(many).tolist(),
        "Current / A": [-1.0] * many,
        "Voltage / V": np.linspace(4, 3, many).tolist(),
    }
    found = [formats.read(json.dumps(columns, indent=i).encode(), name="x") for i in (None, 1)]
    assert len(json.dumps(columns)) > 1 << 18
    assert all(np.array_equal(f.columns["voltage_volt"], columns["Voltage / V"]) for f in found)
    # A line of a table that is as long is none.
    assert "line 1 is longer than" in refused(b"a" * (1 << 19))


def test_half_a_letter_in_a_key_that_is_not_read_can_be_told():
    found = whole(json.dumps(COLUMNS | {"\ud800 x": [0] * ROWS}).encode())
    assert found.notes[0].encode("utf-8") == b"columns that are not read: ? x"


def test_a_key_that_stands_twice_is_refused():
    twice = json.dumps(COLUMNS).replace("{", '{"Voltage / V": [1], ', 1)
    assert "has the key 'Voltage / V' twice in one object" in refused(twice.encode())


@pytest.mark.parametrize("digits", [401, 5000])
def test_an_integer_of_hundreds_of_digits_is_no_number(digits):
    long = json.dumps(COLUMNS).replace("-1.0", "-" + "9" * digits, 1)
    said = refused(long.encode())
    assert ("row 1 of data: column 'Current / A': found -999" in said) == (digits == 401)
    assert len(said) < 300


@pytest.mark.parametrize("label", ["9" * 5000, f"Branch {'9' * 5000} Current / A", "a" * 9000])
def test_a_label_of_thousands_of_letters_is_none_that_is_known(label):
    (note,) = whole(text(label)).notes
    assert note == f"columns that are not read: {label[:200]}"
    whole(arrow([TIME, CURRENT, VOLTAGE, TIME], [*NAMES, label]))


@pytest.mark.parametrize("kind", ["parquet", "arrow"])
def test_columns_of_one_name_are_refused_where_they_would_be_read(kind):
    columns = [TIME, CURRENT, VOLTAGE, VOLTAGE]
    said = refused(arrow(columns, [*NAMES, "Voltage / V"], kind))
    assert said.startswith("x: columns 3, 4 have one label, 'Voltage / V'")
    whole(arrow([*columns, VOLTAGE], [*NAMES, "other", "other"], kind))


@pytest.mark.parametrize("kind", ["parquet", "arrow"])
@pytest.mark.parametrize("unit", ["s", "us"])
@pytest.mark.parametrize("year", [1, 1600, 2024, 9999])
def test_dates_of_any_year_are_right_or_refused(kind, unit, year):
    """A timestamp of nanoseconds ends with the year 2262."""
    begin = np.datetime64(f"{year:04d}-01-01", unit)
    dates = begin + (TIME * (1 if unit == "s" else 10**6)).astype(f"timedelta64[{unit}]")
    data = arrow([TIME, CURRENT, VOLTAGE, dates], [*NAMES, "Unix Time / s"], kind)
    if year == 9999:
        assert "its dates lie about the year 9999" in refused(data)
        return
    unix = whole(data).columns["unix_time_second"]
    assert np.array_equal(unix, TIME + begin.astype("datetime64[s]").astype(float))


BEGINNINGS = ("", "time", "Test_Time(s", "Capacity", "temperature t", '{"a', "Date", "Freq")


@pytest.mark.parametrize("begin", BEGINNINGS)
@pytest.mark.parametrize("fill", [" ", "\xa0", "\r", "9", "a ", "(", "_", "-"])
def test_a_label_takes_no_longer_for_being_long(begin, fill):
    """As 250,000 blanks behind `time` did: hours."""
    label = begin + fill * 20_000
    start = time.process_time()
    for data in (label.encode() + b"x\n1,2,3\n", text(label), text(label, names=NAMES[::-1])):
        try:
            formats.read(data, name="x")
        except Refusal:
            continue
    assert time.process_time() - start < 2.0


@pytest.mark.parametrize(
    "sheet",
    [
        b'<c r="A1" ' * 20_000,
        b"<c " + b'r="A1" ' * 40_000,
        b"<c " * 60_000,
        b"<c r" + b" " * 200_000,
    ],
)
def test_tags_without_an_end_are_looked_through_once(sheet):
    start = time.process_time()
    container._extent(sheet, (0, 0))
    assert time.process_time() - start < 1.0


def test_cells_of_a_sheet_are_counted():
    sheet = b'<row r="2"><c r="B2" s="1"><v>1</v></c><x:c t="n" r="AA2"/><c r = \'C3\' ></c></row>'
    assert container._extent(sheet, (0, 0))[0] == (3, 3)


def matlab(kind, shape, further=b""):
    """An array of a class in a .mat, with what follows its name."""
    sizes = struct.pack(f"<II{len(shape)}i", 5, 4 * len(shape), *shape)
    body = struct.pack("<IIII", 6, 8, kind, 0) + sizes + struct.pack("<II", 1, 1) + b"a" + bytes(7)
    return struct.pack("<II", 14, len(body + further)) + body + further


def matlab_file(*arrays):
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\x01IM" + b"".join(arrays)


FIELDS = struct.pack("<HHI", 5, 4, 8) + struct.pack("<II", 1, 0)
MANY = (250_000_000, 1)
PACKED = zlib.compress(matlab(1, MANY))
FALSE = {
    "cells": matlab(1, MANY),
    "a structure": matlab(2, MANY, FIELDS),
    "numbers": matlab(6, MANY),
    "cells in cells": matlab(1, (1, 1), matlab(1, MANY)),
    "packed": struct.pack("<II", 15, len(PACKED)) + PACKED,
}


@pytest.mark.parametrize("what", FALSE)
def test_dimensions_that_no_bytes_stand_behind_take_no_memory(what):
    """192 bytes took 2 GB: room for all members is made before they are read."""
    tracemalloc.start()
    assert "an array of 250000000 × 1 members takes" in refused(matlab_file(FALSE[what]))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1e7


def test_arrays_of_a_kind_that_there_is_not_reach_no_library():
    """SciPy reads beyond its table of kinds, which ends the process."""
    numbers = struct.pack("<IId", 161, 8, 1.0)
    assert "an element of kind 161" in refused(matlab_file(matlab(6, (1, 1), numbers)))
    assert "without its 1 elements of data" in refused(matlab_file(matlab(6, (1, 1))))
    deep = matlab(6, (1, 1), struct.pack("<IId", 9, 8, 1.0))
    for _ in range(40):
        deep = matlab(1, (1, 1), deep)
    assert "arrays in arrays, more than 32 deep" in refused(matlab_file(deep))


@pytest.mark.parametrize("packed", [False, True])
def test_structures_of_any_members_are_read(packed):
    others = {
        "names": np.array(["a", "bcd"], dtype=object),
        "inner": {"more": {"zeros": np.zeros((3, 4)), "nothing": np.zeros((0, 5))}},
        "complex": np.array([[1 + 2j]]),
        "text": "hello",
        "switches": np.ones((2, 2), bool),
        "sparse": sparse.csc_array(np.eye(3)),
    }
    columns = {"time": TIME, "current": CURRENT, "voltage": VOLTAGE}
    file = io.BytesIO()
    savemat(file, {"meas": columns | others}, do_compression=packed)
    whole(file.getvalue())


@pytest.mark.parametrize("codec", ["zstd", "lz4", None])
def test_pages_of_an_arrow_file_are_counted_before_they_are_unpacked(codec):
    """74 kB of zeros took 4.8 GB."""
    rows = 5_000_000 if codec else ROWS
    zeros = np.zeros(rows)
    table = pa.table(
        dict.fromkeys(NAMES, zeros) | {"x": pa.array(["a"] * rows).dictionary_encode()}
    )
    file = io.BytesIO()
    options = pa.ipc.IpcWriteOptions(compression=codec)
    with pa.ipc.new_file(file, table.schema, options=options) as writer:
        writer.write_table(table, max_chunksize=rows // 2)
    data = file.getvalue()
    # Numbers as they stand in the file and as they are read, and a code for each text.
    assert arrow_size.unpacked_byte(data, 3) == pytest.approx(rows * (2 * 3 * 8 + 4), rel=0.02)
    if codec:
        assert "unpacks to more than 100 times its" in refused(data)


def test_damaged_arrow_files_are_refused():
    data, rng = arrow([TIME, CURRENT, VOLTAGE], NAMES, "arrow"), np.random.default_rng(1)
    for _ in range(300):
        damaged = bytearray(data)
        damaged[rng.integers(len(data))] = rng.integers(256)
        try:
            formats.read(bytes(damaged[: rng.integers(8, 2 * len(data))]), name="x")
        except Refusal:
            continue
