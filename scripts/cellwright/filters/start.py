"""The first sample of a filter: the voltage weighed over all SoC at once, not on one slope."""

import numpy as np

from cellwright.filters.bank import NODES
from cellwright.filters.kalman import State
from cellwright.filters.plant import ERROR, GAIN, SLOPE, TOTAL, slope_at

POINTS = 1001
WIDTH = 5.0  # standard deviations of the stated SoC that are looked at
LEAST_LEFT = 0.01  # share of a variance: a SoC known no better than the voltage tells came from it


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
    doubt, stated = _prior_variances(plant, start, soc)
    variance = np.sum(jacobian**2 * doubt, axis=1) + plant.white_variance
    variance += plant.edge_variance[0]
    variance += 0.0 if plant.error >= 0 else stated
    prior = -0.5 * ((soc - start.soc) / start.soc_std) ** 2
    missed = plant.voltage_volt[0] - volt
    weight = _normal(prior - 0.5 * (missed**2 / variance + np.log(variance)))
    before = _normal(prior)
    expected = before @ missed
    spread = before @ (missed - expected) ** 2 + before @ variance
    return _start_state(plant, start, noise, soc, weight), expected, spread


def _start_state(plant, start, noise, soc, weight):
    """State whose SoC has the posterior's mean and variance; all else follows on the slopes that
    the filter will go on with. Any other slopes, were they nearer the truth, would differ from its
    own, and the difference pass for a measurement.
    """
    middle = weight @ soc
    variance = weight @ (soc - middle) ** 2 + (soc[1] - soc[0]) ** 2 / 12.0
    here = np.array([middle])
    volt, rest = _predicted(plant, here)
    doubt, stated = (values[0] for values in _prior_variances(plant, start, here))
    slope = np.append(slope_at(plant, middle, variance, noise)[0], rest[0])
    white = plant.white_variance + plant.edge_variance[0]
    white += 0.0 if plant.error >= 0 else stated
    other = slope[1:] ** 2 @ doubt + white
    before = variance * other / max(other - variance * slope[0] ** 2, LEAST_LEFT * other)
    covariance = np.diag(np.append(before, doubt))
    shared = covariance @ slope
    covariance -= np.outer(shared, shared) / (slope @ shared + white)
    covariance[0, 0] = max(covariance[0, 0], variance)
    mean = np.append(middle, doubt * slope[1:] / other * (plant.voltage_volt[0] - volt[0]))
    mean[[spot for spot in (plant.capacity, plant.ohmic) if spot >= 0]] += 1.0
    walk, nothing = noise.soc_walk[0], np.empty((0, 3))
    return State(mean, covariance, walk, float(stated), nothing, middle, 0.0, variance)


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
    ones = np.ones(len(soc))
    standing = np.sqrt(_stated(plant, soc))
    for spot, scale in ((plant.error, ones), (plant.fast, ones), (plant.standing, standing)):
        if spot >= 0:
            jacobian[:, spot] = scale
    if plant.ohmic >= 0:
        jacobian[:, plant.ohmic] = plant.direct[0] * drive[0]
    return volt, jacobian[:, 1:]


def _prior_variances(plant, start, soc):
    """Variances of the states but the SoC before any voltage (p, s−1), and of the error (p,).

    At rest nothing is over the circuit that a model could be wrong about but its OCV.
    """
    loaded = float(start.c_rate > 0.0 or plant.current_ampere[0] != 0.0)
    curve = _stated(plant, soc) if plant.standing < 0 else np.zeros(len(soc))
    stated = curve + plant.slow_variance
    found = np.zeros((len(soc), plant.size))
    for j, e in enumerate(plant.element):
        found[:, 1 + j] = _steady_lag(plant, e, start.c_rate) ** 2
    for spot, variance in (
        (plant.error, curve + loaded * plant.slow_variance),
        (plant.fast, loaded * plant.fast_variance),
        (plant.standing, 1.0),
        (plant.capacity, start.capacity_error**2),
        (plant.ohmic, start.ohmic_error**2),
    ):
        if spot >= 0:
            found[:, spot] = variance
    return found[:, 1:], stated


def _stated(plant, soc):
    return np.interp(soc, _grid(plant), plant.tables[:, ERROR]) ** 2


# ASSUME: A lag that moves with charge (hysteresis) may start anywhere within its limits.
def _steady_lag(plant, e, c_rate):
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
