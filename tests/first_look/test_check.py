"""A campaign looked at before anything runs: sheets, files, what each test gives."""

import re
from pathlib import Path

import numpy as np
import pytest
from cycler_texts import RECORDS, text_of

from first_look.__main__ import main
from runtime import campaign_check, sheets

SCHEMAS = Path(__file__).resolve().parents[2] / "workflow/schemas"
CELL = "cell\trated_capacity_ampere_hour\tlower_cutoff_volt\tupper_cutoff_volt\nA7\t{}\t3\t4.2\n"
HEAD = "cell\ttest\tkind\tfile\tambient_temperature_celsius\tsoc\n"


def campaign(folder, *tests, rated=2):
    """A campaign of one cell with a capacity test in `raw data/A #1.csv`; rows of its tests."""
    (folder / "config").mkdir()
    (folder / "raw data").mkdir()
    (folder / "raw data/A #1.csv").write_text(text_of(*RECORDS["capacity"]))
    (folder / "config/cells.tsv").write_text(CELL.format(rated))
    rows = tests or ("A7\tcap\tcapacity\traw data/A #1.csv\t25\t1",)
    (folder / "config/tests.tsv").write_text(HEAD + "\n".join(rows))
    return folder


def shown_of(folder, capsys, ended=0):
    assert main(["check", str(folder)]) == ended
    shown = capsys.readouterr()
    return shown.out + shown.err


def test_a_sound_test_gives_its_capacity_and_the_next_command(tmp_path, capsys):
    """2 A for 0.99 h, counted to the row that reaches the cut-off."""
    said = shown_of(campaign(tmp_path), capsys)
    assert "sheets: 1 cells, 1 tests, no fault" in said
    (found,) = re.findall(r"cap \(capacity\): .*capacity: .*?([\d.]+) Ah discharge at 1 C", said)
    assert float(found) == pytest.approx(1.98, abs=0.02)
    assert "no model: needs an hppc test" in said
    assert said.splitlines()[-1] == f"next: ./run snakemake --cores 2 --directory {tmp_path}"
    assert "1 tests: 0 left out, 0 that lack a result" in said


def test_kelvin_percent_and_millivolt_are_told_by_their_size_all_at_once(tmp_path, capsys):
    folder = campaign(tmp_path, "A7\tcap\tcapacity\traw data/A #1.csv\t298.15\t80")
    sheet = folder / "config/cells.tsv"
    sheet.write_text(sheet.read_text().replace("4.2", "4200"))
    said = shown_of(folder, capsys, ended=1)
    for words in ("in kelvin? Write 25", "in percent? Write 0.8", "in millivolt? Write 4.2"):
        assert words in said
    assert "Traceback" not in said


def test_a_number_a_little_beyond_its_range_is_of_no_other_unit(tmp_path, capsys):
    folder = campaign(tmp_path, "A7\tcap\tcapacity\traw data/A #1.csv\t160\t1.02")
    said = shown_of(folder, capsys, ended=1)
    assert "found '1.02', wanted a number from 0 to 1\n" in said
    assert "kelvin" not in said


def test_a_rating_in_milliampere_hours_is_told_by_the_currents(tmp_path, capsys):
    said = shown_of(campaign(tmp_path, rated=2000), capsys)
    assert "or a rating written in mAh?" in said
    time, current, voltage = RECORDS["capacity"]
    short = tmp_path / "raw data/A #1.csv"  # neither full nor empty: its charge tells nothing
    short.write_text(text_of(time[:400], current[:400], voltage[:400]))
    said = shown_of(tmp_path, capsys)
    assert "found a rating of 2000 Ah beside currents of 2 A at most; in mAh? Write 2" in said
    (tmp_path / "config/cells.tsv").write_text(CELL.format(2))
    assert "mAh" not in shown_of(tmp_path, capsys)


def test_a_file_that_was_moved_is_named_with_where_it_lies(tmp_path, capsys):
    folder = campaign(tmp_path, "A7\tcap\tcapacity\traw/A #1.csv\t25\t1")
    said = shown_of(folder, capsys)
    wanted = (
        "config/tests.tsv, row 1 (A7 cap), file: raw/A #1.csv: there is no such file in the "
        "campaign; one of this name lies at raw data/A #1.csv: moved?"
    )
    assert wanted in said
    assert "files that no sheet names: raw data/A #1.csv" in said
    assert "1 tests: 1 left out" in said
    _, missing = campaign_check.check(folder, SCHEMAS)
    assert missing == [wanted], "a run, and a dry one, is told the same"


def test_files_beside_those_of_the_sheets_are_named_and_no_others(tmp_path, capsys):
    folder = campaign(tmp_path)
    for other in ("raw data/B #1.csv", "README.md"):
        (folder / other).write_text("text\n")
    said = shown_of(folder, capsys)
    assert "files that no sheet names: raw data/B #1.csv\n" in said
    assert "README.md" not in said


def test_what_a_test_cannot_give_is_said_with_what_its_steps_look_like(tmp_path, capsys):
    said = shown_of(campaign(tmp_path, "A7\tslow\tocv\traw data/A #1.csv\t25\t1"), capsys)
    assert "no open-circuit voltage: " in said
    assert "its steps look like those of kind capacity" in said
    assert "1 tests: 0 left out, 1 that lack a result" in said


def test_a_spectrum_in_milliohm_is_told_by_the_size_of_its_cell(tmp_path, capsys):
    folder = campaign(tmp_path, "A7\te\teis\traw data/e.csv\t25\t0.5")
    hertz = np.logspace(4, -2, 31)
    ohm = 20.0 + 15.0 / (1 + 1j * hertz)  # of milliohm
    rows = [f"{f:.5g},{z.real:.5g},{z.imag:.5g}\n" for f, z in zip(hertz, ohm, strict=True)]
    (folder / "raw data/e.csv").write_text("freq/Hz,Re(Z)/Ohm,Im(Z)/Ohm\n" + "".join(rows))
    said = shown_of(folder, capsys)
    assert "e (eis): a spectrum of 31 points, 0.01 to 1e+04 Hz; in doubt: no cell of 2 Ah" in said


def test_a_run_names_the_first_missing_files_and_counts_the_others():
    lines = campaign_check.in_words([f"{k}" for k in range(12)])
    assert lines[-2:] == ["9", "… 2 more files that cannot be read"]
    assert campaign_check.in_words(["a"]) == ["a"]


def test_faults_of_sheets_are_those_of_a_run(tmp_path):
    folder = campaign(tmp_path, "B\tcap\tcapacity\traw data/A #1.csv\t25\t1")
    with pytest.raises(sheets.CampaignError, match=r"row 1 \(line 2\), cell: found 'B'"):
        campaign_check.check(folder, SCHEMAS)
