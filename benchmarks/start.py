"""Start of a process until it could work: what every job of a run pays."""

import subprocess
import sys

from timing import Entry, Goal, Topic, missing

JOBS = {
    "**Cellwright**, simulation and fit": "cellwright.circuits.cell, pulse_methods.pulse",
    "**Cellwright**, dQ/dV": "cellwright.protocols.ica.charge",
    "Python alone": "sys",
    "numpy": "numpy",
    "pandas": "pandas",
    "scipy.signal": "scipy.signal",
    "lmfit": "lmfit",
    "PyBaMM": "pybamm",
}


def topic():
    """Topic: one process per library."""
    entries, skipped = [], []
    for name, modules in JOBS.items():
        reason = missing(modules.split(", "))
        if reason:
            skipped.append((name, reason))
        else:
            entries.append(
                Entry(name, lambda code=f"import {modules}": _process(code), str, runs=5)
            )
    return Topic(
        "Start of a job",
        "a fresh process that imports what it needs and ends",
        "nothing to compare",
        [entry._replace(accuracy=lambda _found: "–") for entry in entries],
        skipped,
        unit="process",
        goals=(Goal("**Cellwright**, simulation and fit", 0.3),),
    )


def _process(code):
    subprocess.run([sys.executable, "-c", code], check=True)
