"""What a run took: jobs since its start, by rule."""

import json

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
