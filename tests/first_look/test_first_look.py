"""Commands of a first look at files of a made-up laboratory."""

import hashlib
import json
import os
import re
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from cycler_texts import HOUR, RECORDS, text_of

import cellwright as cw
from cellwright.records.kinds import likely_kinds, whole_charge
from first_look import check
from first_look import sheets as first_sheets
from first_look.__main__ import main
from first_look.one_file import celsius
from runtime import artefact


@pytest.mark.parametrize("kind", RECORDS)
def test_kinds_by_their_steps(kind):
    time, current, voltage = RECORDS[kind]
    if kind == "relaxation":
        steps = {
            "kind": np.array(["rest"]),
            "duration_second": np.array([time[-1]]),
            "charge_ampere_hour": np.zeros(1),
            "current_mean_ampere": np.zeros(1),
        }
        assert likely_kinds(steps)[0][0] == "relaxation"
        assert likely_kinds(steps, celsius_span=20.0)[0][0] == "ocv_temperature"
        return
    series = cw.clean(
        {"test_time_second": time, "current_ampere": current, "voltage_volt": voltage}
    )
    steps = cw.segment(series.columns).rows._asdict()
    assert likely_kinds(steps)[0][0] == kind


def test_a_titration_has_no_slow_branch_and_is_fitted_as_pulses():
    """Loads of ten minutes, each before a rest of an hour."""
    time = np.arange(0.0, 12 * 4200.0, 10.0)
    current = np.where((time % 4200 < 600) & (time > 4200), -2.0, 0.0)
    record = dict(zip(SERIES, (time, current, 4.1 - 1e-5 * time + 0.05 * current), strict=True))
    steps = cw.segment(cw.clean(record).columns).rows._asdict()
    assert [kind for kind, _ in likely_kinds(steps)] == ["hppc"]
    assert "loads from rest: 11" in check._pulses(SimpleNamespace(**steps))


def test_two_charges_joined_by_a_discharge_that_was_not_logged_are_no_whole_one():
    """The largest of few half cycles is whole, for nothing tells more."""
    assert whole_charge(np.array([2.0, -2.1, 2.0, -2.0, 4.1, -1.9])) == 2.1
    assert whole_charge(np.array([2.0, -0.4])) == 2.0
    assert whole_charge(np.zeros(0)) == 0.0


def test_a_cell_that_loads_warm_tells_its_surroundings_where_it_is_coolest():
    warm = np.r_[np.full(20, 24.0), np.full(80, 33.0)]
    assert celsius({"surface_temperature_celsius": warm}) == 24.0
    assert celsius({"ambient_temperature_celsius": warm}) == 33.0


@pytest.mark.parametrize(
    ("name", "kinds", "wanted"),
    [
        ("A7 aging 2.csv", ["capacity", "ageing"], ("ageing", "")),
        ("A7_ageing.csv", ["drive", "hppc"], ("drive", "ageing")),
        ("A7 HPPC.csv", ["pulse_resistance"], ("hppc", "")),
        ("A7 US06.csv", ["drive"], ("drive", "")),
        ("A7 cap.csv", [], ("", "capacity")),
    ],
)
def test_a_name_chooses_among_the_kinds_that_the_steps_allow(name, kinds, wanted):
    assert first_sheets._kind_of(name, kinds) == wanted


def test_inspect_says_what_a_file_holds(tmp_path, capsys):
    path = tmp_path / "A7_25degC.csv"
    path.write_text(text_of(*RECORDS["capacity"]))
    assert main(["inspect", str(path)]) == 0
    shown = capsys.readouterr().out
    assert "series of" in shown
    assert "read as table" in shown
    moved = re.search(r"charge: ([\d.]+) Ah in, ([\d.]+) out", shown).groups()
    row = 2 * 10 / 3600  # Ah that flow between two rows
    assert list(map(float, moved)) == pytest.approx([1.95, 1.98], abs=row)
    assert "could be of kind capacity" in shown


@pytest.mark.parametrize("command", ["inspect", "convert"])
def test_a_pipe_keeps_nobody_waiting(tmp_path, capsys, command):
    os.mkfifo(tmp_path / "pipe.csv")
    assert main([command, str(tmp_path / "pipe.csv")]) == 1
    assert "pipe.csv: is a pipe (FIFO), wanted a file" in capsys.readouterr().err


