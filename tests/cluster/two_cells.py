"""A small campaign on the demo's records, to be run here and elsewhere and compared."""

import csv
import importlib.metadata
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CELLS = ("C1", "C2")
# Rules of several parts of a cell's work, which depend on each other, and a table of all cells.
TARGETS = [
    "results/tables/capacity.csv",
    *(f"results/stages/basis/{cell}.json" for cell in CELLS),
    *(f"results/figures/{cell}" for cell in CELLS),
]


def needs(*packages):
    """Skip where packages are missing: those for clusters and the cloud have their own locks."""
    for package in packages:
        try:
            importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            pytest.skip(f"no {package} here: ./run --cluster or --cloud pytest tests/cluster")


def write_campaign(folder):
    """Sheets of two cells of the demo with a capacity test each, over the demo's raw files."""
    (folder / "config").mkdir(parents=True)
    shutil.copytree(ROOT / "data", folder / "data")
    (folder / "config" / "config.yaml").write_text("title: Two cells\n", encoding="utf-8")
    for sheet in ("cells", "tests"):
        with open(ROOT / "config" / f"{sheet}.tsv", encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file, delimiter="\t"))
        chosen = [
            row
            for row in rows
            if row["cell"] in CELLS and row.get("test", "capacity_25C") == "capacity_25C"
        ]
        with open(folder / "config" / f"{sheet}.tsv", "w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, rows[0], delimiter="\t", lineterminator="\n")
            writer.writeheader()
            writer.writerows(chosen)
    return folder


def command(folder, *arguments):
    """A run of Snakemake in a campaign, for subprocess."""
    program = [sys.executable, "-m", "snakemake", "--directory", str(folder)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    return {"args": [*program, *arguments], "cwd": ROOT, "env": os.environ.copy()} | pipes


def artefacts(folder):
    """Bytes of each file below a folder, by path."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}
