"""A campaign on Slurm, on this machine: a job is killed, and the bytes are those of a plain run."""

import os
import re
import shutil
import subprocess
import time

import pytest
from two_cells import ROOT, TARGETS, artefacts, command, needs, write_campaign

SCRIPT = ROOT / "tests" / "cluster" / "slurm.sh"
DAEMONS = ("munged", "slurmctld", "slurmd")
# Long enough for a machine that is busy with other things; an idle one needs a minute.
PATIENCE_SECOND = 1800


@pytest.fixture
def cluster(tmp_path):
    needs("snakemake-executor-plugin-slurm")
    if missing := [name for name in DAEMONS if shutil.which(name) is None]:
        pytest.skip(f"no {', '.join(missing)} here: apt-get install slurm-wlm munge")
    if os.geteuid() != 0:
        pytest.skip("a Slurm cluster of this machine needs root")
    if os.path.exists("/etc/slurm/slurm.conf"):
        pytest.skip("/etc/slurm/slurm.conf is there: this machine belongs to another cluster")
    subprocess.run([SCRIPT, "start", tmp_path / "slurm"], check=True)
    yield
    subprocess.run([SCRIPT, "stop", tmp_path / "slurm"], check=True)


def running_job():
    """Number of a job of the queue that runs, or nothing."""
    queue = ["squeue", "--noheader", "--states", "RUNNING", "--format", "%i"]
    listed = subprocess.run(queue, capture_output=True, text=True, check=True).stdout.split()
    return listed[0] if listed else None


def kill_first_job(process):
    """Kill the processes of the first job that runs; returns its number."""
    end = time.monotonic() + PATIENCE_SECOND
    while (job := running_job()) is None:
        assert process.poll() is None, process.stdout.read()
        assert time.monotonic() < end, "no job has begun"
        time.sleep(0.2)
    subprocess.run(["scancel", "--signal=KILL", "--full", job], check=True)
    return job


@pytest.mark.slow
def test_a_campaign_on_slurm_ends_with_the_bytes_of_a_plain_run(cluster, tmp_path, local_artefacts):
    folder = write_campaign(tmp_path / "campaign")
    profile = ["--workflow-profile", "workflow/profiles/slurm"]
    process = subprocess.Popen(**command(folder, *profile, *TARGETS))
    try:
        killed = kill_first_job(process)
        said, _ = process.communicate(timeout=PATIENCE_SECOND)
    finally:
        process.kill()
    assert process.returncode == 0, said
    assert artefacts(folder / "results") == local_artefacts
    submitted = re.findall(r"SLURM jobid (\d+) \(log: \S*slurm_logs/(\w+)/", said)
    parts = dict(submitted)
    assert killed in parts, "the killed job is one of this run"
    again = [name for _, name in submitted if name == parts[killed]]
    assert len(again) >= 2, f"job {killed} was not submitted again:\n{said}"
    assert {re.sub("_C.*", "", name) for name in parts.values()} == {
        "group_tests",
        "group_models",
        "group_figures",
        "rule_tables_of_tests",
    }
