"""Cells that a spreadsheet would run are texts to it, and to ours what they were."""

import csv

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime import artefact, csv_cells, page, tables

HOSTILE = ["=HYPERLINK(1)", "+1+1", "-A1", "@SUM(A1)", "\t=1", "\n=1", "'=1", "''@x", "=", "-"]
PLAIN = ["", "C1", "a-b", "'quoted'", "'", "-5", "+1.5e-3", "raw/x.csv: is empty", "–5 mV"]


@pytest.mark.parametrize("text", HOSTILE)
def test_a_formula_is_guarded(text):
    assert csv_cells.guarded(text) == f"'{text}"


@given(st.text(st.sampled_from("'=+-@\t\r\n1.eaü "), max_size=6))
def test_every_text_comes_back_and_none_begins_as_a_formula(text):
    cell = csv_cells.guarded(text)
    assert csv_cells.as_written(cell) == text
    try:
        float(cell)
    except ValueError:
        assert not cell.startswith(("=", "+", "-", "@", "\t", "\r", "\n"))


@pytest.mark.parametrize("text", [*HOSTILE, *PLAIN])
def test_a_written_table_is_read_as_it_was(tmp_path, text):
    path = tmp_path / "results/tables/excluded.csv"
    rows = [{"cell": "C1", "test": "t", "file": "f", "stage": "s", "reason": text}]
    artefact.write(path, rows, {"reason": None})
    with open(path, encoding="utf-8", newline="") as file:
        (cell,) = [row["reason"] for row in csv.DictReader(file)]
    assert cell == csv_cells.guarded(text)
    assert artefact.load_table(path)[0]["reason"] == text
    assert page._text(path)["reason"].tolist() == [text]
    (read,) = tables.load_frame(path)["reason"]
    assert read == text or pd.isna(read) or float(text) == read
