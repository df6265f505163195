"""Porous-electrode cells over whose voltage a hidden effect is laid.

An equivalent circuit leaves millivolts on these whatever is added; only beside healthy cells that
went through the same protocol does an effect show. What is laid over is how much the fast
generator's voltage changes by the effect under the very same current.
"""

from functools import lru_cache, partial

import numpy as np

from virtual_lab import cells
from virtual_lab.hidden.replay import corners, driven
from virtual_lab.hidden.specimen import HiddenCell, made, told
from virtual_lab.plan import seed_of
from virtual_lab.specimens import Physical

CONTACT_OHM = 4e-3
SPREAD = {"contact": 0.1, "kinetics": 0.05, "loss": 0.01}


class HiddenPhysics(HiddenCell):
    """A healthy cell by physics; effects and channel as of the fast cell of the same name."""

    __slots__ = ()

    @property
    def full_ampere_hour(self) -> float:
        """Charge [Ah] of the full cell."""
        return self._physical.full_ampere_hour

    @property
    def _physical(self) -> Physical:
        return Physical(_porous(self.name, self.seed))

    def run(self, steps, *, chamber, initial_soc=1.0):
        """Through a protocol, the effects laid over the voltage."""
        behaviours = self._physical.run(steps, chamber=chamber, initial_soc=initial_soc)
        plain, setup = made(self).plain, self.setup
        if setup.cell is plain.cell:  # only the channel is changed
            return behaviours
        times = [corners(b.duration_second, s) for b, s in zip(behaviours, steps, strict=True)]
        currents = [(t, b.current(t)) for b, t in zip(behaviours, times, strict=True)]
        with_it, without = (
            driven(currents, one.cell, chamber, initial_soc=initial_soc) for one in (setup, plain)
        )
        return [
            b._replace(voltage=partial(_laid_over, b.voltage, more.voltage, less.voltage))
            for b, more, less in zip(behaviours, with_it, without, strict=True)
        ]

    def facts(self, name: str) -> dict[str, list[dict]]:
        """What was hidden, and the open-circuit voltage."""
        curve = self._physical.facts(name)["ocv"]
        return {"missing_effect": [told(self, name)], "ocv": curve}


@lru_cache(maxsize=32)
def _porous(name, seed) -> cells.Cell:
    """A healthy cell: a little of everything differs from cell to cell."""
    random = np.random.default_rng(seed_of(f"porous {name}", seed))
    lli, lam_negative, lam_positive = (SPREAD["loss"] * random.random(3)).tolist()
    return cells.Cell(
        lli,
        lam_negative,
        lam_positive,
        contact_resistance_ohm=CONTACT_OHM * float(np.exp(SPREAD["contact"] * random.normal())),
        kinetics=float(np.exp(SPREAD["kinetics"] * random.normal())),
        capacity_ampere_hour=cells.RATED_CAPACITY_AMPERE_HOUR * (1 - lli),
        cycle=None,
        note="healthy",
    )


def _laid_over(voltage, more, less, second):
    return voltage(second) + more(second) - less(second)
