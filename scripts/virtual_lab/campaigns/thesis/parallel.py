"""34 cells in 27 groups of two to four in parallel (S20, S21); groups 1 to 8 are of table 5.2."""

from functools import cache, partial

import numpy as np

from virtual_lab import protocols
from virtual_lab.campaigns.thesis.pack import CHAIN, RATING, Used, used
from virtual_lab.plan import Cell, Test, seed_of
from virtual_lab.rating import Rating
from virtual_lab.specimens import BehaviouralGroup

COUNT, GROUPS = 34, 27
WIRE_OHM = 3e-4
# Table 5.2 [Ah]; where it gives a cell twice, what it says first.
CAPACITIES = {
    2: 24.9, 3: 29.8, 4: 31.5, 5: 28.7, 6: 22.7, 11: 31.1, 13: 31.7, 14: 29.7, 15: 31.7, 16: 30.2,
    18: 29.4, 19: 31.2, 20: 24.9, 24: 21.2, 25: 27.3, 26: 29.4, 27: 26.3, 31: 30.1, 33: 18.7,
}  # fmt: skip
TABLE = (
    (15, 19), (13, 24), (6, 13, 25), (14, 15, 31), (4, 11, 20), (5, 6, 13, 27), (14, 15, 16, 31),
    (2, 3, 18, 26),
)  # fmt: skip
OTHERS_AMPERE_HOUR = (22.0, 31.0)


@cache
def cells(seed: int) -> tuple[Used, ...]:
    """All 34."""
    random = np.random.default_rng(seed_of("parallel cells", seed))
    found = []
    for number in range(1, COUNT + 1):
        drawn = round(float(random.uniform(*OTHERS_AMPERE_HOUR)), 1)
        found.append(used(_name(number), CAPACITIES.get(number, drawn), random))
    return tuple(found)


@cache
def members(seed: int) -> dict[str, tuple[Used, ...]]:
    """The cells of each group, by its name."""
    random = np.random.default_rng(seed_of("parallel groups", seed))
    chosen = list(TABLE)
    while len(chosen) < GROUPS:
        size = int(random.integers(2, 5))
        chosen.append(tuple(sorted((random.permutation(COUNT)[:size] + 1).tolist())))
    known = {one.name: one for one in cells(seed)}
    return {
        f"group{k:02d}": tuple(known[_name(number)] for number in numbers)
        for k, numbers in enumerate(chosen, 1)
    }


def _name(number):
    return f"G{number:02d}"


def groups(seed: int) -> dict[str, BehaviouralGroup]:
    """Specimens by name: all cells full, behind alike wires."""
    return {name: _group(cells) for name, cells in members(seed).items()}


def _group(cells):
    names, specimens = (tuple(one.name for one in cells), tuple(one.specimen for one in cells))
    same = [(value,) * len(names) for value in (WIRE_OHM, 1.0)]
    return BehaviouralGroup(names, specimens, *same)


def tests_and_cells(seed: int) -> tuple[list[Cell], list[Test]]:
    """Rows of the sheet and all tests: of each cell first, then of the groups."""
    rows = [Cell(one.name, "NMC", RATING, one.specimen, note="for groups") for one in cells(seed)]
    tests = [test for one in cells(seed) for test in _alone(one, seed)]
    specimens = groups(seed)
    for name, of_group in members(seed).items():
        full = sum(one.capacity_ampere_hour for one in of_group)
        tests += _together(name, specimens[name], full, seed)
    return rows, tests


def _alone(one, seed):
    at = partial(
        Test,
        one.name,
        ambient_celsius=25.0,
        instrument="parquet",
        specimen=one.specimen,
        chain=CHAIN,
        batch=one.name,
        seed_of_campaign=seed,
    )
    pulses = protocols.hybrid_pulses(RATING, one.capacity_ampere_hour)
    return [
        at("capacity_25C", "capacity", steps=protocols.capacity(RATING)),
        at("hppc_25C", "hppc", steps=pulses),
    ]


def _together(name, group, full, seed):
    """Discharges at 1C (of pairs at 2C too) to the cut-off, and a drive; all to be predicted."""
    rating = Rating(len(group.names) * RATING.capacity_ampere_hour, *RATING[1:])
    at = partial(
        Test,
        name,
        kind="group",
        ambient_celsius=25.0,
        instrument="parquet",
        specimen=group,
        chain=CHAIN,
        soc=None,
        initial_soc=None,
        role="validation",
        batch=name,
        seed_of_campaign=seed,
    )
    rates = (1.0, 2.0) if len(group.names) == 2 else (1.0,)
    tests = [
        at(f"discharge_{rate:.0f}C", steps=protocols.group_capacity(rating, c_rate=rate))
        for rate in rates
    ]
    return [*tests, at("udds_25C", steps=protocols.group_drive(rating, full, schedule="udds"))]
