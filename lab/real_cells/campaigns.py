"""Campaigns of real cells: listed, copied to separate folders, and run there."""

import csv
import hashlib
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COPIED = ("config", "raw")
TABLES_ONLY = ("results/summary.csv", "results/tables/checks.csv")
SHOWN_LINES = 15  # of the log of a run that failed
UNKNOWN_SECOND = 1_000_000  # campaigns that were never timed run first
# Where the campaigns lie, as seen from the repository; which of them, none named means all; how far
# each is run: tables and summary hold the same numbers, without figures and report.
OPTIONS = {"folder": "../shared/campaigns", "names": [], "to": "report"}
ENDS = ("report", "tables")


def options(given: dict) -> dict:
    """What `--config "real={...}"` chooses, the defaults for what it does not say.

    Raises
    ------
    ValueError
        No such option, names that are no list, or another end than the report or the tables.
    """
    if unknown := sorted(given.keys() - OPTIONS.keys()):
        raise ValueError(f"real: found option {unknown[0]}, wanted one of {', '.join(OPTIONS)}")
    chosen = OPTIONS | given
    if not isinstance(chosen["names"], list):
        raise ValueError(f"real.names: found {chosen['names']!r}, wanted a list, such as [a123]")
    if chosen["to"] not in ENDS:
        raise ValueError(f"real.to: found {chosen['to']!r}, wanted one of {', '.join(ENDS)}")
    return chosen


def names_in(folder) -> list[str]:
    """Names of the campaigns that lie in a folder.

    Raises
    ------
    FileNotFoundError
        Where there is no such folder, or no campaign in it.
    """
    names = sorted(path.parents[1].name for path in Path(folder).glob("*/config/tests.tsv"))
    if not names:
        raise FileNotFoundError(
            f"{folder}: found no campaign (a folder with config/tests.tsv), wanted at least one; "
            "--config 'real={folder: ...}' says where campaigns of real cells lie"
        )
    return names


def wanted(folder, names) -> list[str]:
    """Names of the requested campaigns; all of the folder where none is requested.

    Raises
    ------
    FileNotFoundError
        Where one of them is not there.
    """
    available = names_in(folder)
    missing = [name for name in names if name not in available]
    if missing:
        raise FileNotFoundError(
            f"{folder}: found no {', '.join(missing)}, wanted one of {available}"
        )
    return list(names) or available


def files(folder, name: str) -> list[Path]:
    """Files of a campaign without its results, sorted."""
    campaign = Path(folder) / name
    paths = [path for path in campaign.rglob("*") if path.is_file()]
    made = {"results", "logs", ".snakemake"}
    return sorted(path for path in paths if path.relative_to(campaign).parts[0] not in made)


@cache
def expected_second(name: str) -> int:
    """Time [s] that a campaign took when it was recorded; very long where that is not known."""
    for table in ("recorded.csv", "before.csv"):
        with open(ROOT / "docs" / "real-cells" / table, encoding="utf-8", newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["campaign"] == name]
        times = [row["value"] for row in rows if row["quantity"] == "time of all jobs"]
        if times:
            return round(float(times[0]))
    return UNKNOWN_SECOND


@cache
def code_hash() -> str:
    """Hash of the pipeline's code and of what takes numbers from its results.

    Rules, schemas, scripts and the lock of the environment; of the laboratory the record of numbers
    and the score.
    """
    digest = hashlib.sha256()
    endings = {".py", ".c", ".smk", ".yaml", ".j2", ".html", ".md"}
    parts = ("scripts", "workflow", "lab/real_cells", "lab/virtual_lab/score")
    below = [path for part in parts for path in (ROOT / part).rglob("*")]
    for path in sorted([ROOT / "Snakefile", ROOT / "environment.lock", *below]):
        if path.is_file() and (path.suffix in endings or path.parent == ROOT):
            digest.update(path.relative_to(ROOT).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def copy_campaign(source, target):
    """Copy a campaign to `target`, without files gone from `source`; results in `target` stay.

    Copies, so that what artefacts say they were made from is a file of the campaign.
    """
    source, target = Path(source), Path(target)
    copied = {path.relative_to(source): path for path in files(source.parent, source.name)}
    old = [path for part in COPIED for path in (target / part).rglob("*") if path.is_file()]
    for path in old:
        if path.relative_to(target) not in copied:
            path.unlink()
    for name, path in copied.items():
        copy = target / name
        if not copy.is_file() or copy.read_bytes() != path.read_bytes():
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, copy)


def run(folder, *, whole: bool, log):
    """Run the pipeline on a campaign in a Snakemake of its own, one job at a time.

    Parameters
    ----------
    folder : of the campaign.
    whole : to the report; else to the tables, the summary and the check by physics.
    log : file for what it says.

    Raises
    ------
    RuntimeError
        Where it fails: with the name of the log and its last lines.
    """
    targets = ["all"] if whole else [*TABLES_ONLY]
    command = [sys.executable, "-m", "snakemake", "--snakefile", ROOT / "Snakefile", "--cores", "1"]
    # A job's own settings for Snakemake are not for the one inside it.
    environment = {k: v for k, v in os.environ.items() if not k.startswith("SNAKEMAKE_")}
    with open(log, "w", encoding="utf-8") as file:
        done = subprocess.run(
            [*command, "--directory", folder, *targets],
            stdout=file,
            stderr=subprocess.STDOUT,
            env=environment,
            check=False,
        )
    if done.returncode:
        last = Path(log).read_text(encoding="utf-8", errors="replace").splitlines()[-SHOWN_LINES:]
        end = "\n".join(f"  {line}" for line in last)
        raise RuntimeError(
            f"the run of {Path(folder).name} failed; all it said is in {log}:\n{end}"
        )
