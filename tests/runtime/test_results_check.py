"""Laws over the results: each outcome is a row, with what was found where one is broken."""

import pytest

from runtime import results_check

LAWS = '''
import pytest
def test_kept():
    """A law that is kept."""
def test_broken():
    """A law that is broken.

    And why.
    """
    assert 3 < 2
def test_asked():
    """A law that cannot be asked."""
    {}["soc"]
def test_cells(law):
    """A law of cells."""
    rows = [{"cell": "A", "test": "t", "volt": volt} for volt in range(8)] + [{"cell": "B"}]
    law.each(rows, lambda row: row["volt"] > 2, "{volt} V")
    law.hold()
def test_unknown():
    """A law that needs a table."""
    pytest.skip("capacity.csv is not there")
'''


@pytest.fixture
def laws(tmp_path, monkeypatch):
    (tmp_path / "laws").mkdir()
    (tmp_path / "laws/test_laws.py").write_text(LAWS)
    (tmp_path / "laws/conftest.py").write_text(
        "import pytest\n"
        "from runtime.results_check import Law\n"
        "def pytest_addoption(parser):\n    parser.addoption('--results')\n"
        "@pytest.fixture\ndef law():\n    return Law()\n"
    )
    monkeypatch.setattr(results_check, "TESTS", tmp_path / "laws")
    return tmp_path


def outcome(check, ended, found="", **whose):
    return {"check": check, "outcome": ended, "cell": "", "test": "", "found": found} | whose


def test_each_law_says_how_it_ended(laws, capsys):
    assert results_check.outcomes(laws) == [
        outcome("A law that is kept.", "passed"),
        outcome("A law that is broken.", "failed", "does not hold: 3 < 2"),
        outcome("A law that cannot be asked.", "failed", "could not be checked (KeyError: 'soc')"),
        outcome("A law of cells.", "failed", "3 V; 4 V; 5 V; and 2 more", cell="A", test="t"),
        outcome("A law of cells.", "failed", "a row cannot be checked: 'volt'", cell="B"),
        outcome("A law that needs a table.", "skipped"),
    ]
    assert capsys.readouterr().out == ""


def write(folder, resistance):
    folder.mkdir()
    head = "cell,test,start_time_second,soc,direction,delay_second,"
    head += "resistance_ohm,resistance_std_ohm\n"
    row = "0,0.5,discharge,0"
    lines = [f"A,hppc,{row},{resistance},0.001", f"B,hppc,{row},0.02,0.001"]
    (folder / "resistance.csv").write_text(head + "\n".join(lines) + "\n")
    return folder


def test_the_houses_own_laws_find_a_negative_resistance(tmp_path):
    kept = results_check.outcomes(write(tmp_path / "good", 0.03))
    broken = results_check.outcomes(write(tmp_path / "bad", -0.03))
    assert [row["outcome"] for row in kept].count("failed") == 0
    (failed,) = [row for row in broken if row["outcome"] == "failed"]
    assert failed["check"].startswith("A resistance is not negative")
    assert (failed["cell"], failed["test"]) == ("A", "hppc")
    assert failed["found"] == "a resistance of -0.03 Ω at SoC 0.5, wanted above 0 and below 10 Ω"


def test_one_row_that_cannot_be_checked_keeps_no_other_from_it(tmp_path):
    rows = results_check.outcomes(write(tmp_path / "text", "-0.03,0.1\nC,p,0,0.5,discharge,0,x"))
    failed = {(row["cell"], row["found"].split(" of ")[0]) for row in rows if row["found"]}
    assert ("A", "a resistance") in failed
    assert any(cell == "C" and "cannot be checked" in found for cell, found in failed)
    assert not [row for row in rows if "Error" in row["found"]]


