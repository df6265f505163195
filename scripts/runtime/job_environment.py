"""Environment of every job's process: where packages are, how many threads."""

import os
import sys


def prepare(*folders: str):
    """Let this process and those of jobs find the packages of these folders; one thread per job.

    Linear algebra that takes all cores in each of several jobs slows them all down, and its sums
    would depend on how many cores there are. A number of threads that is set already stays.
    """
    sys.path[:] = [*folders, *[path for path in sys.path if path not in folders]]
    inherited = [path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path]
    others = [path for path in inherited if path not in folders]
    os.environ["PYTHONPATH"] = os.pathsep.join([*folders, *others])
    for library in ("OMP", "OPENBLAS", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
