"""However a table is written, cut or damaged: the same numbers, or a refusal of our own."""

import gzip
import io
import re

import numpy as np
import pandas as pd
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st

from cellwright import formats
from cellwright.formats import content, table
from cellwright.refusal import Refusal

SERIES = ("test_time_second", "current_ampere", "voltage_volt")
ROWS = 24
SECOND = 30.0 * np.arange(ROWS)
AMPERE = np.where(np.arange(ROWS) < 4, 0.0, -1.25)
VOLT = 3.7 - 0.0031 * np.arange(ROWS)
CELSIUS = 25.5 + 0.1 * np.arange(ROWS)


def dated(form):
    return pd.Series(pd.to_datetime(1.7e9 + SECOND, unit="s")).dt.strftime(form)


def clocked():
    return [f"{int(t // 3600):02d}:{int(t // 60) % 60:02d}:{int(t) % 60:02d}" for t in SECOND]


def written(columns, *, above=(), delimiter=","):
    """A text with labels and rows, below some lines that are neither."""
    columns = {k: np.broadcast_to(np.asarray(v), ROWS).tolist() for k, v in columns.items()}
    cells = [[f"{x:.6g}" if isinstance(x, float) else str(x) for x in c] for c in columns.values()]
    lines = [*above, delimiter.join(columns), *map(delimiter.join, zip(*cells, strict=True))]
    return "\n".join(lines) + "\n"


SAMPLES = {
    "arbin": written(
        {"Data_Point": np.arange(ROWS), "Test_Time(s)": SECOND, "Date_Time": dated("%Y-%m-%d %T"),
         "Step_Index": 1, "Current(A)": AMPERE, "Voltage(V)": VOLT,
         "Aux_Temperature_1(C)": CELSIUS}),
    "maccor": written(
        {"Rec#": np.arange(ROWS), "Cyc#": 0, "Step": 1, "Test (Sec)": SECOND,
         "Amps": np.abs(AMPERE), "Volts": VOLT, "State": np.where(AMPERE < 0, "D", "R"),
         "Temp 1": CELSIUS, "DPt Time": dated("%m/%d/%Y %T")},
        above=["Today's Date 01/02/2024\tDate of Test:\t01/01/2024"], delimiter="\t"),
    "neware": written(
        {"DataPoint": np.arange(ROWS), "Cycle Index": 1, "Step Index": 1, "Total Time": clocked(),
         "Current(A)": AMPERE, "Voltage(V)": VOLT, "T1(°C)": CELSIUS,
         "Date": dated("%Y-%m-%d %T")}),
    "biologic": written(
        {"time/s": SECOND, "Ecell/V": VOLT, "I/mA": 1e3 * AMPERE, "Temperature/°C": CELSIUS},
        above=["EC-Lab ASCII FILE", "Nb header lines : 3"], delimiter="\t"),
    "novonix": written(
        {"Date and Time": dated("%Y-%m-%d %T"), "Run Time (h)": SECOND / 3600,
         "Current (A)": AMPERE, "Potential (V)": VOLT, "Temperature (°C)": CELSIUS},
        above=["[Summary]", "[End Summary]"]),
    "basytec": written(
        {"~Time[s]": SECOND, "I[A]": AMPERE, "U[V]": VOLT, "Line": 3, "T1[°C]": CELSIUS},
        above=["~Resultfile from Basytec Battery Test System"], delimiter="\t"),
    "landt": written(
        {"channel_index": np.arange(ROWS), "test_time_s": SECOND, "current_A": AMPERE,
         "voltage_V": VOLT, "temperature_1_C": CELSIUS}, above=["cell model:"]),
    "pec": written(
        {"Test": 187, "Cell": 1, "Rack": "R", "Total Time (Seconds)": SECOND, "Step": 1,
         "Voltage (mV)": 1e3 * VOLT, "Current (mA)": 1e3 * AMPERE, "Temp (°C)": CELSIUS},
        above=["Request Year:,2024"]),
    "table": written(
        {"Time (s)": SECOND, "Current (A)": AMPERE, "Voltage (V)": VOLT,
         "Temperature (C)": CELSIUS}, above=["an export"], delimiter=";"),
    "bdf": written(
        {"Test Time / s": SECOND, "Current / A": AMPERE, "Voltage / V": VOLT,
         "Temperature T1 / degC": CELSIUS}),
}  # fmt: skip


