"""docs/api.md: its blocks run one after the other on the demo's files."""

import doctest
import re
from pathlib import Path

import numpy as np
import pytest

import cellwright as cw

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```", TEXT, re.M | re.S)


@pytest.mark.slow
def test_the_page_runs_from_a_raw_file_to_a_verdict(monkeypatch):
    monkeypatch.chdir(ROOT)
    assert len(BLOCKS) >= 8
    names = {}
    for number, block in enumerate(BLOCKS):
        exec(compile(block, f"docs/api.md, block {number}", "exec"), names)
    assert names["lacking"].verdict["verdict"] in ("none", "named", "ambiguous", "unknown")
    assert 4.0 < names["basis"].content["capacity_ampere_hour"] < 5.0
    verdict, series = names["lacking"].verdict, names["lacking"].series
    for role, errors in (("fit", "rmse_volt"), ("validation", "validation_rmse_volt")):
        rows = np.equal(series["role"], role) & series["counted"]
        assert not np.any(rows & ~np.asarray(series["used"]))
        for model, volt in verdict[errors].items():
            error = np.subtract(series["voltage_volt"], series[f"{model}_volt"])[rows]
            assert np.sqrt(np.mean(error**2)) == pytest.approx(volt, rel=1e-9)
    case = cw.prepared_case(names["cell"], names["basis"], names["tests"])
    assert [case.fit.tests, case.validation.tests] == [("hppc_25C",), ("us06_25C",)]


def test_every_example_calls_what_exists():
    called = set(re.findall(r"\bcw\.(\w+)", "".join(BLOCKS)))
    assert called <= {*cw.MODULE_OF, "settings"}


# Steps whose docstring has an example that needs no file.
SHOWN = [name for name in cw.__all__ if ">>>" in (getattr(cw, name).__doc__ or "")]


@pytest.mark.parametrize("name", SHOWN)
def test_an_example_of_a_docstring_does_what_it_shows(name):
    step = getattr(cw, name)
    (example,) = doctest.DocTestFinder(recurse=False).find(step, name, globs={})
    assert doctest.DocTestRunner().run(example).failed == 0


def test_the_first_steps_show_an_example():
    assert {"read", "clean", "segment", "capacity", "simulate", "model_of_table"} <= set(SHOWN)


def test_help_of_a_step_stands_alone():
    """No page of documentation that a wheel has not; shared arguments and keys of settings."""
    for name in cw.__all__:
        assert "docs/" not in getattr(cw, name).__doc__, name
    shown = cw.capacity.__doc__
    assert shown.count("series : DataFrame, columns or result of `clean`") == 1
    assert "cell, test : CellFacts and TestFacts" in shown
    assert "current_accuracy_share [1] : Largest error of the current" in shown
    assert "current_accuracy_share = 0.0005" in shown
    assert cw.capacity.__doc__ == shown, "completed once"
