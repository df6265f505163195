"""Sheets and config: what is read, and that every fault is named with its place."""

import contextlib
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import settings as effort
from hypothesis import strategies as st

from runtime import settings, sheets

SCHEMAS = Path(__file__).resolve().parents[2] / "workflow" / "schemas"
CELLS = "cell\tlower_cutoff_volt\tupper_cutoff_volt\nA\t2.5\t4.2\nB\t2.5\t4.2\n"
HEAD = "cell\ttest\tkind\tfile\tambient_temperature_celsius\tsoc\trole\tsha256\tnote\n"
TESTS = HEAD + "A\tt1\thppc\traw/a.csv\t25\t0.5\n"
GROUPS = "group\tposition\tcell\npair\t1\tA\npair\t2\tB\n"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "config").mkdir()
    write(tmp_path, "cells.tsv", CELLS)
    write(tmp_path, "tests.tsv", TESTS)
    return tmp_path


def write(folder, name, content):
    data = content if isinstance(content, bytes) else content.encode()
    (folder / "config" / name).write_bytes(data)


def read(folder, **given):
    return sheets.read(folder, SCHEMAS, given)


def faults(folder, **given):
    with pytest.raises(sheets.CampaignError) as error:
        read(folder, **given)
    return str(error.value).splitlines()[1:]


def test_values_are_typed_and_blanks_are_none(folder):
    test = read(folder).tests[0]
    assert test["file"] == ["raw/a.csv"]
    assert test["ambient_temperature_celsius"] == 25.0
    assert test["soc"] == 0.5
    assert test["sha256"] is None
    assert test["instrument"] is None


def test_no_config_file_means_all_defaults(folder):
    expected = settings.defaults(settings.load(SCHEMAS, "config"))
    assert read(folder).config == expected
    write(folder, "config.yaml", "# nothing chosen\n")
    assert read(folder).config == expected
    assert expected["strict"] is False


def test_choice_replaces_its_default_only(folder):
    write(folder, "config.yaml", "resistance:\n  delay_second: [0, 5]\nclean:\n")
    chosen = read(folder, strict=True).config
    assert chosen["resistance"]["delay_second"] == [0, 5]
    assert chosen["strict"] is True
    assert chosen["clean"] == settings.defaults(settings.load(SCHEMAS, "config"))["clean"]


def test_given_settings_go_before_the_file(folder):
    write(folder, "config.yaml", "segment:\n  rest_c_rate: 0.01\n  pulse_max_second: 60\n")
    segment = read(folder, segment={"rest_c_rate": 0.02}).config["segment"]
    assert (segment["rest_c_rate"], segment["pulse_max_second"]) == (0.02, 60)


def test_drives_validate_and_the_rest_fits_unless_said(folder):
    rows = "A\tt1\tdrive\ta.csv\nA\tt2\thppc\tb.csv\nA\tt3\tdrive\tc.csv\t\t\tsplit\n"
    write(folder, "tests.tsv", HEAD + rows)
    assert [row["role"] for row in read(folder).tests] == ["validation", "fit", "split"]


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + TESTS,
        TESTS.replace("\n", "\r\n"),
        TESTS.replace("\n", "\r"),
        TESTS.replace("\n", "\n\n \t\n"),
        TESTS.replace("\t", " \t "),
        TESTS + "\n\n",
        TESTS.encode("utf-16"),
        TESTS.replace("note\n", "note\t\t\n"),
        TESTS.replace("0.5\n", "0.5\t\t\t\t\t\n"),
    ],
)
def test_how_the_editor_saved_it_does_not_matter(folder, text):
    plain = read(folder)
    write(folder, "tests.tsv", text)
    assert read(folder) == plain


def test_blank_cut_off_is_not_known_and_no_fault(folder):
    write(folder, "cells.tsv", "cell\tlower_cutoff_volt\tupper_cutoff_volt\nA\t2.5\n")
    assert read(folder).cells[0]["upper_cutoff_volt"] is None


