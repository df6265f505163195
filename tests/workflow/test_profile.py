"""The default profile and the stale lock, on a toy workflow: what re-runs, and after a kill."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
import starts

ROOT = Path(__file__).resolve().parents[2]
WORKFLOW = """
import sys
from pathlib import Path
sys.path.insert(0, {scripts!r})
from runtime import snakemake_state
if workflow.is_main_process:
    snakemake_state.clear_stale_locks(Path.cwd())
rule copy:
    input: "raw.txt"
    output: "copy.txt"
    params: unit=config.get("unit", "V")
    shell: "sleep {{config[nap]}}; cat {{input}} > {{output}}"
"""


@pytest.fixture
def toy(tmp_path):
    repository, folder = tmp_path / "repository", tmp_path / "campaign"
    repository.mkdir()
    folder.mkdir()
    (repository / "Snakefile").write_text(WORKFLOW.format(scripts=str(ROOT / "scripts")))
    shutil.copytree(ROOT / "profiles", repository / "profiles")
    (folder / "raw.txt").write_text("raw\n" * 400_000)  # larger than Snakemake's own limit, 1 MB
    return repository, folder


def arguments(folder, *config, nap=0):
    given = ["--cores", "1", "--directory", str(folder), "--profile", "none"]
    return [*given, "--config", f"nap={nap}", *config]


def run(toy, *config):
    repository, folder = toy
    return starts.forked(*arguments(folder, *config), folder=repository).said


@pytest.mark.slow
def test_only_what_changed_is_made_again(toy):
    raw = toy[1] / "raw.txt"
    assert "Using workflow specific profile" in run(toy)
    raw.touch()
    assert "Nothing to be done" in run(toy)
    assert "1 of 1 steps (100%) done" in run(toy, "unit=mV")
    raw.write_text("new\n" * 400_000)
    assert "1 of 1 steps (100%) done" in run(toy, "unit=mV")


@pytest.mark.slow
def test_a_killed_run_does_not_lock_the_folder(toy):
    repository, folder = toy
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    call = [sys.executable, "-m", "snakemake", *arguments(folder, nap=60)]
    first = subprocess.Popen(call, cwd=repository, start_new_session=True, **quiet)
    locks = folder / ".snakemake" / "locks"
    end = time.monotonic() + 30
    while not (locks.is_dir() and any(locks.iterdir())) and time.monotonic() < end:
        time.sleep(0.1)
    assert "Directory cannot be locked" in run(toy)
    assert any(locks.iterdir())
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()
    assert "1 of 1 steps (100%) done" in run(toy)


def test_another_machine_may_still_be_running(tmp_path):
    from runtime import snakemake_state

    locks, starts = (tmp_path / ".snakemake" / name for name in ("locks", "starts"))
    locks.mkdir(parents=True)
    starts.mkdir()
    (starts / "1@elsewhere").write_text("0.0")
    snakemake_state.clear_stale_locks(tmp_path)
    assert locks.is_dir()
    (starts / "1@elsewhere").unlink()
    (starts / f"{os.getppid()}@{os.uname().nodename}").write_text("0.0")  # a number used again
    snakemake_state.clear_stale_locks(tmp_path)
    assert not locks.exists()


def test_a_lock_of_a_live_process_stays(tmp_path):
    import psutil

    from runtime import snakemake_state

    locks, starts = (tmp_path / ".snakemake" / name for name in ("locks", "starts"))
    locks.mkdir(parents=True)
    starts.mkdir()
    parent = psutil.Process(os.getppid())
    (starts / f"{parent.pid}@{os.uname().nodename}").write_text(str(parent.create_time()))
    (starts / f"99999999@{os.uname().nodename}").write_text("0.0")
    snakemake_state.clear_stale_locks(tmp_path)
    assert locks.is_dir()
