"""Peaks of dQ/dV of a charge with constant current, without noise."""

import numpy as np
from scipy.signal import find_peaks

from virtual_lab.rating import Rating

POINTS = 4001
BESIDE_SHARE = 0.002  # of the charge, to either side: what the slope of the voltage is taken over
PROMINENCE = 0.05
LONG_SECOND = 120.0
LEAST_SHARE = 0.3  # of the rating: a shorter charge shows no whole curve


def ica_rows(
    steps: list, behaviours: list, *, rating: Rating, prominence: float = PROMINENCE
) -> list[dict]:
    """Peaks of every long charge of constant current, by rising voltage.

    Parameters
    ----------
    steps, behaviours : what was asked and what happened.
    rating : to which the C-rates refer.
    prominence : how far a peak stands out at least, as a share of the highest dQ/dV [1].

    Returns
    -------
    Rows of ica.csv without cell and test.
    """
    rows = []
    for step, behaviour in zip(steps, behaviours, strict=True):
        if step.kind != "current" or step.value <= 0 or behaviour.duration_second < LONG_SECOND:
            continue
        moved = step.value * behaviour.duration_second / 3600
        if moved < LEAST_SHARE * rating.capacity_ampere_hour:
            continue
        volt, height = incremental_capacity(behaviour, step.value)
        rows += [
            {
                "c_rate": round(step.value / rating.capacity_ampere_hour, 4),
                "peak": number,
                "voltage_volt": round(float(volt[top]), 5),
                "height_ampere_hour_per_volt": float(f"{height[top]:.6g}"),
            }
            for number, top in enumerate(tops(height, prominence), 1)
        ]
    return rows


def incremental_capacity(behaviour, current_ampere: float) -> tuple[np.ndarray, np.ndarray]:
    """Voltage [V] and dQ/dV [Ah/V] of a charge with constant current, shape (n,) each.

    Even steps of charge, so that a flat plateau has as many points as it has charge. Where the
    voltage falls while the cell is charged there is no dQ/dV: such points are left out.
    """
    second = np.linspace(0.0, behaviour.duration_second, POINTS)
    volt = behaviour.voltage(second)
    charge = current_ampere * second / 3600
    beside = round(BESIDE_SHARE * POINTS)
    rise = volt[2 * beside :] - volt[: -2 * beside]
    middle = volt[beside:-beside]
    rising = rise > 0
    passed = charge[2 * beside] - charge[0]
    return middle[rising], passed / rise[rising]


def tops(height: np.ndarray, prominence: float) -> np.ndarray:
    """Indices of peaks that stand out by so large a share of the highest point."""
    return find_peaks(height, prominence=prominence * height.max())[0]
