"""Parallel groups with a hidden effect in one branch: each effect, its strength, the specimens.

A branch's strength is a voltage too: the difference of its current from that of a healthy group,
times its cell's ohmic resistance (root mean square over the group's tests and branches).
"""

from collections.abc import Callable
from functools import cache, lru_cache, partial
from typing import Any, NamedTuple

import numpy as np

from virtual_lab import fast, protocols
from virtual_lab.behaviour import Rating
from virtual_lab.campaigns import seed_of
from virtual_lab.chamber import Chamber, steady, temperature_at
from virtual_lab.hidden.setup import CHAIN, HARSH_SEED, RATING, SOFT_SEED, File, Task, healthy
from virtual_lab.instruments.chain import Chain
from virtual_lab.specimens import branch_rows

ACTIVATION_JOULE_PER_MOLE = 30e3
WIRE_OHM = 2e-3
TOLERANCE, TRIES = 0.02, 8


class GroupSetup(NamedTuple):
    """Cells in parallel with their wires; `warmer_kelvin`: of each cell above the chamber."""

    cells: tuple[fast.Cell, ...]
    wire_ohm: tuple[float, ...]
    initial_soc: tuple[float, ...]
    warmer_kelvin: tuple[float, ...]
    chain: Chain = CHAIN

    def run(self, steps, *, chamber: Chamber):
        """Simulate the group in a protocol of its total current."""
        around = [Chamber(chamber.second, chamber.celsius + k) for k in self.warmer_kelvin]
        behaviours = fast.run_group(
            steps,
            self.cells,
            wire_ohm=self.wire_ohm,
            initial_soc=self.initial_soc,
            chambers=tuple(around),
        )
        # The sensor is beside the cells: one on a cell would show which of them is warm.
        begins = np.cumsum([0.0, *[b.duration_second for b in behaviours[:-1]]])
        return [
            b._replace(temperature=partial(_around, chamber, begin))
            for b, begin in zip(behaviours, begins, strict=True)
        ]


def _around(chamber, begin, second):
    return temperature_at(chamber, begin + np.asarray(second, float))


class GroupEffect(NamedTuple):
    """One effect: its size with unit, the first size tried, the largest plausible one."""

    parameter: str
    first: float
    most: float
    act: Callable[[GroupSetup, int, float], GroupSetup]
    either_sign: bool = False


def _replaced(values, branch, value):
    return (*values[:branch], value, *values[branch + 1 :])


def _added(field):
    def act(setup, branch, size):
        values = getattr(setup, field)
        return setup._replace(**{field: _replaced(values, branch, values[branch] + size)})

    return act


def _capacity(setup, branch, size):
    cell = setup.cells[branch]
    changed = cell._replace(capacity_ampere_hour=cell.capacity_ampere_hour * (1 + size))
    return setup._replace(cells=_replaced(setup.cells, branch, changed))


def _resistance(setup, branch, size):
    cell = setup.cells[branch]
    changed = cell._replace(
        r0_ohm=cell.r0_ohm * (1 + size), pair_r_ohm=tuple(r * (1 + size) for r in cell.pair_r_ohm)
    )
    return setup._replace(cells=_replaced(setup.cells, branch, changed))


def _sensor(field):
    def act(setup, branch, size):
        values = getattr(setup.chain, field) or (0.0,) * len(setup.cells)
        changed = setup.chain._replace(**{field: _replaced(values, branch, size)})
        return setup._replace(chain=changed)

    return act


GROUP_EFFECTS = {
    "branch_wire_resistance": GroupEffect("excess_ohm", 2e-3, 0.03, _added("wire_ohm")),
    "branch_initial_soc": GroupEffect("lower_soc", -0.02, 0.3, _added("initial_soc")),
    "branch_capacity": GroupEffect("excess_relative", -0.03, 0.3, _capacity),
    "branch_cell_resistance": GroupEffect("excess_relative", 0.1, 1.5, _resistance),
    "branch_temperature": GroupEffect("warmer_kelvin", 3.0, 30.0, _added("warmer_kelvin")),
    "branch_current_offset": GroupEffect(
        "offset_ampere", 0.05, 1.0, _sensor("branch_offset_ampere"), either_sign=True
    ),
    "branch_current_gain": GroupEffect(
        "gain_relative", 0.02, 0.3, _sensor("branch_gain"), either_sign=True
    ),
}


def healthy_group(random: np.random.Generator, branches: int, soc: float = 0.95) -> GroupSetup:
    """Healthy cells, equally full, behind wires of one resistance.

    Their resistances depend on temperature, so that a warm cell has another share of the current.
    """
    cells = []
    for _ in range(branches):
        cell = healthy(random).cell
        energies = (ACTIVATION_JOULE_PER_MOLE,) * len(cell.pair_r_ohm)
        cells.append(
            cell._replace(
                r0_activation_joule_per_mole=ACTIVATION_JOULE_PER_MOLE,
                pair_activation_joule_per_mole=energies,
            )
        )
    same = [(value,) * branches for value in (WIRE_OHM, soc, 0.0)]
    return GroupSetup(tuple(cells), *same)


