"""What a job of each rule costs: CPU time and peak memory of every script that a run starts.

    ./run python scripts/tools/job_costs.py TABLE SNAKEMAKE_ARGUMENTS...
    ./run python scripts/tools/job_costs.py costs.csv --directory CAMPAIGN --cores 1

Each Python process of a job writes, as it ends, its CPU time (user and system) and the highest
memory that the kernel saw (VmHWM, Linux). Nothing is sampled, so that jobs of half a second count.
TABLE then has one row a rule: jobs, CPU of all of them, of the longest one, and the highest peak.
Rows of a TABLE that is there already stay where the run started no job of their rule, and where it
did the larger values are kept, so that several campaigns add up to one table.
workflow/job_costs.csv, from which jobs ask for memory and time, is such a table (docs/scaling.md).
"""

import csv
import os
import subprocess
import sys
import tempfile
from pathlib import Path

MEASURED = ("jobs", "cpu_second", "longest_cpu_second", "peak_megabyte")
# Which part of a cell's work a rule belongs to is decided, not measured (runtime/job_requests.py).
COLUMNS = ("rule", "part", *MEASURED)
# Python imports a module of this name as it starts. Snakemake copies the script of a job to
# .snakemake/scripts/tmp<letters>.<script>.py.
AT_END = """
import atexit, sys

def note():
    import os, time
    with open("/proc/self/status") as file:
        peak = next(line for line in file if line.startswith("VmHWM")).split()[1]
    rule = sys.argv[0].rpartition("/")[2].split(".", 1)[1].removesuffix(".py")
    with open(os.environ["JOB_COSTS"], "a") as file:
        file.write(f"{rule}\\t{time.process_time()}\\t{peak}\\n")

if any("/.snakemake/scripts/" in word for word in sys.orig_argv):
    atexit.register(note)
"""


def measured(arguments) -> tuple[list[tuple[str, float, float]], int]:
    """Rule, CPU [s] and peak [MB] of each job of a run of Snakemake, and its exit status."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "sitecustomize.py").write_text(AT_END, encoding="utf-8")
        notes = Path(folder, "jobs.tsv")
        notes.touch()
        paths = [folder, *filter(None, [os.environ.get("PYTHONPATH")])]
        environment = {"PYTHONPATH": os.pathsep.join(paths), "JOB_COSTS": str(notes)}
        program = [sys.executable, "-m", "snakemake", *arguments]
        status = subprocess.run(program, env=os.environ | environment, check=False).returncode
        lines = [line.split("\t") for line in notes.read_text(encoding="utf-8").splitlines()]
    return [(rule, float(cpu), int(kilobyte) / 1000) for rule, cpu, kilobyte in lines], status


def merged(before, jobs) -> list[dict]:
    """Rows of the table: those from before, and of each rule that ran the larger values."""
    rows = {row["rule"]: {name: float(row[name]) for name in MEASURED} for row in before}
    parts = {row["rule"]: row["part"] for row in before}
    ran = {}
    for rule, cpu, peak in jobs:
        ran.setdefault(rule, []).append((cpu, peak))
    for rule, costs in ran.items():
        cpu, peak = zip(*costs, strict=True)
        new = dict(zip(MEASURED, (len(costs), sum(cpu), max(cpu), max(peak)), strict=True))
        old = rows.get(rule, new)
        rows[rule] = {name: max(new[name], old[name]) for name in MEASURED}
    return [
        {"rule": rule, "part": parts.get(rule, "")} | _rounded(rows[rule]) for rule in sorted(rows)
    ]


def _rounded(row):
    whole = {name: round(row[name]) for name in ("jobs", "peak_megabyte")}
    return {name: whole.get(name, round(row[name], 1)) for name in MEASURED}


def main(table, *arguments):
    """Run Snakemake and write the table; returns the run's exit status, of failed jobs too."""
    table = Path(table)
    before = []
    if table.exists():
        with open(table, encoding="utf-8", newline="") as file:
            before = list(csv.DictReader(file))
    jobs, status = measured(arguments)
    rows = merged(before, jobs)
    with open(table, "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return status


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