BAD_ROWS = [
    ("A\tt2\thpcp\tb.csv", "kind: found 'hpcp', wanted one of capacity,", "did you mean 'hppc'?"),
    ("A\tt2\thppc\tb.csv\tcold", "ambient_temperature_celsius: found 'cold', wanted a number"),
    ("A\tt2\thppc\tb.csv\t298.15", "found '298.15', wanted a number from -60 to 150"),
    ("A\tt2\thppc\tb.csv\t2,5", "with a point: 2.5"),
    ("A\tt2\thppc\tb.csv\tnan", "found 'nan', wanted a number"),
    ("A\tt2\thppc\tb.csv\t\t50", "soc: found '50', wanted a number from 0 to 1"),
    ("A\tt2\thppc\tb.csv\t\t\ttrain", "role: found 'train', wanted one of fit,"),
    ("A\tt2\thppc\tb.csv\t\t\t\tabc", "sha256: found 'abc'", "64 hexadecimal digits"),
    (f"A\tt2\thppc\tb.csv;c.csv\t\t\t\t{'0' * 64}", "found '1 checksums', wanted one for each"),
    ("A\tt2\thppc\tb.csv;;c.csv", "file: found 'b.csv;;c.csv'"),
    ("A\tt2\thppc\tb.csv;b.csv", "each file of a test once"),
    ("A\tt2\thppc\t/data/b.csv", "found '/data/b.csv', wanted a path relative to the campaign"),
    ("A\tt2\thppc\tC:\\b.csv", "a path relative to the campaign"),
    ("A\tt2\thppc\traw/../../b.csv", "a path inside the campaign, without .."),
    ("A\tt2\thppc\tb.csv;results/report.html", "found 'results/report.html', wanted a file of the"),
    ("A\tt2\thppc\t./logs/../Logs/a.log", "found './logs/../Logs/a.log', wanted a path inside"),
    (
        "A\tt2\thppc\t./logs//report.log",
        "'./logs//report.log'",
        "not one that a run makes; copy it",
    ),
    ("A\tt2\thppc", "file: found '', wanted a value"),
    ("\tt2\thppc\tb.csv", "cell: found '', wanted a value"),
    ("A\tt 2\thppc\tb.csv", "test: found 't 2', wanted up to 64 letters, digits, _ and -"),
    ("A\tt1\thppc\tb.csv", "found 'A t1', wanted each once", "also row 1 (line 2)"),
    ("C\tt2\thppc\tb.csv", "cell: found 'C', wanted a cell of cells.tsv"),
    ("pair\tt2\tgroup\tb.csv", "cell: found 'pair', wanted a group of groups.tsv"),
    ("A\tt2\tdrive\t./raw/a.csv", "wanted a file that row 1 (line 2) does not use to fit"),
    ("A\tt2\thppc\tb.csv\t\t\t\t\tnote\tmore", "found 'more', wanted nothing here"),
]


@pytest.mark.parametrize(("row", "expected"), [(row, words) for row, *words in BAD_ROWS])
def test_a_bad_test_is_named_with_its_place(folder, row, expected):
    write(folder, "tests.tsv", f"{TESTS}\n{row}\n")
    lines = faults(folder)
    assert all(line.startswith("config/tests.tsv, row 2 (line 4)") for line in lines)
    assert any(all(words in line for words in expected) for line in lines)


def test_validation_data_that_were_fitted_are_seen_through_a_copy(folder):
    same = "\t\t\t\t" + "ab" * 32
    write(folder, "tests.tsv", f"{HEAD}A\tt1\thppc\ta.csv{same}\nA\tt2\tdrive\tb.csv{same}\n")
    assert "does not use to fit" in faults(folder)[0]


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ("A\t2\t3", "found 'A', wanted each once"),
        ("C\t4.2\t4.2", "upper_cutoff_volt: found 4.2, wanted more than lower_cutoff_volt, 4.2"),
        ("C d\t2\t3", "cell: found 'C d', wanted up to 64 letters"),
        ("C\t2500\t4200", "found '2500', wanted a number from 0 to 10"),
    ],
)
def test_a_bad_cell_is_named_with_its_place(folder, row, expected):
    write(folder, "cells.tsv", f"{CELLS}{row}\n")
    lines = faults(folder)
    assert all(line.startswith("config/cells.tsv, row 3 (line 4)") for line in lines)
    assert any(expected in line for line in lines)


def test_a_stated_state_of_health_needs_the_rating_it_refers_to(folder):
    header = CELLS.split("\n", 1)[0]
    names = f"{header}\trated_capacity_ampere_hour\tstate_of_health\n"
    write(folder, "cells.tsv", f"{names}A\t2.5\t4.2\t2\t0.8\nB\t2.5\t4.2\t\t0.8\n")
    assert faults(folder) == [
        "config/cells.tsv, row 2 (line 3), state_of_health: found 0.8, wanted a "
        "rated_capacity_ampere_hour in the same row, which it refers to"
    ]
    write(folder, "cells.tsv", f"{names}A\t2.5\t4.2\t2\t80\nB\t2.5\t4.2\t2\t0.8\n")
    assert "state_of_health: found '80', wanted a number" in faults(folder)[0]


