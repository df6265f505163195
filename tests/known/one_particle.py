"""A cell that is one particle with charge transfer, of numbers that are known."""

import numpy as np

from cellwright.circuits.particle import Particle, layout, to_document

CAPACITY = 3.0
GRID = np.linspace(0.0, 1.0, 201)
OCV = 3.4 + 0.7 * GRID + 0.05 * np.sin(6 * GRID)
NUMBERS = {
    "diffusion_per_second": -8.0,
    "diffusion_joule_per_mole": 35e3,
    "transfer_ohm": np.log(0.02),
    "transfer_joule_per_mole": 50e3,
    "transfer_bend_joule_per_mole": 5e3,
    "double_layer_farad": np.log(15.0),
    "double_layer_joule_per_mole": 2e3,
    "transfer_scale": np.log(2.0),
    "r0_ohm": np.log(0.02),
    "r0_joule_per_mole": 12e3,
    "r0_bend_joule_per_mole": 3e3,
    "fast_ohm": np.log(0.01),
    "fast_joule_per_mole": 25e3,
    "fast_second": np.log(15.0),
    "fast_second_joule_per_mole": 10e3,
    "slow_ohm": np.log(0.008),
    "slow_joule_per_mole": 30e3,
    "slow_second": np.log(300.0),
    "slow_second_joule_per_mole": 5e3,
}


def a_particle(celsius=(0.0, 25.0), **changed):
    """A particle of those numbers, courses flat over SoC."""
    places = layout(len(celsius))
    vector = np.zeros(max(place.stop for place in places.values()))
    for name, value in (NUMBERS | changed).items():
        vector[places[name]] = value
    return Particle(OCV, np.array(celsius, float), vector)


def in_use(model, cell=None):
    """A model file whose particle predicts better than its chosen member."""
    about = {"fitted_soc": [0.0, 1.0], "in_use": True, "left_out_rmse_volt": 0.004}
    cell = cell or a_particle(hysteresis_volt=np.linspace(0.02, 0.005, 5))
    return model | {"particle": to_document(cell) | about}


def a_record(rows=300, seed=1):
    """Time, current, SoC and temperature of uneven rows with loads both ways."""
    random = np.random.default_rng(seed)
    time = np.append(0.0, np.cumsum(random.choice([0.1, 1.0, 7.0, 45.0], rows - 1)))
    current = np.repeat(random.normal(-0.5, 2.0, rows // 10), 10)
    passed = np.append(0.0, np.cumsum((current[1:] + current[:-1]) / 2 * np.diff(time)))
    return time, current, 0.7 + passed / 3600.0 / CAPACITY, 12.0 + 8.0 * np.sin(time / 400.0)
