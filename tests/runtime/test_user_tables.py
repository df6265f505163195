"""Tables that a user gives of a cell: read as numbers, or refused with what was found and where."""

import numpy as np
import pytest

from cellwright.refusal import Refusal
from runtime import user_tables

NOTHING = {"negative_half_cell": None, "positive_half_cell": None}


@pytest.fixture(autouse=True)
def campaign(tmp_path, monkeypatch):
    """Jobs run in the folder of the campaign, and read nothing outside it."""
    monkeypatch.chdir(tmp_path)


def written(folder, text):
    path = folder / "raw/a.csv"
    path.parent.mkdir()
    path.write_text(text, encoding="utf-8")


def test_columns_are_numbers_and_others_are_left_out(tmp_path):
    written(tmp_path, "soc,ocv_volt,resistance_ohm,note\n0,3.0,0.5,x\n1,4.1,0.3,y\n")
    columns = user_tables.read("raw/a.csv", user_tables.MODEL)
    assert columns == {"soc": [0.0, 1.0], "ocv_volt": [3.0, 4.1], "resistance_ohm": [0.5, 0.3]}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("soc,volt\n0,3\n", "found columns soc, volt, wanted soc, ocv_volt, resistance_ohm"),
        (
            "soc,ocv_volt,resistance_ohm\n0,3,0.1\n1,full,0.1\n",
            "line 3, column ocv_volt: found 'full', wanted a number",
        ),
        ("soc,ocv_volt,resistance_ohm\n0,3\n", "line 2, column resistance_ohm: found None"),
        (" ", "found columns none"),
    ],
)
def test_refusals_name_the_file_and_the_place(tmp_path, text, message):
    written(tmp_path, text)
    with pytest.raises(Refusal, match=f"raw/a.csv: .*{message}"):
        user_tables.read("raw/a.csv", user_tables.MODEL)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(Refusal, match=r"raw/b.csv: there is no such file in the campaign"):
        user_tables.read("raw/b.csv", user_tables.MODEL)


def test_half_cells_from_a_file_by_name_and_blank(tmp_path):
    rows = "\n".join(f"{x:.3f},{1 - 0.9 * x:.4f}" for x in np.linspace(0, 1, 30))
    written(tmp_path, f"lithiation,potential_volt\n{rows}\n")
    materials = {"negative_half_cell": "raw/a.csv", "positive_half_cell": "nmc811_chen"}
    negative, positive = user_tables.half_cells(materials)
    assert np.interp(0.5, negative.lithiation, negative.potential_volt) == pytest.approx(0.55)
    assert positive == "nmc811_chen"
    assert user_tables.half_cells(NOTHING) == (None, None)


def test_own_half_cells_are_blended_and_one_that_is_not_there_is_named(tmp_path):
    rows = "\n".join(f"{x:.3f},{1 - 0.9 * x:.4f}" for x in np.linspace(0, 1, 30))
    written(tmp_path, f"lithiation,potential_volt\n{rows}\n")
    materials = NOTHING | {"negative_half_cell": "raw/a.csv+silicon_verbrugge:0.3"}
    negative, positive = user_tables.half_cells(materials)
    assert (negative.name, negative.share, positive) == ("raw/a.csv+silicon_verbrugge", 0.3, None)
    with pytest.raises(Refusal, match=r"b\.csv: there is no such file in the campaign"):
        user_tables.half_cells(NOTHING | {"negative_half_cell": "raw/a.csv+b.csv"})