@pytest.mark.parametrize("rating", ["1e-308", "0", "1e300"])
def test_a_rating_that_no_cell_has_is_a_fault(folder, rating):
    """A current over it would be beyond all numbers."""
    header = CELLS.split("\n", 1)[0]
    write(folder, "cells.tsv", f"{header}\trated_capacity_ampere_hour\nA\t2.5\t4.2\t{rating}\n")
    (line,) = faults(folder)
    assert (
        f"rated_capacity_ampere_hour: found {rating!r}, wanted a number from 1e-06 to 1e+06" in line
    )


def test_groups_are_read_and_their_tests_belong_to_them(folder):
    write(folder, "groups.tsv", GROUPS)
    write(folder, "tests.tsv", HEAD + "pair\tt1\tgroup\ta.csv\n")
    groups = read(folder).groups
    assert [row["position"] for row in groups] == [1, 2]
    assert groups[0]["wire_resistance_ohm"] is None


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ("pair\t2\tA", "position: found 2, wanted each once in pair (also row 2 (line 3))"),
        ("pair\t3\tA", "cell: found 'A', wanted each once in pair (also row 1 (line 2))"),
        ("pair\t3\tZ", "found 'Z', wanted a cell of cells.tsv or a group"),
        ("A\t1\tB", "a name that no cell of cells.tsv has"),
        ("pair\t1.5\tA", "found '1.5', wanted a whole number at least 1"),
    ],
)
def test_a_bad_group_is_named(folder, row, expected):
    write(folder, "groups.tsv", f"{GROUPS}{row}\n")
    assert any(expected in line for line in faults(folder))


WIRED_HEAD = "group\tposition\tcell\tconnection\tlink_resistance_ohm\tsense\n"
WIRED = (
    f"{WIRED_HEAD}pack\t1\tpair\tseries\npack\t2\tC\tseries\npair\t1\tA\npair\t2\tB\t\t1e-4\tyes\n"
)


def test_groups_nest_and_blank_cells_of_the_sheet_have_their_defaults(folder):
    write(folder, "cells.tsv", f"{CELLS}C\t2\t3\n")
    write(folder, "groups.tsv", WIRED)
    groups = read(folder).groups
    assert [row["connection"] for row in groups] == ["series", "series", "parallel", "parallel"]
    assert groups[3]["link_resistance_ohm"] == 1e-4


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "pack\t2\tC\tseries",
            "pack\t2\tC",
            "row 2 (line 3), connection: found 'parallel', wanted",
        ),
        ("pack\t2\tC", "pack\t2\tpack", "row 2 (line 3), cell: found 'pack', wanted no group that"),
        ("pack\t2\tC", "pack\t2\tA", "row 3 (line 4), cell: found 'A', wanted each once in pack"),
        ("pack\t1\tpair", "pack\t1\tpear", "did you mean 'pair'?"),
        ("\t1e-4", "\t-1e-4", "link_resistance_ohm: found '-1e-4', wanted a number from 0 to 1000"),
        ("A\n", "A\t\t\tyes\n", "row 4 (line 5), sense: found 'yes', wanted one sense point"),
        ("pack\t2\tC\tseries\n", "", "row 1 (line 2), group: found 'pack', wanted two or more"),
        ("pair\t2", "pair\t3", "row 4 (line 5), position: found 3, wanted positions of pair"),
        ("\tseries\n", "\tserial\n", "found 'serial', wanted one of parallel, series"),
    ],
)
def test_a_bad_wiring_is_named_with_row_and_column(folder, old, new, expected):
    write(folder, "cells.tsv", f"{CELLS}C\t2\t3\n")
    write(folder, "groups.tsv", WIRED.replace(old, new))
    lines = faults(folder)
    assert any(expected in line for line in lines), lines
    assert all(line.startswith("config/groups.tsv, row") for line in lines)


def test_a_row_with_blanks_for_tabs_is_one_fault(folder):
    write(folder, "tests.tsv", f"{TESTS}A t2 hppc raw/b.csv 25\n")
    assert faults(folder) == [
        "config/tests.tsv, row 2 (line 3): found 'A t2 hppc raw/b.csv 25', "
        "wanted values separated by tabs, not by blanks"
    ]


