"""The fast generator: equivalent-circuit cells by their own equations, alone or in parallel.

fast.run(steps, fast.Cell(...), chamber=steady(25.0)) gives one Behaviour per step.
"""

from virtual_lab.fast.parameters import Cell
from virtual_lab.fast.run import (
    GRID,
    Grid,
    impedance,
    resistances,
    rested_volt,
    run,
    run_changing,
    run_group,
)

__all__ = [
    "GRID",
    "Cell",
    "Grid",
    "impedance",
    "resistances",
    "rested_volt",
    "run",
    "run_changing",
    "run_group",
]
