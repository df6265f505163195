"""A parallel group for tests, by equations of its own: the branches' charges and relaxations as one
linear system in time, integrated in fine steps of held currents; none of the product's code."""

import math
from typing import NamedTuple

import numpy as np

SECOND, FINE = 2.0, 0.2


def ocv(soc):
    """OCV of all cells at one SoC [V]."""
    return 3.3 + 0.75 * soc - 0.08 * math.exp(-12.0 * soc) + 0.03 * math.sin(5.0 * soc)


def load(seed, hours=0.5):
    """Total current, one value every SECOND [A]: rest, then pulses, mostly discharge, then rest."""
    random = np.random.default_rng(seed)
    rest, tail = np.zeros(60), np.zeros(60)
    pulses = np.repeat(random.choice([-16.0, -10.0, -6.0, -3.0, 0.0, 5.0], int(hours * 120)), 15)
    return np.concatenate([rest, pulses, tail])


def plant(total, r0, pairs, capacity, soc):
    """Branch currents (n, b) and voltage (n,) under a total held between samples.

    pairs : of each branch a list of (resistance, time constant).
    """
    cells = [[z, *[0.0] * len(of)] for z, of in zip(soc, pairs, strict=True)]
    rates = [FINE / 3600.0 / q for q in capacity]
    gone = [[(1.0 - math.exp(-FINE / tau), r) for r, tau in of] for of in pairs]
    flow = [1.0 / r for r in r0]
    all_flow = sum(flow)
    current, volt = np.empty((len(total), len(r0))), np.empty(len(total))
    for k, ampere in enumerate(total.tolist()):
        for sub in range(round(SECOND / FINE)):
            source = [ocv(cell[0]) + sum(cell[1:]) for cell in cells]
            common = (ampere + sum(s * g for s, g in zip(source, flow, strict=True))) / all_flow
            branch = [(common - s) * g for s, g in zip(source, flow, strict=True)]
            if sub == 0:
                current[k], volt[k] = branch, common
            for b, cell in enumerate(cells):
                cell[0] += branch[b] * rates[b]
                for j, (share, r) in enumerate(gone[b]):
                    cell[1 + j] += share * (r * branch[b] - cell[1 + j])
    return current, volt


CAPACITY, R0, R1, R2 = (
    np.array(x) for x in ([5.0, 5.2], [0.02, 0.022], [0.01, 0.011], [0.012] * 2)
)
WIRE, TAU1, TAU2, ENERGY = 0.002, 8.0, 120.0, 30e3


class Whole(NamedTuple):
    """What a cell has beyond constant pairs of one activation energy: that of the pairs above it
    [J/mol], the exponent of their time constants, slow diffusion [ohm], [s]."""

    excess: float = 0.0
    exponent: float = 0.0
    slow_ohm: float = 0.0
    slow_second: float = 1500.0


def resistance_factor(celsius, energy=ENERGY):
    """Factor on the cells' resistances."""
    return np.exp(energy / 8.314462618 * (1.0 / (celsius + 273.15) - 1.0 / 298.15))


def measured(
    seed,
    *,
    celsius=25.0,
    wire=0.0,
    soc=0.0,
    capacity=0.0,
    resistance=0.0,
    warmer=0.0,
    offset=0.0,
    gain=0.0,
    branch=1,
    whole=None,
):
    """Time [s], total [A], voltage [V], branch currents [A] of a pair with one faulty branch."""
    faulty = np.arange(2) == branch
    whole = whole or Whole()
    inside, more = celsius + warmer * faulty, 1.0 + resistance * faulty
    slower = resistance_factor(inside, ENERGY + whole.excess)
    second = slower**whole.exponent
    pairs = [R1 * slower * more, TAU1 * second, R2 * slower * more, TAU2 * second]
    pairs += [whole.slow_ohm * more, whole.slow_second * np.ones(2)]
    total = load(seed)
    current, volt = plant(
        total,
        (R0 * resistance_factor(inside) * more + WIRE + wire * faulty).tolist(),
        np.reshape(np.transpose(pairs), (2, 3, 2)).tolist(),
        (CAPACITY * (1.0 + capacity * faulty)).tolist(),
        (0.9 + soc * faulty).tolist(),
    )
    random = np.random.default_rng(seed + 100)
    volt = volt + random.normal(0.0, 1e-3, len(volt))
    read = (
        current * (1.0 + gain * faulty) + offset * faulty + random.normal(0.0, 2e-3, current.shape)
    )
    return SECOND * np.arange(len(total)), total, volt, read