@pytest.mark.parametrize("begin", [b"PK\x03\x04\x14\x00", b"\xd0\xcf\x11\xe0\xa1"])
def test_a_workbook_under_the_name_of_a_sheet_is_named(folder, begin):
    write(folder, "tests.tsv", begin + bytes(range(256)))
    (line,) = faults(folder)
    assert line.startswith("config/tests.tsv: found a workbook, wanted text with tabs (in the ")


@pytest.mark.parametrize("name", ["tests.xlsx", "tests.csv", "tests.tsv.txt"])
def test_another_file_in_the_place_of_a_sheet_is_named(folder, name):
    (folder / "config/tests.tsv").rename(folder / "config" / name)
    (line,) = faults(folder)
    assert line.startswith(f"config/{name}: found in the place of a sheet, wanted text with tabs")
    assert line.endswith("called config/tests.tsv")


@pytest.mark.parametrize(
    ("head", "expected"),
    [
        ("cell,test,kind,file", "columns separated by tabs, not by ,"),
        ("cell test kind file\nA t1 hppc a.csv", "columns separated by tabs, not by a blank"),
        ("cell test\tkind\tfile", "found 'cell test', wanted a tab between two columns"),
        ("cell\ttest\tkind\tfile\tOperator", "rename it or delete the column (remarks"),
        ("cell\ttest\tkind\tfiles", "did you mean 'file'?"),
        ("cell\ttest\tkind", "found no column 'file'"),
        ("cell\ttest\tkind\tfile\tkind", "wanted each column once"),
        ("", "wanted a row of column names"),
        ("cell\ttest\tkind\tfile", "found no row below the header"),
    ],
)
def test_a_bad_header_is_named(folder, head, expected):
    write(folder, "tests.tsv", head)
    assert any(expected in line for line in faults(folder))


def test_latin_1_is_named_with_its_line(folder):
    write(folder, "tests.tsv", (TESTS + "A\tt2\thppc\tb\t\t\t\t\t25 °C\n").encode("latin-1"))
    assert faults(folder) == [
        "config/tests.tsv, line 3: found '°', wanted UTF-8, not Latin-1; save the sheet as UTF-8"
    ]


def test_an_open_quote_swallows_no_rows(folder):
    write(folder, "tests.tsv", f'{TESTS}A\tt2\thppc\tb\t\t\t\t\t"open\nA\tt3\thppc\tc\n')
    assert "config/tests.tsv, line 3" in faults(folder)[0]


def test_missing_sheets_are_named_once_each(tmp_path):
    lines = faults(tmp_path)
    assert [line.split(":")[0] for line in lines] == ["config/cells.tsv", "config/tests.tsv"]
    assert all("no such file" in line for line in lines)


IDS = {
    "-C": "wanted up to 64 letters, digits, _ and -, first no -",
    "C" * 65: "wanted up to 64 letters",
    "C" * 64: "last not the same twenty times over",
    "x" + "ab" * 20: "last not the same twenty times over",
    "a": "each once within the sheet, whatever the case of its letters (also row 1 (line 2))",
}


@pytest.mark.parametrize("name", IDS)
def test_an_id_that_is_no_name_of_a_folder_is_a_fault(folder, name):
    """Snakemake takes what ends in repetitions for a circle, and stops the run."""
    write(folder, "cells.tsv", f"{CELLS}{name}\t2.5\t4.2\n")
    (line,) = faults(folder)
    assert line.startswith(f"config/cells.tsv, row 3 (line 4), cell: found {name!r}, wanted ")
    assert IDS[name] in line
    write(folder, "cells.tsv", f"{CELLS}{'C' * 44}{'D' * 19}x\t2.5\t4.2\n")
    assert len(read(folder).cells) == 3


def test_names_that_differ_in_case_are_one_name(folder):
    write(folder, "tests.tsv", f"{TESTS}A\tT1\thppc\tb.csv\n")
    assert "found 'A T1', wanted each once within the sheet, whatever the case" in faults(folder)[0]
    write(folder, "tests.tsv", TESTS)
    write(folder, "groups.tsv", GROUPS.replace("pair\t2", "Pair\t2"))
    assert "row 2 (line 3), group: found 'Pair', wanted one spelling of 'pair'" in faults(folder)[0]
    write(folder, "groups.tsv", GROUPS.replace("pair", "a"))
    assert "found 'a', wanted a name that no cell of cells.tsv has" in faults(folder)[0]


