"""Workbooks, Arbin's and of anybody: one sheet or several, dates, and each refusal by name."""

import io
import zipfile

import numpy as np
import pytest

from cellwright import formats
from cellwright.formats.workbook import _written
from cellwright.refusal import Refusal

MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
OFFICE = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
PACKAGE = "http://schemas.openxmlformats.org/package/2006"
LABELS = ["Data_Point", "Test_Time(s)", "Date_Time", "Step_Index", "Cycle_Index", "Current(A)"]
LABELS += ["Voltage(V)", "Charge_Capacity(Ah)", "Discharge_Capacity(Ah)"]
NOON = 40407.5  # 17 August 2010, 12:00, in Excel's days


def sheet_xml(rows):
    def cell(value):
        if value == "":
            return "<c/>"
        if isinstance(value, str):
            return f'<c t="inlineStr"><is><t>{value}</t></is></c>'
        return f"<c><v>{value!r}</v></c>"

    body = "".join(f"<row>{''.join(map(cell, row))}</row>" for row in rows)
    return f'<worksheet xmlns="{MAIN}"><sheetData>{body}</sheetData></worksheet>'


def workbook(sheets):
    """Bytes of a workbook with the given sheets: name → rows."""
    numbered = list(enumerate(sheets, 1))
    kind = "application/vnd.openxmlformats-officedocument.spreadsheetml"
    listed = "".join(f'<sheet name="{n}" sheetId="{k}" r:id="r{k}"/>' for k, n in numbered)
    links = "".join(
        f'<Relationship Id="r{k}" Type="{OFFICE}/worksheet" Target="worksheets/sheet{k}.xml"/>'
        for k, _ in numbered
    )
    parts = "".join(
        f'<Override PartName="/xl/worksheets/sheet{k}.xml" ContentType="{kind}.worksheet+xml"/>'
        for k, _ in numbered
    )
    content = {
        "[Content_Types].xml": f'<Types xmlns="{PACKAGE}/content-types"><Default Extension="rels" '
        'ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Override '
        f'PartName="/xl/workbook.xml" ContentType="{kind}.sheet.main+xml"/>{parts}</Types>',
        "_rels/.rels": f'<Relationships xmlns="{PACKAGE}/relationships"><Relationship Id="r1" '
        f'Type="{OFFICE}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{MAIN}" xmlns:r="{OFFICE}"><sheets>{listed}</sheets>'
        "</workbook>",
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{PACKAGE}/relationships">{links}'
        "</Relationships>",
    }
    content |= {f"xl/worksheets/sheet{k}.xml": sheet_xml(sheets[n]) for k, n in numbered}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, text in content.items():
            archive.writestr(name, text)
    return buffer.getvalue()


def readings(first, count, *, charged=0.0):
    """Rows of a channel sheet: a charge with 1 A, a row a minute."""
    minutes = range(first, first + count)
    return [
        [k + 1, 60.0 * k, NOON + k / 1440, 1, 1, 1.0, 3.5 + k / 100, charged + k / 60, 0.0]
        for k in minutes
    ]


def read(data):
    return formats.read(data, name="some.xlsx")


def test_a_channel_goes_on_in_another_sheet():
    sheets = {
        "Info": [["Test name", "any"]],
        "Channel_1-008_2": [LABELS, *readings(5, 3)],
        "Channel_1-008": [LABELS, *readings(0, 5)],
        "Statistics_1-008": [["Cycle_Index"], [1]],
    }
    found = read(workbook(sheets))
    assert found.instrument == "arbin"
    columns = found.columns
    assert columns["test_time_second"] == pytest.approx(60.0 * np.arange(8))
    assert columns["net_capacity_ampere_hour"] == pytest.approx(np.arange(8) / 60)
    assert columns["unix_time_second"] - 1282046400 == pytest.approx(60.0 * np.arange(8), abs=1e-3)


def test_blank_rows_and_cells_are_no_readings():
    rows = readings(0, 4)
    rows[2][7] = ""
    found = read(workbook({"Channel_1": [LABELS, *rows, [""] * len(LABELS)]}))
    assert found.columns["voltage_volt"].size == 4
    assert np.isnan(found.columns["net_capacity_ampere_hour"][2])


def with_text():
    rows = readings(0, 4)
    rows[1][6] = "overflow"
    return {"Channel_1-008": [LABELS, *rows]}


PLAIN = ["Time (s)", "Current (A)", "Voltage (V)"]


def plain(first, count):
    """Rows of a table of nobody in particular: a row a minute."""
    return [[60.0 * k, 1.0, 3.5 + k / 100] for k in range(first, first + count)]


def test_sheets_of_anybody_follow_their_clocks_below_a_title():
    book = workbook(
        {
            "Cell": [["Made by", "any"]],
            "Late": [["Run 2"], PLAIN, *plain(3, 4)],
            "Early": [["Run 1"], [], PLAIN, *plain(0, 3), ["", "", ""]],
        }
    )
    found = read(book)
    assert (found.instrument, found.kind) == ("table", "series")
    assert found.columns["test_time_second"] == pytest.approx(60.0 * np.arange(7))
    assert found.columns["voltage_volt"] == pytest.approx(3.5 + np.arange(7) / 100)
    assert "sheets that are not read: 'Cell'" in found.notes


