"""Extended Kalman filter of a cell on a frozen state, and a whole record through it.

The state: SoC, the lags of the circuit, and where asked the model's own errors (one that lasts
minutes and one that lasts seconds [V], and one that stands over SoC, in units of what is stated
there), the inverse of the capacity over its nominal value, and a scale of the ohmic resistance.
"""

from typing import NamedTuple

import numpy as np

from cellwright.filters.bank import NODES
from cellwright.filters.plant import (
    ERROR,
    OCV,
    SLOPE,
    TOTAL,
    drive_at,
    look_at,
    relaxation_at,
    slope_at,
)
from cellwright.native import array, function, integers


class State(NamedTuple):
    """Mean (s,) and covariance (s, s) of the states, and the noise of the adaptive law.

    soc_walk : variance of the SoC that each second adds [1/s].
    error_variance : variance of the model's slow error [V²].
    seen : (samples, 3) of the window: e², its share from the state, and the same of the model
        without its error state, net.
    linear_soc, surface_soc : SoC at which the Jacobian is taken, and how far the surface of the
        particles is from it. wide_variance : of the SoC, over which the chord is taken [1].
    """

    mean: np.ndarray
    covariance: np.ndarray
    soc_walk: float
    error_variance: float
    seen: np.ndarray
    linear_soc: float
    surface_soc: float
    wide_variance: float


def predict(state, plant, k, noise):
    """State at sample k from that at sample k − 1.

    The SoC by the charge that passed, each lag exactly for its hold of the current, over the true
    step; parameters are looked up at the predicted SoC.

    Parameters
    ----------
    state : State.
    plant : Plant.
    k : number of the sample, from 1.
    noise : Noise.

    Source: thesis, table 2.3, (4) and (7).
    """
    step, charge = plant.step_second[k], plant.charge_ampere_hour[k] / plant.capacity_ampere_hour
    mean, transition = state.mean.copy(), np.eye(plant.size)
    mean[0] += charge * (mean[plant.capacity] if plant.capacity >= 0 else 1.0)
    if plant.capacity >= 0:
        transition[0, plant.capacity] = charge
    covariance = transition @ state.covariance @ transition.T
    covariance[0, 0] += state.soc_walk * step
    relaxed = np.eye(plant.size)
    for j in range(len(plant.element)):
        relaxed[1 + j, 1 + j], towards = relaxation_at(plant, k, j, mean[0])
        mean[1 + j] = relaxed[1 + j, 1 + j] * mean[1 + j] + towards
    passed = plant.passed_ampere_hour[k] / plant.capacity_ampere_hour
    forgotten = [(plant.error, step, noise.error_second, state.error_variance)]
    forgotten += [(plant.fast, step, noise.fast_second, plant.fast_variance)]
    forgotten += [(plant.standing, passed, noise.error_soc, 1.0)]
    for spot, by, span, variance in (drift for drift in forgotten if drift[0] >= 0):
        keep = np.exp(-by / span)
        mean[spot] *= keep
        covariance[spot, :] *= keep
        covariance[:, spot] *= keep
        covariance[spot, spot] += (1.0 - keep**2) * variance
    covariance = relaxed @ covariance @ relaxed.T
    if plant.ohmic >= 0:
        covariance[plant.ohmic, plant.ohmic] += noise.ohmic_walk * step
    spots = _linear(state, mean[0], covariance[0, 0], _follows(step, noise), noise)
    return state._replace(mean=mean, covariance=covariance)._replace(**spots)


def _linear(state, soc, variance, follows, noise):
    """SoC and variance at which the Jacobian is taken; they follow corrections only slowly.

    Were the slope taken anew at every corrected SoC, its change would pass for a second, different
    measurement of the same error: SoC and model error, which one voltage cannot tell apart, would
    be told apart by the filter's own steps.

    Source: G. P. Huang, A. I. Mourikis, S. I. Roumeliotis, Int. J. Robotics Research 29 (2010) 502.
    """
    if noise.error_second <= 0.0:
        return {"linear_soc": soc, "wide_variance": variance}
    linear = state.linear_soc + (soc - state.mean[0])
    linear += follows * (soc - linear)
    wide = state.wide_variance + follows * (variance - state.wide_variance)
    half = noise.slope_window_soc / 2
    reach = np.sqrt(3.0 * wide) if 3.0 * wide > half**2 else half
    linear = max(min(linear, soc + reach), soc - reach)
    return {"linear_soc": linear, "wide_variance": wide}


def _follows(step, noise):
    return 1.0 - np.exp(-step / noise.error_second) if noise.error_second > 0.0 else 1.0


