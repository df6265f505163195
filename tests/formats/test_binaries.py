"""Neware's nda and ndax, and Arbin's data bases: others' readings, and cut or damaged files."""

import zipfile
import zlib
from io import BytesIO

import numpy as np
import pandas as pd
import pytest

from cellwright import formats
from cellwright.formats.jet import Base
from cellwright.refusal import Refusal

PAGE = 4096
NDA, RES = "neware/TestFile.nda", "arbin/arbin_example.res"


def content(shared, file):
    return (shared / "formats" / file).read_bytes()


def read(data):
    return formats.read(bytes(data), name="file")


def test_neware_binaries_are_as_others_read_them(shared):
    from pyarrow import feather

    rows = pd.read_csv(shared / "formats/manifest.tsv", sep="\t").set_index("file")["golden"]
    golden = rows[rows.str.endswith(".ftr").fillna(False)]
    assert len(golden) >= 5
    for file, name in golden.items():
        wanted = feather.read_table(shared / "formats" / name).to_pandas()
        reading = read(content(shared, file))
        columns = reading.columns
        np.testing.assert_allclose(columns["voltage_volt"], wanted["Voltage"], atol=2e-7)
        np.testing.assert_allclose(
            columns["current_ampere"], wanted["Current(mA)"] / 1e3, atol=1e-12
        )
        counted = (wanted["Charge_Capacity(mAh)"] - wanted["Discharge_Capacity(mAh)"]) / 1e3
        within = np.diff(columns["step_count"]) == 0  # counters begin anew with each step
        moved = np.diff(columns["net_capacity_ampere_hour"])[within]
        np.testing.assert_allclose(moved, np.diff(counted)[within], atol=2e-6)


def test_thermometers_of_neware_keep_their_names(shared):
    columns = read(content(shared, "neware/123456789012_Unit27_Example_Data_File.ndax")).columns
    assert columns["surface_temperature_celsius"][-1] == pytest.approx(25.414, abs=1e-3)
    assert columns["surface_temperature_2_celsius"][-1] == pytest.approx(25.487, abs=1e-3)


def test_reading_an_archive_leaves_the_functions_of_python_as_they_were(shared):
    before = zlib.decompress, zlib.decompressobj
    read(content(shared, "neware/test.ndax"))
    assert (zlib.decompress, zlib.decompressobj) == before


FILES = (NDA, "neware/test.ndax", "neware/TESTCELL0001-Test_Data_Collection_Ndc17.ndax", RES)


@pytest.mark.parametrize("file", FILES)
def test_a_file_that_is_cut_off_is_whole_or_refused(shared, file):
    data = content(shared, file)
    whole = read(data).columns
    refused = 0
    for end in np.linspace(30, len(data) - 1, 40).astype(int):
        try:
            cut = read(data[:end]).columns
        except Refusal:
            refused += 1
            continue
        assert cut.keys() == whole.keys()
        for name, values in cut.items():
            np.testing.assert_array_equal(values, whole[name])
    assert refused > 30


@pytest.mark.parametrize("at", [20_000, 120_000, 250_000, 370_000])
@pytest.mark.parametrize("lost", [1, 86, PAGE])
def test_bytes_that_are_missing_within_an_nda_are_missed(shared, at, lost):
    data = content(shared, NDA)
    with pytest.raises(Refusal):
        read(data[:at] + data[at + lost :])
    blank = max(lost, 86)
    with pytest.raises(Refusal, match=r"readings of the .* are missing"):
        read(data[:at] + bytes(blank) + data[at + blank :])


def test_an_archive_of_neware_without_its_readings_or_times_is_refused(shared):
    archive = zipfile.ZipFile(BytesIO(content(shared, FILES[2])))
    for lost in ("data.ndc", "data_runInfo.ndc"):
        kept = BytesIO()
        with zipfile.ZipFile(kept, "w") as parts:
            for part in archive.namelist():
                if part != lost:
                    parts.writestr(part, archive.read(part))
        with pytest.raises(Refusal, match="Neware file"):
            read(kept.getvalue())


def test_a_damaged_neware_archive_is_refused():
    archive = BytesIO()
    with zipfile.ZipFile(archive, "w") as parts:
        parts.writestr("data.ndc", bytes(1000))
    with pytest.raises(Refusal, match="ndax archive is cut off or damaged"):
        read(archive.getvalue()[:-30])


