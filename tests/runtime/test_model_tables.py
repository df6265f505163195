"""Tables of a cell that a user gives: read as numbers, refused with the file's name."""

import pytest

from cellwright.refusal import Refusal
from runtime import model_tables


def written(folder, text):
    path = folder / "a.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_columns_are_numbers_and_others_are_left_out(tmp_path):
    path = written(tmp_path, "soc,ocv_volt,resistance_ohm,note\n0,3.0,0.5,x\n1,4.1,0.3,y\n")
    columns = model_tables.read(path, "raw/a.csv")
    assert columns == {"soc": [0.0, 1.0], "ocv_volt": [3.0, 4.1], "resistance_ohm": [0.5, 0.3]}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("soc,volt\n0,3\n", "found columns soc, volt, wanted soc, ocv_volt, resistance_ohm"),
        ("soc,ocv_volt,resistance_ohm\n0,a,0.1\n", "is no number"),
        ("", "found columns none"),
    ],
)
def test_refusals_name_the_file(tmp_path, text, message):
    with pytest.raises(Refusal, match=f"raw/a.csv: .*{message}"):
        model_tables.read(written(tmp_path, text), "raw/a.csv")


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(Refusal, match=r"no file raw/b.csv"):
        model_tables.read(tmp_path / "b.csv", "raw/b.csv")
