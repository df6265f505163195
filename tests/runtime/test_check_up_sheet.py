"""The sheet of check-ups: any further numbers, named with their unit; faults are told."""

import pytest

from runtime import sheets
from runtime.contract import CONTRACT

SCHEMAS = CONTRACT.parent
CELLS = "cell\tlower_cutoff_volt\tupper_cutoff_volt\nA1\t3\t4.2\n"
TESTS = "cell\ttest\tkind\tfile\tcycle\nA1\tc0\tcapacity\ta.csv\t\nA1\tc900\tcapacity\tb.csv\t900\n"


def read(folder, text):
    config = folder / "config"
    config.mkdir()
    for name, content in (("cells", CELLS), ("tests", TESTS), ("checkups", text)):
        (config / f"{name}.tsv").write_text(content, encoding="utf-8")
    return sheets.read(folder, SCHEMAS)


def test_any_quantity_with_its_unit_is_read(tmp_path):
    text = "cell\tcycle\tthickness_millimetre\tmass_gram\nA1\t0\t7.2\t\nA1\t900\t7.67\t512.5\n"
    rows = read(tmp_path, text).check_ups
    assert [row["thickness_millimetre"] for row in rows] == [7.2, 7.67]
    assert [row["mass_gram"] for row in rows] == [None, 512.5]


def test_without_the_sheet_there_are_none(tmp_path):
    assert read(tmp_path, "cell\tcycle\nA1\t0\n").check_ups == [{"cell": "A1", "cycle": 0.0}]
    (tmp_path / "config" / "checkups.tsv").unlink()
    assert sheets.read(tmp_path, SCHEMAS).check_ups == []
    (tmp_path / "config" / "checkups.tsv").mkdir()
    with pytest.raises(sheets.CampaignError, match="is a folder, wanted a file"):
        sheets.read(tmp_path, SCHEMAS)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("cell\tcycle\tthickness\nA1\t0\t7\n", "'thickness'"),
        ("cell\tcycle\tthickness_mm\nA1\t0\tthick\n", "'thick'"),
        ("cell\tcycle\nA1\t\n", "cycle: found '', wanted a value"),
        ("cell\tcycle\nB7\t0\n", "a cell of cells.tsv"),
        ("cell\tcycle\nA1\t800\n", "a cycle at which tests.tsv has a test of A1"),
        ("cell\tcycle\nA1\t0\nA1\t0\n", "each once within the sheet"),
    ],
)
def test_faults_are_told(tmp_path, text, said):
    with pytest.raises(sheets.CampaignError, match=r"config/checkups\.tsv") as told:
        read(tmp_path, text)
    assert said in str(told.value)
