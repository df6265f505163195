"""A simulator of one cell in a plain loop, which shares no code with the model that is fitted.

Two RC pairs on fine steps; hidden effects are set by their sizes (`Truth`).
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from cellwright.effects import base, finding
from cellwright.effects.case import Case
from cellwright.effects.library import LIBRARY
from cellwright.effects.records import stacked
from cellwright.records.record import record_of

CAPACITY = 2.5  # [Ah]
FINE_SECOND, ROW_SECOND = 0.5, 2.0
NOISE_VOLT = 1.5e-3
KELVIN, GAS = 273.15, 8.314462618
THERMAL_VOLT = 0.0257  # RT/F at 25 °C
OWN_HEAT = 30e3  # activation energy by which a warm core shows itself [J/mol]


class Truth(NamedTuple):
    """Hidden effects of a cell; all zero: it is healthy."""

    activation: float = 0.0  # of resistances [J/mol]
    following: float = 0.0  # power of their factor over temperature that is in time constants
    hysteresis: float = 0.0  # sign of the last load [V]
    slow_ohm: float = 0.0  # third RC pair, of 1000 s
    particle: float = 0.0  # radius squared over diffusivity of all particles; 0: no gradient [s]
    thermal: float = 0.0  # core over surface [K/W], 400 s
    delay: float = 0.0  # of the voltage reading [s], steps of 0.5 s
    leak: float = 0.0  # current that passes the ammeter by, half full [A]
    leak_to_full: float = 0.0  # its logarithm from empty to full
    offset: float = 0.0  # of the ammeter [A]
    falling: float = 0.0  # logarithm of R0 from full to empty
    asymmetry: float = 0.0  # of R0 on charge, relative
    asymmetry_full: float = 0.0  # more of it where full than half full
    asymmetry_r1: float = 0.0  # of R1 on charge, relative
    wave: float = 0.0  # of the OCV over its table [V]
    entropy: float = 0.0  # of a wave of the entropic coefficient over SoC [V/K]
    slope_r1: float = 0.0  # logarithm of R1 and R2 from full to empty
    bend_r1: float = 0.0  # the same of R1 alone
    ripple: float = 0.0  # of the OCV over SoC, which no effect of the library explains [V]
    contact: float = 0.0  # resistance above 1C, which none explains either [ohm]
    drift: float = 0.0  # of R0 in each hour of a test, relative, nor this
    settling: float = 0.0  # time constant with which it drifts by that instead; 0: steadily [s]
    exchange: float = 0.0  # current of charge transfer half full; 0: none [A]
    charge: float = 0.5  # its transfer coefficient of charge
    ramps: bool = False  # between rows the current moves on a straight line, else it waits


HEALTHY = Truth()


def ocv(soc):
    """OCV of the table [V]."""
    return 3.35 + 0.75 * soc + 0.06 * np.sin(7 * soc) - 0.2 * np.exp(-np.maximum(soc, 0) / 0.04)


def entropic(soc, truth):
    """Entropic coefficient [V/K]."""
    return truth.entropy * np.sin(2 * np.pi * soc)


CELL = base.Cell(CAPACITY, ocv(np.linspace(0.0, 1.0, 201)))


def transfer_volt(load, soc, truth):
    """Butler–Volmer by bisection [V]; the exchange current goes with the root of z·(1 − z)."""
    over = load / (truth.exchange * 2 * np.sqrt(max(soc * (1 - soc), 0.02)))
    low, high = -20.0, 20.0
    for _ in range(40):
        x = (low + high) / 2
        above = np.exp(truth.charge * x) - np.exp((truth.charge - 1) * x) > over
        low, high = (low, x) if above else (x, high)
    return THERMAL_VOLT * x


def drifted(second, truth):
    """Factor of the ohmic resistance so long after a test began."""
    hour = second / 3600
    course = -np.expm1(-second / truth.settling) if truth.settling else hour
    return 1 + truth.drift * course


SHELLS = 50
EDGES = np.linspace(0.0, 1.0, SHELLS + 1)  # over the radius
SHELL = np.diff(EDGES**3) / 3  # volumes


def evened(shells, load, truth):
    """Filling of a particle's shells after a step, and at its surface: finite volumes [1]."""
    inflow = load / (3600 * CAPACITY) * truth.particle / 3  # gradient at the surface
    between = np.diff(shells) * SHELLS * EDGES[1:-1] ** 2
    change = np.diff(np.r_[0.0, between, inflow]) / SHELL
    shells = shells + FINE_SECOND / truth.particle * change
    return shells, shells[-1] + inflow / (2 * SHELLS)


