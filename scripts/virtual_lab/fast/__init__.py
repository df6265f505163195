"""The fast generator: behavioural cells by their own equations, alone or in parallel.

fast.run(steps, fast.Cell(...), chamber=steady(25.0)) gives one Behaviour per step.
"""

from virtual_lab.fast.cell import Cell
from virtual_lab.fast.generator import GRID, Grid, run, run_changing, run_group
from virtual_lab.fast.known import resistances, rested_volt
from virtual_lab.fast.spectrum import impedance

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
