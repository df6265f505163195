"""The gate: what is no file is not opened, what unpacks without end is not unpacked."""

import gzip
import io
import os
import socket
import struct
import tracemalloc
import zipfile
import zlib

import numpy as np
import pyarrow as pa
import pytest
import zstandard
from pyarrow import parquet
from quick import slow_but

import cellwright as cw
from cellwright import formats, gate
from cellwright.formats import container, matlab_elements
from cellwright.refusal import Refusal

HEADER = b"Test Time / s,Current / A,Voltage / V\n"
ROWS = HEADER + b"".join(b"%d,1,%.4f\n" % (k, 3 + 1e-4 * k) for k in range(3000))
ZEROS = bytes(1 << 20)
NOT_READ_ON = "unpacks to more than 100 times its .* MB, which no record of readings does"


@pytest.fixture
def campaign(tmp_path):
    """A campaign with a file, a link to it, and everything that is none."""
    folder = tmp_path / "campaign"
    (folder / "folder").mkdir(parents=True)
    (folder / "good.csv").write_bytes(ROWS)
    (folder / "inside.csv").symlink_to("good.csv")
    (tmp_path / "secret.csv").write_bytes(ROWS)
    (folder / "outside.csv").symlink_to(tmp_path / "secret.csv")
    (folder / "raw").symlink_to(tmp_path)
    (folder / "loop").symlink_to("loop")
    for name in ("{a}.csv", "<results>.csv", "<3 A.csv"):
        (folder / name).write_bytes(ROWS)
    (folder / "device").symlink_to("/dev/zero")
    os.mkfifo(folder / "pipe")
    with socket.socket(socket.AF_UNIX) as opened:
        opened.bind(str(folder / "s"))
    return folder


SAID = {
    "good.csv": "",
    "<3 A.csv": "",
    "<results>.csv": "has a word between < and > in its name; rename it",
    "inside.csv": "",
    "nowhere.csv": "there is no such file in the campaign",
    "good.csv/more": "there is no such file in the campaign",
    "folder": "is a folder, wanted a file",
    "pipe": "is a pipe (FIFO), wanted a file",
    "device": "is a device, wanted a file",
    "s": "is a socket, wanted a file",
    "loop": "cannot be read: Too many levels of symbolic links",
    "outside.csv": "leads out of the campaign by a link; copy the file into it",
    "raw/secret.csv": "leads out of the campaign by a link; copy the file into it",
    "{a}.csv": "has a brace in its name; rename it",
    "a\nb.csv": "has a line break in its name; rename it",
    "a\0b.csv": "has a NUL in its name; rename it",
}


@pytest.mark.parametrize("name", SAID)
def test_a_campaign_reads_regular_files_that_lie_in_it(campaign, monkeypatch, name):
    monkeypatch.chdir(campaign)
    assert gate.obstacle(name, ".") == SAID[name]
    if not SAID[name]:
        assert gate.contents(name, within=".") == ROWS
        return
    with pytest.raises(Refusal) as refused:
        gate.contents(name, within=".")
    assert str(refused.value) == f"{name}: {SAID[name]}"


def test_a_campaign_below_a_link_is_a_campaign(campaign, tmp_path, monkeypatch):
    (tmp_path / "link").symlink_to(campaign)
    monkeypatch.chdir(tmp_path)
    assert gate.contents("good.csv", within="link") == ROWS


@pytest.mark.parametrize("name", ["pipe", "device", "folder"])
def test_the_interface_reads_files_anywhere_but_nothing_else(campaign, name):
    assert len(cw.read(campaign / "outside.csv").columns["voltage_volt"]) == 3000
    assert len(cw.read(campaign / "{a}.csv").columns["voltage_volt"]) == 3000
    for step in (cw.read, cw.read_simulated, cw.export_model):
        with pytest.raises(Refusal, match=f"{name}: is a .*, wanted a file"):
            step(campaign / name)


def test_a_fault_of_the_disk_is_no_fault_of_the_file(campaign, monkeypatch):
    """Another try may read it: it is not refused for good."""

    def fails(*_):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "open", fails)
    with pytest.raises(OSError, match="Input/output error"):
        gate.contents("good.csv", within=campaign)


def test_a_pipe_in_the_place_of_a_file_keeps_nobody_waiting(campaign, monkeypatch):
    monkeypatch.setattr(gate, "obstacle", lambda *about: "")
    with pytest.raises(Refusal, match="is no file any more"):
        gate.contents(campaign / "pipe")


