"""Cells with hidden effects as specimens; what was hidden is found once and kept."""

from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from virtual_lab import fast
from virtual_lab.hidden.outside import OUTSIDE
from virtual_lab.hidden.protocols import files
from virtual_lab.hidden.setup import NOISE_VOLT, RATING, Setup, healthy
from virtual_lab.hidden.strength import Hidden, accepted, with_effect
from virtual_lab.plan import seed_of
from virtual_lab.specimens import CURVE_SOC, curve_rows

KEPT = 64  # more than the cells of one job


class HiddenCell(NamedTuple):
    """A healthy cell into which effects have been put, each with a strength [V].

    `kind` is what the truth says: reference, none, single, two, unknown. `at_capacity_test`: the
    cell as it was then.
    """

    name: str
    seed: int
    kind: str
    effects: tuple[str, ...]
    strength_volt: float
    at_capacity_test: bool = False

    @property
    def setup(self) -> Setup:
        """The cell and its channel, all effects in."""
        return made(self).setup

    @property
    def chain(self):
        """The channel's faults are those of the effects."""
        return self.setup.chain

    @property
    def rating(self):
        """Data sheet."""
        return RATING

    @property
    def full_ampere_hour(self) -> float:
        """Charge [Ah] of the full cell."""
        return self._cell.capacity_ampere_hour

    @property
    def capacity_per_kelvin(self) -> float:
        """By what share that charge grows with temperature [1/K]."""
        return self._cell.capacity_per_kelvin

    @property
    def _cell(self) -> fast.Cell:
        setup = self.setup
        return (setup.at_capacity_test if self.at_capacity_test else None) or setup.cell

    def run(self, steps, *, chamber, initial_soc=1.0):
        """Through a protocol, disturbances in the voltage."""
        behaviours = fast.run(steps, self._cell, chamber=chamber, initial_soc=initial_soc)
        if not self.setup.disturbance:
            return behaviours
        begins = np.cumsum([0.0, *[b.duration_second for b in behaviours[:-1]]])
        return [
            b._replace(voltage=partial(_disturbed, b, begin, self.setup.disturbance))
            for b, begin in zip(behaviours, begins, strict=True)
        ]

    def facts(self, name: str) -> dict[str, list[dict]]:
        """What was hidden, and the open-circuit voltage."""
        ocv = self.setup.cell.ocv_volt
        volt = np.interp(CURVE_SOC, np.linspace(0, 1, ocv.size), ocv)
        return {"missing_effect": [told(self, name)], "ocv": curve_rows(name, 25.0, volt)}


class Made(NamedTuple):
    """A cell without and with its effects, each effect by itself, the names accepted for each."""

    plain: Setup
    setup: Setup
    found: list[Hidden]
    accept: list[list[str]]


def made(cell) -> Made:
    """What a specimen with name, seed, effects and strength is, found once."""
    return _made(cell.name, cell.seed, cell.effects, cell.strength_volt)


@lru_cache(maxsize=KEPT)
def _made(name, seed, effects, strength_volt) -> Made:
    random = np.random.default_rng(seed_of(name, seed))
    plain = setup = healthy(random)
    found, accept = [], []
    for effect in effects:
        hidden = with_effect(setup, effect, strength_volt, files(), random)
        known = effect not in OUTSIDE
        accept.append(accepted(hidden, setup, int(random.integers(2**31))) if known else [])
        found.append(hidden)
        setup = hidden.setup
    return Made(plain, setup, found, accept)


def told(cell, name: str) -> dict:
    """Row of the truth: what was hidden, how much of it shows, which names are right."""
    known = made(cell)
    effects = [
        {
            "effect": one.effect,
            "parameters": one.parameters,
            "target_gap_millivolt": round(1e3 * cell.strength_volt, 3),
            "visible_gap_millivolt": round(1e3 * one.gap.visible_volt, 3),
            "gap_after_base_fit_millivolt": round(1e3 * one.gap.base_volt, 3),
            "validation_gap_millivolt": round(1e3 * one.gap.validation_volt, 3),
            "accept": names,
        }
        for one, names in zip(known.found, known.accept, strict=True)
    ]
    visible = any(one.visible for one in known.found)
    return {
        "cell": name,
        "kind": cell.kind,
        "visible": bool(visible),
        "none_acceptable": not visible,
        "floor_volt": round(NOISE_VOLT, 6),
        "effects": effects,
    }


def _disturbed(behaviour, begin, disturbance, second):
    second = np.asarray(second, float)
    return behaviour.voltage(second) + disturbance(begin + second, behaviour.current(second))
