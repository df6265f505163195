"""Records made wrong, through the workflow's own jobs: the scripts of ingest, capacity and ageing.

What the functions publish of a record its artefacts hold too; a fault of the program is none.
"""

import runpy

import numpy as np
import pytest

from fuzz.kinds import BENIGN, KINDS
from fuzz.published import file_of, outcome_of
from fuzz.records import HERE, entries, record_of
from runtime import artefact, raw_files, settings

SEEDS = {"words for numbers": 1, "cut mid-line": 2, "offset": 3, "mA under A": 4, "a NUL": 5}
SEEDS |= {"clock begins anew": 6, "block twice": 7, "current zero in a block": 8, "unchanged": 9}
NAMES = {"cell": "C1", "test": "t"}


class Named(list):
    """Files, parameters or wildcards as Snakemake hands them over: in order, and by their names."""

    def __init__(self, named):
        lists = [value if isinstance(value, list) else [value] for value in named.values()]
        super().__init__(path for paths in lists for path in paths)
        self.__dict__.update(named)
        self.items, self.get = named.items, named.get


class Job:
    """What Snakemake hands to a script."""

    def __init__(self, rule, *named):
        self.input, self.output, self.params, self.wildcards = map(Named, named)
        self.rule, self.log = rule, ["log"]


def run(script, *job):
    """Run a script of the workflow as a job."""
    runpy.run_path(str(HERE / "scripts" / script), init_globals={"snakemake": Job(*job)})


@pytest.fixture(scope="module")
def record():
    """The demo's capacity test of C1."""
    entry = next(e for e in entries() if e[0] == HERE and e[2]["test"] == "capacity_25C")
    return record_of(entry)


def ingest(changed, longest_minute=10.0):
    """Paths of what the job of a record's file makes, and what it says of cell and test."""
    chosen = settings.defaults(settings.load(HERE / "workflow" / "schemas", "config"))
    steps = ("ingest", "clean", "flags", "segment")
    paths = {name: f"results/stages/{name}/C1/t.parquet" for name in steps}
    reading = {"file": ["record.csv"], "sha256": None, "instrument": None, "current_sign": None}
    reading["columns"] = None
    test = {name: value for name, value in changed.test.items() if name != "test"}
    facts = {"cell": changed.cell, "test": test}
    params = {"reading": reading, "channels": {}, "clean": chosen["clean"]}
    params |= {"segment": chosen["segment"], "largest_megabyte": 100.0} | facts
    params |= {"content": raw_files.planned({"record.csv": 100.0})}
    params |= {"longest_minute": longest_minute}
    run("ingest/series.py", "series", {"raw": "record.csv"}, paths, params, NAMES)
    return paths, facts | {"instrument": chosen["instrument"]}


def test_a_file_that_takes_too_long_is_left_out_by_name(record, tmp_path, monkeypatch):
    """Its artefacts carry the reason, as any refusal; the job itself ends well."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "record.csv").write_bytes(file_of(record))
    paths, _ = ingest(record, longest_minute=1e-6)
    for path in paths.values():
        reason = artefact.read_about(path)["reason"]
        assert reason.startswith("record.csv: took more than 1e-06 min of CPU time")
        assert "raise files.longest_reading_minute" in reason


@pytest.mark.parametrize("kind", sorted(SEEDS))
def test_artefacts_hold_what_the_functions_publish(record, kind, tmp_path, monkeypatch):
    changed = (KINDS | BENIGN)[kind](record, np.random.default_rng(SEEDS[kind]))
    monkeypatch.chdir(tmp_path)
    written = file_of(changed)
    # Where a text is damaged chance tells anew each time it is written.
    changed = changed._replace(text=lambda _: written.decode("utf-8", "surrogateescape"))
    (tmp_path / "record.csv").write_bytes(written)
    paths, params = ingest(changed)
    made = "results/stages/capacity/C1/t.parquet"
    inputs = {"series": paths["clean"], "steps": paths["segment"], "course": [], "curves": []}
    run("protocols/capacity.py", "capacity", inputs, {"rows": made}, params, NAMES)
    reason = artefact.read_about(made)["reason"] or ""
    outcome = outcome_of(changed)
    assert "failed" not in reason
    assert "Traceback" not in (tmp_path / "log").read_text()
    rows = outcome.rows.get("capacity", [])
    assert bool(reason) == (not rows)
    if not reason:
        found = artefact.load(made)
        for name in ("capacity_ampere_hour", "capacity_std_ampere_hour"):
            np.testing.assert_allclose(found[name], [row[name] for row in rows], rtol=1e-12)
        assert list(found["doubt"]) == [row["doubt"] for row in rows]
    else:
        assert reason.split(": ", 1)[1] in outcome.refused