def test_a_spectrum_in_a_sheet():
    hertz = np.geomspace(1e3, 1, 10)
    ohm = 0.02 + 0.01 / (1 + 1j * hertz / 50)
    rows = np.column_stack([hertz, ohm.real, -ohm.imag]).tolist()
    found = read(workbook({"EIS": [["Freq (Hz)", "Z' (Ohm)", "-Z'' (Ohm)"], *rows]}))
    assert found.kind == "impedance"
    np.testing.assert_array_equal(found.columns["impedance_imaginary_ohm"], ohm.imag)


def test_neware_s_older_export_by_the_clocks_of_its_steps():
    """BTS 7: a sheet of details, each step with a clock of its own, and dates."""
    labels = ["Record Index", "Status", "Step", "Current(mA)", "Voltage(V)", "CapaCity(mAh)"]
    labels += ["Relative Time(h:min:s.ms)", "Absolute Time"]
    rows, second = [], 0
    for step, (state, current) in enumerate([("Rest", 0), ("CC_Chg", 600), ("CC_DChg", -600)], 1):
        for k in range(1, 6):
            second += 60
            date = f"2024-03-01 23:{50 + second // 60:02}:00" if second < 600 else (
                f"2024-03-02 00:{second // 60 - 10:02}:00"
            )  # fmt: skip
            volt, counted = 3.5 + step / 10 + k / 1000, abs(current) * k / 60
            rows.append(
                [len(rows) + 1, state, step, current, volt, counted, f"0:0{k}:00.000", date]
            )
    found = read(workbook({"Info": [["any"]], "Detail_1": [labels, *rows]}))
    columns = found.columns
    assert np.ptp(columns["test_time_second"]) == 14 * 60
    assert np.ptp(columns["unix_time_second"]) == 14 * 60
    np.testing.assert_allclose(columns["current_ampere"], np.repeat([0, 0.6, -0.6], 5))
    assert columns["net_capacity_ampere_hour"][[9, 14]] == pytest.approx([0.05, 0.0])


def test_cells_are_written_as_a_csv_has_them():
    from datetime import date, datetime, time, timedelta

    written = {
        0.1: "0.1",
        datetime(2024, 3, 1, 12): "2024-03-01 12:00:00",
        date(2024, 3, 1): "2024-03-01 00:00:00",
        time(1, 2, 3): "01:02:03",
        timedelta(hours=30, seconds=5.5): "30:00:5.5",
        datetime(1899, 12, 31, 6, 0, 5): "30:00:5",  # as a time of more than a day is read
        " Time\n(s) ": "Time (s)",
    }
    assert [_written(cell) for cell in written] == list(written.values())


REFUSED = {
    "other instrument": ({"Test": [["A", "B", "C"], [1.0, 2.0, 3.0]]}, "its sheets are 'Test'"),
    "tables of two kinds": (
        {
            "A": [PLAIN, *plain(0, 4)],
            "B": [[*PLAIN, "Step"], *([*row, 1.0] for row in plain(4, 4))],
        },
        "sheets 'A', 'B' hold tables of different labels",
    ),
    "two at a time": (
        {"A": [PLAIN, *plain(0, 4)], "B": [PLAIN, *plain(2, 4)]},
        "sheets 'A', 'B' run at the same time .'B' begins 60 s before 'A' ends.",
    ),
    "a word in a sheet": (
        {"A": [[], PLAIN, *plain(0, 4), [240.0, "12,5 mA", 3.7]]},
        "sheet 'A', whose rows are called lines: line 7: column 'Current .A.': found '12,5 mA'",
    ),
    "two channels": (
        {"Channel_1": [LABELS, *readings(0, 4)], "Channel_2": [LABELS, *readings(2, 4)]},
        "sheets 'Channel_1', 'Channel_2' run at the same time .*one channel a file",
    ),
    "empty": ({"Channel_1": [LABELS]}, "sheet 'Channel_1' has no row of data"),
    "text": (with_text(), "sheet 'Channel_1-008', row 2 of data, column 'Voltage.V.'.*overflow"),
    "no voltage": (
        {"Channel_1": [LABELS[:6], *[row[:6] for row in readings(0, 4)]]},
        "no column 'Voltage.V.'",
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_refusals_say_what_is_wrong(what):
    sheets, message = REFUSED[what]
    with pytest.raises(Refusal, match=r"^some\.xlsx: .*" + message):
        read(workbook(sheets))


def test_a_cut_workbook_is_refused():
    whole = workbook({"Channel_1": [LABELS, *readings(0, 40)]})
    with pytest.raises(Refusal, match=r"^some\.xlsx: .*workbook is cut off or damaged"):
        read(whole[: len(whole) // 2])


def test_measured_workbook(shared):
    """CALCE CS2_35 after its first month: 50 cycles of 1.1 Ah nominal, rows as in the sheet."""
    file = shared / "campaigns/cs2_35/raw/CS2_35_9_21_10.xlsx"
    columns = formats.read(file.read_bytes(), name=file.name).columns
    assert columns["voltage_volt"].size == 17314
    assert columns["cycle_count"].max() == 50
    pause = np.diff(columns["unix_time_second"]) - np.diff(columns["test_time_second"])
    assert np.abs(pause).max() < 1.5  # its dates are whole seconds
    assert columns["test_time_second"][-1] == pytest.approx(587403.39, abs=0.01)