def read(data, **options):
    data = data if isinstance(data, bytes) else data.encode()
    return formats.read(data, name="file", **options)


@pytest.mark.parametrize("maker", SAMPLES)
def test_the_samples_say_what_they_mean(maker):
    reading = read(SAMPLES[maker])
    assert reading.instrument == maker
    # What a maker's own numbers of rows, channels and steps are called is all that is left unread.
    assert all(note.startswith("columns that are not read: ") for note in reading.notes)
    assert not any(label in note for note in reading.notes for label in ("urrent", "olt", "Temp"))
    for name, true in zip(SERIES, (SECOND, AMPERE, VOLT), strict=True):
        np.testing.assert_allclose(reading.columns[name], true, rtol=5e-6, atol=1e-5)
    np.testing.assert_allclose(reading.columns["surface_temperature_celsius"], CELSIUS, atol=1e-4)


def with_delimiter(text, new):
    lines = text.split("\n")
    first = max(range(len(lines)), key=lambda k: max(map(lines[k].count, ",;\t")))
    old = max(",;\t", key=lines[first].count)
    begin = next(k for k, line in enumerate(lines) if line.count(old) == lines[first].count(old))
    return "\n".join([*lines[:begin], *(line.replace(old, new) for line in lines[begin:])])


def decimal_comma(text):
    return re.sub(r"(?<=\d)\.(?=\d)", ",", text)


def quoted(text):
    """Every field between quotation marks."""
    old = max(",;\t", key=text.split("\n")[-2].count)
    begin = len([x for x in text.split("\n") if x.count(old) < text.split("\n")[-2].count(old)])
    lines = text.split("\n")
    return "\n".join(
        line if k < begin - 1 or not line else '"' + f'"{old}"'.join(line.split(old)) + '"'
        for k, line in enumerate(lines)
    )


# A line that one maker recognises its files by begins with its first labels as they are.
BY_COMMA = ("neware", "novonix", "pec", "landt")
WRITTEN = {
    "gzip": lambda text: gzip.compress(text.encode()),
    "Zstandard": lambda text: zstandard.ZstdCompressor().compress(text.encode()),
    "UTF-8 with a mark": lambda text: text.encode("utf-8-sig"),
    "UTF-16": lambda text: text.encode("utf-16"),
    "UTF-16, big-endian": lambda text: b"\xfe\xff" + text.encode("utf-16-be"),
    "cp1252": lambda text: text.encode("cp1252"),
    "gb18030": lambda text: text.replace("°C", "℃").encode("gb18030"),
    "lines of Windows": lambda text: text.replace("\n", "\r\n").encode(),
    "no line end": lambda text: text.rstrip("\n").encode(),
    "blank lines below": lambda text: (text + "\n\n  \n\n").encode(),
    "quoted fields": lambda text: quoted(text).encode(),
    "semicolons": lambda text: with_delimiter(text, ";").encode(),
    "tabs": lambda text: with_delimiter(text, "\t").encode(),
    "semicolons and decimal commas": lambda text: decimal_comma(with_delimiter(text, ";")).encode(),
}


@pytest.mark.parametrize("how", WRITTEN)
@pytest.mark.parametrize("maker", SAMPLES)
def test_however_it_is_written(maker, how):
    if maker in BY_COMMA and ("semicolons" in how or how == "tabs"):
        pytest.skip(f"{maker} is recognised by its commas")
    if maker in ("biologic", "maccor", "basytec") and "semicolons" in how:
        pytest.skip(f"{maker} is recognised by its tabs")
    before, after = read(SAMPLES[maker]), read(WRITTEN[how](SAMPLES[maker]))
    assert (after.instrument, after.notes) == (maker, before.notes)
    assert after.columns.keys() == before.columns.keys()
    for name, values in before.columns.items():
        np.testing.assert_array_equal(after.columns[name], values, name)


