"""Extended Kalman filter of a cell: predict and update on a frozen state, and a whole record.

The state: SoC, the lags of the circuit, and where asked the model's own slow error [V], the inverse
of the capacity over its nominal value, and a scale of the ohmic resistance.
"""

from typing import NamedTuple

import numpy as np

from cellwright.models.bank import NODES
from cellwright.models.plant import ERROR, OCV, TOTAL
from cellwright.models.reading import drive_at, look_at, relaxation_at, slope_at
from cellwright.native import array, function, integers


class State(NamedTuple):
    """Mean (s,) and covariance (s, s); beside them what the adaptive law has found so far.

    soc_walk : variance of the SoC that each second adds [1/s].
    error_variance : variance of the model's slow error [V²].
    seen : (samples, 3) of the window: e², its share from the state, and the same of the model
        without its error state, net.
    """

    mean: np.ndarray
    covariance: np.ndarray
    soc_walk: float
    error_variance: float
    seen: np.ndarray


class Output(NamedTuple):
    """Voltage that a state predicts, its Jacobian (s,), and what the linear form leaves out."""

    volt: float
    jacobian: np.ndarray
    curvature_volt: float


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
    mean, moved = state.mean.copy(), np.eye(plant.size)
    mean[0] += charge * (mean[plant.capacity] if plant.capacity >= 0 else 1.0)
    if plant.capacity >= 0:
        moved[0, plant.capacity] = charge
    covariance = moved @ state.covariance @ moved.T
    covariance[0, 0] += state.soc_walk * step
    relaxed = np.eye(plant.size)
    for j in range(len(plant.element)):
        relaxed[1 + j, 1 + j], towards = relaxation_at(plant, k, j, mean[0])
        mean[1 + j] = relaxed[1 + j, 1 + j] * mean[1 + j] + towards
    if plant.error >= 0:
        keep = np.exp(-step / noise.error_second)
        mean[plant.error] *= keep
        relaxed[plant.error, plant.error] = keep
    covariance = relaxed @ covariance @ relaxed.T
    if plant.error >= 0:
        covariance[plant.error, plant.error] += (1.0 - keep**2) * state.error_variance
    if plant.ohmic >= 0:
        covariance[plant.ohmic, plant.ohmic] += noise.ohmic_walk * step
    return state._replace(mean=mean, covariance=covariance)


def output(state, plant, k, noise):
    """Voltage that a state predicts at sample k, and its Jacobian.

    The slope of the OCV is that of a chord as wide as what is not known of the SoC, within 0…1,
    and at least `slope_window_soc`: a tangent would mislead a filter that does not yet know where
    it is. What the chord misses in its middle is told as `curvature_volt`. That resistances change
    over SoC is in the voltage, not in the Jacobian: one that is 10 % off would be read as a SoC.

    Parameters
    ----------
    state, plant, k, noise : as in `predict`.
    """
    mean, jacobian = state.mean, np.zeros(plant.size)
    direct, offset, over, ohmic = 0.0, 0.0, 0.0, 0.0
    slope, curvature = slope_at(plant, mean[0], state.covariance[0, 0], noise)
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
        jacobian[1 + j] = plant.share[j] * (slope if plant.shifts_soc[e] else 1.0)
    jacobian[0] = slope
    at = look_at(plant, mean[0])
    volt = look_at(plant, mean[0] + offset)[OCV] + at[TOTAL] - at[OCV] + direct + over
    if plant.error >= 0:
        volt, jacobian[plant.error] = volt + mean[plant.error], 1.0
    if plant.ohmic >= 0:
        jacobian[plant.ohmic] = ohmic
    return Output(volt, jacobian, curvature)


