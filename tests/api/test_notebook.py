"""docs/examples/first_model.ipynb: no outputs are committed; its cells run one after the other."""

import json
import re
from pathlib import Path

import matplotlib
import pandas as pd
import pytest
from page_blocks import ROOT, value_of

import cellwright as cw

PATH = "docs/examples/first_model.ipynb"
NOTEBOOK = json.loads((ROOT / PATH).read_text(encoding="utf-8"))
CELLS = [cell for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]
TEXT = ["".join(cell["source"]) for cell in NOTEBOOK["cells"] if cell["cell_type"] == "markdown"]


def test_the_notebook_is_one_and_has_no_outputs():
    assert (NOTEBOOK["nbformat"], NOTEBOOK["nbformat_minor"]) == (4, 5)
    assert not [cell for cell in CELLS if cell["outputs"] or cell["execution_count"] is not None]
    assert len({cell["id"] for cell in NOTEBOOK["cells"]}) == len(NOTEBOOK["cells"])


def test_what_the_notebook_names_exists():
    called = set(re.findall(r"\bcw\.(\w+)", "".join("".join(cell["source"]) for cell in CELLS)))
    assert called <= {*cw.MODULE_OF, "settings"}
    for link in re.findall(r"\]\(([^)#]+)", "".join(TEXT)):
        assert (ROOT / "docs/examples" / link).exists(), link


@pytest.mark.slow
def test_the_notebook_runs_from_a_raw_file_to_a_saved_model(tmp_path, monkeypatch):
    """As a kernel runs it in its folder; 15 s of CPU."""
    matplotlib.use("Agg")
    folder = tmp_path / "docs/examples"
    folder.mkdir(parents=True)
    (tmp_path / "data").symlink_to(ROOT / "data")
    monkeypatch.chdir(folder)
    names, shown = {}, []
    for cell in CELLS:
        shown.append(value_of("".join(cell["source"]), names))
    capacity, score = shown[3], shown[-2]
    assert capacity["capacity_ampere_hour"].tolist() == pytest.approx([4.892] * 2, rel=2e-3)
    assert score["rmse_volt"].item() < 0.03
    assert shown[-1] == ["model.json", "pybamm.json", "resistance.csv"]
    table = pd.read_csv(Path("my_first_model/resistance.csv"))
    assert table["resistance_ohm"].between(0.03, 0.07).all()
