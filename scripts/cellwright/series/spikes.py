"""Single samples of the voltage that jump out and back though the current gives no reason."""

import numpy as np


def spike_rows(
    current_ampere: np.ndarray,
    voltage_volt: np.ndarray,
    *,
    limit_volt: float = 0.01,
    noise_factor: float = 8.0,
    current_step_ampere: float,
) -> np.ndarray:
    """Rows of the voltage that are spikes.

    1. The steps to both neighbours exceed the limit and have opposite signs.
    2. The limit is `limit_volt`, or `noise_factor` times the typical step nearby if that is more.
    3. The current of the five samples around moves by less than `current_step_ampere`: a step of
       the voltage that the current explains is never a spike, even where its channel lags by two.
    4. Nor does the current jump out and back with it by three of its own small steps: on a
       coarse grid a short pulse leaves little of its current and much of its voltage.
    5. The four neighbours agree with each other better than with the spike: it jumped out of a
       smooth curve, and back.

    Parameters
    ----------
    current_ampere, voltage_volt : arrays [A], [V], same length
    limit_volt : float [V]
    noise_factor : float
    current_step_ampere : float [A]

    Returns
    -------
    array of row numbers

    Source
    ------
    Thesis ch. 5.2 and table 5.1. Erratum: its test compares signed differences; the two steps of
    a spike have opposite signs, so magnitudes and signs are compared here.
    """
    step = np.diff(voltage_volt)
    if step.size < 4:
        return np.empty(0, dtype=int)
    rows = np.arange(2, voltage_volt.size - 2)
    into, out = step[1:-2], step[2:-1]
    least = np.minimum(np.abs(into), np.abs(out))
    suspect = rows[(into * out < 0) & (least > limit_volt)]
    limit = noise_factor * _typical_step(step, suspect)
    suspect = suspect[least[suspect - 2] > limit]
    around = suspect[:, None] + np.arange(-2, 3)
    quiet = np.ptp(current_ampere[around], axis=1) < current_step_ampere
    quiet &= ~_answered(current_ampere, voltage_volt, suspect, 0.1 * current_step_ampere)
    neighbours = voltage_volt[around[:, [0, 1, 3, 4]]]
    smooth = np.ptp(neighbours, axis=1) < 0.5 * least[suspect - 2]
    return suspect[quiet & smooth]


def spike_free(voltage_volt: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """The voltage [V] with each spike replaced by the mean of its four neighbours."""
    repaired = voltage_volt.copy()
    around = rows[:, None] + np.array([-2, -1, 1, 2])
    repaired[rows] = voltage_volt[around].mean(axis=1)
    return repaired


def _answered(
    current: np.ndarray, voltage: np.ndarray, rows: np.ndarray, least_ampere: float
) -> np.ndarray:
    """Whether the current left its neighbours in the direction of the voltage at each row."""
    beside = rows[:, None] + np.array([-1, 1])
    out_current = current[rows] - current[beside].mean(axis=1)
    out_voltage = voltage[rows] - voltage[beside].mean(axis=1)
    quiet = _typical_step(np.diff(current), rows, quantile=0.25)
    limit = np.maximum(3 * quiet, least_ampere)
    return (out_current * out_voltage > 0) & (np.abs(out_current) > limit)


def _typical_step(
    step: np.ndarray, rows: np.ndarray, *, quantile: float = 0.5, half_width: int = 10
) -> np.ndarray:
    """Quantile of the magnitude of the steps within `half_width` samples of each row."""
    near = np.clip(rows[:, None] + np.arange(-half_width, half_width), 0, step.size - 1)
    return np.quantile(np.abs(step[near]), quantile, axis=1)
