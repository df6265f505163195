"""A killed run leaves Snakemake's lock behind; the next start clears it, if nobody else runs."""

import shutil
import socket
from pathlib import Path

import psutil

# Clocks are corrected while processes run; a process number comes back much later than this.
SAME_BIRTH_SECOND = 60.0


def clear(folder):
    """Write this process down as working in `folder`; free the folder of dead processes' locks.

    Every start writes `.snakemake/starts/<process>@<machine>` with the time of its birth. Locks
    go only where a start is found whose process is gone and none whose process may still live: a
    process on another machine may. Two starts at once see each other, and neither clears.
    """
    own = Path(folder) / ".snakemake"
    starts = own / "starts"
    starts.mkdir(parents=True, exist_ok=True)
    me = psutil.Process()
    mine = starts / f"{me.pid}@{socket.gethostname()}"
    mine.write_text(str(me.create_time()), encoding="utf-8")
    others = [start for start in starts.iterdir() if start != mine]
    if others and all(_is_gone(start) for start in others):
        shutil.rmtree(own / "locks", ignore_errors=True)
        for start in others:
            start.unlink(missing_ok=True)


def _is_gone(start: Path) -> bool:
    number, machine = start.name.split("@", 1)
    if machine != socket.gethostname():
        return False
    try:
        born = psutil.Process(int(number)).create_time()
        return abs(born - float(start.read_text(encoding="utf-8"))) > SAME_BIRTH_SECOND
    except psutil.NoSuchProcess:
        return True
    except (OSError, ValueError):  # another start is just writing or removing it
        return False