def test_each_page_of_a_data_base_that_is_blanked_is_missed_or_not_needed(shared):
    data = content(shared, RES)
    whole = read(data).columns
    refused = 0
    for place in range(PAGE, len(data), PAGE):
        try:
            columns = read(data[:place] + bytes(PAGE) + data[place + PAGE :]).columns
        except Refusal:
            refused += 1
        else:
            for name, values in columns.items():
                np.testing.assert_array_equal(values, whole[name])
    assert refused >= 54  # pages of the readings


def owned(base, name):
    """Number of the page that defines a table of a data base, as its pages of rows say it."""
    return base.base.get_table(name).table.offset // PAGE


def with_rows(data, name, records):
    """A data base with a page more, which holds rows of a table that had none."""
    number = owned(Base(data), name)
    ends, body = [], b""
    for record in records:
        body = record + body
        ends.append(PAGE - len(body))
    head = b"\x01\x01\0\0" + number.to_bytes(4, "little") + bytes(4)
    head += len(ends).to_bytes(2, "little") + np.array(ends, "<u2").tobytes()
    page = head + bytes(PAGE - len(head) - len(body)) + body
    counted = bytearray(data)  # the number of rows stands at byte 16 of the definition
    counted[number * PAGE + 16 : number * PAGE + 20] = len(ends).to_bytes(4, "little")
    return bytes(counted) + page


def auxiliary(point, number, kind, value):
    """A row of Auxiliary_Table: count of columns, columns, bits of those that are not blank."""
    fixed = np.array([1, point], "<i4").tobytes() + np.array([number, kind], "<i2").tobytes()
    return b"\x05\0" + fixed + np.float32(value).tobytes() + b"\x1f"


def test_auxiliary_temperatures_of_arbin_keep_their_names(shared):
    data = content(shared, RES)
    rows = [auxiliary(p, 0, 1, 20 + p / 10) for p in range(1, 41)]
    rows += [auxiliary(p, 3, 1, 30 + p % 2) for p in range(2, 41)] + [auxiliary(1, 0, 0, 3.7)]
    reading = read(with_rows(data, "Auxiliary_Table", rows))
    first, second = (reading.columns[f"surface_temperature{k}_celsius"] for k in ("", "_2"))
    assert first[:40] == pytest.approx(20 + np.arange(1, 41) / 10, abs=1e-5)
    assert np.isnan(first[40:]).all()
    assert np.isnan(second[0])
    assert second[1:40].tolist() == [30 + p % 2 for p in range(2, 41)]
    assert "auxiliary inputs that are not read: 0 of type 0" in reading.notes


def test_a_row_that_lies_on_another_page_is_followed(shared):
    data = bytearray(content(shared, RES))
    base = Base(bytes(data))
    wanted = base.numbers("Channel_Normal_Table")["Voltage"]
    owner = owned(base, "Channel_Normal_Table")
    page = next(
        k for k in range(0, len(data), PAGE)
        if data[k : k + 2] == b"\x01\x01" and int.from_bytes(data[k + 4 : k + 8], "little") == owner
    )  # fmt: skip
    start = int.from_bytes(data[page + 14 : page + 16], "little")  # of its first row
    row, moved = bytes(data[page + start : page + PAGE]), len(data) // PAGE
    data[page + start : page + start + 4] = b"\0" + moved.to_bytes(3, "little")
    data[page + 14 : page + 16] = (start | 0x4000).to_bytes(2, "little")
    head = b"\x01\x01\0\0" + owner.to_bytes(4, "little") + bytes(4) + b"\1\0"
    head += (PAGE - len(row) | 0x8000).to_bytes(2, "little")
    data += head + bytes(PAGE - len(head) - len(row)) + row
    np.testing.assert_array_equal(
        Base(bytes(data)).numbers("Channel_Normal_Table")["Voltage"], wanted
    )


def test_a_definition_that_leads_back_to_itself_is_refused(shared):
    data = bytearray(content(shared, RES))
    number = owned(Base(bytes(data)), "Channel_Normal_Table")
    data[number * PAGE + 4 : number * PAGE + 8] = number.to_bytes(4, "little")
    with pytest.raises(Refusal, match="definition of a table has no end"):
        read(data)
