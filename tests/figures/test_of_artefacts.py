"""Figures of one cell, each from its own artefacts."""

import json
import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from figures import of_artefacts
from runtime import artefact

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "drawing" / "figures.py"


class Named(dict):
    """Values by name, as Snakemake hands them to a script."""

    __getattr__ = dict.__getitem__


def write(snakemake, test, *, reason=None):
    """A simulation of a test and its score; with a reason, neither has rows."""
    time = np.arange(0.0, 600.0)
    series = {"test_time_second": time, "current_ampere": -1 + 0 * time}
    series |= {"voltage_volt": 3.7 - time / 3600, "simulated_1RC_volt": 3.69 - time / 3600}
    series["scored"] = np.ones(len(time), bool)
    score = {"model": "1RC", "rmse_volt": 0.01, "chosen": True}
    paths = {}
    for name, stage, content in (("series", "simulation", series), ("scores", "validation", score)):
        paths[name] = f"results/stages/{stage}/A/{test}.parquet"
        job = snakemake(paths[name], wildcards={"cell": "A", "test": test})
        about = artefact.Job(job).about(reason, paths[name] if reason else None)
        columns = {} if reason else {k: np.atleast_1d(v) for k, v in content.items()}
        _write(paths[name], columns, about)
    return {"kind": "validation", "test": test, "inputs": paths, "settings": {}}


def _write(path, columns, about):
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(about, sort_keys=True)
    table = pa.table(columns).replace_schema_metadata({artefact.KEY: text})
    pq.write_table(table, path)


@pytest.fixture
def job(snakemake):
    """The job of a cell with a figure of a good test, one of a bad one, and one that fails."""
    figures = {
        "validation_bad": write(snakemake, "bad", reason="no OCV curve & no rest"),
        "validation_good": write(snakemake, "good"),
    }
    figures["soc_good"] = figures["validation_good"] | {"kind": "soc"}
    params = Named(figures=figures, owner_kind="cell", code="c0de", contract="")
    return SimpleNamespace(
        rule="figures",
        params=params,
        wildcards=Named(owner="A"),
        input=sorted({path for drawn in figures.values() for path in drawn["inputs"].values()}),
        output=["results/figures/A"],
        log=[],
    )


def drawn(job):
    runpy.run_path(str(SCRIPT), {"snakemake": job})
    return {path.stem: path.read_text() for path in Path(job.output[0]).glob("*.svg")}


def test_a_reason_is_written_into_the_figure_that_it_concerns_and_no_other(job):
    figures = drawn(job)
    assert set(figures) == set(job.params.figures)
    assert "no OCV curve &amp; no rest" in figures["validation_bad"]
    assert artefact.FAILED in figures["soc_good"]
    assert "good: model over measurement" in figures["validation_good"]


def test_a_figure_names_its_own_inputs_and_test(job):
    figures = drawn(job)
    good, bad = figures["validation_good"], figures["validation_bad"]
    assert "results/stages/simulation/A/good.parquet" in good
    assert "A/bad.parquet" not in good
    assert "A/bad.parquet" in bad
    assert '"wildcards": {"cell": "A", "test": "good"}' in good
    assert '"code": "c0de"' in good


def test_figures_made_again_have_the_same_bytes(job):
    assert drawn(job) == drawn(job)


def test_every_kind_that_the_workflow_plans_can_be_drawn():
    rules = (SCRIPT.parents[2] / "workflow" / "rules" / "drawing.smk").read_text()
    planned = set(re.findall(r'\bfigure\(\s*"(\w+)"', rules))
    tables = rules.partition("\ndef ")[0]
    planned |= {f"effect_{name}" for name in re.findall(r'^    "(\w+)":', tables, re.M)}
    tests = rules.partition("def figures_of_tests")[2].partition("return [")[0]
    planned |= set(re.findall(r'^        "(\w+)": \{', tests, re.M))
    assert planned == set(of_artefacts.DRAW)
