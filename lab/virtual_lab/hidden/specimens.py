"""Cells with hidden effects as specimens, by the fast generator and by physics.

An equivalent circuit leaves millivolts on a porous-electrode cell whatever is added; an effect
shows only beside healthy cells that went through the same protocol. So the effect is added to the
voltage: by how much it changes the fast generator's voltage under the very same current.
"""

from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from virtual_lab import fast, physics
from virtual_lab.campaigns import seed_of
from virtual_lab.hidden.setup import (
    NOISE_VOLT,
    RATING,
    Setup,
    current_corners,
    driven_by,
    gap_files,
    healthy,
)
from virtual_lab.hidden.strength import Hidden, accepted, with_effect
from virtual_lab.hidden.vocabulary import OUTSIDE
from virtual_lab.specimens import CURVE_SOC, Physical, curve_rows

KEPT = 64  # more than the cells of one job


class HiddenCell(NamedTuple):
    """A healthy cell into which effects have been put, each with a strength [V].

    `kind` is that of the truth: reference, none, single, two, unknown. `at_capacity_test`: the
    cell during the capacity test.
    """

    name: str
    seed: int
    kind: str
    effects: tuple[str, ...]
    strength_volt: float
    at_capacity_test: bool = False

    @property
    def setup(self) -> Setup:
        """The cell and its channel with all effects."""
        return hidden_in(self).setup

    @property
    def chain(self):
        """The channel, with the errors of the effects."""
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
        """Relative growth of that charge with temperature [1/K]."""
        return self._cell.capacity_per_kelvin

    @property
    def _cell(self) -> fast.Cell:
        setup = self.setup
        return (setup.at_capacity_test if self.at_capacity_test else None) or setup.cell

    def run(self, steps, *, chamber, initial_soc=1.0):
        """Take the cell through a protocol; disturbances are added to the voltage."""
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
        return {"missing_effect": [truth_row(self, name)], "ocv": curve_rows(name, 25.0, volt)}


class HiddenEffects(NamedTuple):
    """A cell without and with its effects, each effect by itself, the names accepted for each."""

    plain: Setup
    setup: Setup
    found: list[Hidden]
    accept: list[list[str]]


def hidden_in(cell) -> HiddenEffects:
    """Effects of a specimen with name, seed, effects and strength, computed once."""
    return _hidden_in(cell.name, cell.seed, cell.effects, cell.strength_volt)


@lru_cache(maxsize=KEPT)
def _hidden_in(name, seed, effects, strength_volt) -> HiddenEffects:
    random = np.random.default_rng(seed_of(name, seed))
    plain = setup = healthy(random)
    effects_found, accept = [], []
    for effect in effects:
        hidden = with_effect(setup, effect, strength_volt, gap_files(), random)
        in_vocabulary = effect not in OUTSIDE
        accept.append(accepted(hidden, setup, int(random.integers(2**31))) if in_vocabulary else [])
        effects_found.append(hidden)
        setup = hidden.setup
    return HiddenEffects(plain, setup, effects_found, accept)


def truth_row(cell, name: str) -> dict:
    """Row of missing_effect.json: what was hidden, how much of it is visible, accepted names."""
    hidden = hidden_in(cell)
    pairs = zip(hidden.found, hidden.accept, strict=True)
    effects = [effect_row(one, names, cell.strength_volt) for one, names in pairs]
    visible = any(one.visible for one in hidden.found)
    return {
        "cell": name,
        "kind": cell.kind,
        "visible": bool(visible),
        "none_acceptable": not visible,
        "floor_volt": round(NOISE_VOLT, 6),
        "effects": effects,
    }


def effect_row(hidden: Hidden, accept: list[str], strength_volt: float) -> dict:
    """What the truth says of one effect: its parameters, its strength asked for and found."""
    return {
        "effect": hidden.effect,
        "parameters": hidden.parameters,
        "target_gap_millivolt": round(1e3 * strength_volt, 3),
        "visible_gap_millivolt": round(1e3 * hidden.gap.visible_volt, 3),
        "gap_after_base_fit_millivolt": round(1e3 * hidden.gap.base_volt, 3),
        "validation_gap_millivolt": round(1e3 * hidden.gap.validation_volt, 3),
        "accept": accept,
    }


def _disturbed(behaviour, begin, disturbance, second):
    second = np.asarray(second, float)
    return behaviour.voltage(second) + disturbance(begin + second, behaviour.current(second))


CONTACT_OHM = 4e-3
SPREAD = {"contact": 0.1, "kinetics": 0.05, "loss": 0.01}


class HiddenPhysics(HiddenCell):
    """A healthy cell by physics; effects and channel of the fast cell of the same name."""

    __slots__ = ()

    @property
    def full_ampere_hour(self) -> float:
        """Charge [Ah] of the full cell."""
        return self._physical.full_ampere_hour

    @property
    def _physical(self) -> Physical:
        return Physical(_healthy_porous_cell(self.name, self.seed))

    def run(self, steps, *, chamber, initial_soc=1.0):
        """Take the cell through a protocol; the effects are added to the voltage."""
        behaviours = self._physical.run(steps, chamber=chamber, initial_soc=initial_soc)
        plain, setup = hidden_in(self).plain, self.setup
        if setup.cell is plain.cell:  # only the channel is changed
            return behaviours
        times = [
            current_corners(b.duration_second, s) for b, s in zip(behaviours, steps, strict=True)
        ]
        currents = [(t, b.current(t)) for b, t in zip(behaviours, times, strict=True)]
        with_it, without = (
            driven_by(currents, one.cell, chamber, initial_soc=initial_soc)
            for one in (setup, plain)
        )
        return [
            b._replace(voltage=partial(_added_voltage, b.voltage, more.voltage, less.voltage))
            for b, more, less in zip(behaviours, with_it, without, strict=True)
        ]

    def facts(self, name: str) -> dict[str, list[dict]]:
        """Truth: what was hidden, and the open-circuit voltage."""
        curve = self._physical.facts(name)["ocv"]
        return {"missing_effect": [truth_row(self, name)], "ocv": curve}


@lru_cache(maxsize=32)
def _healthy_porous_cell(name, seed) -> physics.Cell:
    """A healthy cell; its parameters differ a little from cell to cell."""
    random = np.random.default_rng(seed_of(f"porous {name}", seed))
    lli, lam_negative, lam_positive = (SPREAD["loss"] * random.random(3)).tolist()
    return physics.Cell(
        lli,
        lam_negative,
        lam_positive,
        contact_resistance_ohm=CONTACT_OHM * float(np.exp(SPREAD["contact"] * random.normal())),
        kinetics=float(np.exp(SPREAD["kinetics"] * random.normal())),
        capacity_ampere_hour=physics.RATED_CAPACITY_AMPERE_HOUR * (1 - lli),
        cycle=None,
        note="healthy",
    )


def _added_voltage(voltage, more, less, second):
    return voltage(second) + more(second) - less(second)
