"""Equilibrium potentials of electrode materials, and the voltage window of a cell of two.

Plain numpy. Both generators use these curves, so a cell has the same open-circuit voltage (OCV)
whichever simulates it. State of charge (SoC) here is of the window between the cut-offs at rest
(0: lower, 1: upper).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from virtual_lab.behaviour import Rating


class HalfCell(NamedTuple):
    """An electrode material: potential [V] and dU/dT [V/K] over lithiation [1], and its range."""

    potential_volt: Callable
    entropic_volt_per_kelvin: Callable
    lowest: float
    highest: float


def graphite_siox_volt(x):
    """Graphite with some SiOx of the LG M50; Chen et al., J. Electrochem. Soc. 167, 080534."""
    return (
        0.2482
        + 1.9793 * np.exp(-39.3631 * x)
        - 0.0909 * np.tanh(29.8538 * (x - 0.1234))
        - 0.04478 * np.tanh(14.9159 * (x - 0.2769))
        - 0.0205 * np.tanh(30.4444 * (x - 0.6103))
    )


def graphite_volt(x):
    """Graphite with sharp stages; Mohtat et al., J. Electrochem. Soc. 167 (2020), 110561.

    The last term is ours: the published fit ends at 0.95 V, and no cell would reach its lower
    cut-off when the graphite is empty. It is below 0.1 mV from x = 0.01 on.
    """
    return (
        0.063
        + 0.8 * np.exp(-75 * (x + 0.001))
        - 0.0120 * np.tanh((x - 0.127) / 0.016)
        - 0.0118 * np.tanh((x - 0.155) / 0.016)
        - 0.0095 * np.tanh((x - 0.190) / 0.013)
        - 0.0035 * np.tanh((x - 0.220) / 0.020)
        - 0.0145 * np.tanh((x - 0.490) / 0.020)
        - 0.0800 * np.tanh((x - 1.030) / 0.055)
        + 1.5 * np.exp(-1000 * x)
    )


def graphite_entropy(x):
    """Graphite [V/K]; O'Regan et al., Electrochim. Acta 425 (2022), 140700, their fixed fit."""
    peak = 0.3561 * np.exp(-((x - 0.08309) ** 2) / 0.004616)
    return 1e-3 * (0.02914 - 0.1112 * x + peak)


def nmc811_volt(y):
    """LiNi0.8Mn0.1Co0.1O2 of the LG M50; Chen et al., J. Electrochem. Soc. 167, 080534."""
    return (
        4.4875
        - 0.8090 * y
        - 0.0428 * np.tanh(18.5138 * (y - 0.5542))
        - 17.7326 * np.tanh(15.7890 * (y - 0.3117))
        + 17.5842 * np.tanh(15.9308 * (y - 0.3120))
    )


def nmc811_entropy(y):
    """LiNi0.8Mn0.1Co0.1O2 [V/K]; O'Regan et al., Electrochim. Acta 425 (2022), 140700."""
    low = 0.04006 * np.exp(-((y - 0.2828) ** 2) / 0.0009855)
    high = 0.06656 * np.exp(-((y - 0.8032) ** 2) / 0.02179)
    return 1e-3 * (low - high)


def lfp_volt(y):
    """LiFePO4; Afshar et al., SAE 2017-01-1211 (the one in PyBaMM's Prada2013)."""
    return 3.4077 - 0.020269 * y + 0.5 * np.exp(-150 * y) - 0.9 * np.exp(-30 * (1 - y))


def lmo_volt(y):
    """LiMn2O4 spinel; Doyle et al., J. Electrochem. Soc. 143 (1996), 1890."""
    return (
        4.19829
        + 0.0565661 * np.tanh(8.60942 - 14.5546 * y)
        - 0.0275479 * ((0.998432 - y) ** -0.492465 - 1.90111)
        - 0.157123 * np.exp(-0.04738 * y**8)
        + 0.810239 * np.exp(-40 * (y - 0.133875))
    )


def lmo_entropy(y):
    """LiMn2O4 [V/K]: own form, by the change of OCV with temperature in the thesis (S6).

    A spinel cell gained up to 30 mV at −15 °C below 40 % SoC, lost up to 10 mV above 60 % and
    crossed zero near 50 %; the part of graphite is subtracted.
    """
    emptier_cell = 0.5 * (1 + np.tanh((y - 0.6) / 0.06))
    return 1e-3 * (0.22 - 0.72 * emptier_cell)


def lco_volt(y):
    """LiCoO2; Dualfoil, stretched as by Marquis et al., J. Electrochem. Soc. 166 (2019), A3693."""
    s = 1.062 * y
    return (
        2.16216
        + 0.07645 * np.tanh(30.834 - 54.4806 * s)
        + 2.1581 * np.tanh(52.294 - 50.294 * s)
        - 0.14169 * np.tanh(11.0923 - 19.8543 * s)
        + 0.2051 * np.tanh(1.4684 - 5.4888 * s)
        + 0.2531 * np.tanh((0.56478 - s) / 0.1316)
        - 0.02167 * np.tanh((s - 0.525) / 0.006)
    )


def lco_entropy(y):
    """LiCoO2 [V/K], fitted for 0.43 < y < 0.99; Ai et al., J. Electrochem. Soc. 167, 013512."""
    powers = [0.109667298, -1.30382445, 6.54799331, -17.992018]
    powers += [29.1744564, -27.9047599, 14.5719049, -3.20392657]
    return sum(power * y**k for k, power in enumerate(powers))


def nca_volt(y):
    """LiNi0.8Co0.15Al0.05O2; Kim et al., J. Electrochem. Soc. 158 (2011), A955."""
    powers = [11.8058, -66.3691, 264.427, -554.774, 621.3475, -344.566]
    powers += [81.246, -23.488, 15.056, -2.222, 1.638]
    smooth = sum(power * y**k for k, power in enumerate(powers))
    return smooth - 0.61386 * np.exp(5.8201 * y**136.4)


