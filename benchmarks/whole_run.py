"""Runs campaigns from their raw files and tells where the CPU time goes: benchmarks/whole_run.

benchmarks/whole_run NAME=FOLDER ...     run these campaigns, keep what was measured in whole_runs/
benchmarks/whole_run --cores 1 ...       as many jobs at a time (default 2)
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from as_page import machine
from whole_run_page import KEPT, KINDS

HERE = Path(__file__).resolve().parent
CALM_LOAD, CALM_SECOND = 0.5, 180.0  # a machine may take so long to become calm
# What a run makes, which a run from the raw files must not find.
MADE = {"results", "logs", ".snakemake", "real", "virtual"}


def main(words):
    """Measure the campaigns named and keep what was measured."""
    cores = words.pop(words.index("--cores") + 1) if "--cores" in words else "2"
    for word in (word for word in words if word != "--cores"):
        name, separator, folder = word.partition("=")
        if not separator or not Path(folder, "config").is_dir():
            sys.exit(f"whole_run: {word}: found no folder with config/, wanted NAME=FOLDER")
        KEPT.mkdir(exist_ok=True)
        measured = run(Path(folder).resolve(), cores)
        (KEPT / f"{name}.json").write_text(json.dumps(measured, indent=1) + "\n", encoding="utf-8")


def run(campaign, cores) -> dict:
    """Run a campaign in a new folder. What its processes needed, by rule."""
    with tempfile.TemporaryDirectory() as place:
        records, folder = Path(place, "records"), Path(place, "campaign")
        records.mkdir()
        folder.mkdir()
        for entry in (entry for entry in campaign.iterdir() if entry.name not in MADE):
            copy = shutil.copytree if entry.is_dir() else shutil.copy
            copy(entry, folder / entry.name)
        load, begin = _load_once_calm(), time.monotonic()
        _snakemake(folder, cores, records)
        second = time.monotonic() - begin
        again = Path(place, "again")
        again.mkdir()
        _snakemake(folder, cores, again)
        sheet = (folder / "config" / "cells.tsv").read_text(encoding="utf-8").split("\n")[1:]
        return {
            "machine": machine(),
            "cores": int(cores),
            "load_before": round(load, 1),
            "load_after": round(os.getloadavg()[0], 1),
            "wall_second": round(second, 1),
            "cells": sum(bool(line.strip()) for line in sheet),
            "again_cpu_second": _total(again),
            "rules": _by_rule(records),
        }


def _load_once_calm():
    """Mean load of the last minute, once the run before has left it or time is up."""
    until = time.monotonic() + CALM_SECOND
    while os.getloadavg()[0] > CALM_LOAD and time.monotonic() < until:
        time.sleep(5)
    return os.getloadavg()[0]


def _snakemake(folder, cores, records):
    """Run the pipeline in a campaign's folder, its processes measured."""
    root = HERE.parent
    paths = [
        HERE / "sampled",
        root / "scripts",
        root / "plugins" / "snakemake-executor-plugin-warm",
    ]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(map(str, paths)),
        "WHOLE_RUN_RECORDS": str(records),
        "SNAKEMAKE_PROFILE": str(root / "workflow" / "profiles" / "warm"),
    }
    where = ["--snakefile", str(root / "Snakefile"), "--directory", str(folder)]
    command = ["snakemake", *where, "--cores", cores, "--quiet", "all"]
    subprocess.run(command, env=environment, check=True)


def _read(records):
    return [json.loads(path.read_text(encoding="utf-8")) for path in sorted(records.iterdir())]


def _total(records) -> float:
    return round(sum(one["cpu_second"] for one in _read(records)), 2)


def _by_rule(records) -> dict:
    """Name of a rule, or of a process that is none → jobs, CPU [s], by kind [s], peak [MB]."""
    rules = {}
    for one in _read(records):
        start = {"process": one["process"], "jobs": 0, "cpu_second": 0.0, "memory_megabyte": 0.0}
        rule = rules.setdefault(one["name"], start | dict.fromkeys(KINDS, 0.0))
        rule["jobs"] += 1
        rule["cpu_second"] += one["cpu_second"]
        rule["memory_megabyte"] = max(rule["memory_megabyte"], one["memory_megabyte"])
        for kind, second in one["seconds"].items():
            rule[kind] += second
    rounded = {
        name: {key: value if key == "process" else round(value, 3) for key, value in rule.items()}
        for name, rule in rules.items()
    }
    return dict(sorted(rounded.items(), key=lambda item: -item[1]["cpu_second"]))


if __name__ == "__main__":
    main(sys.argv[1:])