def with_group_effect(
    plain: GroupSetup,
    effect: str,
    strength_volt: float,
    files: list[File],
    random: np.random.Generator,
) -> tuple[GroupSetup, dict[str, Any], float]:
    """One branch with an effect of a strength [V]: the setup, its parameters, its true strength."""
    chosen = GROUP_EFFECTS[effect]
    branch = int(random.integers(len(plain.cells)))
    sign = float(random.choice([-1.0, 1.0])) if chosen.either_sign else np.sign(chosen.first)
    size = abs(chosen.first)
    for _ in range(TRIES):
        volt = deviation(chosen.act(plain, branch, sign * size), plain, files)
        ratio = strength_volt / max(volt, 1e-9)
        if abs(ratio - 1) < TOLERANCE or (size >= chosen.most and ratio > 1):
            break
        size = min(size * np.clip(ratio, 0.1, 10.0), chosen.most)
    setup = chosen.act(plain, branch, sign * size)
    parameters = {chosen.parameter: float(f"{sign * size:.6g}"), "branch": branch + 1}
    return setup, parameters, deviation(setup, plain, files)


def deviation(setup: GroupSetup, plain: GroupSetup, files: list[File]) -> float:
    """Deviation of the branch currents shown from those of a healthy group, as a voltage [V]."""
    squares = [_deviations(setup, plain, file) for file in files]
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def _deviations(setup, plain, file):
    """Squares of these deviations [V²] in one file."""
    behaviours = setup.run(file.steps, chamber=steady(file.celsius))
    healthy = plain.run(file.steps, chamber=steady(file.celsius))
    parts = []
    for one, other in zip(behaviours, healthy, strict=True):
        second = np.linspace(0.0, min(one.duration_second, other.duration_second), 400)
        for k, cell in enumerate(plain.cells):
            excess = _shown_ampere(setup.chain, k, one.branches[k](second)) - other.branches[k](
                second
            )
            parts.append((excess * cell.r0_ohm) ** 2)
    return np.concatenate(parts)


def _shown_ampere(chain, branch, ampere):
    gains, offsets = chain.branch_gain, chain.branch_offset_ampere
    gain = gains[branch] if gains else 0.0
    return ampere * (1 + gain) + (offsets[branch] if offsets else 0.0)


SIZES = (2, 3, 4)
# Noise of a branch's ammeter, as a voltage over its cell's resistance.
FLOOR_VOLT = CHAIN.current_noise_ampere * 0.02
KEPT = 16


class HiddenGroup(NamedTuple):
    """Cells in parallel with an effect in one branch (`effect` None: a healthy group)."""

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
        """Number of cells."""
        return SIZES[seed_of(f"size of {self.name}", self.seed) % len(SIZES)]

    @property
    def capacities_ampere_hour(self) -> list[float]:
        """True charge [Ah] of each full cell."""
        return [cell.capacity_ampere_hour for cell in _group_setups(self)[1].cells]

    @property
    def full_ampere_hour(self) -> float:
        """Sum of the cells' charges [Ah]."""
        return sum(self.capacities_ampere_hour)

    @property
    def chain(self):
        """The channel, with the errors of a branch's sensor."""
        return _group_setups(self)[1].chain

    def run(self, steps, *, chamber, initial_soc=None):
        """Take the group through a protocol of its total current."""
        return _group_setups(self)[1].run(steps, chamber=chamber)

    def facts(self, name: str) -> dict[str, list[dict]]:
        """Truth: rows of groups.tsv as the laboratory assumes them, and what is hidden."""
        plain, _, parameters, strength = _group_setups(self)
        effect = {
            "effect": self.effect,
            "parameters": parameters,
            "visible_gap_millivolt": round(1e3 * strength, 3),
            "accept": [self.effect],
        }
        row = {
            "cell": name,
            "kind": "single" if self.effect else "none",
            "visible": bool(strength > FLOOR_VOLT),
            "none_acceptable": bool(strength <= FLOOR_VOLT),
            "floor_volt": round(FLOOR_VOLT, 7),
            "effects": [effect] if self.effect else [],
        }
        wiring = branch_rows(name, self.names, plain.wire_ohm, plain.initial_soc)
        return {"groups": wiring, "missing_effect": [row]}


class BranchCell(NamedTuple):
    """A cell of a group by itself, as it was tested before."""

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
        return _group_setups(self.group)[0].cells[self.position]

    def run(self, steps, *, chamber, initial_soc=1.0):
        """Take the cell through a protocol."""
        return fast.run(steps, self._cell, chamber=chamber, initial_soc=initial_soc)

    def facts(self, name: str) -> dict[str, list[dict]]:
        """No truth of its own; the group has it."""
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
def _group_setups(group: HiddenGroup) -> tuple[GroupSetup, GroupSetup, dict[str, Any], float]:
    """The group as assumed, as it is, the effect's parameters, and its strength [V]."""
    random = np.random.default_rng(seed_of(group.name, group.seed))
    plain = healthy_group(random, group.size)
    if not group.effect:
        return plain, plain, {}, 0.0
    files = [File(task.steps, task.celsius) for task in group_tasks(group.size)]
    changed = with_group_effect(plain, group.effect, group.strength_volt, files, random)
    return plain, *changed
