"""Two electrodes against each other: where they stand, and what a rested cell therefore shows.

Shared by both generators, so that a cell shows one open-circuit voltage whoever simulates it.
State of charge here is of the window between the cut-offs at rest (0: lower, 1: upper).
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from virtual_lab.half_cells import HALF_CELLS
from virtual_lab.rating import Rating


class Chemistry(NamedTuple):
    """Materials of a cell and how its maker balanced them.

    `x` and `y`: lithiation [1] of the negative and positive electrode at any two states (emptier
    first); only what they say of the ratio of the electrodes and of the lithium is used.
    `rest_per_rated`: charge [1] between the cut-offs at rest over that of the data sheet.
    """

    negative: str
    positive: str
    x: tuple[float, float]
    y: tuple[float, float]
    cutoffs_volt: tuple[float, float]
    rest_per_rated: float

    @property
    def negative_per_positive(self) -> float:
        """Capacity of the negative electrode over that of the positive [1]."""
        return (self.y[0] - self.y[1]) / (self.x[1] - self.x[0])

    @property
    def lithium_per_positive(self) -> float:
        """Cyclable lithium [1] over the positive electrode's capacity."""
        return self.y[1] + self.negative_per_positive * self.x[1]


class Window(NamedTuple):
    """Lithiation [1] of both electrodes at 0 and 100 % and the charges [Ah] that belong to it.

    `capacity_ampere_hour` lies between the cut-offs at rest; `negative_ampere_hour` and
    `positive_ampere_hour` are what the electrodes would hold from 0 to 1.
    """

    x_0: float
    x_100: float
    y_0: float
    y_100: float
    capacity_ampere_hour: float
    negative_ampere_hour: float
    positive_ampere_hour: float


CHEMISTRIES = {
    # LG M50 as Chen et al. 2020 built it; the numbers are PyBaMM's solution for its set OKane2022.
    "NMC": Chemistry(
        "graphite_siox", "nmc811",
        x=(0.02634579027064577, 0.9106180466524094), y=(0.853974674630047, 0.2638452245913298),
        cutoffs_volt=(2.5, 4.2), rest_per_rated=1.0306396652263882,
    ),
    # A123 26650 after Prada et al. 2013, initial state of PyBaMM's set.
    "LFP": Chemistry("graphite_siox", "lfp", (0.0176, 0.81), (0.95, 0.0038), (2.0, 3.6), 1.03),
    # Graphite to spare: its stages then meet the spinel's two plateaus so that dQ/dV has the four
    # peaks which the thesis saw near 3.75, 3.90, 4.02 and 4.07 V (S9).
    "LMO": Chemistry("graphite", "lmo", (0.01, 0.65), (0.99, 0.17), (3.0, 4.2), 1.02),
    "LCO": Chemistry("graphite", "lco", (0.01, 0.80), (0.98, 0.44), (3.0, 4.2), 1.02),
    "NCA": Chemistry("graphite", "nca", (0.01, 0.80), (0.97, 0.36), (2.7, 4.2), 1.02),
}  # fmt: skip


def window(
    chemistry: str,
    rating: Rating,
    *,
    lli: float = 0.0,
    lam_negative: float = 0.0,
    lam_positive: float = 0.0,
) -> Window:
    """Where the electrodes of a cell stand at both cut-offs at rest, at 25 °C.

    Parameters
    ----------
    chemistry : a name of CHEMISTRIES.
    rating : its capacity sizes the fresh cell's electrodes, its cut-offs bound the window.
    lli : share [1] of the fresh cell's cyclable lithium that is lost.
    lam_negative, lam_positive : share [1] of each active material that is lost, with no lithium
        in it (delithiated): only `lli` takes lithium away.

    Raises
    ------
    ValueError : when the electrodes cannot reach a cut-off.
    """
    made, fresh = CHEMISTRIES[chemistry], _fresh(chemistry, rating)
    negative = fresh.negative_ampere_hour * (1 - lam_negative)
    positive = fresh.positive_ampere_hour * (1 - lam_positive)
    lithium = made.lithium_per_positive * fresh.positive_ampere_hour * (1 - lli)
    return _solved(chemistry, rating, negative, positive, lithium)


def open_circuit_volt(chemistry: str, window: Window, soc):
    """Equilibrium voltage [V] at 25 °C over the window's state of charge [1]."""
    made = CHEMISTRIES[chemistry]
    x, y = lithiation(window, soc)
    positive, negative = HALF_CELLS[made.positive], HALF_CELLS[made.negative]
    return positive.potential_volt(y) - negative.potential_volt(x)


def entropic_volt_per_kelvin(chemistry: str, window: Window, soc):
    """Entropic coefficient dOCV/dT [V/K] over the window's state of charge [1]."""
    made = CHEMISTRIES[chemistry]
    x, y = lithiation(window, soc)
    positive, negative = HALF_CELLS[made.positive], HALF_CELLS[made.negative]
    return positive.entropic_volt_per_kelvin(y) - negative.entropic_volt_per_kelvin(x)


def lithiation(window: Window, soc):
    """Lithiation [1] of the negative and of the positive electrode at a state of charge [1]."""
    soc = np.asarray(soc)
    x = window.x_0 + soc * (window.x_100 - window.x_0)
    y = window.y_0 + soc * (window.y_100 - window.y_0)
    return x, y


def rating_of(chemistry: str, capacity_ampere_hour: float) -> Rating:
    """A data sheet of a capacity [Ah] with the chemistry's usual cut-offs."""
    return Rating(capacity_ampere_hour, *CHEMISTRIES[chemistry].cutoffs_volt)


def _fresh(chemistry, rating):
    """The window scaled to the data sheet: without losses everything is proportional."""
    made = CHEMISTRIES[chemistry]
    unit = _solved(chemistry, rating, made.negative_per_positive, 1.0, made.lithium_per_positive)
    scale = made.rest_per_rated * rating.capacity_ampere_hour / unit.capacity_ampere_hour
    return Window(*unit[:4], *(scale * charge for charge in unit[4:]))


def _solved(chemistry, rating, negative, positive, lithium):
    ends = []
    for volt in (rating.lower_cutoff_volt, rating.upper_cutoff_volt):
        x = _negative_at(CHEMISTRIES[chemistry], volt, negative, positive, lithium)
        ends.append((x, (lithium - x * negative) / positive))
    (x_0, y_0), (x_100, y_100) = ends
    return Window(x_0, x_100, y_0, y_100, negative * (x_100 - x_0), negative, positive)


def _negative_at(made, volt, negative, positive, lithium):
    """Lithiation of the negative electrode at which the rested cell shows a voltage."""
    of_negative, of_positive = HALF_CELLS[made.negative], HALF_CELLS[made.positive]

    def excess(x):
        y = (lithium - x * negative) / positive
        return of_positive.potential_volt(y) - of_negative.potential_volt(x) - volt

    low = max(of_negative.lowest, (lithium - of_positive.highest * positive) / negative)
    high = min(of_negative.highest, (lithium - of_positive.lowest * positive) / negative)
    if low >= high or excess(low) > 0 or excess(high) < 0:
        raise ValueError(f"no lithiation gives {volt} V: too much lithium or material is lost")
    return brentq(excess, low, high, xtol=1e-13)