def no_entropy(sto):
    """Zero entropic coefficient [V/K], for materials whose source gives none."""
    return 0.0 * sto


HALF_CELLS = {
    "graphite_siox": HalfCell(graphite_siox_volt, graphite_entropy, 0.0, 0.9999),
    "graphite": HalfCell(graphite_volt, graphite_entropy, 0.0, 0.9999),
    "nmc811": HalfCell(nmc811_volt, nmc811_entropy, 0.15, 0.9999),
    # Across the two phases the entropy of mixing is constant; what it is, is left at zero.
    "lfp": HalfCell(lfp_volt, no_entropy, 0.0, 0.9999),
    "lmo": HalfCell(lmo_volt, lmo_entropy, 0.13, 0.998),
    "lco": HalfCell(lco_volt, lco_entropy, 0.38, 0.9999),
    "nca": HalfCell(nca_volt, no_entropy, 0.3, 0.9995),
}


class Chemistry(NamedTuple):
    """The two materials of a cell and the ratio of its electrodes.

    `x` and `y`: lithiation [1] of the negative and positive electrode at any two states (emptier
    first); only the ratio of the electrodes and the cyclable lithium are taken from them.
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
    """Lithiation [1] of both electrodes at 0 and 100 % SoC, and their charges [Ah].

    `capacity_ampere_hour` lies between the cut-offs at rest; `negative_ampere_hour` and
    `positive_ampere_hour` are the electrodes' capacities from lithiation 0 to 1.
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
    """Lithiation of both electrodes at the two cut-offs at rest, at 25 °C.

    Parameters
    ----------
    chemistry : a name of CHEMISTRIES.
    rating : its capacity sizes the fresh cell's electrodes, its cut-offs bound the window.
    lli : loss of lithium inventory, a share [1] of the fresh cell's cyclable lithium.
    lam_negative, lam_positive : share [1] of each active material that is lost, with no lithium
        in it (delithiated): only `lli` takes lithium away.

    Raises
    ------
    ValueError : when the electrodes cannot reach a cut-off.
    """
    design = CHEMISTRIES[chemistry]
    # The fresh cell is scaled to the data sheet: without losses all charges are proportional.
    unit = _solved(
        chemistry, rating, design.negative_per_positive, 1.0, design.lithium_per_positive
    )
    scale = design.rest_per_rated * rating.capacity_ampere_hour / unit.capacity_ampere_hour
    fresh = Window(*unit[:4], *(scale * charge for charge in unit[4:]))
    negative = fresh.negative_ampere_hour * (1 - lam_negative)
    positive = fresh.positive_ampere_hour * (1 - lam_positive)
    lithium = design.lithium_per_positive * fresh.positive_ampere_hour * (1 - lli)
    return _solved(chemistry, rating, negative, positive, lithium)


def open_circuit_volt(chemistry: str, window: Window, soc):
    """Equilibrium voltage [V] at 25 °C over the window's state of charge [1]."""
    negative, positive, x, y = _electrodes_at(chemistry, window, soc)
    return positive.potential_volt(y) - negative.potential_volt(x)


def entropic_volt_per_kelvin(chemistry: str, window: Window, soc):
    """Entropic coefficient dOCV/dT [V/K] over the window's state of charge [1]."""
    negative, positive, x, y = _electrodes_at(chemistry, window, soc)
    return positive.entropic_volt_per_kelvin(y) - negative.entropic_volt_per_kelvin(x)


def _electrodes_at(chemistry, window, soc):
    """Materials of the negative and positive electrode, and their lithiation [1]."""
    design = CHEMISTRIES[chemistry]
    return HALF_CELLS[design.negative], HALF_CELLS[design.positive], *lithiation(window, soc)


def lithiation(window: Window, soc):
    """Lithiation [1] of the negative and of the positive electrode at a state of charge [1]."""
    soc = np.asarray(soc)
    x = window.x_0 + soc * (window.x_100 - window.x_0)
    y = window.y_0 + soc * (window.y_100 - window.y_0)
    return x, y


def usual_rating(chemistry: str, capacity_ampere_hour: float) -> Rating:
    """A data sheet of a capacity [Ah] with the chemistry's usual cut-offs [V]."""
    return Rating(capacity_ampere_hour, *CHEMISTRIES[chemistry].cutoffs_volt)


def _solved(chemistry, rating, negative, positive, lithium):
    ends = []
    for volt in (rating.lower_cutoff_volt, rating.upper_cutoff_volt):
        x = _negative_at(CHEMISTRIES[chemistry], volt, negative, positive, lithium)
        ends.append((x, (lithium - x * negative) / positive))
    (x_0, y_0), (x_100, y_100) = ends
    return Window(x_0, x_100, y_0, y_100, negative * (x_100 - x_0), negative, positive)


def _negative_at(design, volt, negative, positive, lithium):
    """Lithiation [1] of the negative electrode at which the rested cell has a voltage [V]."""
    of_negative, of_positive = HALF_CELLS[design.negative], HALF_CELLS[design.positive]

    def excess(x):
        y = (lithium - x * negative) / positive
        return of_positive.potential_volt(y) - of_negative.potential_volt(x) - volt

    low = max(of_negative.lowest, (lithium - of_positive.highest * positive) / negative)
    high = min(of_negative.highest, (lithium - of_positive.lowest * positive) / negative)
    if low >= high or excess(low) > 0 or excess(high) < 0:
        raise ValueError(f"no lithiation gives {volt} V: too much lithium or material is lost")
    return brentq(excess, low, high, xtol=1e-13)