def test_init_leaves_out_what_a_campaign_would_not_read(tmp_path, capsys):
    folder = tmp_path / "raw"
    folder.mkdir()
    for name in ("A7.csv", "{A8}.csv", "A9;b.csv", "../outside.csv"):
        (folder / name).write_text(text_of(*RECORDS["capacity"]))
    (folder / "link.csv").symlink_to(tmp_path / "outside.csv")
    os.mkfifo(folder / "pipe.csv")
    assert main(["init", str(folder)]) == 0
    shown = capsys.readouterr().out
    for said in (
        "{A8}.csv: has a brace in its name; rename it",
        "A9;b.csv: has a ; in its name, which joins files; rename it",
        "link.csv: leads out of the campaign by a link; copy the file into it",
        "pipe.csv: is a pipe (FIFO), wanted a file",
    ):
        assert f"left out: {said}" in shown
    assert len(pd.read_csv(folder / "config/tests.tsv", sep="\t")) == 1


def test_inspect_says_why_a_file_cannot_be_read(tmp_path, capsys):
    path = tmp_path / "notes.txt"
    path.write_text("nothing here\n")
    assert main(["inspect", str(path)]) == 1
    assert "notes.txt: of no instrument known here" in capsys.readouterr().err


def test_inspect_goes_on_after_a_file_that_is_refused(tmp_path, capsys):
    bad, good = tmp_path / "notes.txt", tmp_path / "A7_25degC.csv"
    bad.write_text("nothing here\n")
    good.write_text(text_of(*RECORDS["capacity"]))
    assert main(["inspect", str(bad), str(good)]) == 1
    shown = capsys.readouterr()
    assert "notes.txt: of no instrument known here" in shown.err
    assert "A7_25degC.csv: series of" in shown.out


def test_init_drafts_sheets_and_overwrites_none(tmp_path, capsys):
    for cell in ("A7", "B2"):
        for kind, degree in (("capacity", "25degC"), ("ocv", "n10C")):
            (tmp_path / f"{cell}_{kind}_{degree}.csv").write_text(text_of(*RECORDS[kind]))
    (tmp_path / "readme.txt").write_text("see the paper\n")
    assert main(["init", str(tmp_path)]) == 0
    assert "left out: readme.txt: " in capsys.readouterr().out
    cells = pd.read_csv(tmp_path / "config/cells.tsv", sep="\t")
    tests = pd.read_csv(tmp_path / "config/tests.tsv", sep="\t")
    assert list(cells["cell"]) == ["A7", "B2"]
    assert list(tests["kind"]) == ["capacity", "ocv"] * 2
    assert list(tests["ambient_temperature_celsius"]) == [25, -10] * 2
    assert cells["upper_cutoff_volt"].between(4.1, 4.3).all()
    assert main(["init", str(tmp_path)]) == 1
    assert "is there already; it is not overwritten" in capsys.readouterr().err


def read_sheet(path):
    return pd.read_csv(path, sep="\t", dtype=str, keep_default_na=False).to_dict("records")


def drafted(folder, *places, kind="capacity", volt=0.0):
    """Rows of both sheets that `init` drafts of files at these places, and what it says."""
    for place in places:
        (folder / place).parent.mkdir(parents=True, exist_ok=True)
        time, current, voltage = RECORDS[kind]
        (folder / place).write_text(text_of(time, current, voltage + volt))
    lines = first_sheets.write(folder)
    return *(read_sheet(folder / f"config/{n}.tsv") for n in ("cells", "tests")), lines


@pytest.mark.parametrize(
    ("places", "cells"),
    [
        (("LF280 #3/25degC/cap 1C.csv", "LF280 #4/0 degC/cap.csv"), ["LF280_3", "LF280_4"]),
        (("25degC/A7_cap.csv", "0degC/A7_cap.csv"), ["A7", "A7"]),
        (("raw/A7_capacity_25C.csv", "raw/B 2 ocv.csv"), ["A7", "B"]),
        (("hppc/0C_1C.csv", "rate/25C.csv"), ["Maker"] * 2),
        (("LF 26650 #3 cap #2.csv", "LF 26650 #4 0.5C.csv"), ["LF_26650_3", "LF_26650_4"]),
        (("M50 #1 0degC.csv", "M50T #2.csv"), ["M50_1", "M50T_2"]),
        (("S001_C10.csv", "S002_C10.csv"), ["S001", "S002"]),
        (("C1/cap 25degC.csv", "C2/25degC/cap.csv"), ["C1", "C2"]),
        (("C2/25degC/cap.csv", "C20/cap 25degC.csv"), ["Maker"] * 2),
    ],
)
def test_a_cell_is_named_by_what_is_no_temperature_and_no_test(tmp_path, places, cells):
    _, tests, _ = drafted(tmp_path / "Maker", *places)
    found = {row["file"]: row["cell"] for row in tests}
    assert [found[place] for place in places] == cells