# What breaks each of the other laws, in the least that its table needs, and what is said of it.
IMPLAUSIBLE = {
    "../summary": ("cell,soh\nA,1e300", "a state of health of 1e+300, wanted 0.1 to 1.5"),
    "capacity": (
        "cell,test,cycle,direction,c_rate,ambient_temperature_celsius,capacity_ampere_hour,"
        "coulombic_efficiency,energy_watt_hour\nA,t,0,discharge,1,0,5,0.5,18\n"
        "A,w,0,discharge,1,25,4,1,15\nA,n,0,discharge,,25,4,1,15\n"
        "A,leads,0,discharge,0.066,25,4,1,14\nA,sound,0,discharge,0.066,0,4,1,18",
        "a coulombic efficiency of 0.5, wanted 0.8 to 1.1",
    ),
    "temperature": (
        "cell,parameter,quantity,value,lower,upper\nA,activation_energy,resistance,10,,",
        "resistance: an activation energy of 10 J/mol, wanted 2000 to 120000",
    ),
    "packs": (
        "group,test,kcl_residual_ampere\nA,t,0.1",
        "the currents of the branches miss the total by 0.1 A",
    ),
    "fade": (
        "cell,knee_cycle,knee_lower_cycle,knee_upper_cycle,last_cycle,remaining_cycles,"
        "remaining_lower_cycles,remaining_upper_cycles\nA,9,10,12,20,5,6,",
        "a knee at cycle 9.0 between 10.0 and 12.0, of a life to cycle 20.0",
    ),
    "health": (
        "cell,cycle,method,soh\nA,300,check-up,1.2",
        "a state of health of 1.2 at cycle 300.0 by check-up, wanted 0.02 to 1.1",
    ),
}


@pytest.mark.parametrize("table", IMPLAUSIBLE)
def test_a_broken_law_is_told_of_its_cell_in_words(tmp_path, table):
    text, said = IMPLAUSIBLE[table]
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables" / f"{table}.csv").write_text(text + "\n")
    failed = [r for r in results_check.outcomes(tmp_path / "tables") if r["outcome"] == "failed"]
    assert {row["cell"] for row in failed} == {"A"}
    assert any(row["found"].startswith(said) for row in failed)
    assert not [row for row in failed if "Error" in row["found"]]
    if table == "capacity":
        assert failed[1]["found"] == "5 Ah at 0 °C and 4 Ah at 25 °C, at 1C"
        (energy,) = [row for row in failed if " Wh" in row["found"]]
        assert energy["test"] == "leads"
        assert "at 0.066C gives 14 Wh, w at 1C gives 15 Wh" in energy["found"]


@pytest.mark.parametrize(
    ("column", "found"),
    [
        ("beyond_volt", "model 2RC leaves what was measured by 4 V"),
        ("fit_beyond_volt", "model 2RC leaves what was measured by 4 V"),
        ("max_abs_volt", "model 2RC misses the measured voltage by up to 4 V"),
    ],
)
def test_a_chosen_model_that_is_volts_off_does_not_pass(tmp_path, column, found):
    for name, errors in (
        ("validation", ("max_abs_volt", "beyond_volt")),
        ("choice", ("fit_beyond_volt",)),
    ):
        volts = ",".join("4.0" if error == column else "0.02" for error in errors)
        head = f"cell,test,model,rmse_volt,{','.join(errors)},chosen"
        others = ",".join(["4.5"] * len(errors))
        lines = [head, f"A,t,2RC,0.2,{volts},True", f"A,t,1RC,0.2,{others},False"]
        (tmp_path / f"{name}.csv").write_text("\n".join(lines))
    (failed,) = [row for row in results_check.outcomes(tmp_path) if row["outcome"] == "failed"]
    assert failed["check"].startswith("A model half a volt off")
    assert (failed["cell"], failed["test"]) == ("A", "t")
    assert failed["found"] == found


def table(folder, name, rows):
    """A folder with one table of rows of text."""
    folder.mkdir()
    lines = [",".join(rows[0]), *(",".join(map(str, row.values())) for row in rows)]
    (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    return folder


@pytest.mark.parametrize(("taken", "ended"), [(2.62, "failed"), (2.95, "passed")])
def test_a_cell_that_gives_more_than_it_took_is_found_without_an_efficiency(tmp_path, taken, ended):
    """Panasonic's slow test: 3.00 Ah out, 2.62 Ah in, no partner of a cycle, no efficiency."""
    about = {"cell": "A", "test": "slow", "cycle": ""}
    rows = [
        about | {"direction": name, "capacity_ampere_hour": size, "coulombic_efficiency": ""}
        for name, size in (("charge", taken), ("discharge", 3.0))
    ]
    found = results_check.outcomes(table(tmp_path / "r", "capacity", rows))
    (row,) = [row for row in found if row["check"].startswith("A cell gives back")]
    assert row["outcome"] == ended
    if ended == "failed":
        assert row["found"] == "discharged 3 Ah but charged 2.62 Ah in one test"
