"""Situations that people reported in public: the capacity is right, or the file is refused."""

import json

import numpy as np
import pandas as pd
import pytest

import cellwright as cw
from cellwright.refusal import Refusal

RIGHT = {
    "a01_outage_under_load_join30": "the cell rested",
    "a05_outage_one_file_10min": "the cell rested",
    "a08_logging_lost_load_on": "the charge is counted",
    "b01_ms_as_s_with_unix": "counts milliseconds, as its dates prove",
    "b03_min_as_s": "counts minutes, as its dates prove",
    "c04_kelvin_as_degC": "kelvin under degC? left out",
    "h02_bdf_short_names": "",
    "h04_time_as_text": "",
    "i01_second_export_holds_first": "file 2 holds all rows of file 1",
    "j01_summer_time_ends_between_files": "the clock being set back by an hour",
    "n02_biologic_three_electrodes": "not read: mode, ox/red",
    "n05_neware_workbook": "",
    "o01_day_first_files": "file 2 begins 1820 s after the end of file 1, by their dates",
    "q01_pybamm_output": "",
    "q06_excel_day_fraction": "20 s if it counts d",
    "r02_cycling_and_spectrum_one_file": "61 rows of a spectrum are left out",
    "s01_chinese_neware_gbk": "",
}
REFUSED = {
    "n04_neware_mAh_holds_Ah": r"the charge counter \(Ah under a label in mAh\)",
    "s06_voltage_twice": "columns 3, 4 have one label, 'Voltage",
    "s09_one_channel_a_row": "rows of their own",
    "s11_row_numbers_without_a_label": "only [34] labels",
}


def measured(folder, row):
    """Capacities [Ah] of charge and discharge of one test, and all notes."""
    cells = pd.read_csv(folder / "config/cells.tsv", sep="\t").set_index("cell")
    cell = cells.loc[row.cell].dropna().to_dict() | {"cell": row.cell}
    raw = cw.read([folder / file for file in row.file.split(";")])
    series = cw.clean(raw.columns)
    found = cw.capacity(series, cw.segment(series, cell), cell)
    rows = pd.DataFrame(dict(found.rows.items()))
    means = rows.groupby("direction")["capacity_ampere_hour"].mean()
    return means, " ".join((*raw.notes, *series.notes))


@pytest.mark.parametrize("case", RIGHT)
def test_capacity_is_right_and_what_was_decided_is_said(shared, case):
    folder = shared / "cases/files" / case
    expected = json.loads((folder / "expected.json").read_text())
    for row in pd.read_csv(folder / "config/tests.tsv", sep="\t").itertuples():
        if row.kind != "capacity":
            continue
        means, notes = measured(folder, row)
        wanted = expected[f"{row.cell}/{row.test}"]
        # Sampling alone costs up to 0.0008 Ah.
        assert means["discharge"] == pytest.approx(np.mean(wanted["D"]), abs=0.0012)
        assert RIGHT[case] in notes


@pytest.mark.parametrize("case", REFUSED)
def test_what_no_one_can_read_is_refused_for_its_reason(shared, case):
    folder = shared / "cases/files" / case
    for row in pd.read_csv(folder / "config/tests.tsv", sep="\t").itertuples():
        kind = "impedance" if row.kind == "eis" else "series"
        with pytest.raises(Refusal, match=REFUSED[case]):
            cw.clean(cw.read([folder / row.file], kind=kind).columns)


def test_of_three_electrodes_the_cell_is_their_difference(shared):
    folder = shared / "cases/files/n02_biologic_three_electrodes"
    series = cw.read([folder / "raw/N02_p.mpt.gz"]).columns
    at = np.flatnonzero(np.abs(np.diff(series["current_ampere"])) > 0.1)[0]
    step = np.diff(series["voltage_volt"])[at] / np.diff(series["current_ampere"])[at]
    assert step == pytest.approx(20.25e-3, abs=3e-4)


def test_where_a_thermometer_shows_nothing_its_mean_says_so(shared):
    folder = shared / "cases/files/t02_thermometer_broken_at_first"
    cell = {"cell": "T02", "lower_cutoff_volt": 2.5, "upper_cutoff_volt": 4.2}
    series = cw.clean(cw.read([folder / "raw/T02_t.csv.gz"]).columns, cell=cell)
    found = cw.capacity(series, cw.segment(series, cell), cell)
    doubts = dict(zip(found.rows["direction"], found.rows["doubt"], strict=True))
    assert "its thermometer shows nothing for a while" in doubts["discharge"]
    assert doubts["charge"] == ""


def test_milliohm_under_ohm_are_told(shared):
    folder = shared / "cases/files/r09_milliohm_as_ohm"
    row = next(pd.read_csv(folder / "config/tests.tsv", sep="\t").itertuples())
    spectrum = cw.read([folder / row.file], kind="impedance")
    cell = {"cell": row.cell, "rated_capacity_ampere_hour": 3.0}
    told = cw.impedance(spectrum, cell=cell).rows[0]["doubt"]
    assert "milliohm read as ohm" in told
    assert "milliohm" not in cw.impedance(spectrum).rows[0]["doubt"]


def test_files_of_opposite_signs_are_refused_by_number(shared):
    folder = shared / "cases/files/e03_sign_differs_by_file"
    row = next(pd.read_csv(folder / "config/tests.tsv", sep="\t").itertuples())
    with pytest.raises(Refusal, match="file 2 shows discharge_positive"):
        measured(folder, row)


def test_the_spectrum_in_a_file_of_cycling_is_that_of_its_rows(shared):
    folder = shared / "cases/files/r02_cycling_and_spectrum_one_file"
    wanted = json.loads((folder / "expected.json").read_text())["R02/e"]
    row = cw.impedance(cw.read(folder / "raw/R02e.mpt.gz", kind="impedance")).rows[0]
    for name in ("r_ohmic", "r_charge_transfer"):
        assert 1e3 * row[f"{name}_ohm"] == pytest.approx(wanted[f"{name}_mohm"], rel=0.005)
