"""What a run took by rule, and how parameters are compared with those of the run before."""

import base64
import json
import sys
from functools import partial
from types import SimpleNamespace

import pandas as pd

from runtime import snakemake_state


def test_rules_are_ranked_by_what_they_took_since_the_start(tmp_path):
    folder = tmp_path / ".snakemake" / "metadata"
    (folder / "@deep").mkdir(parents=True)
    jobs = [("old", 0, 99), ("fit", 10, 15), ("fit", 11, 13), ("read", 10, 11)]
    for number, (rule, start, end) in enumerate(jobs):
        log = [f"logs/{number}.log"]
        record = {"rule": rule, "starttime": start, "endtime": end, "log": log}
        (folder / str(number)).write_text(json.dumps(record))
    (folder / "@deep" / "two_outputs").write_text((folder / "1").read_text())
    (folder / "half").write_text("{")
    assert snakemake_state.slowest(tmp_path, 5) == [
        "fit: 7 s in 2 jobs, longest 5.0 s",
        "read: 1 s in 1 job, longest 1.0 s",
    ]


def test_parameters_are_compared_as_before_and_pandas_is_not_imported_for_them(monkeypatch):
    from snakemake.persistence import PersistenceBase

    original = PersistenceBase._serialize_param_pandas
    monkeypatch.setattr(PersistenceBase, "_serialize_param_pandas", original)
    snakemake_state.compare_parameters_without_pandas()
    serialize = PersistenceBase._serialize_param_pandas
    builtin = partial(PersistenceBase._serialize_param_builtin, None)
    records = SimpleNamespace(_serialize_param_builtin=builtin)
    frame = pd.DataFrame({"volt": [3.6, 3.7]})
    values = [None, 1, 2.5, "text", [1, 2], {"a": (1,)}, frame, frame["volt"]]
    assert [serialize(records, value) for value in values] == [
        original(records, value) for value in values
    ]
    monkeypatch.delitem(sys.modules, "pandas")
    assert serialize(records, {"a": (1,)}) == "{'a': (1,)}"
    assert "pandas" not in sys.modules


def test_the_end_of_a_job_is_known_where_snakemake_keeps_its_record(tmp_path):
    records = tmp_path / ".snakemake/metadata"
    records.mkdir(parents=True)
    name = base64.urlsafe_b64encode(b"results/a.csv").decode()
    (records / name).write_text(json.dumps({"endtime": 0.0}))
    assert snakemake_state.ended(tmp_path, "results/a.csv") == "1970-01-01T00:00:00+00:00"
    assert snakemake_state.ended(tmp_path, "results/b.csv") is None
