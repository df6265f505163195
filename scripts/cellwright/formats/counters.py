"""Ampere-hour counters of charge and discharge → one signed counter, continuous over resets."""

import numpy as np


def net_capacity(charge_counter: np.ndarray, discharge_counter: np.ndarray) -> np.ndarray:
    """Net charge put in, from two counters that only grow, but may start again from zero.

    Parameters
    ----------
    charge_counter, discharge_counter : arrays [Ah]

    Returns
    -------
    array [Ah], positive on charge whatever the sign of the file's current.
    """
    return _without_resets(charge_counter) - _without_resets(discharge_counter)


def _without_resets(counter: np.ndarray) -> np.ndarray:
    """Some instruments count discharge downwards: the magnitude is what grows."""
    magnitude = np.abs(counter)
    step = np.diff(magnitude, prepend=magnitude[:1])
    # A counter that falls to less than half began again from zero: what it shows was counted since.
    reset = (step < 0) & (magnitude < 0.5 * (magnitude - step))
    return magnitude[:1] + np.cumsum(np.where(reset, magnitude, step))