@pytest.mark.parametrize("how", WRITTEN)
@pytest.mark.parametrize("maker", SAMPLES)
def test_a_large_file_is_read_alike_in_blocks(maker, how, monkeypatch):
    """The head in memory and blocks are shorter than the file, and end anywhere."""
    monkeypatch.setattr(content, "HEAD", 900)
    monkeypatch.setattr(content, "BLOCK", 333)
    monkeypatch.setattr(table, "BLOCK", 512)
    monkeypatch.setattr(table, "PIECE_ROWS", 5)
    data = WRITTEN[how](SAMPLES[maker])
    try:
        before = read(data)
    except Refusal as reason:
        with pytest.raises(Refusal, match=f"^{re.escape(str(reason))}$"):
            formats.read(io.BytesIO(data), name="file")
        return
    after = formats.read(io.BytesIO(data), name="file")
    assert after._replace(columns={}) == before._replace(columns={})
    for name, values in before.columns.items():
        np.testing.assert_array_equal(after.columns[name], values, name)


@pytest.mark.parametrize("pack", [gzip.compress, zstandard.ZstdCompressor().compress])
def test_a_large_packed_file_that_is_cut_is_refused(pack):
    data = pack(SAMPLES["arbin"].encode())
    with pytest.raises(Refusal, match=r"^file: the (gzip|Zstandard) file is cut off"):
        formats.read(io.BytesIO(data[:-9]), name="file")


@pytest.mark.parametrize("maker", SAMPLES)
def test_a_last_row_that_is_cut_off_is_left_out_and_told(maker):
    whole = read(SAMPLES[maker]).columns
    last = SAMPLES[maker].rstrip("\n").rpartition("\n")[2]
    cut = last[: max(map(last.find, ",;\t"))]  # of its first field
    reading = read(SAMPLES[maker].removesuffix(last + "\n") + cut)
    fields = max(map(last.count, ",;\t")) + 1
    assert reading.notes[0] == f"the last row is cut off (1 of {fields} fields) and was left out"
    for name in SERIES:
        np.testing.assert_array_equal(reading.columns[name], whole[name][:-1])


@pytest.mark.parametrize("maker", SAMPLES)
def test_a_short_row_in_the_middle_is_refused_with_its_line(maker):
    lines = SAMPLES[maker].split("\n")
    lines[-5] = lines[-5][: max(map(lines[-5].rfind, ",;\t"))]
    with pytest.raises(Refusal, match=rf"^file: line {len(lines) - 4}: \d+ fields where \d+ are"):
        read("\n".join(lines))


@pytest.mark.parametrize("maker", SAMPLES)
def test_every_cut_gives_right_values_or_a_refusal(maker):
    data = SAMPLES[maker].encode()
    whole = read(data).columns
    for end in range(0, len(data), 7):
        try:
            cut = read(data[:end]).columns
        except Refusal:
            continue
        for name in SERIES:
            # A number that is cut in the last row cannot be seen.
            kept = len(cut[name]) - 1
            np.testing.assert_array_equal(cut[name][:kept], whole[name][:kept], f"{end}")


@pytest.mark.parametrize("maker", SAMPLES)
@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_a_byte_that_is_another_changes_one_row_or_is_refused(maker, data):
    content_, first = rows_of(maker)
    place = data.draw(st.integers(first, len(content_) - 1))
    changes_one_row_or_is_refused(content_, place, bytes([data.draw(st.integers(0, 255))]))


