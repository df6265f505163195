"""What a job of each rule costs: CPU time and peak memory of every script that a run starts.

    ./run python lab/tools/job_costs.py TABLE SNAKEMAKE_ARGUMENTS...
    ./run python lab/tools/job_costs.py costs.csv --directory CAMPAIGN --cores 1

Each script of a job, in a process of its own or forked by the warm executor, writes as it ends its
CPU time (user and system) and the highest memory that the kernel saw (VmHWM, Linux). Nothing is
sampled, so that jobs of half a second count; a forked one begins with the packages of all jobs.
TABLE then has one row a rule: jobs, CPU of all of them and of the longest one in units of a
calibration made before and after (real_cells/calibration.py), and the highest peak. Rows of a TABLE
that the same code wrote stay where the run started no job of their rule, and where it did the
larger values are kept, so that several campaigns add up to one table.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from real_cells import campaigns, costs
from real_cells.calibration import calibration_second

# Python imports a module of this name as it starts. Snakemake copies the script of a job to
# .snakemake/scripts/tmp<letters>.<script>.py.
AT_END = """
import atexit, sys

def note():
    import os, time
    folder, _, name = sys.argv[0].rpartition("/")
    if not folder.endswith("/.snakemake/scripts"):
        return
    with open("/proc/self/status") as file:
        peak = next(line for line in file if line.startswith("VmHWM")).split()[1]
    rule = name.split(".", 1)[1].removesuffix(".py")
    with open(os.environ["JOB_COSTS"], "a") as file:
        file.write(f"{rule}\\t{time.process_time()}\\t{peak}\\n")

starts = "/.snakemake/scripts/", "snakemake_executor_plugin_warm/server.py"
if any(start in word for word in sys.orig_argv for start in starts):
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


def main(table, *arguments):
    """Run Snakemake and write the table; returns the run's exit status, of failed jobs too."""
    before, code = calibration_second(), campaigns.code_hash()
    jobs, status = measured(arguments)
    unit = (before * calibration_second()) ** 0.5
    known = costs.read(table, code=code)
    new = costs.of_jobs(jobs, unit)
    both = {rule: cost.or_more(known.get(rule, cost)) for rule, cost in new.items()}
    costs.write(known | both, table, code=code)
    print(f"{table}: {len(jobs)} jobs, {sum(cost.cpu_units for cost in new.values()):.0f} units of")
    print(f"  {unit:.2f} s of CPU (the calibration), {before:.2f} s of them before the run")
    return status


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
