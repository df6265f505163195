"""Commands of a first look at files of a made-up laboratory."""

import json
import os
import re

import numpy as np
import pandas as pd
import pytest

import cellwright as cw
from cellwright.records.kinds import likely_kinds
from first_look.__main__ import main

HOUR = 3600.0


def record(*stretches, step=10.0, capacity=2.0):
    """Time [s], current [A] and voltage [V] of stretches (current, hours) of a 2 Ah cell."""
    current = np.concatenate([np.full(int(hours * HOUR / step), amps) for amps, hours in stretches])
    time = step * np.arange(len(current))
    soc = 1 + np.cumsum(current) * step / HOUR / capacity
    return time, current, 3.0 + 1.2 * np.clip(soc, 0, 1) + 0.05 * current


def text_of(time, current, voltage):
    frame = {"Time (s)": time, "Current (A)": current, "Voltage (V)": voltage}
    return pd.DataFrame(frame).to_csv(index=False)


RECORDS = {
    "capacity": record((0, 0.5), (-2, 0.99), (0, 0.5), (1, 1.95), (0, 0.5)),
    "ocv": record((0, 0.5), (-0.1, 19.8), (0, 0.5), (0.1, 19.5), (0, 0.5), step=60.0),
    "ageing": record((0, 0.2), *[(-2, 0.99), (0, 0.1), (2, 0.98), (0, 0.1)] * 6),
    "relaxation": record((0, 3.0)),
}


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


def test_init_drafts_sheets_and_overwrites_none(tmp_path, capsys):
    for cell in ("A7", "B2"):
        for kind, celsius in (("capacity", "25degC"), ("ocv", "n10C")):
            (tmp_path / f"{cell}_{kind}_{celsius}.csv").write_text(text_of(*RECORDS[kind]))
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


def test_convert_writes_what_reads_back_equal(tmp_path, capsys):
    path = tmp_path / "A7.csv"
    path.write_text(text_of(*RECORDS["capacity"]))
    for goal in ("out.bdf.csv", "out.bdf.parquet"):
        assert main(["convert", str(path), "--to", str(tmp_path / goal)]) == 0
        before, after = cw.read(path), cw.read(tmp_path / goal)
        for name in ("test_time_second", "current_ampere", "voltage_volt"):
            np.testing.assert_allclose(after.columns[name], before.columns[name], rtol=1e-12)
        about = json.loads((tmp_path / f"{goal}.json").read_text())
        assert about["instrument"] == "table"
        assert about["current_is"] == "positive on charge"
    assert main(["convert", str(path), "--to", str(tmp_path / "out.bdf.csv")]) == 1