@pytest.mark.parametrize("name", ["cells.tsv", "tests.tsv", "groups.tsv", "config.yaml"])
def test_a_sheet_that_is_a_pipe_or_leads_out_is_a_fault_and_keeps_nobody_waiting(
    folder, tmp_path_factory, name
):
    path, elsewhere = folder / "config" / name, tmp_path_factory.mktemp("elsewhere") / name
    elsewhere.write_text("a\n")
    path.unlink(missing_ok=True)
    os.mkfifo(path)
    assert f"config/{name}: is a pipe (FIFO), wanted a file; wanted a" in faults(folder)[0]
    path.unlink()
    path.symlink_to(elsewhere)
    assert f"config/{name}: leads out of the campaign by a link" in faults(folder)[0]


@pytest.mark.parametrize("text", ["9" * 5000, "0." + "1" * 200])
def test_a_number_without_end_is_no_number(folder, text):
    write(
        folder, "groups.tsv", f"group\tposition\tcell\twire_resistance_ohm\np\t{text}\tA\t{text}\n"
    )
    lines = faults(folder)
    assert any("position: found '" in line for line in lines)
    assert any("wire_resistance_ohm: found '" in line for line in lines)


LAUGHS = "a: &a [x, x]\n" + "".join(
    f"{new}: &{new} [*{old}, *{old}, *{old}]\n"
    for old, new in zip("abcdefgh", "bcdefghi", strict=True)
)
BAD_CONFIG = [
    (LAUGHS, "line 2: found '*a', wanted the value itself; no *name stands for one"),
    ("title: &x [*x]", "line 1: found '*x', wanted the value itself"),
    ("title: " + "[" * 100_000, "line 1: found 9 values within values, wanted 8 at most"),
    ("{a: " * 5000, "line 1: found 9 values within values, wanted 8 at most"),
    ("title: " + "x" * 1001, "line 1: found a value of 1001 characters, wanted 1000 at most"),
    ("strict: 2024-13-45", "found 'month must be in 1..12', wanted YAML"),
    ("strict: !!python/object/apply:os.system [ls]", "could not determine a constructor"),
    ("strict: maybe", "line 1, strict: found 'maybe', wanted true or false"),
    ("\nresistence: {}", "line 2: found 'resistence'", "did you mean 'resistance'?"),
    ("rest_c_rate: 1", "did you mean 'segment.rest_c_rate'?"),
    (
        "soc:\n  sensor_volt: 0.001",
        "line 2: found soc.sensor_volt, wanted no such key: ",
        "soc.sensor_volt is fixed now at 0.002 V",
    ),
    ("ica: {prominence: 0.05}", "line 1: found ica, wanted no such key: ica.prominence is fixed"),
    ("resistance:\n  delay_second: [0, -1]", "line 2, resistance.delay_second.1: found -1"),
    (
        "resistance:\n  delay_second: [1, 1]",
        "found [1, 1], wanted one or more values",
        "all different",
    ),
    ("segment:\n  rest_c_rate: 1e-3", "found '1e-3', wanted a number above 0; write 0.001"),
    (
        "pack_decisions:\n  draws: '20'",
        "found '20', wanted a whole number at least",
    ),
    ("segment:\n  rest_c_rate: .nan", "found nan, wanted a number above 0"),
    # Numbers of so many digits that nothing can be computed with them.
    ("segment:\n  rest_c_rate: " + "9" * 401, "line 2, segment.rest_c_rate: found 999", "a number"),
    (
        "pack_decisions:\n  draws: " + "9" * 401,
        "draws: found 999",
        "wanted a whole number at least",
    ),
    ("segment: 3", "segment: found 3, wanted keys with values below it"),
    ("strict: true\nstrict: false", "line 2", "each key once (also line 1)"),
    ("strict: [", "config/config.yaml, line", "wanted YAML"),
    ("a: 1\n\tb: 2", "config/config.yaml, line 2", "wanted YAML"),
    ("just words", "wanted keys with values"),
]


@pytest.mark.parametrize(("text", "expected"), [(text, words) for text, *words in BAD_CONFIG])
def test_a_bad_setting_is_named_with_its_line(folder, text, expected):
    write(folder, "config.yaml", text)
    assert any(all(words in line for words in expected) for line in faults(folder))


