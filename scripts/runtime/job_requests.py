"""What jobs ask a cluster for: memory and time from measured ones, and which run as one job.

workflow/job_costs.csv has a row a rule, measured by lab/tools/job_costs.py; its column `part`
says which jobs of a cell are submitted together. Nothing here matters to a run on one machine,
where jobs start as soon as a core is free.
"""

import csv
import math
from typing import NamedTuple

# Records may be longer than the measured ones, and a machine slower. An attempt that ran out of
# memory or time is followed by one with twice as much (`retries` of the profile).
MEMORY_MARGIN = 2.0
TIME_MARGIN = 10.0
# Parts of the work of a cell or group of cells that are one job each, in the order in which they
# depend on each other: `models` of a cell may borrow from `tests` of others, `validation` from
# `models` of others. Snakemake refuses parts that wait for each other; looking for such, it walks
# through what each of their jobs depends on. Tables and report depend on all jobs and go alone.
PARTS = ("tests", "models", "validation", "packs", "figures")


class Cost(NamedTuple):
    """What measured jobs of a rule took: CPU of the mean and the longest [s], most memory [MB]."""

    part: str
    mean_cpu_second: float
    longest_cpu_second: float
    peak_megabyte: float


def read(path) -> dict[str, Cost]:
    """Cost of each rule from the table of measured jobs.

    Raises
    ------
    ValueError
        A part that is none of PARTS.
    """
    with open(path, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    if unknown := {row["part"] for row in rows} - {"", *PARTS}:
        raise ValueError(f"{path}: column part: found {sorted(unknown)}, wanted one of {PARTS}")
    return {
        row["rule"]: Cost(
            row["part"],
            float(row["cpu_second"]) / int(row["jobs"]),
            float(row["longest_cpu_second"]),
            float(row["peak_megabyte"]),
        )
        for row in rows
    }


def requests(cost: Cost) -> dict:
    """Resources of a rule, as functions of wildcards and attempt: memory [MB] and time [min]."""
    hundreds = math.ceil(MEMORY_MARGIN * cost.peak_megabyte / 100)
    minutes = math.ceil(TIME_MARGIN * cost.longest_cpu_second / 60)
    return {
        "mem_mb": lambda wildcards, attempt: 100 * hundreds * 2 ** (attempt - 1),
        "runtime": lambda wildcards, attempt: minutes * 2 ** (attempt - 1),
    }


def group_of(cost: Cost, wildcard_names) -> str | None:
    """Name of the group of a rule's jobs, with a wildcard in it; None where a job goes alone."""
    owner = next((name for name in ("cell", "group", "owner") if name in wildcard_names), None)
    return f"{cost.part}_{{{owner}}}" if cost.part and owner else None
