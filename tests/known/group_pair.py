"""The pair of `group_plant` as branches of the search, and its records."""

from functools import cache

import group_plant
import numpy as np

from cellwright.effects.groups.model import Branch
from cellwright.records.record import record_of

TABLE = np.array([group_plant.ocv(soc) for soc in np.linspace(0.0, 1.0, 401).tolist()])
CELLS = [
    Branch(
        f"c{b}",
        group_plant.CAPACITY[b],
        TABLE,
        (group_plant.R0[b], group_plant.R1[b], group_plant.R2[b]),
        (group_plant.TAU1, group_plant.TAU2),
        group_plant.ENERGY,
        group_plant.WIRE,
        True,
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
