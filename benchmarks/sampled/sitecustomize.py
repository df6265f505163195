"""Measures the processes of a run that `benchmarks/whole_run` starts, and no others.

Python imports this module at its start where its folder is in PYTHONPATH. In a script of Snakemake
(a process of its own, or one forked from the warm executor's server) it looks every 10 ms of CPU
time at what the process is doing, and at the end writes one record into the folder that
WHOLE_RUN_RECORDS names. A compiled kernel is not interrupted: the look comes after it, and counts
with all the CPU time since the look before.
"""

import atexit
import json
import os
import resource
import signal
import sys
import time

FOLDER = os.environ.get("WHOLE_RUN_RECORDS")
EACH_SECOND = 0.01
SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "")
# What a function belongs to, by how the name of its file begins; the innermost that is named here
# decides.
KINDS = tuple(
    (beginning if beginning.startswith("<") else os.path.normpath(SCRIPTS + beginning), kind)
    for beginning, kind in (
        ("<frozen importlib", "import"),
        ("runtime/artefact.py", "files"),
        ("runtime/provenance.py", "files"),
        ("runtime/contract.py", "files"),
        ("runtime/raw_files.py", "files"),
        ("cellwright/formats", "files"),
        ("figures", "figures"),
        ("cellwright", "numerics"),
    )
)


class Sampler:
    """CPU time of this process by kind of work [s]."""

    def __init__(self):
        self.seconds = {}
        self.last = time.process_time()

    def look(self, number=None, frame=None):
        """Count the CPU time since the last look to what the process is doing."""
        now = time.process_time()
        kind = kind_of(frame)
        self.seconds[kind] = self.seconds.get(kind, 0.0) + now - self.last
        self.last = now

    def start(self):
        """Begin to look, and write the record when the process ends."""
        self.last = time.process_time()
        self.look()  # what the process has needed so far, for its own start
        signal.signal(signal.SIGPROF, self.look)
        signal.setitimer(signal.ITIMER_PROF, EACH_SECOND, EACH_SECOND)
        atexit.register(self.finish)

    def finish(self):
        """Stop and write the record."""
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        self.look()
        write("script", os.path.basename(sys.argv[0]).split(".")[-2], self.seconds)


def kind_of(frame) -> str:
    """Kind of work of a stack of calls; `other` is Snakemake's preamble, tables and the report."""
    while frame is not None:
        file = frame.f_code.co_filename
        for beginning, kind in KINDS:
            if file.startswith(beginning):
                return kind
        frame = frame.f_back
    return "other"


def write(process, name, seconds=None):
    """One record: kind of process, its name, CPU time with its ended children, peak memory."""
    own, ended = (
        resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    # Of Snakemake the children are the jobs and the server, which have records of their own.
    counted = [own] if process == "snakemake" else [own, ended]
    record = {
        "process": process,
        "name": name,
        "cpu_second": sum(usage.ru_utime + usage.ru_stime for usage in counted),
        "memory_megabyte": own.ru_maxrss / 1024,
        "seconds": seconds or {},
    }
    path = os.path.join(FOLDER, f"{os.getpid()}-{time.monotonic_ns()}.json")
    with open(path, "w", encoding="utf-8") as file:
        json.dump(record, file)


def begin():
    """Find out what this process is, and measure it accordingly."""
    words = [os.path.basename(word) for word in sys.orig_argv[1:3]]
    path = next((word for word in sys.orig_argv[1:2] if ".snakemake/scripts/" in word), None)
    if path:
        Sampler().start()
    elif words[:1] == ["server.py"]:
        first = [True]

        def before():
            if first:
                first.clear()
                write("server", "imports of the warm executor's server")

        os.register_at_fork(before=before, after_in_child=lambda: Sampler().start())
    elif words[:1] == ["snakemake"]:
        atexit.register(write, "snakemake", "Snakemake itself")


if FOLDER:
    begin()