def update(state, plant, k, noise):
    """State at sample k with its voltage taken in.

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
    out = output(state, plant, k, noise)
    innovation = plant.voltage_volt[k] - out.volt
    shared = state.covariance @ out.jacobian
    known = out.jacobian @ shared
    floor, error = plant.white_variance, plant.slow_variance
    error = error + look_at(plant, state.mean[0])[ERROR] ** 2
    if plant.error < 0:
        floor, own = floor + error, np.nan
    else:
        b = plant.error
        own = (innovation + state.mean[b]) ** 2 - (known - 2.0 * shared[b] + state.covariance[b, b])
    white, error = _matched(state.seen, floor, error, noise) if noise.adaptive else (floor, error)
    white = white + out.curvature_volt**2
    variance = known + white
    gain = shared / variance
    left = np.eye(plant.size) - np.outer(gain, out.jacobian)
    covariance = left @ state.covariance @ left.T + white * np.outer(gain, gain)
    walk = _walk(state, gain[0], variance, plant.step_second[k], noise)
    mean = state.mean + gain * innovation
    seen = np.vstack([state.seen, [innovation**2, known, own]])[-noise.window :]
    return State(mean, covariance, walk, error, seen), innovation, variance


def run(plant, noise, state):
    """Filter a whole record, in C where that can be built.

    Parameters
    ----------
    plant, noise : as in `predict`.
    state : State at the first sample, its voltage taken in.

    Returns
    -------
    found : (n, 8): SoC, its variance, innovation [V], its variance; inverse capacity over nominal
        with variance; ohmic scale with variance. Row 0 holds no innovation.
    """
    kernel = function("kalman", *[integers] * 7, *[array] * 14)
    if kernel is None:
        return run_by_numpy(plant, noise, state)
    found = np.empty((len(plant.step_second), 8))
    found[0] = _row(plant, state, np.nan, np.nan)
    sizes = [*found.shape[:1], *plant.tables.shape, len(plant.direct), len(plant.element)]
    sizes += [plant.size, plant.error, plant.capacity, plant.ohmic, plant.first_order]
    sizes += [noise.adaptive, noise.window, len(NODES)]
    reals = [plant.soc_first, plant.soc_spacing, plant.capacity_ampere_hour, plant.white_variance]
    reals += [plant.slow_variance, noise.error_second, *noise.soc_walk, noise.ohmic_walk]
    reals += [noise.slope_window_soc / 2, state.soc_walk, state.error_variance]
    ring = np.zeros((noise.window, 3))
    ring[: len(state.seen)] = state.seen
    whole = [plant.shifts_soc, plant.source, plant.by_charge, plant.element, plant.moves]
    record = [plant.step_second, plant.charge_ampere_hour, plant.passed_ampere_hour]
    record += [plant.current_ampere, plant.between_ampere, plant.voltage_volt]
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
    found = np.empty((len(plant.step_second), 8))
    found[0] = _row(plant, state, np.nan, np.nan)
    for k in range(1, len(found)):
        state, innovation, variance = update(predict(state, plant, k, noise), plant, k, noise)
        found[k] = _row(plant, state, innovation, variance)
    return found


def _row(plant, state, innovation, variance):
    row = [state.mean[0], state.covariance[0, 0], innovation, variance]
    for spot in (plant.capacity, plant.ohmic):
        known = spot >= 0
        row += [state.mean[spot], state.covariance[spot, spot]] if known else [1.0, 0.0]
    return row


def _matched(seen, floor, error, noise):
    """White and slow variance that the last samples show, never below what was stated.

    What of the window is still empty counts as stated, so that one sample is no statistics. From
    each e² goes its own share CPCᵀ, so that a wrong start does not pass for noise.

    Source: K. A. Myers, B. D. Tapley, IEEE Trans. Automatic Control 21 (1976) 520.
    """
    empty = noise.window - len(seen)
    white = max(floor, (np.sum(seen[:, 0] - seen[:, 1]) + empty * floor) / noise.window)
    slow = (np.sum(seen[:, 2]) + empty * (error + white)) / noise.window - white
    return white, max(error, slow)


def _walk(state, gain, variance, step, noise):
    """Variance of the SoC per second, Q = K·H·Kᵀ, between what the current sensor adds at least
    and at most: unbounded, the print's law puts back all that a measurement taught."""
    if not noise.adaptive or step <= 0.0:
        return state.soc_walk
    empty = noise.window - len(state.seen)
    mean_square = (np.sum(state.seen[:, 0]) + empty * variance) / noise.window
    return float(np.clip(gain**2 * mean_square / step, *noise.soc_walk))
