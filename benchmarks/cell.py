"""The cell that all topics simulate, fit and filter: two RC pairs, parameters over SoC."""

import numpy as np

from cellwright.circuits.cell import ocv_on_grid, simulate
from cellwright.circuits.circuit import rc_circuit

CAPACITY_AMPERE_HOUR, INITIAL_SOC = 3.0, 0.8
GRID = np.linspace(0.0, 1.0, 101)
OCV = 3.3 + 0.75 * GRID + 0.08 * np.sin(6 * GRID)
R0 = 0.025 + 0.006 * np.cos(3 * GRID)
R = np.array([0.012 - 0.004 * GRID, 0.010 + 0.006 * GRID**2])
TAU = np.array([8.0, 150.0])


def simulated(time, current, initial_soc):
    """Voltage [V] and SoC [1] of the cell (n,) under a current on a straight line between samples.

    As the pipeline simulates every cell: the SoC counted, parameters and OCV looked up along it.
    """
    passed = (current[:-1] + current[1:]) / 2 * np.diff(time)
    soc = initial_soc + np.append(0.0, np.cumsum(passed)) / (3600.0 * CAPACITY_AMPERE_HOUR)
    r0, *r = (np.interp(soc, GRID, course) for course in (R0, *R))
    circuit = rc_circuit(r0, r, TAU)
    return simulate(circuit, time, current, ocv_on_grid(OCV, soc), hold="first_order"), soc


def drive(samples, seed=1):
    """Current of a drive: a level for every 20 samples, mostly discharge [A]."""
    rng = np.random.default_rng(seed)
    level = rng.uniform(-3.0, 2.0, samples // 20 + 1) * min(1.0, 10_000 / samples)
    return np.repeat(level, 20)[:samples]


def model():
    """The same cell as a model file."""
    branches = [
        {"r_ohm": r.tolist(), "tau_second": np.full(len(GRID), tau).tolist()}
        for r, tau in zip(R, TAU, strict=True)
    ]
    at = {"ambient_temperature_celsius": 25.0, "soc": GRID.tolist()}
    condition = at | {"r0_ohm": R0.tolist(), "branches": branches, "fit_rmse_volt": 1e-3}
    return {
        "schema": "cellwright-model/1",
        "cell": "benchmark",
        "capacity_ampere_hour": CAPACITY_AMPERE_HOUR,
        "ocv": [at | {"ocv_volt": OCV.tolist()}],
        "members": [{"model": "2RC", "conditions": [condition]}],
        "chosen": "2RC",
        "notes": [],
    }
