"""What a run took: from Snakemake's own records of its jobs, after the run."""

import json
from pathlib import Path


def slowest(folder, since, *, count=5) -> list[str]:
    """The rules that took longest since a moment: seconds, jobs, and the longest one's output.

    Parameters
    ----------
    folder : the campaign, where Snakemake keeps its records
    since : start of the run [s since 1970]
    count : how many rules to name
    """
    records = [_record(path) for path in Path(folder, ".snakemake", "metadata").rglob("*")]
    recent = [record for record in records if record and (record["starttime"] or 0) >= since]
    jobs = {(record["rule"], *record["log"]): record for record in recent}
    rules = {}
    for job in jobs.values():
        rules.setdefault(job["rule"], []).append(job["endtime"] - job["starttime"])
    ranked = sorted(rules.items(), key=lambda item: -sum(item[1]))[:count]
    return [
        f"{rule}: {sum(took):.0f} s in {len(took)} job{'s' * (len(took) > 1)}, "
        f"longest {max(took):.1f} s"
        for rule, took in ranked
    ]


def _record(path):
    """One record, or nothing where it is a folder or still being written."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (IsADirectoryError, ValueError):
        return None
