"""A campaign of many cells with small files, to see how the pipeline scales."""

from functools import partial

import numpy as np

from virtual_lab import protocols, thesis_cells
from virtual_lab.campaigns import Cell, Plan, Test, seed_of
from virtual_lab.specimens import Behavioural

KIND = "D"
RATING = thesis_cells.CELL_TYPES[KIND].rating
CELLS_PER_JOB = 50
SPREAD = 0.05
PULSE_SOC = (1.0, 0.8, 0.6, 0.4, 0.2)
CONFIG = """title: Many cells, from the virtual laboratory
models:
  members: [1RC, 2RC]
soc:
  filters: [coulomb, aekf]
  initial_soc: []
  scenarios: []
"""
ABOUT = """# What is true in this campaign

Cells of one type: lithium lost |N(0, 5 %)|, resistance grown by 2·|N(0, 5 %)|; the first is fresh.
"""


def plan(*, seed: int, cells: int) -> Plan:
    """The plan: capacity test, pulses and a drive for each cell; the first has a slow OCV too."""
    specimens = [_specimen(k, seed) for k in range(cells)]
    names = [f"S{k:05d}" for k in range(1, cells + 1)]
    rows = [
        Cell(name, "NMC", RATING, one, reference=name == names[0])
        for name, one in zip(names, specimens, strict=True)
    ]
    tests = [
        test
        for k, (name, one) in enumerate(zip(names, specimens, strict=True))
        for test in _tests(name, one, seed, f"cells_{k // CELLS_PER_JOB:04d}")
    ]
    return Plan(tuple(rows), tuple(tests), {}, CONFIG, ABOUT)


def _specimen(number, seed):
    random = np.random.default_rng(seed_of(f"scale {number}", seed))
    loss, resistance = (abs(random.normal(0.0, SPREAD, 2)) if number else np.zeros(2)).tolist()
    return Behavioural(partial(thesis_cells.cell, KIND, lli=loss, resistance=1 + 2 * resistance))


def _tests(name, specimen, seed, batch):
    at = partial(
        Test,
        name,
        ambient_celsius=25.0,
        instrument="parquet",
        specimen=specimen,
        batch=batch,
        seed_of_campaign=seed,
    )
    rated = RATING.capacity_ampere_hour
    pulses = protocols.hybrid_pulses(RATING, 0.9 * rated, points=PULSE_SOC)
    slow = at("ocv_25C", "ocv", steps=protocols.slow_ocv(RATING, period_second=120.0))
    tests = [
        at(
            "capacity_25C",
            "capacity",
            steps=protocols.capacity(RATING, repeats=1, period_second=30.0),
        ),
        at("hppc_25C", "hppc", steps=pulses),
        at("drive_25C", "drive", steps=protocols.dynamic_load(RATING, style="harsh", seed=1)),
    ]
    return [slow, *tests] if name == "S00001" else tests
