"""The first sample of a filter: the voltage weighed over all SoC at once, not on one slope."""

import numpy as np

from cellwright.models.bank import NODES
from cellwright.models.kalman import State
from cellwright.models.plant import ERROR, GAIN, SLOPE, TOTAL

POINTS = 2001
WIDTH = 5.0  # standard deviations of the stated SoC that are looked at


def acquire(plant, start, noise):
    """State at the first sample, its voltage taken in.

    A filter that starts 60 % off has no slope to linearise on: the chord between there and here may
    be ten times the tangent. Over SoC the posterior is therefore taken point by point; all else is
    linear and Gaussian given the SoC. What the filter goes on with are mean and covariance.

    Parameters
    ----------
    plant : Plant.
    start : soc.Start.
    noise : Noise.

    Returns
    -------
    state : State.
    innovation_volt, variance_volt2 : of the first sample, against what was stated [V], [V²].
    """
    ends = start.soc + WIDTH * start.soc_std * np.array([-1.0, 1.0])
    soc = np.linspace(*np.clip(ends, 0.0, 1.0), POINTS)
    volt, jacobian = _predicted(plant, soc)
    doubt, stated = _doubt(plant, start, soc)
    variance = jacobian**2 @ doubt + plant.white_variance
    variance += 0.0 if plant.error >= 0 else stated
    prior = -0.5 * ((soc - start.soc) / start.soc_std) ** 2
    missed = plant.voltage_volt[0] - volt
    weight = _normal(prior - 0.5 * (missed**2 / variance + np.log(variance)))
    state = _moments(plant, soc, missed, weight, doubt, jacobian, variance)
    before = _normal(prior)
    expected = before @ missed
    spread = before @ (missed - expected) ** 2 + before @ variance
    found = State(*state, noise.soc_walk[0], float(weight @ stated), np.empty((0, 3)))
    return found, expected, spread


def _moments(plant, soc, missed, weight, doubt, jacobian, variance):
    """Mean and covariance of all states; those but the SoC follow it as K·(V − h(z))."""
    mean, covariance = np.ones(plant.size), np.zeros((plant.size, plant.size))
    rest = slice(1, plant.size)
    row = weight @ jacobian
    gain = doubt * row / (weight @ variance)
    mean[0], late = weight @ soc, weight @ missed
    linear = len(plant.element) + (plant.error >= 0)
    mean[rest] = (np.arange(plant.size - 1) >= linear) + gain * late
    spread = weight @ (missed - late) ** 2 - weight @ variance
    covariance[rest, rest] = np.diag(doubt) + spread * np.outer(gain, gain)
    covariance[0, rest] = covariance[rest, 0] = gain * (weight @ ((soc - mean[0]) * missed))
    covariance[0, 0] = weight @ (soc - mean[0]) ** 2 + (soc[1] - soc[0]) ** 2 / 12.0
    return mean, covariance


def _predicted(plant, soc):
    """Voltage (p,), and its slopes by the states but the SoC (p, s−1)."""
    grid = _grid(plant)
    drive = np.array([_drive(plant, e, soc, grid) for e in range(len(plant.direct))])
    slope = np.interp(soc, grid, plant.tables[:, SLOPE])
    scale = np.where(plant.shifts_soc[:, None], slope, 1.0)
    volt = np.interp(soc, grid, plant.tables[:, TOTAL]) + plant.direct @ (scale * drive)
    jacobian = np.zeros((len(soc), plant.size))
    for j, e in enumerate(plant.element):
        jacobian[:, 1 + j] = plant.share[j] * scale[e]
    if plant.error >= 0:
        jacobian[:, plant.error] = 1.0
    if plant.ohmic >= 0:
        jacobian[:, plant.ohmic] = plant.direct[0] * drive[0]
    return volt, jacobian[:, 1:]


def _doubt(plant, start, soc):
    """Variances of the states but the SoC before any voltage; (p,) that of the model's error."""
    stated = np.interp(soc, _grid(plant), plant.tables[:, ERROR]) ** 2
    stated += plant.slow_variance
    found = np.zeros(plant.size)
    for j, e in enumerate(plant.element):
        found[1 + j] = _settled(plant, e, start.c_rate) ** 2
    for spot, variance in (
        (plant.error, float(np.mean(stated))),
        (plant.capacity, start.capacity_error**2),
        (plant.ohmic, start.ohmic_error**2),
    ):
        if spot >= 0:
            found[spot] = variance
    return found[1:], stated


# ASSUME: A lag that moves with charge (hysteresis) may start anywhere within its limits.
def _settled(plant, e, c_rate):
    """What a lag of element e may hold at the start: what a steady current would have left."""
    current = c_rate * plant.capacity_ampere_hour
    inside = np.clip(_grid(plant), 0.0, 1.0) == _grid(plant)
    if plant.source[e] < 0:
        return np.median(plant.tables[inside, GAIN + e]) * current
    largest = np.abs(plant.drives[plant.source[e]]).max(axis=0).mean()
    swing = np.abs(plant.current_ampere).max()
    return largest * (1.0 if plant.by_charge[e] else min(1.0, current / max(swing, current, 1e-9)))


def _drive(plant, e, soc, grid):
    if plant.source[e] < 0:
        return plant.current_ampere[0] * np.interp(soc, grid, plant.tables[:, GAIN + e])
    return np.interp(soc, NODES, plant.drives[plant.source[e], 0])


def _grid(plant):
    return plant.soc_first + plant.soc_spacing * np.arange(len(plant.tables))


def _normal(logarithm):
    weight = np.exp(logarithm - logarithm.max())
    return weight / weight.sum()