@pytest.mark.parametrize(
    ("file", "test"),
    [("A7 0.5C.bdf.csv.gz", "A7_0_5C"), ("A7 0.2C.001", "A7_0_2C"), ("A7 #1.csv", "A7_1")],
)
def test_a_point_in_a_name_begins_no_suffix(tmp_path, file, test):
    assert drafted(tmp_path, file)[1][0]["test"] == test


@pytest.mark.parametrize(
    ("name", "celsius"),
    [
        ("cap_1C_25degC", 25.0),
        ("cap_1C_40C", 40.0),
        ("cap_1C", None),
        ("cap_0.5C", None),
        ("n10C_2C", -10.0),
        ("3C_0C", 0.0),
        ("-5 degC", -5.0),
        ("5 °C", 5.0),
    ],
)
def test_a_rate_in_a_name_is_no_temperature(name, celsius):
    assert first_sheets._celsius_in([name]) == celsius


def test_init_drafts_rating_cut_offs_title_and_the_next_command(tmp_path):
    """1.98 Ah to two digits; from 3.0 to 4.25 V, of which the record goes to 4.2504 V."""
    folder = tmp_path / "My cells"
    cells, tests, lines = drafted(
        folder, "A7_a.csv", volt=0.05 + 4.2 - RECORDS["capacity"][2].max()
    )
    assert cells[0]["rated_capacity_ampere_hour"] == "2"
    assert cells[0]["upper_cutoff_volt"] == "4.25"
    assert "1.978 Ah" in cells[0]["note"]
    assert tests[0]["role"] == "fit"
    assert (folder / "config/config.yaml").read_text() == "title: My cells\n"
    assert lines[-1] == f"next: ./run cellwright check '{folder}'"


def test_thermometers_of_one_room_draft_one_temperature():
    read = [({}, degree) for degree in (26.6, 24.1, -9.0, 25.2, 40.0)]
    first_sheets._propose_temperatures(read)
    drafted = [row["ambient_temperature_celsius"] for row, _ in read]
    assert drafted == ["25", "25", "-9", "25", "40"]


def test_one_cycle_that_runs_beyond_moves_no_cut_off():
    kind = np.array(["CC"] * 6)
    charge = np.array([-2.0, 2.0, -2.0, 2.0, -2.0, 2.0])
    steps = {"kind": kind, "charge_ampere_hour": charge, "current_mean_ampere": charge}
    steps["voltage_end_volt"] = np.array([2.5, 4.2, 2.31, 4.2, 2.49, 4.27])
    assert first_sheets._full(steps, "a") == (2.49, 4.2, 2.0, "a")


def test_cells_that_move_nearly_the_same_charge_get_one_rating():
    """Two digits of 2.752 and 2.748 Ah differ; those of another type stay another's."""
    charges = {"A": 2.748, "B": 2.752, "C": 2.0, "D": 0.0}
    cells = [{"cell": name} for name in charges]
    largest = {name: first_sheets.Full(3.0, 4.2, charge, "a") for name, charge in charges.items()}
    first_sheets._propose_ratings(cells, largest)
    ratings = [row.get("rated_capacity_ampere_hour") for row in cells]
    assert ratings == ["2.8", "2.8", "2", None]


def test_no_cut_off_is_drafted_below_a_voltage_that_another_test_reaches():
    full = [first_sheets.Full(3.0, 4.1, 2.0, "a")]

    def cell_of(full, most):
        found = first_sheets.Found([], {"A": full}, {"A": (3.0, most)}, {}, [])
        return first_sheets._cell("A", found)

    assert "upper_cutoff_volt" not in cell_of(full, 4.21)
    assert cell_of(full, 4.12)["upper_cutoff_volt"] == "4.10"
    assert cell_of([first_sheets.Full(3.0, 4.17, 2.0, "a")], 4.17)["upper_cutoff_volt"] == "4.20"
    discharge = cell_of([first_sheets.Full(3.0, -np.inf, 2.0, "a")], 4.16)
    assert (discharge["lower_cutoff_volt"], discharge["upper_cutoff_volt"]) == ("3.00", "4.20")
    assert discharge["note"].startswith("upper cut-off is a guess")


def test_drives_validate_and_one_is_fitted_where_there_are_no_pulses():
    rows = [("A", "hppc", "25"), ("A", "drive", "25"), ("B", "drive", "25"), ("B", "drive", "25")]
    rows = [*rows, ("B", "drive", "0"), ("B", "capacity", "0")]
    names = ("cell", "kind", "ambient_temperature_celsius")
    tests = [dict(zip(names, row, strict=True)) for row in rows]
    first_sheets._propose_roles(tests)
    roles = ["fit", "validation", "fit", "validation", "split", "fit"]
    assert [row["role"] for row in tests] == roles


