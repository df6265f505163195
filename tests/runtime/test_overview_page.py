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
    assert [(one["words"], one["tests"], one["grave"]) for one in found["first"]] == [
        ("3 Ah", "", True),
        ("the clock runs back", "test", True),
        ("lowest state of health of NMC, 5 Ah: 81.0 ± 0.4 %", "", False),
        ("highest R0 of NMC, 5 Ah: 31 mΩ", "", False),
    ]
    assert all(one["do"] for one in found["first"])
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


def told(**parts):
    about = {"summary": [], "excluded": [], "checks": [], "types": {}} | parts
    return [
        (str(one["link"]).count("#cell"), one["tests"], one["words"])
        for one in overview_page.findings(**about)
    ]


def test_the_same_doubt_of_five_tests_is_one_line_with_the_range_of_its_number():
    tests = [f"ocv_C20_{k}C" for k in range(5)]
    doubt = "; ".join(f"{t}: 0.0{3 + k} Ah (1.{k}%) off at 2RC" for k, t in enumerate(tests))
    assert told(summary=[cell("A", doubt=doubt)]) == [
        (
            1,
            "5 tests (ocv_C20_0C, ocv_C20_1C, ocv_C20_2C and 2 more)",
            "0.03 to 0.07 Ah (1.0 to 1.4%) off at 2RC",
        )
    ]
    many = [cell(f"N{k}", doubt="a, b: it drifts") for k in range(9)]
    ((shown, tests, words),) = told(summary=many)
    assert (shown, tests, words) == (6, "2 tests (a, b)", "it drifts")
    two = [cell("A", doubt="a: it drifts; a: the clock jumps")]
    assert [words for *_, words in told(summary=two)] == ["it drifts", "the clock jumps"]


def test_what_is_said_of_both_halves_of_a_cycle_is_said_once():
    doubt = "a, b: it drifts; a, c: in the charge of its cycle it drifts"
    assert overview_page.doubts_of(doubt) == [
        (["a", "b"], "it drifts"),
        (["c"], "in the charge of its cycle it drifts"),
    ]
    assert overview_page.doubts_of("") == []


def test_names_that_a_measurement_contradicts_or_that_sit_on_a_limit_do_not_count():
    row = {"effect": "slow_diffusion", "witnesses_contradict": "0", "doubt_codes": "beside"}
    effects = [
        row | {"cell": "A"},
        row | {"cell": "B", "doubt_codes": "beside;at_bound"},
        row | {"cell": "C", "witnesses_contradict": "1"},
        {"cell": "D", "effect": "", "witnesses_contradict": "2", "doubt_codes": ""},
    ]
    summary = [cell(name, verdict="named") for name in "ABC"] + [cell("D", verdict="unknown")]
    words = dict(overview_page.digest(summary, {}, [], [], effects))["missing effects"]
    assert words == "named in 1 of 4 cells; 1 of 3 names stand; no name in 1"
    (line,) = told(effects=effects)
    assert line[0] == 2
    assert line[2].startswith("2 of 3 names do not count")
    assert told(effects=effects[:1]) == []


def test_a_state_of_health_says_the_rate_at_which_it_was_measured():
    aged = cell("A", soh="0.92", soh_cycle="300", capacity_ampere_hour="4.7")
    rows = [{"c_rate": "0.5", "soh": "0.92", "capacity_ampere_hour": "4.6"}]
    slow = {"c_rate": "0.04", "capacity_ampere_hour": "4.70001", "soh": ""}
    assert overview_page.rate_of_health(aged, [slow, *rows]) == "C/2"
    assert overview_page.rate_of_health(aged | {"soh_cycle": ""}, [*rows, slow]) == "C/25"
    assert overview_page.rate_of_health(aged | {"soh": "0.93"}, rows) == ""
    assert [overview_page.rate_in_words(rate) for rate in (2.0, 0.9999, 0.0333)] == [
        "2C",
        "1C",
        "C/30",
    ]


PULSE = {"direction": "discharge", "ambient_temperature_celsius": "25", "soc": "0.5"}


@pytest.mark.parametrize(
    ("pulses", "said"),
    [
        ([], "no pulses found"),
        ([PULSE | {"soc": ""}], "SoC of its pulses not known"),
        ([PULSE | {"direction": "charge"}], "charge pulses only"),
        (
            [PULSE | {"ambient_temperature_celsius": at} for at in ("-10", "0", "0")],
            "pulses at -10, 0 °C only",
        ),
        ([PULSE | {"soc": soc} for soc in ("0.8", "1.0")], "pulses at 80 to 100 % SoC only"),
        ([PULSE | {"ambient_temperature_celsius": ""}], "first samples of the pulses are missing"),
    ],
)
def test_a_cell_without_r0_says_why(pulses, said):
    assert overview_page.why_no_r0(pulses) == said


def test_a_long_table_shows_its_worst_rows_and_names_the_file_of_the_others():
    spec = {"title": "T", "read": "r.", "columns": {"test": "test", "x": "error [mV]"}}
    frame = pd.DataFrame({"test": [f"t{k}" for k in range(40)], "x": [*map(str, range(39)), ""]})
    table = page_tables.table_of("t", frame, spec | {"worst": "x"})
    assert [row[0].text for row in table.rows] == [f"t{k}" for k in range(38, 28, -1)]
    assert (table.more, table.made) == (30, "results/tables/t.csv")
    assert "largest error [mV]" in table.read
    short = page_tables.table_of("t", frame.head(20), spec | {"worst": "x"})
    assert [row[0].text for row in short.rows][:2] == ["t0", "t1"]


def test_a_particle_has_words_as_circuits_have():
    found = {name: overview_page.model_in_words(name) for name in ("P", "2RC+H")}
    assert found["P"] == "one particle with diffusion and charge transfer"
    assert found["2RC+H"] == "2 RC pairs, hysteresis"
