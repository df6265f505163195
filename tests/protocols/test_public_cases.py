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
        means, notes = measured(folder, row)
        wanted = expected[f"{row.cell}/{row.test}"]
        # Sampling alone costs up to 0.0008 Ah.
        assert means["discharge"] == pytest.approx(np.mean(wanted["D"]), abs=0.0012)
        assert RIGHT[case] in notes


def test_files_of_opposite_signs_are_refused_by_number(shared):
    folder = shared / "cases/files/e03_sign_differs_by_file"
    row = next(pd.read_csv(folder / "config/tests.tsv", sep="\t").itertuples())
    with pytest.raises(Refusal, match="file 2 shows discharge_positive"):
        measured(folder, row)