def test_files_of_one_reason_are_one_line(tmp_path):
    for name in ("a.txt", "b.txt"):
        (tmp_path / name).write_text("nothing\n")
    *_, lines = drafted(tmp_path, "A7.csv")
    assert lines[0] == "left out: a.txt, b.txt: of no instrument known here"


SERIES = ("test_time_second", "current_ampere", "voltage_volt")
ONTOLOGY = "https://w3id.org/battery-data-alliance/ontology/battery-data-format#"


@pytest.mark.parametrize("kind", ["csv", "csv.gz", "parquet", "feather", "arrow", "json"])
def test_convert_writes_what_reads_back_equal(tmp_path, capsys, kind):
    path, goal = tmp_path / "A7.csv", tmp_path / f"out.bdf.{kind}"
    path.write_text(text_of(*RECORDS["capacity"]))
    assert main(["convert", str(path), "--to", str(goal)]) == 0
    before, after = cw.read(path), cw.read(goal)
    for name in SERIES:
        np.testing.assert_array_equal(after.columns[name], before.columns[name])
    about = json.loads((tmp_path / "out.bdf.metadata.json").read_text())["extras"]["cellwright"]
    assert about["instrument"] == "table"
    assert about["current_is"] == "positive on charge"
    assert about["source_sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
    assert about["left_out_columns"] == ["charge_ampere_hour", "file_index"]  # both ours
    told = json.loads((tmp_path / "out.bdf.jsonld").read_text())
    terms = [one["schema:propertyID"] for one in told["schema:variableMeasured"]]
    assert terms == [ONTOLOGY + name for name in SERIES]
    sha256 = hashlib.sha256(goal.read_bytes()).hexdigest()
    assert told["schema:distribution"]["schema:sha256"] == sha256
    assert main(["convert", str(path), "--to", str(goal)]) == 1
    assert "is there already; it is not overwritten" in capsys.readouterr().err


def test_convert_keeps_every_column_that_the_format_has(tmp_path):
    """Also of a group's channels; twice converted is converted once."""
    time, current, voltage = RECORDS["capacity"]
    frame = pd.DataFrame({"Test Time / s": time, "Current / A": current, "Voltage / V": voltage})
    others = {
        "Unix Time / s": 1.7e9 + time,
        "Cycle Count / 1": 1,
        "Step ID": 7,
        "Step Count / 1": 3,
        "Ambient Temperature / degC": 25.25,
        "Temperature T1 / degC": 26.5,
        "Temperature T2 / degC": 27.5,
        "Net Capacity / Ah": np.cumsum(current) * 10 / HOUR,
        "Branch 1 Current / A": current / 4,
        "Cell 2 Voltage / V": voltage - 0.001,
    }
    path = tmp_path / "whole.bdf.csv"
    frame.assign(**others).to_csv(path, index=False)
    for source, goal in (("whole.bdf.csv", "once.bdf.parquet"), ("once.bdf.parquet", "two.csv")):
        assert main(["convert", str(tmp_path / source), "--to", str(tmp_path / goal)]) == 0
        before, after = cw.read(path).columns, cw.read(tmp_path / goal).columns
        assert before.keys() == after.keys()
        for name, values in before.items():
            np.testing.assert_array_equal(after[name], values, name)
    about = json.loads((tmp_path / "two.metadata.json").read_text())["extras"]["cellwright"]
    assert about["not_in_the_ontology"] == ["Branch 1 Current / A", "Cell 2 Voltage / V"]


def test_a_clean_series_of_the_results_is_an_export(tmp_path):
    """It keeps its values, and what the artefact says of how it was made."""
    time, current, voltage = RECORDS["capacity"]
    raw = dict(zip(SERIES, (time, current, voltage), strict=True))
    clean = cw.clean(raw | {"voltage_volt": np.where(time == 5000, np.nan, voltage)}).columns
    path = tmp_path / "results" / "stages" / "clean" / "A7" / "t.parquet"
    artefact.write(path, clean, {"reason": None, "notes": ["a note"]})
    assert main(["convert", str(path), "--to", str(tmp_path / "t.bdf.csv")]) == 0
    again = cw.read(tmp_path / "t.bdf.csv").columns
    for name in SERIES:
        np.testing.assert_array_equal(again[name], clean[name])
    about = json.loads((tmp_path / "t.bdf.metadata.json").read_text())["extras"]["cellwright"]
    assert about["artefact"]["notes"] == ["a note"]


def test_convert_refuses_a_name_it_cannot_write(tmp_path, capsys):
    path = tmp_path / "A7.csv"
    path.write_text(text_of(*RECORDS["capacity"]))
    assert main(["convert", str(path), "--to", str(tmp_path / "A7.docx")]) == 1
    assert "wanted a name that ends in .csv, .csv.gz, .parquet" in capsys.readouterr().err
