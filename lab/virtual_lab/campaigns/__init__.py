"""The campaigns that the laboratory can make, and the plan of one: cells, tests, sheets."""

import hashlib
from collections.abc import Callable
from importlib import import_module
from typing import Any, NamedTuple

from virtual_lab.behaviour import Rating
from virtual_lab.chamber import Chamber, steady
from virtual_lab.instruments.chain import CHAIN, Chain
from virtual_lab.instruments.measurement import Columns
from virtual_lab.protocols import Step

SUFFIX = {
    "arbin": ".csv.gz",
    "bdf": ".bdf.csv.gz",
    "parquet": ".bdf.parquet",
    "bitrode": ".csv.gz",
    "digatron": ".csv.gz",
    "digatron_german": ".csv.gz",
    "plett": ".csv.gz",
    "eis": ".bdf.csv",
    "digatron_eis": ".csv",
}


class Cell(NamedTuple):
    """A row of cells.tsv, and the specimen (see `specimens`) that it stands for."""

    name: str
    chemistry: str
    rating: Rating
    specimen: Any
    reference: bool = False
    note: str | None = None
    ageing_protocol: str | None = None


class Test(NamedTuple):
    """One test of a cell or group.

    `steps` is None for spectra, a function where they depend on the cell's response.
    `current_sign` is what the sheet says; `discharge_positive` what the file really holds. `soc`
    is the SoC at the start by the sheet, `initial_soc` the true one. `faults` spoil the record as
    instruments do, `damage` the file beyond use; without a `chain` that of the specimen is taken.
    `batch` names the job that makes the test, `folder` where its file goes. Blank (None) stays
    blank in the sheet.
    """

    cell: str
    test: str
    kind: str
    ambient_celsius: float
    instrument: str
    specimen: Any
    steps: list[Step] | Callable[[], list[Step]] | None = None
    chamber: Chamber | None = None
    chain: Chain | None = CHAIN
    current_sign: str | None = None
    discharge_positive: bool = False
    soc: float | None = 1.0
    initial_soc: Any = 1.0
    cycle: float | None = None
    role: str | None = None
    faults: tuple[Callable[[Columns], Any], ...] = ()
    damage: Callable[[bytes], Any] | None = None
    note: str | None = None
    batch: str = ""
    folder: str = "raw"
    seed_of_campaign: int = 0

    @property
    def file(self) -> str:
        """Path in the campaign."""
        return f"{self.folder}/{self.cell}/{self.test}{SUFFIX[self.instrument]}"

    @property
    def around(self) -> Chamber:
        """The chamber of the test; without one, a chamber that holds the sheet's temperature."""
        return self.chamber or steady(self.ambient_celsius)

    @property
    def seed(self) -> int:
        """Seed of the test's noise, the same on any machine and for any order of jobs."""
        return seed_of(f"{self.cell}/{self.test}", self.seed_of_campaign)


class Plan(NamedTuple):
    """A campaign as planned: cells, tests, groups, and the texts that go with them.

    `groups` holds the specimen of each parallel group by name. `config` is the text of
    config.yaml, `about` that of a README beside the truth, which goes to the folder `truth` of the
    campaign. `compared` completes the truth tables of all cells where cells are compared with each
    other. `simulated` has for each cell its name, what it was made of in words, and the ids of the
    effects in it, which the report shows beside its verdict.
    """

    cells: tuple[Cell, ...]
    tests: tuple[Test, ...]
    groups: dict[str, Any]
    config: str
    about: str
    truth: str = "truth"
    compared: Callable[[dict[str, list[dict]]], dict[str, list[dict]]] | None = None
    simulated: tuple[dict, ...] = ()

    def batches(self) -> dict[str, list[Test]]:
        """Tests by the job that makes them, in the plan's order."""
        batches: dict[str, list[Test]] = {}
        for test in self.tests:
            batches.setdefault(test.batch, []).append(test)
        return batches


def seed_of(name: str, campaign: int = 0) -> int:
    """A random seed for a name; seed 0 of a campaign gives that of the name alone."""
    text = f"{name}@{campaign}" if campaign else name
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "big")


def cells_sheet(plan: Plan) -> list[dict]:
    """Rows of cells.tsv; how cells were aged only where some were."""
    aged = any(cell.ageing_protocol for cell in plan.cells)
    return [
        {
            "cell": cell.name,
            "chemistry": cell.chemistry,
            "rated_capacity_ampere_hour": cell.rating.capacity_ampere_hour,
            "lower_cutoff_volt": cell.rating.lower_cutoff_volt,
            "upper_cutoff_volt": cell.rating.upper_cutoff_volt,
            "reference": "yes" if cell.reference else None,
            **({"ageing_protocol": cell.ageing_protocol} if aged else {}),
            "note": cell.note,
        }
        for cell in plan.cells
    ]


def tests_sheet(plan: Plan, checksums: dict[str, str]) -> list[dict]:
    """Rows of tests.tsv; `checksums` gives the SHA-256 of each file that was made."""
    return [
        {
            "cell": test.cell,
            "test": test.test,
            "kind": test.kind,
            "file": test.file,
            "ambient_temperature_celsius": test.ambient_celsius,
            "instrument": None,
            "current_sign": test.current_sign,
            "cycle": test.cycle,
            "soc": test.soc,
            "role": test.role,
            "sha256": checksums[test.file],
            "note": test.note,
        }
        for test in plan.tests
        if test.file in checksums
    ]


def as_table(rows: list[dict], *, separator: str) -> str:
    """Text with a header row; columns in the order they first appear, blank where not known."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    shown = [["" if row.get(n) is None else f"{row[n]}" for n in names] for row in rows]
    return "\n".join([separator.join(line) for line in [names, *shown]]) + "\n"


# Options with their defaults; `seed` 0 is the one that committed and documented campaigns have.
OPTIONS: dict[str, dict[str, Any]] = {
    "demo": {},
    "thesis": {"seed": 0},
    "hidden": {
        "seed": 0,
        "cells": 10,
        "healthy": 200,
        "unknown": 40,
        "two": 60,
        "physics": 12,
        "groups": 2,
    },
    "scale": {"seed": 0, "cells": 1000},
}
OF_THE_WORKFLOW = {"campaign", "folder", "real"}  # what else its --config may hold
FOLDERS = {"demo": "."} | {name: f"virtual/{name}" for name in OPTIONS if name != "demo"}


def options(name: str, given: dict[str, Any]) -> dict[str, Any]:
    """A campaign's options, the defaults for what is not given.

    Raises
    ------
    ValueError : no such campaign, no such option, or a value of another type than the default.
    """
    if name not in OPTIONS:
        raise ValueError(f"no campaign {name!r}; there are {', '.join(OPTIONS)}")
    chosen = dict(OPTIONS[name])
    if unknown := sorted(given.keys() - chosen.keys() - OF_THE_WORKFLOW):
        allowed = ", ".join(chosen) or "none"
        raise ValueError(f"{name} has no option {', '.join(unknown)}; it has {allowed}")
    for key in chosen.keys() & given.keys():
        kind = type(chosen[key])
        try:
            chosen[key] = kind(given[key])
        except (TypeError, ValueError):
            raise ValueError(f"option {key}: {given[key]!r} is not {kind.__name__}") from None
    return chosen


def plan(name: str, **chosen: Any) -> Plan:
    """The plan of a campaign: all its cells and tests."""
    full = options(name, chosen)
    return import_module(f"virtual_lab.campaigns.{name}").plan(**full)