@pytest.mark.parametrize("maker", SAMPLES)
def test_a_quotation_mark_that_opens_a_cell_loses_no_rows_unsaid(maker):
    content_, first = rows_of(maker)
    begins = [first + found.end() for found in re.finditer(rb"[,;\t\n]", content_[first:-1])]
    for place in begins[:: max(len(begins) // 40, 1)]:
        changes_one_row_or_is_refused(content_, place, b'"')


def rows_of(maker):
    """A sample, and the place at which its rows begin or a little later."""
    content_ = SAMPLES[maker].encode()
    first = content_.index(b"\n", content_.index(b"3.6")) if maker != "pec" else len(content_) // 2
    return content_, first


def changes_one_row_or_is_refused(content_, place, byte):
    whole = read(content_).columns
    try:
        changed = read(content_[:place] + byte + content_[place + 1 :]).columns
    except Refusal:
        return
    same = np.ones(ROWS, bool)
    for name in SERIES:
        rows = len(changed[name])
        assert rows in (ROWS - 1, ROWS)
        same[rows:] = False
        same[:rows] &= changed[name] == whole[name][:rows]
    assert np.count_nonzero(~same) <= 1


def with_channels(names):
    rows = zip(np.arange(6), names, strict=True)
    lines = [f"{k},{10 * (k % 3)},1,{name},1.0,3.7" for k, name in rows]
    return "\n".join(["Data_Point,Test_Time(s),Step_Index,Channel,Current(A),Voltage(V)", *lines])


@pytest.mark.parametrize("instrument", [None, "table"])
def test_several_channels_in_one_file_are_named_and_not_mixed(instrument):
    text = with_channels(["2-1"] * 3 + ["2-7"] * 3)
    text = text if instrument is None else text.replace("Test_Time(s)", "Time (s)")
    with pytest.raises(Refusal, match=r"'Channel' names 2 channels \(2-1, 2-7\): one channel a"):
        read(text, instrument=instrument)


def test_one_channel_and_a_counter_of_rows_are_no_several_channels():
    one = with_channels(["2-1"] * 6).replace(",1,", ",2,", 0)
    assert len(read(one).columns["voltage_volt"]) == 6
    assert len(read(with_channels(range(6))).columns["voltage_volt"]) == 6


def test_two_candidates_are_refused_and_both_named():
    text = SAMPLES["maccor"].replace("Today's Date", "cell model:\nToday's Date")
    with pytest.raises(Refusal, match=r"could be of maccor or landt: say which as `instrument`"):
        read(text)
    assert read(text, instrument="maccor").instrument == "maccor"


THOUSANDS = "Time (s)\tCurrent (mA)\tVoltage (V)\n" + "".join(
    f"{t}\t1,250\t{3.7 + t / 1000}\n" for t in (1, 2, 3)
)


def test_a_comma_between_thousands_is_no_decimal_comma():
    with pytest.raises(Refusal, match=r"line 2: column 'Current \(mA\)': found '1,250'"):
        read(THOUSANDS)


def test_a_number_with_the_other_decimal_point_is_refused():
    text = "Time (s);Current (A);Voltage (V)\n0;0,5;3,7\n1;0,5;3,6\n2;0.5;3,5\n"
    with pytest.raises(Refusal, match=r"line 4: column 'Current \(A\)': found '0.5'"):
        read(text)


@pytest.mark.parametrize("form", ["%m/%d/%Y %H:%M:%S", "%Y-%m-%d %H:%M:%S"])
@settings(max_examples=100, deadline=None)
@given(
    seconds=st.lists(st.integers(0, 4_102_444_799), min_size=1, max_size=6),
    digits=st.integers(0, 6),
    pad=st.booleans(),
)
def test_dates_by_their_places_are_those_of_a_calendar(form, seconds, digits, pad):
    import pyarrow as pa

    from cellwright.formats.dates import unix_time_second

    stamps = pd.to_datetime(seconds, unit="s")
    texts = [stamp.strftime(form) for stamp in stamps]
    texts = [re.sub(r"\b0(\d)(?=/)", r"\1", text) if pad else text for text in texts]
    fraction = f".{'123456'[:digits]}" if digits else ""
    found = unix_time_second(pa.array([text + fraction for text in texts]), [form])
    np.testing.assert_array_equal(found, np.array(seconds, float) + float(fraction or 0))


@pytest.mark.parametrize("text", ["2024-02-30 00:00:00", "2024-13-01 00:00:00", "2024-01-01", ""])
def test_what_is_no_date_is_none(text):
    import pyarrow as pa

    from cellwright.formats.dates import unix_time_second

    assert unix_time_second(pa.array([text]), ["%Y-%m-%d %H:%M:%S"]) is None


def test_every_public_file_is_read_alike_in_blocks(shared):
    """To the last bit: from memory, and from the disk."""
    for path in sorted((shared / "formats").rglob("*")):
        if not path.is_file() or ".golden." in path.name or path.suffix in (".res", ".mpr"):
            continue
        try:
            before = formats.read(path.read_bytes(), name=path.name)
        except Refusal:
            continue
        with path.open("rb") as file:
            after = formats.read(file, name=path.name)
        assert after._replace(columns={}) == before._replace(columns={})
        for name, values in before.columns.items():
            np.testing.assert_array_equal(after.columns[name], values, f"{path.name} {name}")
