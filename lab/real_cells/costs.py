"""What the demo's rules cost: CPU over the calibration and peak memory, held against a record.

`units` are CPU seconds over those of `calibration.calibration_second`. On a machine that others
use, too, that takes half as long again from one minute to the next: what most rules cost more by,
up to half, is the machine's, and a rule is held against the others of its run.
"""

import csv
from pathlib import Path
from statistics import median
from typing import NamedTuple

from real_cells import campaigns

RECORDED = campaigns.ROOT / "docs" / "real-cells" / "demo_costs.csv"
MEASURED = campaigns.ROOT / ".snakemake" / "job_costs.csv"  # of the last run that was measured
REQUESTED = campaigns.ROOT / "workflow" / "job_costs.csv"  # what jobs ask a cluster for
# A rule may cost a quarter more than recorded, and as much besides as milliseconds vary by.
MORE, LEAST_UNITS, LEAST_MEGABYTE = 1.25, 1.0, 50.0
MOST_OF_MACHINE, FEWEST_RULES = 1.5, 10
# ASSUME: A node of a cluster takes half a second for the calibration, as usual machines do.
CALIBRATION_SECOND = 0.5
MEASURE = "./run python lab/tools/job_costs.py .snakemake/job_costs.csv --cores 2"


class Cost(NamedTuple):
    """Jobs of one rule: how many, CPU of all and of the longest [units], highest memory [MB]."""

    jobs: int
    cpu_units: float
    longest_cpu_units: float
    peak_megabyte: float

    def or_more(self, other):
        """The larger of each number: of several campaigns or runs."""
        return Cost(*map(max, self, other))


def of_jobs(jobs, calibration_second) -> dict[str, Cost]:
    """Cost of each rule, in the order of their names.

    Parameters
    ----------
    jobs : rows (rule, CPU [s], peak [MB]). calibration_second : of the same minutes.
    """
    ran = {}
    for rule, second, megabyte in sorted(jobs):
        ran.setdefault(rule, []).append((second / calibration_second, megabyte))
    costs = {}
    for rule, found in ran.items():
        units, peaks = zip(*found, strict=True)
        costs[rule] = Cost(len(found), sum(units), max(units), max(peaks))
    return costs


def read(path, *, code=None) -> dict[str, Cost]:
    """Costs by rule; none where there is no table, or where it is of other code than `code`."""
    if not Path(path).is_file():
        return {}
    with open(path, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    known = [row for row in rows if code is None or row["code"] == code]
    return {
        row["rule"]: Cost(int(row["jobs"]), *(float(row[name]) for name in Cost._fields[1:]))
        for row in known
    }


def write(costs, path, *, code):
    """Write costs as CSV, with the hash of the code that they were measured with."""
    rows = [
        [rule, cost.jobs, *(f"{value:.3g}" for value in cost[1:3]), round(cost.peak_megabyte), code]
        for rule, cost in sorted(costs.items())
    ]
    _write_rows([["rule", *Cost._fields, "code"], *rows], path)


def _write_rows(rows, path):
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def compare(recorded, measured) -> tuple[list[str], list[str]]:
    """Lines for people: what costs more than recorded, and what else has changed.

    Parameters
    ----------
    recorded, measured : Cost by rule. A rule of which fewer jobs ran than are recorded, since not
        all was to be made anew, is not compared; of more jobs each may cost what one did.
    """
    more, other = [], []
    machine = _factor_of_machine(recorded, measured)
    for rule, new in measured.items():
        if (old := recorded.get(rule)) is None:
            other.append(f"{rule}: not recorded yet")
            continue
        if new.jobs < old.jobs:
            continue
        cpu = machine * old.cpu_units * new.jobs / old.jobs
        pairs = (
            ("CPU in units of the calibration", cpu, new.cpu_units, LEAST_UNITS),
            ("peak memory in MB", old.peak_megabyte, new.peak_megabyte, LEAST_MEGABYTE),
        )
        for what, before, now, least in pairs:
            line = f"{rule}, {what}: recorded {before:.3g}, found {now:.3g}"
            if now > MORE * before + least:
                more.append(line)
            elif before > MORE * now + least:
                other.append(f"{line}: cheaper, renew the record")
    return more, other


def _factor_of_machine(recorded, measured):
    """What most rules cost over their record, 1 or more; of few rules it cannot be told, and is 1.

    Beyond half it is no machine: then all rules are dearer.
    """
    pairs = [(recorded[rule], new) for rule, new in measured.items() if rule in recorded]
    ratios = [
        new.cpu_units * old.jobs / (old.cpu_units * new.jobs)
        for old, new in pairs
        if new.jobs >= old.jobs and old.cpu_units >= LEAST_UNITS
    ]
    if len(ratios) < FEWEST_RULES or median(ratios) > MOST_OF_MACHINE:
        return 1.0
    return max(median(ratios), 1.0)


def renewed(recorded, measured) -> dict[str, Cost]:
    """The record with the rules replaced of which no fewer jobs ran than are recorded."""
    enough = {
        rule: cost
        for rule, cost in measured.items()
        if rule not in recorded or cost.jobs >= recorded[rule].jobs
    }
    return recorded | enough


def write_requests(costs, path=REQUESTED):
    """Put costs into the table from which jobs ask a cluster for memory and time.

    Other rules' rows, and the part of a cell's work that a rule belongs to, stay as they are.
    """
    with open(path, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    table = {row["rule"]: row for row in rows}
    for rule, cost in costs.items():
        table[rule] = {
            "rule": rule,
            "part": table.get(rule, {}).get("part", ""),
            "jobs": cost.jobs,
            "cpu_second": round(cost.cpu_units * CALIBRATION_SECOND, 1),
            "longest_cpu_second": max(round(cost.longest_cpu_units * CALIBRATION_SECOND, 1), 0.1),
            "peak_megabyte": round(cost.peak_megabyte),
        }
    names = list(rows[0])
    lines = [[table[rule][name] for name in names] for rule in sorted(table)]
    _write_rows([names, *lines], path)
