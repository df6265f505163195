"""What the thesis measured in years: a pack, parallel groups, five types' ageing, the cold.

`plan` puts the parts together; each part is a module of its own.
"""

from virtual_lab.campaigns.thesis import cold, life, pack, parallel, spectra
from virtual_lab.plan import Plan

CONFIG = """# The thesis' own circuits: with all nine members a run would take many hours.
title: The thesis' campaign, from the virtual laboratory
models:
  members: [1RC, 2RC, 2RC+H]
soc:
  filters: [coulomb, aekf]
  initial_soc: []
  scenarios: []
"""
ABOUT = """# What is true in this campaign

Tables without noise, in the columns of the results contract as far as they are defined; see
docs/virtual-laboratory.md. P01 to P50: the cells of one pack (S14, S17, S18). G01 to G34: the cells
of the parallel groups (S20, S21; groups 1 to 8 are those of table 5.2). A1 to E2: ageing (S12, S13,
S16). E3, E4: one cell over temperature (S5 to S10), by the fast equations and by physics. E5: the
circuit of table 3.1. C6: 29 cycles in a room with a daily swing (S4).
"""


def plan(*, seed: int) -> Plan:
    """All tests."""
    parts = [part.tests_and_cells(seed) for part in (pack, parallel, life, cold, spectra)]
    cells = tuple(cell for found, _ in parts for cell in found)
    tests = tuple(test for _, found in parts for test in found)
    return Plan(cells, tests, parallel.groups(seed), CONFIG, ABOUT)
