"""What every cell of the hidden campaign goes through, the same for all."""

from functools import cache
from typing import NamedTuple

from virtual_lab import protocols
from virtual_lab.hidden.replay import File
from virtual_lab.hidden.setup import RATING
from virtual_lab.protocols import Step

SOFT_SEED, HARSH_SEED = 11, 29


class Task(NamedTuple):
    """A test by name; `role` blank as in the sheet."""

    test: str
    kind: str
    celsius: float
    steps: list[Step]
    role: str


@cache
def tasks() -> tuple[Task, ...]:
    """Capacity, pulses and three drives to fit; two harsher drives to validate."""
    rated = RATING.capacity_ampere_hour
    full = protocols.capacity(
        RATING, repeats=1, c_rate=1 / 3, until_c_rate=1 / 50, hold_empty=True, period_second=20.0
    )
    pulses = protocols.hybrid_pulses_below_full(RATING, rated)
    soft = protocols.dynamic_load(RATING, style="soft", seed=SOFT_SEED)
    harsh = protocols.dynamic_load(RATING, style="harsh", seed=HARSH_SEED)
    return (
        Task("capacity_25C", "capacity", 25.0, full, "fit"),
        Task("hppc_25C", "hppc", 25.0, pulses, "fit"),
        Task("drive_25C", "drive", 25.0, soft, "fit"),
        Task("drive_10C", "drive", 10.0, soft, "fit"),
        Task("drive_40C", "drive", 40.0, soft, "fit"),
        Task("validation_25C", "drive", 25.0, harsh, "validation"),
        Task("validation_15C", "drive", 15.0, harsh, "validation"),
    )


def slow_task() -> Task:
    """C/20 both ways, which only reference cells have."""
    steps = protocols.slow_ocv(RATING, c_rate=1 / 20, period_second=60.0)
    return Task("ocv_C20_25C", "ocv", 25.0, steps, "fit")


@cache
def files() -> list[File]:
    """The same tests as gaps are measured on."""
    return [
        File(task.steps, task.celsius, task.kind, task.role == "validation") for task in tasks()
    ]
