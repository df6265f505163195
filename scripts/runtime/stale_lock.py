"""Locks of Snakemake that a killed run left: the next start removes them, if nobody else runs."""

import shutil
import socket
from pathlib import Path

import psutil

# Clocks are corrected while processes run; a process number is used again much later than this.
SAME_START_SECOND = 60.0


def clear(folder):
    """Remove the locks of processes that have ended, and note that this one works in `folder`.

    Every start writes `.snakemake/starts/<process>@<machine>` with the start time of its process.
    Locks are removed only where some noted process has ended and all others have too; one on
    another machine counts as running. Two starts at once see each other, and neither removes any.
    """
    state = Path(folder) / ".snakemake"
    starts = state / "starts"
    starts.mkdir(parents=True, exist_ok=True)
    me = psutil.Process()
    record = starts / f"{me.pid}@{socket.gethostname()}"
    record.write_text(str(me.create_time()), encoding="utf-8")
    others = [start for start in starts.iterdir() if start != record]
    if others and all(_has_ended(start) for start in others):
        shutil.rmtree(state / "locks", ignore_errors=True)
        for start in others:
            start.unlink(missing_ok=True)


def _has_ended(start: Path) -> bool:
    """Whether the process of a noted start has ended."""
    number, machine = start.name.split("@", 1)
    if machine != socket.gethostname():
        return False
    try:
        started = psutil.Process(int(number)).create_time()
        return abs(started - float(start.read_text(encoding="utf-8"))) > SAME_START_SECOND
    except psutil.NoSuchProcess:
        return True
    except (OSError, ValueError):  # another start is just writing or removing it
        return False