def test_a_bad_given_setting_is_named(folder):
    assert faults(folder, strict="perhaps") == [
        "--config, strict: found 'perhaps', wanted true or false"
    ]


def test_numbers_of_a_section_given_on_the_command_line_are_numbers(folder):
    """Snakemake's --config 'segment={rest_c_rate: 1e-3}' hands over texts."""
    given = read(
        folder, segment={"rest_c_rate": "1e-3"}, resistance={"delay_second": ["1", "10.5"]}
    )
    assert given.config["segment"]["rest_c_rate"] == 1e-3
    assert given.config["resistance"]["delay_second"] == [1, 10.5]
    assert faults(folder, segment={"rest_c_rate": "low"}) == [
        "--config, segment.rest_c_rate: found 'low', wanted a number above 0"
    ]


def test_all_faults_of_all_files_are_told_at_once(folder):
    write(folder, "config.yaml", "strict: maybe\n")
    write(folder, "cells.tsv", CELLS + "C\t5\t4\n")
    write(folder, "tests.tsv", TESTS + "A\tt2\thpcp\tb.csv\nA\tt3\thppc\tc.csv\t\t7\n")
    files = [line.split(",")[0] for line in faults(folder)]
    assert sorted(files) == ["config/cells.tsv", "config/config.yaml", *["config/tests.tsv"] * 2]


@effort(max_examples=40, deadline=None)
@given(st.lists(st.text(st.characters(codec="utf-8"), max_size=12), max_size=12))
def test_no_text_breaks_the_reader(tmp_path_factory, cells):
    folder = tmp_path_factory.mktemp("any")
    (folder / "config").mkdir()
    write(folder, "cells.tsv", CELLS)
    write(folder, "tests.tsv", TESTS + "\t".join(cells))
    with contextlib.suppress(sheets.CampaignError):
        read(folder)


def test_measured_campaigns_are_read(shared):
    folders = sorted(folder.parent for folder in shared.glob("campaigns/*/config"))
    assert len(folders) >= 12
    for folder in folders:
        assert read(folder).tests


def test_the_demo_campaign_is_read():
    demo = SCHEMAS.parents[1]
    if not (demo / "config" / "cells.tsv").is_file():
        pytest.skip("the demo campaign is not made yet")
    assert read(demo).tests


def test_sheets_of_a_thousand_cells_are_read_whole(folder):
    cells = [f"c{n}\t2.5\t4.2\n" for n in range(1000)]
    rows = [f"c{n}\tt{k}\thppc\traw/{n}_{k}.csv\t25\n" for n in range(1000) for k in range(12)]
    write(folder, "cells.tsv", CELLS + "".join(cells))
    write(folder, "tests.tsv", HEAD + "".join(rows))
    assert len(read(folder).tests) == 12000


DATED = "cell\ttest\tkind\tfile\tstarted\tnote\n"


def dates(folder, *rows):
    """Dates of tests as the sheet is read; a row is (started, note)."""
    lines = [f"A\tt{k}\thppc\traw/{k}.csv\t{one}\t{note}\n" for k, (one, note) in enumerate(rows)]
    write(folder, "tests.tsv", DATED + "".join(lines))
    return [row["started"] for row in read(folder).tests]


def test_a_test_has_the_date_of_its_column_else_of_its_note(folder):
    stated = "2017-03-18 02:17"
    noted = "started 3/9/2017 5:59:23 PM; discharge, then charge"
    rows = (stated, noted), ("", noted), ("", "restarted 3/9/2017"), ("2017-03-20", "")
    assert dates(folder, *rows) == [stated, "2017-03-09 17:59:23", None, "2017-03-20"]


def test_the_notes_of_a_sheet_have_one_order_of_day_and_month(folder):
    first, second = ("", "started 3/9/2017"), ("", "started 18/9/2017, with a new fixture")
    assert dates(folder, first, second) == ["2017-09-03 00:00:00", "2017-09-18 00:00:00"]


@pytest.mark.parametrize("wrong", ["2017-13-01", "9.3.2017", "2017-03-09 25:00"])
def test_a_date_that_is_none_is_a_fault(folder, wrong):
    write(folder, "tests.tsv", DATED + f"A\tt\thppc\traw/a.csv\t{wrong}\t\n")
    (fault,) = faults(folder)
    assert fault.startswith(f"config/tests.tsv, row 1 (line 2), started: found '{wrong}', wanted")
