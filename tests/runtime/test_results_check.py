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
def test_unknown():
    """A law that needs a table."""
    pytest.skip("capacity.csv is not there")
'''


@pytest.fixture
def laws(tmp_path, monkeypatch):
    (tmp_path / "laws").mkdir()
    (tmp_path / "laws/test_laws.py").write_text(LAWS)
    (tmp_path / "laws/conftest.py").write_text(
        "def pytest_addoption(parser):\n    parser.addoption('--results')\n"
    )
    monkeypatch.setattr(results_check, "TESTS", tmp_path / "laws")
    return tmp_path


def test_each_law_says_how_it_ended(laws, capsys):
    assert results_check.outcomes(laws) == [
        {"check": "A law that is kept.", "outcome": "passed", "found": ""},
        {"check": "A law that is broken.", "outcome": "failed", "found": "assert 3 < 2"},
        {"check": "A law that needs a table.", "outcome": "skipped", "found": ""},
    ]
    assert capsys.readouterr().out == ""


def write(folder, resistance):
    folder.mkdir()
    head = "cell,test,start_time_second,soc,direction,delay_second,"
    head += "resistance_ohm,resistance_std_ohm\n"
    (folder / "resistance.csv").write_text(f"{head}A,hppc,0,0.5,discharge,0,{resistance},0.001\n")
    return folder


def test_the_houses_own_laws_find_a_negative_resistance(tmp_path):
    kept = results_check.outcomes(write(tmp_path / "good", 0.03))
    broken = results_check.outcomes(write(tmp_path / "bad", -0.03))
    assert [row["outcome"] for row in kept].count("failed") == 0
    (failed,) = [row for row in broken if row["outcome"] == "failed"]
    assert failed["check"].startswith("A resistance is not negative")
    assert "A hppc 0.5 -0.03" in failed["found"]


@pytest.mark.parametrize(
    ("table", "column"), [("validation", "beyond_"), ("choice", "fit_beyond_")]
)
def test_a_chosen_model_at_minus_one_and_a_half_volt_does_not_pass(tmp_path, table, column):
    for name, error in (("validation", "beyond_"), ("choice", "fit_beyond_")):
        volt = 4.0 if name == table else 0.02
        head = f"cell,test,model,rmse_volt,{error}volt,chosen"
        lines = [head, f"A,t,2RC,0.2,{volt},True", "A,t,1RC,0.2,4.5,False"]
        (tmp_path / f"{name}.csv").write_text("\n".join(lines))
    (failed,) = [row for row in results_check.outcomes(tmp_path) if row["outcome"] == "failed"]
    assert failed["check"].startswith("A model half a volt off")
    assert "A t 2RC 4.0" in failed["found"]
