"""What the report's first screen says: what to look at first, and numbers as people write them."""

import pandas as pd
import pytest

from runtime import overview_page, page_tables

BLANK = {"capacity_ampere_hour": "", "soh": "", "r0_50_25_ohm": "", "validation_rmse_volt": ""}
BLANK |= {"soc_rmse": "", "verdict": "", "in_one_line": "", "doubt": ""}


def cell(name, **known):
    return {"cell": name} | BLANK | known


SUMMARY = [
    cell("fresh", soh="0.99", r0_50_25_ohm="0.020", r0_50_25_std_ohm="0.0004"),
    cell("aged", soh="0.81", soh_std="0.004", r0_50_25_ohm="0.031"),
    cell("large", soh="0.60", r0_50_25_ohm="0.001"),
    cell("doubted", soh="0.95", doubt="test: the clock runs back"),
    cell("unknown", verdict="unknown"),
]
CELLS = [
    {"cell": row["cell"], "chemistry": "NMC", "rated_capacity_ampere_hour": 5.0} for row in SUMMARY
]
CELLS[2]["rated_capacity_ampere_hour"] = 30.0
CHECKS = [
    {"check": "No charge from nothing.", "outcome": "failed", "cell": "unknown", "found": "3 Ah"},
    {"check": "A second one.", "outcome": "passed", "cell": "", "found": ""},
]
NONE = pd.DataFrame(columns=["cell", "test", "stage", "reason"])
TABLES = dict.fromkeys(("excluded", "validation", "missing_effect"), NONE)
TABLES |= {"resistance_definitions": NONE}


@pytest.fixture(scope="module")
def found():
    return overview_page.section(CELLS, SUMMARY, TABLES, CHECKS)


def test_what_fails_comes_first_then_what_is_in_doubt_then_the_worst_of_each_type(found):
    names = [row[0].key for row in found["table"].rows]
    assert names == ["unknown", "doubted", "aged", "large", "fresh"]
    assert [one["why"] for one in found["first"]] == [
        "a check fails: 3 Ah",
        "in doubt: test: the clock runs back",
        "lowest state of health of NMC, 5 Ah: 81.0 ± 0.4 %; highest R0 of NMC, 5 Ah: 31 mΩ",
    ]
    assert [mark["look"] for mark in found["marks"]] == [True, True, True, False, False]


def test_numbers_stand_with_their_deviation_and_sort_by_what_they_are(found):
    rows = {row[0].key: row for row in found["table"].rows}
    r0 = rows["fresh"][4]
    assert (r0.text, float(r0.key)) == ("20.0 ± 0.4", pytest.approx(20.0))
    assert rows["aged"][3] == page_tables.Cell("81.0 ± 0.4 ▲", "81.0", "worst")
    assert rows["unknown"][7].text == "something without a name"


@pytest.mark.parametrize(
    ("value", "std", "scale", "shown"),
    [
        ("0.0396612", "0.00009", 1e3, "39.66 ± 0.09"),
        ("0.0396612", "0.00013", 1e3, "39.66 ± 0.13"),
        ("0.0396612", "0.004", 1e3, "40 ± 4"),
        ("0.0396612", "", 1e3, "39.66"),
        ("0.0396612", "1e-12", 1e3, "39.66"),
        ("1234.5", "80", 1, "1234 ± 80"),
        ("0", "0.2", 1, "0.0 ± 0.2"),
        ("", "", 1, ""),
        ("nan", "0.1", 1, "nan"),
    ],
)
def test_a_number_has_as_many_decimals_as_its_deviation(value, std, scale, shown):
    assert page_tables.measured(value, std, scale) == shown


def test_a_resistance_whose_first_sample_is_late_says_how_late():
    r0 = pd.DataFrame([{"cell": "A", "name": "R0", "delay_second": "10.0"}])
    cells, summary = [CELLS[0] | {"cell": "A"}], [cell("A", r0_50_25_ohm="0.034")]
    for second, said in (("10.0", "34 after 10 s"), ("0.5", "34")):
        tables = TABLES | {"resistance_definitions": r0.assign(delay_second=second)}
        table = overview_page.section(cells, summary, tables, [])["table"]
        assert table.rows[0][4].text == said


def test_a_doubt_that_all_rows_share_is_told_once_above_them():
    spec = {"title": "T", "read": "r.", "columns": {"test": "test", "doubt": "doubt"}}
    alike = pd.DataFrame({"test": ["a", "b"], "doubt": ["it drifts"] * 2})
    table = page_tables.table_of("t", alike, spec)
    assert (table.columns, table.read) == (["test"], "r. All in doubt: it drifts.")
    table = page_tables.table_of("t", alike.assign(doubt=["it drifts", ""]), spec)
    assert (table.columns, table.read) == (["test", "doubt"], "r.")
    table = page_tables.table_of("t", alike.assign(doubt=["late; it drifts", "it drifts"]), spec)
    assert table.read == "r. All in doubt: it drifts."
    assert [row[-1].text for row in table.rows] == ["late", ""]
    table = page_tables.table_of("t", alike.iloc[:1], spec)
    assert table.columns == ["test", "doubt"]
