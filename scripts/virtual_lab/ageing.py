"""How the thesis' five types of cell aged under its three protocols: state over cycles.

The thesis (4.3: tables 4.1, 4.2, figures 4.8 to 4.15) tells capacities and resistances at some
cycles; between them run monotone cubics. What it cannot tell is which losses lie behind them:
ASSUME the split of `Kind`; the lithium lost is then what gives the told capacity at rest, so that
peaks of dQ/dV and plateaus move as electrodes that have lost this much must move them.

A cell may gain capacity at first (0.5 % in 200 cycles, NCM): lithium that comes back from the
negative electrode's overhang, a negative `lli`.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from virtual_lab import electrodes
from virtual_lab.rating import Rating

PROTOCOLS = ("standard", "high_power", "fast_charge")


class Ageing(NamedTuple):
    """State of a cell: losses [1] of the fresh cell's lithium and materials, as `electrodes.window`
    takes them; factors [1] on its ohmic resistance and on its exchange-current densities."""

    lli: float
    lam_negative: float
    lam_positive: float
    resistance_factor: float
    kinetics: float


class Kind(NamedTuple):
    """A type of cell: data sheet, what a fresh one gave [Ah], its ohmic resistance, its losses.

    Material lost per capacity lost [1], beginning at a first loss of capacity `lam_after` [1].
    """

    chemistry: str
    rating: Rating
    fresh_ampere_hour: float
    fresh_ohm: float
    lam_negative_per_loss: float
    lam_positive_per_loss: float
    lam_after: float = 0.0


# Fresh resistances: C from "four times larger (8 mOhm)", E from table 3.1; ASSUME the others.
# LFP loses lithium only at first: that shortens the plateau of full graphite, the thesis' first
# 10 % (figures 4.15, 4.17); then graphite too, which shortens the next one.
KINDS = {
    "A": Kind("LFP", Rating(1.2, 2.5, 3.65), 1.2, 0.040, 0.8, 0.0, 0.08),
    "B": Kind("LFP", Rating(5.0, 2.0, 3.65), 5.0, 0.008, 0.8, 0.0, 0.08),
    "C": Kind("NMC", Rating(20.0, 3.0, 4.15), 19.56, 0.002, 0.4, 0.5),
    "D": Kind("NMC", Rating(30.0, 3.0, 4.05), 29.5, 0.0015, 0.4, 0.5),
    "E": Kind("LMO", Rating(32.0, 2.5, 4.2), 32.0, 0.002, 0.3, 0.6),
}


class Law(NamedTuple):
    """Points of a life: cycle, capacity and resistance over the fresh one's [1]; the knee, if any.

    Between the points nothing is known; after the last one the cell was taken off.
    """

    points: tuple[tuple[float, float, float], ...]
    knee_cycle: float | None


LAWS = {
    # Figures 4.10, 4.11: the rise ends at 200 cycles, 300: as fresh, 1200: 16 Ah, 1250: 9 Ah;
    # 2.0 mΩ until 900, 2.2 at 1100, 2.6 at 1200, 8 at 1250. 900 and 1100 in between: ASSUME.
    ("C", "standard"): Law(
        (
            (0, 1.0, 1.0), (200, 1.005, 1.001), (300, 1.0, 1.002), (900, 0.900, 1.01),
            (1100, 0.848, 1.1), (1200, 16 / 19.56, 1.3), (1250, 9 / 19.56, 4.0),
        ),
        1200,
    ),
    # Figures 4.8, 4.9: 19.56, 19.66, 18.55 Ah at 0, 200, 1300; resistance "similar".
    ("C", "high_power"): Law(
        ((0, 1.0, 1.0), (200, 19.66 / 19.56, 1.001), (1300, 18.55 / 19.56, 1.05)), None
    ),
    # Figure 4.12: the pattern of the standard test, the drop around 300, 330 and 370 cycles in all.
    ("C", "fast_charge"): Law(
        (
            (0, 1.0, 1.0), (50, 1.003, 1.001), (80, 1.0, 1.002), (225, 0.915, 1.02),
            (275, 0.860, 1.1), (300, 0.830, 1.3), (350, 0.50, 4.0),
        ),
        300,
    ),
    # Figures 4.14, 4.15: 95, 92, 83 % at 300, 500, 900; drop at 850; 1200 in all. The resistance
    # is not told: ASSUME, here and below.
    ("B", "standard"): Law(
        (
            (0, 1.0, 1.0), (300, 0.95, 1.02), (500, 0.92, 1.05), (850, 0.860, 1.12),
            (900, 0.83, 1.16), (1200, 0.62, 1.6),
        ),
        850,
    ),
    # 650 cycles of a steady decline whose size is not told.
    ("A", "standard"): Law(((0, 1.0, 1.0), (300, 0.93, 1.03), (650, 0.85, 1.10)), None),
    # Used cells: 80 % within 150 (D) and 200 cycles (E); high power of E drops after 100.
    ("D", "standard"): Law(((0, 1.0, 1.0), (75, 0.91, 1.05), (150, 0.80, 1.2)), None),
    ("E", "standard"): Law(
        ((0, 1.0, 1.0), (100, 0.905, 1.05), (200, 0.80, 1.15), (400, 0.60, 1.6)), None
    ),
    ("E", "high_power"): Law(
        ((0, 1.0, 1.0), (50, 0.96, 1.03), (100, 0.91, 1.1), (150, 0.70, 1.6)), 100
    ),
}  # fmt: skip
# Not tested in the thesis. ASSUME: fast charge wears a cell out in a quarter of the cycles, as it
# did C (300 of 1200), and high power in as many as the standard test.
PACE = {"standard": 1.0, "high_power": 1.0, "fast_charge": 0.25}


def state(kind: str, protocol: str, cycle: float) -> Ageing:
    """State of a cell of a type (A to E) after so many equivalent full cycles of a protocol."""
    share = capacity_share(kind, protocol, cycle)
    made = KINDS[kind]
    lost = max(0.0, 1 - share - made.lam_after)
    lams = {
        "lam_negative": made.lam_negative_per_loss * lost,
        "lam_positive": made.lam_positive_per_loss * lost,
    }
    factor = _value(kind, protocol, cycle, column=2)
    # ASSUME: charge transfer slows with the root of the ohmic growth.
    return Ageing(_lithium_lost(made, share, **lams), **lams, resistance_factor=factor,
                  kinetics=factor**-0.5)  # fmt: skip


def capacity_share(kind: str, protocol: str, cycle: float) -> float:
    """Capacity [1] after so many cycles over that of the fresh cell."""
    return _value(kind, protocol, cycle, column=1)


def knee_cycle(kind: str, protocol: str) -> float | None:
    """Cycle after which capacity falls steeply; None where it does not."""
    return law(kind, protocol).knee_cycle


def last_cycle(kind: str, protocol: str) -> float:
    """Cycle at which the cell was taken off; there is no state beyond."""
    return law(kind, protocol).points[-1][0]


def law(kind: str, protocol: str) -> Law:
    """What is told of a type under a protocol, or its standard law at the protocol's pace."""
    if (kind, protocol) in LAWS:
        return LAWS[kind, protocol]
    pace, told = PACE[protocol], LAWS[kind, "standard"]
    points = tuple((pace * cycle, *rest) for cycle, *rest in told.points)
    return Law(points, None if told.knee_cycle is None else pace * told.knee_cycle)


def _value(kind, protocol, cycle, *, column) -> float:
    last = last_cycle(kind, protocol)
    if not 0 <= cycle <= last:
        raise ValueError(f"{kind} under {protocol} lived 0 to {last:g} cycles, asked: {cycle:g}")
    return float(_curve(kind, protocol, column)(cycle))


@cache
def _curve(kind, protocol, column):
    points = np.array(law(kind, protocol).points)
    return PchipInterpolator(points[:, 0], points[:, column])


def _lithium_lost(made, share, **lams) -> float:
    fresh = electrodes.window(made.chemistry, made.rating).capacity_ampere_hour

    def excess(lli):
        try:
            left = electrodes.window(made.chemistry, made.rating, lli=lli, **lams)
        except ValueError:  # more lithium than the rest of the graphite takes: too little lost
            return 1.0
        return left.capacity_ampere_hour / fresh - share

    found = float(brentq(excess, -0.02, 0.7, xtol=1e-10))
    if abs(excess(found)) > 1e-6:
        raise ValueError(f"the material lost alone takes more than leaves {share:.3f} of capacity")
    return found
