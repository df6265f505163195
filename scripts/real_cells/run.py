"""Numbers of the run itself: what was left out, flags, broken laws, seconds."""

import json
from pathlib import Path

from real_cells import reading


def left_out(campaign):
    """How many files and analyses were left out, per stage, and how many by an internal error."""
    rows = reading.table(campaign, "excluded")
    internal = rows["reason"].str.startswith("internal error").fillna(False)
    yield "all", "internal errors", "", int(internal.sum())
    yield "all", "left out", "", len(rows)
    for stage, part in rows.groupby("stage"):
        yield "all", "left out", f"stage {stage}", len(part)


def broken_laws(campaign):
    """How many laws of physics the results break."""
    rows = reading.table(campaign, "checks")
    yield "all", "laws of physics broken", "", int((rows["outcome"] == "failed").sum())


def flags(campaign):
    """How many samples carry each flag."""
    counts = {}
    for rows in reading.curves(campaign, "flags").values():
        for flag, count in rows["flag"].value_counts().items():
            counts[flag] = counts.get(flag, 0) + int(count)
    yield "all", "flagged samples", "", sum(counts.values())
    for flag, count in sorted(counts.items()):
        yield "all", "flagged samples", str(flag), count


def seconds(campaign):
    """Time [s] of all jobs, one after the other, from Snakemake's records of them."""
    folder = Path(campaign) / ".snakemake" / "metadata"
    records = [json.loads(path.read_text()) for path in folder.rglob("*") if path.is_file()]
    jobs = {(one["rule"], *one["log"]): one["endtime"] - one["starttime"] for one in records}
    if jobs:
        yield "all", "time of all jobs", "", sum(jobs.values())