def output(state, plant, k, noise):
    """Voltage that a state predicts at sample k, its Jacobian, and what the linear form leaves out.

    The slope of the OCV is that of a chord as wide as what is not known of the SoC, within 0…1,
    and at least `slope_window_soc`: a tangent would mislead a filter that does not yet know where
    it is. That resistances change
    over SoC is in the voltage, not in the Jacobian: one that is 10 % off would be read as a SoC.

    Parameters
    ----------
    state, plant, k, noise : as in `predict`.

    Returns
    -------
    volt : [V]. jacobian : (s,). curvature_volt : what the chord misses in its middle [V].
    stated_volt : error of the model that is stated there [V]. surface_soc : how far the SoC of the
        particles' surface is from the mean's [1].
    """
    mean, jacobian = state.mean, np.zeros(plant.size)
    direct, offset, over, ohmic = 0.0, 0.0, 0.0, 0.0
    for e in range(len(plant.direct)):
        drive = plant.direct[e] * drive_at(plant, e, k, mean[0])
        scale = mean[plant.ohmic] if e == 0 and plant.ohmic >= 0 else 1.0
        if e == 0:
            ohmic = drive
        offset += scale * drive * plant.shifts_soc[e]
        direct += scale * drive * (1 - plant.shifts_soc[e])
    for j, e in enumerate(plant.element):
        part = plant.share[j] * mean[1 + j]
        offset += part * plant.shifts_soc[e]
        over += part * (1 - plant.shifts_soc[e])
    follows = _follows(plant.step_second[k], noise)
    lean = state.surface_soc + follows * (offset - state.surface_soc)
    surface = state.linear_soc + lean
    stated = look_at(plant, surface, ERROR)
    slope, curvature = slope_at(plant, surface, state.wide_variance, noise)
    shifts = plant.shifts_soc[plant.element]
    jacobian[1 : 1 + len(plant.element)] = plant.share * np.where(shifts, slope, 1.0)
    jacobian[0] = slope
    row = look_at(plant, mean[0])
    volt = look_at(plant, mean[0] + offset, OCV) + row[TOTAL] - row[OCV] + direct + over
    for spot, scale in ((plant.error, 1.0), (plant.fast, 1.0), (plant.standing, stated)):
        if spot >= 0:
            volt, jacobian[spot] = volt + scale * mean[spot], scale
    if plant.ohmic >= 0:
        jacobian[plant.ohmic] = ohmic
    return volt, jacobian, curvature, stated, lean


def update(state, plant, k, noise):
    """State at sample k updated with its measured voltage.

    The covariance in Joseph's form, (I − KC)·P·(I − KC)ᵀ + K·R·Kᵀ: a sum of two terms that cannot
    be negative, whatever rounding makes of the gain; the print's (I − KC)·P can.

    Parameters
    ----------
    state, plant, k, noise : as in `predict`.

    Returns
    -------
    state : State.
    innovation : measured minus predicted voltage [V].
    variance : what its variance should be [V²].

    Source: thesis, table 2.3, (5), (6), (8)–(10).
    """
    volt, jacobian, curvature, stated, surface = output(state, plant, k, noise)
    edge, innovation = plant.edge_variance[k], plant.voltage_volt[k] - volt
    shared = state.covariance @ jacobian
    predicted_variance = jacobian @ shared
    floor, error = plant.white_variance, plant.slow_variance
    error = error + (stated**2 if plant.standing < 0 else 0.0)
    if plant.error < 0:
        floor, slow_square = floor + error, np.nan
    else:
        b = plant.error
        slow_square = (innovation + state.mean[b]) ** 2 - (
            predicted_variance - 2.0 * shared[b] + state.covariance[b, b]
        )
        slow_square -= edge
    white, error = _matched(state.seen, floor, error, noise) if noise.adaptive else (floor, error)
    white = white + (curvature**2 + edge)
    variance = predicted_variance + white
    gain = shared / variance
    if noise.considered and plant.capacity >= 0:
        gain[plant.capacity] = 0.0
    joseph = np.eye(plant.size) - np.outer(gain, jacobian)
    covariance = joseph @ state.covariance @ joseph.T + white * np.outer(gain, gain)
    walk = _walk(state, gain[0], variance, plant.step_second[k], noise)
    mean = state.mean + gain * innovation
    seen = np.vstack([state.seen, [innovation**2, predicted_variance + edge, slow_square]])[
        -noise.window :
    ]
    updated = state._replace(mean=mean, covariance=covariance, soc_walk=walk, error_variance=error)
    updated = updated._replace(seen=seen, surface_soc=surface)
    return updated, innovation, variance


