"""Snakemake as tests start it: a new interpreter, or one forked with its packages imported.

Importing Snakemake is half the CPU time of a dry run. What a user's start does in full is tested by
runs in new interpreters; plans and second runs of the same folders are forked.
"""

import multiprocessing
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
# Set by `./run`; an environment of the user's own knows neither.
SET_BY_RUN = ("PYTHONPATH", "SNAKEMAKE_PROFILE")
# A server of its own, not the process of the tests: that has this repository's modules imported,
# where a copy's or a module's are under test.
SERVER = multiprocessing.get_context("forkserver")
# Besides Snakemake's command line what a start of it imports by itself later.
LATER = ("snakemake.report.html_reporter", "snakemake.storage", "smart_open", "numpy")
SERVER.set_forkserver_preload(["snakemake.cli", *LATER, "jsonschema", "pytest"])


class Run(NamedTuple):
    """How Snakemake ended, and what it said."""

    status: int
    said: str


def plain() -> dict[str, str]:
    """Variables of an environment that has the packages, without the launcher `run`."""
    return {name: value for name, value in os.environ.items() if name not in SET_BY_RUN}


def anew(*arguments, folder=ROOT, environment=None) -> Run:
    """Snakemake in an interpreter of its own, started in `folder`."""
    done = subprocess.run(
        [sys.executable, "-m", "snakemake", *arguments],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return Run(done.returncode, done.stdout)


def forked(*arguments, folder=ROOT, environment=None) -> Run:
    """Snakemake in a fork of a process that has imported its packages, started in `folder`."""
    variables = dict(os.environ if environment is None else environment)
    with tempfile.NamedTemporaryFile() as said:
        child = SERVER.Process(target=_main, args=(arguments, str(folder), variables, said.name))
        child.start()
        child.join()
        return Run(child.exitcode, Path(said.name).read_text(encoding="utf-8"))


def _main(arguments, folder, variables, said):
    """What `python -m snakemake` does, after its imports."""
    from snakemake.cli import main

    os.environ.clear()
    os.environ.update(variables)
    os.chdir(folder)
    file = os.open(said, os.O_WRONLY | os.O_APPEND)
    os.dup2(file, 1)
    os.dup2(file, 2)
    # The search path of the tests has this repository's packages.
    installed = [path for path in sys.path if path.startswith((sys.prefix, sys.base_prefix))]
    given = [path for path in variables.get("PYTHONPATH", "").split(os.pathsep) if path]
    sys.path[:] = [folder, *given, *installed]
    sys.argv[:] = ["snakemake", *arguments]
    main(list(arguments))
