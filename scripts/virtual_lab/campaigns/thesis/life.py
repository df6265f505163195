"""Five types of cell aged under three protocols, with check-ups (S12, S13, S16)."""

from functools import partial
from typing import NamedTuple

import numpy as np

from virtual_lab import ageing, cells, fast, protocols, stock
from virtual_lab.campaigns.thesis.pack import CHAIN
from virtual_lab.chamber import room
from virtual_lab.plan import Cell, Test, seed_of
from virtual_lab.specimens import Behavioural, Physical

# Tables 4.2 and 4.3: which cell went through what.
LIVES = {
    "A1": ("A", "standard"), "B1": ("B", "standard"), "B2": ("B", "standard"),
    "C1": ("C", "high_power"), "C2": ("C", "high_power"), "C3": ("C", "standard"),
    "C4": ("C", "fast_charge"), "C5": ("C", "fast_charge"), "D1": ("D", "standard"),
    "E1": ("E", "high_power"), "E2": ("E", "standard"),
}  # fmt: skip
BY_PHYSICS = ("B1", "C3", "E2")  # whose slow charges are solved as porous electrodes
CHECK_UPS = 5
KINETICS = {"C": 3.0}  # a 20 Ah NCM cell has 2 mohm; the set scaled to its size has thrice as much
STRIDE = 5  # cycles over which a cell is taken to stay what it is
RESTED = {"rest_second": 600.0, "period_second": 60.0}


class Life(NamedTuple):
    """A cell over all its cycles: each begins as the one before has left it, warm and polarised."""

    kind: str
    protocol: str
    spread: float  # of its pace: it ages so many times faster than its type

    @property
    def rating(self):
        """Data sheet."""
        return ageing.KINDS[self.kind].rating

    @property
    def full_ampere_hour(self) -> float:
        """Charge [Ah] of the fresh cell."""
        return stock.cell(self.kind).capacity_ampere_hour

    @property
    def cycles(self) -> int:
        """How many it lives."""
        return int(ageing.last_cycle(self.kind, self.protocol) / self.spread)

    def at(self, cycle: float) -> fast.Cell:
        """The cell after so many cycles."""
        return stock.aged(self.kind, self.protocol, cycle * self.spread)

    def told_ampere_hour(self, cycle: float) -> float:
        """Capacity [Ah] that the laboratory has measured after so many cycles."""
        share = ageing.capacity_share(self.kind, self.protocol, cycle * self.spread)
        return share * ageing.KINDS[self.kind].fresh_ampere_hour

    def run(self, steps, *, chamber, initial_soc=1.0):
        """Through its ageing test: a first rest, then cycles of as many steps each."""
        of_one = (len(steps) - 1) // self.cycles
        parts = [(steps[:1], self.at(0))]
        for cycle in range(0, self.cycles, STRIDE):
            part = steps[1 + cycle * of_one : 1 + (cycle + STRIDE) * of_one]
            parts.append((part, self.at(cycle)))
        return fast.run_changing(parts, chamber=chamber, initial_soc=initial_soc)

    def facts(self, name: str) -> dict[str, list[dict]]:
        """Losses at the check-ups, and the knee."""
        knee = ageing.knee_cycle(self.kind, self.protocol)
        fresh = self.full_ampere_hour
        rows = []
        for cycle in check_up_cycles(self):
            state = ageing.state(self.kind, self.protocol, cycle * self.spread)
            left = self.at(cycle).capacity_ampere_hour
            told = {"cell": name, "cycle": cycle, "capacity_ampere_hour": round(left, 5)}
            losses = {loss: round(value, 6) for loss, value in stock.losses_of(state).items()}
            knees = {"knee_cycle": round(knee / self.spread) if knee else None}
            rows.append(told | {"soh": round(left / fresh, 5)} | losses | knees)
        return {"health": rows}


def check_up_cycles(life: Life) -> list[int]:
    """Cycles of the check-ups: the first and last of life, and between."""
    return [int(c) for c in np.linspace(0, life.cycles, CHECK_UPS).round()]


def lives(seed: int) -> dict[str, Life]:
    """Cells by name; two of a type under one protocol do not age quite alike."""
    return {name: Life(*what, spread=_spread(name, seed)) for name, what in LIVES.items()}


def _spread(name, seed):
    random = np.random.default_rng(seed_of(f"pace of {name}", seed))
    return float(1 + 0.04 * random.uniform(0.0, 1.0))


def tests_and_cells(seed: int) -> tuple[list[Cell], list[Test]]:
    """Rows of the sheet; the life of each cell in one file, and its check-ups."""
    rows, tests = [], []
    for name, life in lives(seed).items():
        chemistry = ageing.KINDS[life.kind].chemistry
        rows.append(Cell(name, chemistry, life.rating, life, note=f"{life.protocol} ageing"))
        tests.append(_ageing(name, life, seed))
        for cycle in check_up_cycles(life):
            tests += _check_up(name, life, cycle, seed)
    return rows, tests


def _ageing(name, life, seed):
    steps = protocols.ageing_cycles(life.rating, life.protocol, cycles=life.cycles, **RESTED)
    longest = 4 * 3600.0 * life.cycles
    return Test(
        name,
        "life",
        "ageing",
        25.0,
        "parquet",
        life,
        steps=steps,
        chamber=room(25.0, swing_kelvin=2.0, duration_second=longest),
        chain=CHAIN,
        batch=f"{name}_life",
        seed_of_campaign=seed,
    )


def _check_up(name, life, cycle, seed):
    full, rating = life.told_ampere_hour(cycle), life.rating
    at = partial(
        Test,
        name,
        ambient_celsius=25.0,
        instrument="parquet",
        specimen=Behavioural(partial(life.at, cycle)),
        chain=CHAIN,
        cycle=cycle or None,
        batch=f"{name}_checks",
        seed_of_campaign=seed,
    )
    quick = protocols.incremental_capacity(rating, c_rate=1 / 2, period_second=2.0)
    slow = protocols.incremental_capacity(rating, c_rate=1 / 20)
    found = [
        at(f"capacity_{cycle}", "capacity", steps=protocols.capacity(rating, repeats=1)),
        at(f"hppc_{cycle}", "hppc", steps=protocols.hybrid_pulses(rating, full)),
        at(f"ica_c2_{cycle}", "ica", steps=quick),
        at(f"ica_c20_{cycle}", "ica", steps=slow),
    ]
    if name in BY_PHYSICS:
        physical = Physical(_porous(life, cycle))
        found[-1] = found[-1]._replace(specimen=physical, batch=f"{name}_physics_{cycle}")
    return found


def _porous(life, cycle):
    """The same state as a porous-electrode cell."""
    sheet = ageing.KINDS[life.kind]
    state = ageing.state(life.kind, life.protocol, cycle * life.spread)
    return cells.Cell(
        **stock.losses_of(state),
        contact_resistance_ohm=0.3 * sheet.fresh_ohm * state.resistance_factor,
        kinetics=KINETICS.get(life.kind, 1.0) * state.kinetics,
        capacity_ampere_hour=life.told_ampere_hour(cycle),
        cycle=cycle or None,
        note=f"{life.protocol} ageing",
        chemistry=sheet.chemistry,
        rating=sheet.rating,
    )
