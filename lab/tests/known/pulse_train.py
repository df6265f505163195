"""A pulse train through a known 2RC circuit, with noise, for fits of one short record."""

import numpy as np

from cellwright.circuits.cell import simulate
from cellwright.circuits.circuit import rc_circuit
from pulse_methods.pulse import fit_circuit

TRUE = np.array([0.020, 0.010, 0.015, 3.0, 40.0])
TIME = np.arange(4000) * 0.2
CURRENT = np.zeros(4000)
for start in range(0, 4000, 1000):
    CURRENT[start + 50 : start + 100] = -5.0
    CURRENT[start + 300 : start + 350] = 4.0
NOISE = 1e-3


def voltage(values=TRUE, hold="zero_order", time=TIME, current=CURRENT):
    pairs = (len(values) - 1) // 2
    circuit = rc_circuit(values[0], values[1 : 1 + pairs], values[1 + pairs :])
    return simulate(circuit, time, current, 3.7, hold=hold)


def noisy(seed, **given):
    return voltage(**given) + NOISE * np.random.default_rng(seed).normal(size=len(TIME))


def fitted(volt, **given):
    return fit_circuit(TIME, CURRENT, volt, 3.7, **({"hold": "zero_order"} | given))
