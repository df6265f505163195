"""The pair of `group_plant` as branches of the search, and its records."""

from functools import cache

import group_plant
import numpy as np

from cellwright.effects.groups.branch import Branch
from cellwright.effects.library.thermal import BESIDE, ENERGY, WARMED
from cellwright.records.record import record_of

TABLE = np.array([group_plant.ocv(soc) for soc in np.linspace(0.0, 1.0, 401).tolist()])
CELLS = [
    Branch(
        f"c{b}",
        group_plant.CAPACITY[b],
        TABLE,
        (group_plant.R0[b], group_plant.R1[b], group_plant.R2[b]),
        (group_plant.TAU1, group_plant.TAU2),
        ((WARMED, BESIDE | {ENERGY: group_plant.ENERGY}),),
        wire_ohm=group_plant.WIRE,
        own=True,
    )
    for b in range(2)
]


measured = cache(group_plant.measured)


def record(name, seed, *, currents=True, celsius=25.0, **hidden):
    """Record of the pair with hidden effects, with or without branch currents."""
    time, total, volt, read = measured(seed, celsius=celsius, **hidden)
    read = read if currents else None
    columns = record_of(time, total, volt, np.nan, test=name, celsius=celsius)
    return columns._replace(member_current_ampere=read)


WHOLE = group_plant.Whole(excess=14e3, exponent=0.7, slow_ohm=0.008)


def whole_cells():
    """The pair with all that `WHOLE` has."""
    warmed = {
        ENERGY: group_plant.ENERGY,
        "polarisation_excess_joule_per_mole": WHOLE.excess,
        "time_constant_exponent": WHOLE.exponent,
    }
    slow = {
        "resistance_ohm": WHOLE.slow_ohm,
        "time_constant_second": WHOLE.slow_second,
        "log_diffusivity_to_full": 0.0,
        "finite_length": 0.0,
    }
    effects = ((WARMED, BESIDE | warmed), ("slow_diffusion", slow))
    return [cell._replace(effects=effects) for cell in CELLS]
