"""Cells simulated by porous-electrode physics (PyBaMM), and those of the demo campaign.

The demo's cells are one type of 21700 cell, fresh and aged in stated ways: the LG M50 (5 Ah,
NMC811 against graphite-SiOx) as parameterised by Chen et al. (J. Electrochem. Soc. 167, 2020,
080534) and given temperature dependence by O'Kane et al. (Phys. Chem. Chem. Phys. 24, 2022, 7909),
the set `OKane2022` of PyBaMM. PyBaMM is loaded only by the modules of this folder.
"""

import os
from typing import NamedTuple

from virtual_lab.behaviour import Rating

# PyBaMM must not send telemetry; the modules of this folder, which load it, come after this.
os.environ["PYBAMM_DISABLE_TELEMETRY"] = "true"

RATED_CAPACITY_AMPERE_HOUR = 5.0
LOWER_CUTOFF_VOLT = 2.5
UPPER_CUTOFF_VOLT = 4.2
# Two OCV branches of LFP 20 mV apart (Dreyer et al., Nature Materials 9, 2010, 448).
# ASSUME: a change of branch is two thirds done after a twentieth of the capacity.
LFP_HALF_GAP_VOLT = 0.010
LFP_DECAY = 40.0
DEMO_RATING = Rating(RATED_CAPACITY_AMPERE_HOUR, LOWER_CUTOFF_VOLT, UPPER_CUTOFF_VOLT)


class Cell(NamedTuple):
    """Differences of a cell from a fresh one of its type.

    Losses are fractions of the fresh cell's lithium inventory (`lli`) and active material
    (`lam_negative`, `lam_positive`). `kinetics` multiplies both exchange-current densities.
    `capacity_ampere_hour` is what the laboratory takes for the cell's capacity when it sets the
    charge between two pulses; `cycle` is the number of equivalent full cycles that the cell has
    made. `chemistry` is one of `electrodes.CHEMISTRIES`, `rating` its data sheet. `entropy` is the
    share of the published entropic coefficients that the cell has: those of the demo have none.
    """

    lli: float
    lam_negative: float
    lam_positive: float
    contact_resistance_ohm: float
    kinetics: float
    capacity_ampere_hour: float
    cycle: int | None
    note: str
    chemistry: str = "NMC"
    rating: Rating = DEMO_RATING
    entropy: float = 0.0


DEMO_CELLS = {
    "C1": Cell(0.0, 0.0, 0.0, 0.004, 1.0, 5.0, None, "fresh"),
    "C2": Cell(0.12, 0.05, 0.05, 0.008, 0.75, 4.21, 600, "aged by cycling"),
    "C3": Cell(0.09, 0.08, 0.15, 0.018, 0.9, 4.64, 250, "odd: high resistance, worn cathode"),
    "C4": Cell(0.06, 0.03, 0.02, 0.006, 0.9, 4.6, 300, "aged; never pulsed, no slow OCV"),
    "C5": Cell(0.03, 0.05, 0.06, 0.012, 0.85, 4.8, 150, "lightly aged"),
}