def test_a_file_that_is_too_long_is_not_read(tmp_path):
    path = tmp_path / "long.csv"
    with open(path, "wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(Refusal, match=r"is 1,099,511\.63 MB long, more than the 8000 MB"):
        cw.read(path)
    path.write_bytes(ROWS)
    with pytest.raises(Refusal, match=r"is 0\.04 MB long, more than the 0\.01 MB"):
        cw.read(path, largest_megabyte=0.01)


def zeros(megabyte):
    """Chunks of a table that says nothing."""
    yield HEADER
    for _ in range(megabyte):
        yield b"0,0,0\n" * (1_000_000 // 6)


def gzipped(megabyte):
    packer = zlib.compressobj(9, zlib.DEFLATED, 31)
    return b"".join([*map(packer.compress, zeros(megabyte)), packer.flush()])


def zstandard_of(megabyte):
    packer = zstandard.ZstdCompressor().compressobj()
    return b"".join([*map(packer.compress, zeros(megabyte)), packer.flush()])


def archive(megabyte):
    packed = io.BytesIO()
    parts = zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED)
    with parts, parts.open("data.ndc", "w") as part:
        for _ in range(megabyte):
            part.write(ZEROS)
    return packed.getvalue()


def matlab(megabyte):
    packer = zlib.compressobj(9)
    element = b"".join([*(packer.compress(ZEROS) for _ in range(megabyte)), packer.flush()])
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    return head + struct.pack("<II", matlab_elements.COMPRESSED, len(element)) + element


BOMBS = {"gzip": gzipped, "Zstandard": zstandard_of, "archive": archive, "MATLAB": matlab}


@pytest.mark.parametrize("kind", slow_but("gzip", BOMBS))
def test_what_unpacks_without_end_is_not_unpacked(kind):
    """Neither by its ratio nor by its length; memory is that of the refused length at most."""
    data = BOMBS[kind](150)
    assert len(data) < 2_000_000
    tracemalloc.start()
    with pytest.raises(Refusal, match=f"^x: {NOT_READ_ON}"):
        formats.read(data, name="x")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 120e6
    with pytest.raises(Refusal, match="unpacks to more than the 20 MB that the setting files"):
        formats.read(BOMBS[kind](25), name="x", largest_megabyte=20)


def test_a_length_that_an_archive_misstates_is_no_length():
    data = bytearray(archive(150))
    place = data.rfind(b"PK\x01\x02") + 24
    data[place : place + 4] = struct.pack("<I", 100)
    with pytest.raises(Refusal, match="ndax archive is cut off or damaged"):
        formats.read(bytes(data), name="x")


def test_parquet_of_one_value_is_not_laid_out():
    values = pa.array(np.zeros(10_000_000))
    names = ("Test Time / s", "Current / A", "Voltage / V")
    packed = io.BytesIO()
    parquet.write_table(pa.table(dict.fromkeys(names, values)), packed, compression="zstd")
    for read in (formats.read, formats.read_simulated):
        with pytest.raises(Refusal, match=NOT_READ_ON):
            read(packed.getvalue(), name="x")


def sheet(text):
    """A workbook of one sheet with these rows."""
    names = {
        "[Content_Types].xml": "<Types/>",
        "xl/workbook.xml": "<workbook/>",
        "xl/anything.xml": f"<worksheet><sheetData>{text}</sheetData></worksheet>",
    }
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as parts:
        for name, content in names.items():
            parts.writestr(name, content)
    return packed.getvalue()


FAR = {
    "a cell far out": '<row r="1"><c r="A1"><v>1</v></c></row>'
    '<row r="1048576"><c s="1" r="XFD1048576"><v>1</v></c></row>',
    "cells without a place": f'<row r="1">{"<c><v>1</v></c>" * 16384}</row>'
    '<row r="1048576"><c><v>1</v></c></row>',
}


@pytest.mark.parametrize("text", FAR.values(), ids=FAR)
def test_a_sheet_of_blank_cells_is_not_laid_out(text):
    """The workbook's reader would ask for half a terabyte, and end the process."""
    data = sheet(text)
    assert len(data) < 3000
    with pytest.raises(Refusal, match=NOT_READ_ON):
        formats.read(data, name="x")


def test_cells_that_have_a_format_and_no_value_take_no_room():
    text = '<row r="1"><c r="A1"><v>1</v></c><c r="XFD1" s="3"/></row><row r="50000"/>'
    assert container.unpacked(sheet(text))


def test_a_row_of_a_sheet_has_an_end():
    with pytest.raises(Refusal, match="a row of a sheet is longer than 4194304 bytes"):
        formats.read(sheet("<row>" + "<c><v>1</v></c>" * 400_000), name="x")


WIDE = {
    HEADER + b"1" * 300_000: "line 2 is longer than 262144 bytes",
    HEADER + b"0,0,3\n" * 50_000 + b"1" * 300_000 + b"\n": "line 50002 is longer",
    b"Test Time / s" + b",a" * 5000 + b"\n1\n": "the table has 5001 columns, wanted 4096 at most",
}


@pytest.mark.parametrize("data", WIDE, ids=WIDE.values())
def test_a_line_without_end_and_thousands_of_columns_are_refused(data):
    with pytest.raises(Refusal, match=f"^x: {WIDE[data]}"):
        formats.read(data, name="x")


def test_honest_files_pass_whole():
    packer = zstandard.ZstdCompressor(write_content_size=False).compress
    packed = {
        "gzip": gzip.compress(ROWS),
        "gzip twice": gzip.compress(ROWS[:9000]) + gzip.compress(ROWS[9000:]),
        "Zstandard": packer(ROWS),
        "frames": packer(ROWS[:9000]) + packer(ROWS[9000:]),
        "text": ROWS,
    }
    for kind, data in packed.items():
        assert container.unpacked(data) == ROWS, kind


@pytest.mark.parametrize("known", [True, False])
def test_a_cut_zstandard_file_is_refused_whether_it_says_its_length_or_not(known):
    data = zstandard.ZstdCompressor(write_content_size=known).compress(ROWS)
    with pytest.raises(Refusal, match="the Zstandard file is cut off"):
        container.unpacked(data[:-20])