def _matched(seen, floor, error, noise):
    """White and slow variance [V²] of the last samples, never below the stated ones.

    What of the window is still empty counts as stated, so that one sample is no statistics. From
    each e² goes its own share CPCᵀ, so that a wrong start does not pass for noise.

    Source: K. A. Myers, B. D. Tapley, IEEE Trans. Automatic Control 21 (1976) 520.
    """
    empty = noise.window - len(seen)
    white = max(floor, (np.sum(seen[:, 0] - seen[:, 1]) + empty * floor) / noise.window)
    slow = (np.sum(seen[:, 2]) + empty * (error + white)) / noise.window - white
    return white, max(error, slow)


def _walk(state, gain, variance, step, noise):
    """Variance of the SoC per second [1/s], Q = K·H·Kᵀ, within the bounds of the current sensor.

    Without bounds the printed law adds back all that a measurement removed.
    """
    if not noise.adaptive or step <= 0.0:
        return state.soc_walk
    empty = noise.window - len(state.seen)
    mean_square = (np.sum(state.seen[:, 0]) + empty * variance) / noise.window
    return float(np.clip(gain**2 * mean_square / step, *noise.soc_walk))


def run(plant, noise, state):
    """Filter a whole record, in C where that can be built.

    Parameters
    ----------
    plant : Plant. noise : Noise.
    state : State at the first sample, its voltage taken in.

    Returns
    -------
    rows : (n, 8): SoC, its variance, innovation [V], its variance; inverse capacity over nominal
        with variance; ohmic scale with variance. Row 0 holds no innovation.
    """
    kernel = function("kalman", *[integers] * 7, *[array] * 15)
    if kernel is None:
        return run_by_numpy(plant, noise, state)
    rows = _rows(plant, state)
    sizes = [*rows.shape[:1], *plant.tables.shape, len(plant.direct), len(plant.element)]
    sizes += [plant.size, plant.error, plant.fast, plant.standing, plant.capacity]
    sizes += [plant.ohmic, plant.first_order, noise.adaptive, noise.window, len(NODES)]
    sizes += [noise.considered]
    reals = [plant.soc_first, plant.soc_spacing, plant.capacity_ampere_hour, plant.white_variance]
    reals += [plant.slow_variance, noise.error_second, *noise.soc_walk, noise.ohmic_walk]
    reals += [noise.slope_window_soc / 2, state.soc_walk, state.error_variance, noise.error_soc]
    reals += [state.linear_soc, noise.fast_second, plant.fast_variance]
    reals += [state.wide_variance]
    ring = np.zeros((noise.window, 3))
    ring[: len(state.seen)] = state.seen
    indices = [plant.shifts_soc, plant.source, plant.by_charge, plant.element, plant.moves]
    record = [plant.step_second, plant.charge_ampere_hour, plant.passed_ampere_hour]
    record += [plant.current_ampere, plant.between_ampere, plant.voltage_volt]
    record += [plant.edge_variance]
    kernel(
        np.array(sizes, np.int64),
        *indices,
        np.array([len(state.seen)], np.int64),
        np.array(reals, float),
        *record,
        *(plant.tables, plant.direct, plant.share, plant.drives, ring),
        np.concatenate([state.mean, state.covariance.ravel()]),
        rows,
    )
    return rows


def run_by_numpy(plant, noise, state):
    """As `run`, in plain numpy: the reference.

    Parameters
    ----------
    plant, noise, state : as in `run`.
    """
    rows = _rows(plant, state)
    for k in range(1, len(rows)):
        state, innovation, variance = update(predict(state, plant, k, noise), plant, k, noise)
        rows[k] = _row(plant, state, innovation, variance)
    return rows


def _rows(plant, state):
    first = _row(plant, state, np.nan, np.nan)
    rows = np.empty((len(plant.step_second), len(first)))
    rows[0] = first
    return rows


def _row(plant, state, innovation, variance):
    row = [state.mean[0], state.covariance[0, 0], innovation, variance]
    for spot in (plant.capacity, plant.ohmic):
        tracked = spot >= 0
        row += [state.mean[spot], state.covariance[spot, spot]] if tracked else [1.0, 0.0]
    return row


POINTS = 1001
WIDTH = 5.0  # standard deviations of the stated SoC that are looked at
LEAST_LEFT = 0.01  # share of a variance: a SoC known no better than the voltage tells came from it


