"""Half cells in a user's CSV files: read, or refused with what was found."""

import numpy as np
import pytest

from cellwright.refusal import Refusal
from runtime import half_cell_files

NOTHING = {"negative_half_cell": None, "positive_half_cell": None}


def written(folder, text):
    path = folder / "half.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_a_name_and_a_blank(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = "\n".join(f"{x:.3f},{1 - 0.9 * x:.4f}" for x in np.linspace(0, 1, 30))
    written(tmp_path, f"lithiation,potential_volt\n{rows}\n")
    materials = {"negative_half_cell": "half.csv", "positive_half_cell": "nmc811_chen"}
    negative, positive = half_cell_files.given(materials, ["half.csv"])
    assert np.interp(0.5, negative.lithiation, negative.potential_volt) == pytest.approx(0.55)
    assert positive == "nmc811_chen"
    assert half_cell_files.given(NOTHING, []) == (None, None)


def test_wrong_columns_are_named(tmp_path):
    path = written(tmp_path, "soc,volt\n0,1\n")
    with pytest.raises(Refusal, match=r"half\.csv: found columns soc, volt, wanted lithiation"):
        half_cell_files.read(path, "half.csv")


def test_a_word_among_the_numbers_is_named(tmp_path):
    path = written(tmp_path, "lithiation,potential_volt\n0.1,full\n")
    with pytest.raises(Refusal, match=r"is no number: .*full"):
        half_cell_files.read(path, "half.csv")
