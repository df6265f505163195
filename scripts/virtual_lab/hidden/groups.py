"""Parallel groups with something wrong in one branch: how each group effect acts, and how strong.

A branch's strength is a voltage too: what its current has of its own, times its cell's ohmic
resistance (root mean square over the group's tests and branches).
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from virtual_lab import fast
from virtual_lab.chamber import Chamber, at, steady
from virtual_lab.hidden.replay import File
from virtual_lab.hidden.setup import CHAIN, healthy
from virtual_lab.measurement import Chain

ACTIVATION_JOULE_PER_MOLE = 30e3
WIRE_OHM = 2e-3
TOLERANCE, TRIES = 0.02, 8


class GroupSetup(NamedTuple):
    """Cells in parallel as they truly are; `warmer_kelvin` is of each cell above the chamber."""

    cells: tuple[fast.Cell, ...]
    wire_ohm: tuple[float, ...]
    initial_soc: tuple[float, ...]
    warmer_kelvin: tuple[float, ...]
    chain: Chain = CHAIN

    def run(self, steps, *, chamber: Chamber):
        """Through a protocol of the group's current."""
        around = [Chamber(chamber.second, chamber.celsius + k) for k in self.warmer_kelvin]
        found = fast.run_group(
            steps,
            self.cells,
            wire_ohm=self.wire_ohm,
            initial_soc=self.initial_soc,
            chambers=tuple(around),
        )
        # The sensor hangs beside the cells: one on a cell would tell which of them is warm.
        begins = np.cumsum([0.0, *[b.duration_second for b in found[:-1]]])
        return [
            b._replace(temperature=partial(_around, chamber, begin))
            for b, begin in zip(found, begins, strict=True)
        ]


def _around(chamber, begin, second):
    return at(chamber, begin + np.asarray(second, float))


class GroupEffect(NamedTuple):
    """One effect: its size with unit, where its search begins, the most that is plausible."""

    parameter: str
    first: float
    most: float
    act: Callable[[GroupSetup, int, float], GroupSetup]
    either_sign: bool = False


def _put(values, branch, value):
    return (*values[:branch], value, *values[branch + 1 :])


def _added(field):
    def act(setup, branch, size):
        values = getattr(setup, field)
        return setup._replace(**{field: _put(values, branch, values[branch] + size)})

    return act


def _capacity(setup, branch, size):
    cell = setup.cells[branch]
    changed = cell._replace(capacity_ampere_hour=cell.capacity_ampere_hour * (1 + size))
    return setup._replace(cells=_put(setup.cells, branch, changed))


def _resistance(setup, branch, size):
    cell = setup.cells[branch]
    changed = cell._replace(
        r0_ohm=cell.r0_ohm * (1 + size), pair_r_ohm=tuple(r * (1 + size) for r in cell.pair_r_ohm)
    )
    return setup._replace(cells=_put(setup.cells, branch, changed))


def _sensor(field):
    def act(setup, branch, size):
        values = getattr(setup.chain, field) or (0.0,) * len(setup.cells)
        changed = setup.chain._replace(**{field: _put(values, branch, size)})
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
    """Healthy cells whose resistance moves with temperature, behind alike wires, equally full."""
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
    """One branch with an effect of a strength [V]; the setup, its parameters, its true strength."""
    made = GROUP_EFFECTS[effect]
    branch = int(random.integers(len(plain.cells)))
    sign = float(random.choice([-1.0, 1.0])) if made.either_sign else np.sign(made.first)
    size = abs(made.first)
    for _ in range(TRIES):
        found = deviation(made.act(plain, branch, sign * size), plain, files)
        ratio = strength_volt / max(found, 1e-9)
        if abs(ratio - 1) < TOLERANCE or (size >= made.most and ratio > 1):
            break
        size = min(size * np.clip(ratio, 0.1, 10.0), made.most)
    setup = made.act(plain, branch, sign * size)
    told = {made.parameter: float(f"{sign * size:.6g}"), "branch": branch + 1}
    return setup, told, deviation(setup, plain, files)


def deviation(setup: GroupSetup, plain: GroupSetup, files: list[File]) -> float:
    """How much the branch currents shown differ from those of a healthy group, as a voltage."""
    squares = [_deviations(setup, plain, file) for file in files]
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def _deviations(setup, plain, file):
    found = setup.run(file.steps, chamber=steady(file.celsius))
    sound = plain.run(file.steps, chamber=steady(file.celsius))
    parts = []
    for one, other in zip(found, sound, strict=True):
        second = np.linspace(0.0, min(one.duration_second, other.duration_second), 400)
        for k, cell in enumerate(plain.cells):
            excess = _read(setup.chain, k, one.branches[k](second)) - other.branches[k](second)
            parts.append((excess * cell.r0_ohm) ** 2)
    return np.concatenate(parts)


def _read(chain, branch, ampere):
    gains, offsets = chain.branch_gain, chain.branch_offset_ampere
    gain = gains[branch] if gains else 0.0
    return ampere * (1 + gain) + (offsets[branch] if offsets else 0.0)