def simulated(current, celsius, soc, truth):
    """Voltage [V] on fine steps under the true current [A]; rest before."""
    r0, r1, r2 = 0.026, 0.011, 0.013
    a3, ah = (-np.expm1(-FINE_SECOND / tau) for tau in (1000, 400))
    v1 = v2 = v3 = rise = 0.0
    side, charge = float(soc > 0.9), soc
    volts, socs = np.empty(len(current)), np.empty(len(current))
    leads, shells = np.zeros(len(current)), np.full(SHELLS, soc)
    kelvin = celsius + KELVIN
    outside = np.exp(truth.activation / GAS * (1 / kelvin - 1 / (25 + KELVIN)))
    late = outside**truth.following
    a1, a2 = (-np.expm1(-FINE_SECOND / (tau * late)) for tau in (9.0, 150.0))
    for k, (load, now) in enumerate(zip(current.tolist(), kelvin.tolist(), strict=True)):
        factor = outside[k] * np.exp(OWN_HEAT / GAS * (1 / (now + rise) - 1 / now))
        slow = factor * np.exp(truth.slope_r1 * (0.5 - charge))
        ohmic = r0 * factor * np.exp(truth.falling * (0.5 - charge)) * load
        ohmic *= 1 + (truth.asymmetry + truth.asymmetry_full * (2 * charge - 1)) * (load > 0)
        ohmic *= drifted(k * FINE_SECOND, truth)
        ohmic += truth.contact * load * (abs(load) > CAPACITY)
        ohmic += transfer_volt(load, charge, truth) if truth.exchange else 0.0
        if abs(load) > CAPACITY / 100:
            side = np.sign(load)
        volts[k] = ohmic + v1 + v2 + v3 + truth.hysteresis * side
        socs[k] = charge
        heat = load * (ohmic + v1 + v2)
        leak = truth.leak * np.exp(truth.leak_to_full * (charge - 0.5))
        charge += (load - leak) * FINE_SECOND / 3600 / CAPACITY
        if truth.particle:
            shells, surface = evened(shells, load, truth)
            leads[k] = surface - charge
        bent = np.exp(truth.bend_r1 * (0.5 - charge)) * (1 + truth.asymmetry_r1 * (load > 0))
        v1 += a1[k] * (slow * bent * r1 * load - v1)
        v2 += a2[k] * (slow * r2 * load - v2)
        v3 += a3 * (truth.slow_ohm * load - v3)
        rise += ah * (truth.thermal * heat - rise)
    wave = truth.wave * np.cos(np.pi * socs) + truth.ripple * np.sin(300 * socs)
    warmed = entropic(socs, truth) * (celsius - 25)
    return volts + ocv(socs + leads) + 4e-4 * np.sin(5 * socs + 1) + wave + warmed


def measured(test, rows, celsius, soc, truth=None, *, seed, kind="drive", every=ROW_SECOND):
    """A record of a commanded current [A], one row every so many seconds."""
    truth, random = truth or Truth(), np.random.default_rng(seed)
    fine = round(every / FINE_SECOND)
    warm = celsius + 0.3 * np.sin(np.arange(len(rows)) / 300.0)
    current = np.repeat(rows, fine)
    if truth.ramps:
        current = np.interp(np.arange(len(current)) / fine, np.arange(len(rows)), rows)
    volts = simulated(current, np.repeat(warm, fine), soc, truth)
    at = np.maximum(fine * np.arange(len(rows)) - round(truth.delay / FINE_SECOND), 0)
    read = volts[at] + NOISE_VOLT * random.normal(size=len(rows))
    clock = every * np.arange(len(rows))
    return record_of(clock, rows + truth.offset, read, soc, test=test, kind=kind, celsius=warm)


def drive(seed, *, rows=1300, highest=1.2):
    """Random loads of 20 s, a minute's rest first, ten minutes' rest every half hour [A]."""
    random = np.random.default_rng(seed)
    current = np.repeat(random.uniform(-2.4, highest, rows // 10), 10) * CAPACITY
    row = np.arange(len(current))
    current[(row % 750 > 440) | (row < 30)] = 0.0
    return current


def slow_discharge(rows=1500):
    """Rest, C/1.2 down by four fifths, rest [A]."""
    return np.r_[np.zeros(30), np.full(rows - 430, -CAPACITY / 1.2), np.zeros(400)]


def case_of(truth, *, seed=1, celsius=(8.0, 34.0), every=ROW_SECOND, **changes):
    """A discharge and two drives to fit, two drives of other loads to judge. changes: of Case."""
    cold, warm = celsius
    middle = (cold + warm) / 2

    fit = [
        measured(
            "slow",
            slow_discharge(),
            middle,
            1.0,
            truth,
            every=every,
            seed=10 * seed,
            kind="capacity",
        ),
        measured("cold", drive(101), cold, 0.95, truth, every=every, seed=10 * seed + 1),
        measured("warm", drive(102), warm, 0.95, truth, every=every, seed=10 * seed + 2),
    ]
    judging = [
        measured(
            "wild", drive(103, highest=1.6), cold, 0.95, truth, every=every, seed=10 * seed + 3
        ),
        measured(
            "mild", drive(104, highest=0.9), warm, 0.95, truth, every=every, seed=10 * seed + 4
        ),
    ]
    return laid(fit, judging)._replace(**changes)


def laid(fit, judging, **options):
    """Case of records."""
    both = [stacked(side, capacity_ampere_hour=CAPACITY, **options) for side in (fit, judging)]
    return Case(CELL, *both)


@cache
def case(truth, **options):
    """As `case_of`, made once."""
    return case_of(truth, **options)


@cache
def searched(truth, *, without=(), **options):
    """(Search, Outcome, Fitted) of a search of such a case, made once, by the library without some
    of its effects."""
    library = {name: effect for name, effect in LIBRARY.items() if name not in without}
    return finding.searched(case(truth, **options), library)[:3]


def names_of(result):
    """Ids of the names of an Outcome; none where something is unknown."""
    return [one.effect.id for one in result.names if result.word in ("named", "ambiguous")]
