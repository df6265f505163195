"""Parallel groups with a hidden effect in one branch, as specimens, and what they go through."""

from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np

from virtual_lab import fast, protocols
from virtual_lab.hidden.groups import GroupSetup, healthy_group, with_group_effect
from virtual_lab.hidden.protocols import HARSH_SEED, SOFT_SEED, Task
from virtual_lab.hidden.replay import File
from virtual_lab.hidden.setup import CHAIN, RATING
from virtual_lab.plan import seed_of
from virtual_lab.rating import Rating
from virtual_lab.specimens import branch_rows

SIZES = (2, 3, 4)
# What noise of a branch's ammeter amounts to, as a voltage over its cell's resistance.
FLOOR_VOLT = CHAIN.current_noise_ampere * 0.02
KEPT = 16


class HiddenGroup(NamedTuple):
    """Cells in parallel, one branch not as the sheets say (`effect`; None: all as they say)."""

    name: str
    seed: int
    effect: str | None
    strength_volt: float

    @property
    def names(self) -> tuple[str, ...]:
        """Ids of its cells."""
        return tuple(f"{self.name}{letter}" for letter in "abcd"[: self.size])

    @property
    def size(self) -> int:
        """How many cells."""
        return SIZES[seed_of(f"size of {self.name}", self.seed) % len(SIZES)]

    @property
    def capacities_ampere_hour(self) -> list[float]:
        """Charge [Ah] of each full cell, as it truly is."""
        return [cell.capacity_ampere_hour for cell in _made(self)[1].cells]

    @property
    def full_ampere_hour(self) -> float:
        """Sum of the cells' charges [Ah]."""
        return sum(self.capacities_ampere_hour)

    @property
    def chain(self):
        """The channel, with the faults of a branch's sensor."""
        return _made(self)[1].chain

    def run(self, steps, *, chamber, initial_soc=None):
        """Through a protocol of the group's current."""
        return _made(self)[1].run(steps, chamber=chamber)

    def facts(self, name: str) -> dict[str, list[dict]]:
        """Rows of groups.tsv as the laboratory believes, and what is hidden."""
        plain, _, parameters, found = _made(self)
        effect = {
            "effect": self.effect,
            "parameters": parameters,
            "visible_gap_millivolt": round(1e3 * found, 3),
            "accept": [self.effect],
        }
        row = {
            "cell": name,
            "kind": "single" if self.effect else "none",
            "visible": bool(found > FLOOR_VOLT),
            "none_acceptable": bool(found <= FLOOR_VOLT),
            "floor_volt": round(FLOOR_VOLT, 7),
            "effects": [effect] if self.effect else [],
        }
        told = branch_rows(name, self.names, plain.wire_ohm, plain.initial_soc)
        return {"groups": told, "missing_effect": [row]}


class BranchCell(NamedTuple):
    """A cell of a group by itself, as it was characterised before."""

    group: HiddenGroup
    position: int
    kind: str = "none"
    at_capacity_test: bool = False

    @property
    def name(self) -> str:
        """Its id."""
        return self.group.names[self.position]

    @property
    def rating(self):
        """Data sheet."""
        return RATING

    @property
    def seed(self) -> int:
        """That of the campaign."""
        return self.group.seed

    @property
    def chain(self):
        """A healthy channel."""
        return CHAIN

    @property
    def full_ampere_hour(self) -> float:
        """Charge [Ah] of the full cell."""
        return self._cell.capacity_ampere_hour

    @property
    def _cell(self) -> fast.Cell:
        return _made(self.group)[0].cells[self.position]

    def run(self, steps, *, chamber, initial_soc=1.0):
        """Through a protocol."""
        return fast.run(steps, self._cell, chamber=chamber, initial_soc=initial_soc)

    def facts(self, name: str) -> dict[str, list[dict]]:
        """Nothing is known of it that its group does not say."""
        return {}


def branches(group: HiddenGroup) -> list[BranchCell]:
    """The group's cells, each by itself."""
    return [BranchCell(group, position) for position in range(group.size)]


@cache
def group_tasks(size: int) -> tuple[Task, ...]:
    """Drives at three temperatures to fit, a harsher one to validate."""
    rating = Rating(size * RATING.capacity_ampere_hour, *RATING[1:])
    soft = protocols.dynamic_load(rating, style="soft", seed=SOFT_SEED)
    harsh = protocols.dynamic_load(rating, style="harsh", seed=HARSH_SEED)
    fitted = [Task(f"drive_{t:.0f}C", "group", t, soft, "fit") for t in (25.0, 5.0, 45.0)]
    return (*fitted, Task("validation_25C", "group", 25.0, harsh, "validation"))


@lru_cache(maxsize=KEPT)
def _made(group: HiddenGroup) -> tuple[GroupSetup, GroupSetup, dict[str, Any], float]:
    """The group as the laboratory believes, as it is, the effect's parameters and strength [V]."""
    random = np.random.default_rng(seed_of(group.name, group.seed))
    plain = healthy_group(random, group.size)
    if not group.effect:
        return plain, plain, {}, 0.0
    files = [File(task.steps, task.celsius) for task in group_tasks(group.size)]
    changed = with_group_effect(plain, group.effect, group.strength_volt, files, random)
    return plain, *changed
