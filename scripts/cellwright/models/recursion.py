"""A whole record through the Kalman filter: the compiled kernel, or its twin in numpy."""

import numpy as np

from cellwright.models.bank import NODES
from cellwright.models.kalman import predict, update
from cellwright.native import array, function, integers


def run(plant, noise, state):
    """Filter a whole record, in C where that can be built.

    Parameters
    ----------
    plant : Plant. noise : Noise.
    state : State at the first sample, its voltage taken in.

    Returns
    -------
    found : (n, 8): SoC, its variance, innovation [V], its variance; inverse capacity over nominal
        with variance; ohmic scale with variance. Row 0 holds no innovation.
    """
    kernel = function("kalman", *[integers] * 7, *[array] * 15)
    if kernel is None:
        return run_by_numpy(plant, noise, state)
    found = _rows(plant, state)
    sizes = [*found.shape[:1], *plant.tables.shape, len(plant.direct), len(plant.element)]
    sizes += [plant.size, plant.error, plant.fast, plant.standing, plant.capacity]
    sizes += [plant.ohmic, plant.first_order, noise.adaptive, noise.window, len(NODES)]
    reals = [plant.soc_first, plant.soc_spacing, plant.capacity_ampere_hour, plant.white_variance]
    reals += [plant.slow_variance, noise.error_second, *noise.soc_walk, noise.ohmic_walk]
    reals += [noise.slope_window_soc / 2, state.soc_walk, state.error_variance, noise.error_soc]
    reals += [state.linear_soc, noise.fast_second, plant.fast_variance]
    reals += [state.wide_variance]
    ring = np.zeros((noise.window, 3))
    ring[: len(state.seen)] = state.seen
    whole = [plant.shifts_soc, plant.source, plant.by_charge, plant.element, plant.moves]
    record = [plant.step_second, plant.charge_ampere_hour, plant.passed_ampere_hour]
    record += [plant.current_ampere, plant.between_ampere, plant.voltage_volt]
    record += [plant.edge_variance]
    kernel(
        np.array(sizes, np.int64),
        *whole,
        np.array([len(state.seen)], np.int64),
        np.array(reals, float),
        *record,
        *(plant.tables, plant.direct, plant.share, plant.drives, ring),
        np.concatenate([state.mean, state.covariance.ravel()]),
        found,
    )
    return found


def run_by_numpy(plant, noise, state):
    """As `run`, in plain numpy: the reference.

    Parameters
    ----------
    plant, noise, state : as in `run`.
    """
    found = _rows(plant, state)
    for k in range(1, len(found)):
        state, innovation, variance = update(predict(state, plant, k, noise), plant, k, noise)
        found[k] = _row(plant, state, innovation, variance)
    return found


def _rows(plant, state):
    first = _row(plant, state, np.nan, np.nan)
    found = np.empty((len(plant.step_second), len(first)))
    found[0] = first
    return found


def _row(plant, state, innovation, variance):
    row = [state.mean[0], state.covariance[0, 0], innovation, variance]
    for spot in (plant.capacity, plant.ohmic):
        known = spot >= 0
        row += [state.mean[spot], state.covariance[spot, spot]] if known else [1.0, 0.0]
    return row
