"""Snakemake in a campaign: stale locks, what it does otherwise than here is needed, slow rules."""

import base64
import json
import shutil
import socket
import sys
from datetime import UTC, datetime
from pathlib import Path

import psutil

# Clocks are corrected while processes run; a process number is used again much later than this.
SAME_START_SECOND = 60.0


def clear_stale_locks(folder):
    """Remove the locks of processes that have ended, and note that this one works in `folder`.

    Every start writes `.snakemake/starts/<process>@<machine>` with the start time of its process.
    Locks are removed only where some noted process has ended and all others have too; one on
    another machine counts as running. Two starts at once see each other, and neither removes any.
    """
    state = Path(folder) / ".snakemake"
    starts = state / "starts"
    starts.mkdir(parents=True, exist_ok=True)
    me = psutil.Process()
    record = starts / f"{me.pid}@{socket.gethostname()}"
    record.write_text(str(me.create_time()), encoding="utf-8")
    # Own start written before others are read: of two starts at once at least one sees the other.
    others = [start for start in starts.iterdir() if start != record]
    if others and all(_has_ended(start) for start in others):
        shutil.rmtree(state / "locks", ignore_errors=True)
        for start in others:
            start.unlink(missing_ok=True)


def _has_ended(start: Path) -> bool:
    """Whether the process of a noted start has ended."""
    number, machine = start.name.split("@", 1)
    if machine != socket.gethostname():
        return False
    try:
        started = psutil.Process(int(number)).create_time()
        # The number of an ended process may be another's by now, which began at another time.
        return abs(started - float(start.read_text(encoding="utf-8"))) > SAME_START_SECOND
    except psutil.NoSuchProcess:
        return True
    except (OSError, ValueError):  # another start is just writing or removing it
        return False


def compare_parameters_without_pandas():
    """Let Snakemake import pandas for a comparison of parameters only where one may need it.

    It does so in every start, to recognise DataFrames among the parameters, which takes 0.6 s of
    the 3.5 s of CPU of a start that finds nothing to do. There are none before somebody has
    imported pandas.
    """
    from snakemake.persistence import PersistenceBase

    whole = getattr(PersistenceBase, "_serialize_param_pandas", None)
    if whole is None:  # another version of Snakemake, which compares in another way
        return

    def serialize(self, value):
        may_be_of_pandas = "pandas" in sys.modules
        return whole(self, value) if may_be_of_pandas else self._serialize_param_builtin(value)

    PersistenceBase._serialize_param_pandas = serialize


def lift_usual_job_rate(workflow):
    """Take Snakemake's default limit of 100 jobs a second away; who asks for another limit gets it.

    It limits nothing here, and costs: each look for jobs sets a timer that causes another look a
    second later, and so on, so that looks add up with the jobs done.
    """
    limit = workflow.scheduler.job_rate_limiter
    if limit and (limit.max_jobs, limit.timespan) == (100, 1):
        workflow.scheduler.job_rate_limiter = None


def keep_wildcard_constraints(provider):
    """Let rules with the same output patterns be told apart by the constraints of their wildcards.

    Snakemake writes the constraints into the address of an output and matches files against the
    path of its local copy. The S3 plugin (0.3.6) makes that path once, before there are
    constraints; here it follows from the address as it is.

    Parameters
    ----------
    provider : Snakemake's default storage provider, None where artefacts lie on a disk
    """
    if provider is None or not provider.__module__.startswith("snakemake_storage_plugin_s3"):
        return
    # Patched in the class: Snakemake makes an object for each output of each rule.
    objects = provider.get_storage_object_cls()
    objects.local_suffix = lambda self: self.query.removeprefix("s3://")


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
    # A job of several outputs has a record for each; its log file is one.
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


def ended(folder, output) -> str | None:
    """When the job of an output ended, ISO 8601 in UTC; None where Snakemake keeps no record."""
    name = base64.urlsafe_b64encode(str(output).encode()).decode()
    path = Path(folder, ".snakemake", "metadata", name)
    record = _record(path) if path.is_file() else None
    if not record or record.get("endtime") is None:
        return None
    return datetime.fromtimestamp(record["endtime"], UTC).isoformat(timespec="seconds")


def _record(path):
    """One record, or nothing where it is a folder or still being written."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (IsADirectoryError, ValueError):
        return None
