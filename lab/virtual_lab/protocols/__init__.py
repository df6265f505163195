"""Test protocols: lists of steps that a cycler is told to do. Current positive on charge.

C-rates refer to the rating of the data sheet; where a protocol takes out a share of the charge, it
is of the capacity that the laboratory has measured, which the caller gives.
"""

from virtual_lab.protocols.capacities import (
    AGEING,
    ageing_cycle,
    ageing_cycles,
    capacity,
    fast_charge,
    group_capacity,
    incremental_capacity,
)
from virtual_lab.protocols.drives import drive, dynamic_load, group_drive, pair, series_drive
from virtual_lab.protocols.pulses import (
    hybrid_pulses,
    hybrid_pulses_below_full,
    pulses_at_rest,
    pulses_on_discharge,
    relaxations,
    slow_ocv,
    temperature_steps,
)
from virtual_lab.protocols.steps import HOUR, MINUTE, Step, charge, discharge, draw, hold, rest

__all__ = [
    "AGEING",
    "HOUR",
    "MINUTE",
    "Step",
    "ageing_cycle",
    "ageing_cycles",
    "capacity",
    "charge",
    "discharge",
    "draw",
    "drive",
    "dynamic_load",
    "fast_charge",
    "group_capacity",
    "group_drive",
    "hold",
    "hybrid_pulses",
    "hybrid_pulses_below_full",
    "incremental_capacity",
    "pair",
    "pulses_at_rest",
    "pulses_on_discharge",
    "relaxations",
    "rest",
    "series_drive",
    "slow_ocv",
    "temperature_steps",
]
