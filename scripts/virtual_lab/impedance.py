"""Impedance of a rested cell: the physics linearised by PyBaMM, then measured with noise.

The analyser needs no physics: PyBaMM is loaded only where a cell is linearised.
"""

import numpy as np

from virtual_lab.cells import Cell
from virtual_lab.measurement import CHAIN, Columns

FREQUENCY_HERTZ = np.logspace(3, -2, 41)
OHMIC_FREQUENCY_HERTZ = 1e6
RELATIVE_NOISE = 0.003


def spectrum(cell: Cell, frequency_hertz: np.ndarray, *, ambient_celsius: float, soc: float):
    """Complex impedance [ohm] at each frequency [Hz]; capacitive arcs have a negative part."""
    from virtual_lab import physics

    # isort: split
    import pybamm

    simulation = pybamm.EISSimulation(
        physics.model(cell, hysteresis=False),
        parameter_values=physics.parameters(cell, ambient_celsius=ambient_celsius),
    )
    found = simulation.solve(frequency_hertz, initial_soc=physics.window_soc(cell, soc))
    return np.asarray(found.impedance)


def measured_spectrum(
    impedance_ohm: np.ndarray,
    *,
    ambient_celsius: float,
    seed: int,
    frequency_hertz: np.ndarray = FREQUENCY_HERTZ,
    relative_noise: float = RELATIVE_NOISE,
) -> Columns:
    """The analyser's table: noise in proportion to the modulus on both parts.

    Parameters
    ----------
    impedance_ohm : true impedance [ohm] at each frequency.
    ambient_celsius : chamber temperature [°C].
    seed : of the noise.
    frequency_hertz : where it was measured [Hz].
    relative_noise : standard deviation of either part over the modulus [1].
    """
    random = np.random.default_rng(seed)
    spread = relative_noise * np.abs(impedance_ohm)
    noise = random.normal(0.0, 1.0, (2, impedance_ohm.size)) * spread
    surface = ambient_celsius + random.normal(
        0.0, CHAIN.temperature_noise_celsius, impedance_ohm.size
    )
    return {
        "frequency_hertz": frequency_hertz,
        "real_ohm": impedance_ohm.real + noise[0],
        "imaginary_ohm": impedance_ohm.imag + noise[1],
        "surface_celsius": surface,
    }
