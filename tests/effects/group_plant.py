"""A parallel group for tests, by equations of its own: the branches' charges and relaxations as one
linear system in time, integrated in fine explicit steps; none of the product's code."""

import numpy as np

SECOND, FINE = 2.0, 0.1


def ocv(soc):
    """OCV of all cells [V]."""
    return 3.3 + 0.75 * soc + 0.08 * np.exp(-12.0 * soc) * -1.0 + 0.03 * np.sin(5.0 * soc)


def load(seed, hours=0.8):
    """Total current, one value every SECOND [A]: rest, then pulses, mostly discharge, then rest."""
    random = np.random.default_rng(seed)
    rest, tail = np.zeros(60), np.zeros(60)
    pulses = np.repeat(random.choice([-16.0, -10.0, -6.0, -3.0, 0.0, 5.0], int(hours * 120)), 15)
    return np.concatenate([rest, pulses, tail])


def plant(total, r0, r1, tau1, r2, tau2, capacity, soc):
    """Branch currents (n, b) and voltage (n,) under a total held between samples."""
    soc, v1, v2 = np.array(soc, float), np.zeros(len(r0)), np.zeros(len(r0))
    current, volt = np.empty((len(total), len(r0))), np.empty(len(total))
    for k, ampere in enumerate(total):
        for sub in range(int(SECOND / FINE)):
            source = ocv(soc) + v1 + v2
            one = (ampere + (source / r0).sum()) / (1.0 / r0).sum()
            branch = (one - source) / r0
            if sub == 0:
                current[k], volt[k] = branch, one
            soc = soc + branch * FINE / 3600.0 / capacity
            v1 = v1 + FINE * (r1 * branch - v1) / tau1
            v2 = v2 + FINE * (r2 * branch - v2) / tau2
    return current, volt


CAPACITY, R0, R1, R2 = (
    np.array(x) for x in ([5.0, 5.2], [0.02, 0.022], [0.01, 0.011], [0.012] * 2)
)
WIRE, TAU1, TAU2, ENERGY = 0.002, 8.0, 120.0, 30e3


def warmth(celsius):
    """Factor on the cells' resistances."""
    return np.exp(ENERGY / 8.314462618 * (1.0 / (celsius + 273.15) - 1.0 / 298.15))


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
):
    """Time, total, voltage, branch currents of a pair with something about one branch."""
    own = np.arange(2) == branch
    factor = warmth(celsius + warmer * own) * (1.0 + resistance * own)
    total = load(seed)
    current, volt = plant(
        total,
        R0 * factor + WIRE + wire * own,
        R1 * factor,
        TAU1,
        R2 * factor,
        TAU2,
        CAPACITY * (1.0 + capacity * own),
        0.9 + soc * own,
    )
    random = np.random.default_rng(seed + 100)
    volt = volt + random.normal(0.0, 1e-3, len(volt))
    read = current * (1.0 + gain * own) + offset * own + random.normal(0.0, 2e-3, current.shape)
    return SECOND * np.arange(len(total)), total, volt, read
