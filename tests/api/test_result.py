"""What every step gives: tables and values by name, a document, notes."""

import ast
import pickle
from pathlib import Path

import numpy as np
import pytest

import cellwright as cw
from cellwright.result import Result

FOUND = Result(
    {"rows": [{"soc": 0.5, "ohm": 0.02}], "curve": {"volt": np.arange(3.0), "name": "a"}},
    {"c_rate": 0.05},
    ("a note",),
)


def test_tables_and_values_are_attributes():
    assert FOUND.rows == [{"soc": 0.5, "ohm": 0.02}]
    assert FOUND.c_rate == 0.05
    assert {"rows", "curve", "c_rate", "notes"} <= set(dir(FOUND))
    assert pickle.loads(pickle.dumps(FOUND)).c_rate == 0.05


def test_the_first_table_is_the_frame_and_others_are_named():
    assert FOUND.to_frame().to_dict("list") == {"soc": [0.5], "ohm": [0.02]}
    assert FOUND.to_frame("curve").shape == (3, 2)
    assert Result({}, {"soc": 0.5}).to_frame().to_dict("list") == {"soc": [0.5]}


def test_what_it_has_not_is_said_with_what_it_has():
    with pytest.raises(AttributeError, match="no 'growth'; it has rows, curve, c_rate"):
        _ = FOUND.growth


def test_the_stub_is_what_the_package_gives():
    """Editors find each definition; each name is that of its module."""
    stub = ast.parse(Path(cw.__file__ + "i").read_text(encoding="utf-8"))
    lines = [line for line in stub.body if isinstance(line, ast.ImportFrom)]
    names = {n.name: line.module for line in lines for n in line.names}
    assert set(cw.__all__) == set(names) - {"api", "settings"}
    for name in cw.__all__:
        assert getattr(cw, name).__module__.startswith("cellwright.")


def test_a_notebook_shows_notes_units_and_doubts_safely():
    rows = [{"capacity_ampere_hour": 2.5, "c_rate": 0.5, "doubt": "gain <2 %>"}] * 12
    shown = Result({"rows": rows}, {"member": "2RC"}, ("left out: <b>",))._repr_html_()
    assert "<li>left out: &lt;b&gt;</li>" in shown
    assert "capacity_ampere_hour [Ah]" in shown
    assert "c_rate [1/h]" in shown
    assert "gain &lt;2 %&gt;" in shown
    assert "<b>rows</b>: 12 rows" in shown
    assert shown.count("gain") == 10, "no more than ten rows"
    assert "2RC" in shown
    assert Result({}, None)._repr_html_() == ""


def test_the_version_is_that_of_the_project():
    project = Path(__file__).resolve().parents[2] / "pyproject.toml"
    assert f'version = "{cw.__version__}"' in project.read_text(encoding="utf-8")