def acquire(plant, start, noise):
    """State at the first sample, updated with its measured voltage.

    A filter that starts 60 % off cannot linearise: the chord from the wrong to the true SoC may be
    ten times as steep as the tangent. Over SoC the posterior is therefore taken point by point; all
    else is linear and Gaussian given the SoC. The filter continues with mean and covariance.

    Parameters
    ----------
    plant : Plant.
    start : estimate.Start.
    noise : Noise.

    Returns
    -------
    state : State.
    innovation_volt, variance_volt2 : of the first sample, against what was stated [V], [V²].
    """
    ends = start.soc + WIDTH * start.soc_std * np.array([-1.0, 1.0])
    soc = np.linspace(*np.clip(ends, 0.0, 1.0), POINTS)
    volt, jacobian = _predicted(plant, soc)
    state_variance, stated = _prior_variances(plant, start, soc)
    variance = np.sum(jacobian**2 * state_variance, axis=1) + plant.white_variance
    variance += plant.edge_variance[0]
    variance += 0.0 if plant.error >= 0 else stated
    prior = -0.5 * ((soc - start.soc) / start.soc_std) ** 2
    innovation = plant.voltage_volt[0] - volt
    weight = _normal(prior - 0.5 * (innovation**2 / variance + np.log(variance)))
    before = _normal(prior)
    expected = before @ innovation
    spread = before @ (innovation - expected) ** 2 + before @ variance
    return _start_state(plant, start, noise, soc, weight), expected, spread


def _start_state(plant, start, noise, soc, weight):
    """State whose SoC has the posterior's mean and variance; the others by the filter's own slopes.

    With other slopes, even more accurate ones, the difference to the filter's own would count as a
    measurement.
    """
    middle = weight @ soc
    variance = weight @ (soc - middle) ** 2 + (soc[1] - soc[0]) ** 2 / 12.0
    middle_soc = np.array([middle])
    volt, rest = _predicted(plant, middle_soc)
    doubt, stated = (values[0] for values in _prior_variances(plant, start, middle_soc))
    slope = np.append(slope_at(plant, middle, variance, noise)[0], rest[0])
    white = plant.white_variance + plant.edge_variance[0]
    white += 0.0 if plant.error >= 0 else stated
    rest_variance = slope[1:] ** 2 @ doubt + white
    before = (
        variance
        * rest_variance
        / max(rest_variance - variance * slope[0] ** 2, LEAST_LEFT * rest_variance)
    )
    covariance = np.diag(np.append(before, doubt))
    shared = covariance @ slope
    covariance -= np.outer(shared, shared) / (slope @ shared + white)
    covariance[0, 0] = max(covariance[0, 0], variance)
    mean = np.append(middle, doubt * slope[1:] / rest_variance * (plant.voltage_volt[0] - volt[0]))
    mean[[spot for spot in (plant.capacity, plant.ohmic) if spot >= 0]] += 1.0
    walk, nothing = noise.soc_walk[0], np.empty((0, 3))
    return State(mean, covariance, walk, float(stated), nothing, middle, 0.0, variance)


def _predicted(plant, soc):
    """Predicted voltage (p,) [V], and its derivatives by all states but the SoC (p, s−1)."""
    drive = np.array([drive_at(plant, e, 0, soc) for e in range(len(plant.direct))])
    slope = look_at(plant, soc, SLOPE)
    scale = np.where(plant.shifts_soc[:, None], slope, 1.0)
    volt = look_at(plant, soc, TOTAL) + plant.direct @ (scale * drive)
    jacobian = np.zeros((len(soc), plant.size))
    for j, e in enumerate(plant.element):
        jacobian[:, 1 + j] = plant.share[j] * scale[e]
    ones = np.ones(len(soc))
    standing = look_at(plant, soc, ERROR)
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
    curve = look_at(plant, soc, ERROR) ** 2 if plant.standing < 0 else np.zeros(len(soc))
    stated = curve + plant.slow_variance
    variances = np.zeros((len(soc), plant.size))
    for j, e in enumerate(plant.element):
        variances[:, 1 + j] = _steady_lag(plant, e, start.c_rate) ** 2
    for spot, variance in (
        (plant.error, curve + loaded * plant.slow_variance),
        (plant.fast, loaded * plant.fast_variance),
        (plant.standing, 1.0),
        (plant.capacity, start.capacity_error**2),
        (plant.ohmic, start.ohmic_error**2),
    ):
        if spot >= 0:
            variances[:, spot] = variance
    return variances[:, 1:], stated


# ASSUME: A lag that moves with charge (hysteresis) may start anywhere within its limits.
def _steady_lag(plant, e, c_rate):
    """Standard deviation of a lag of element e at the start: its value after a steady current."""
    current = c_rate * plant.capacity_ampere_hour
    if plant.source[e] < 0:
        return plant.usual_gain[e] * current
    largest = plant.largest[plant.source[e]]
    swing = np.abs(plant.current_ampere).max()
    return largest * (1.0 if plant.by_charge[e] else min(1.0, current / max(swing, current, 1e-9)))


def _normal(logarithm):
    weight = np.exp(logarithm - logarithm.max())
    return weight / weight.sum()
