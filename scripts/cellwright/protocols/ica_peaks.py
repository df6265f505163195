"""Peaks of an incremental-capacity curve."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.protocols.savitzky_golay import weights


class Peaks(NamedTuple):
    """Peaks in order of voltage; empty where the curve has none, which is a result (k,)."""

    voltage_volt: np.ndarray
    voltage_std_volt: np.ndarray
    height_ampere_hour_per_volt: np.ndarray
    area_ampere_hour: np.ndarray


def peaks(curve, *, prominence=0.05, noise_factor=5.0):
    """Peaks of dQ/dV that stand out of their surroundings and of the noise.

    Parameters
    ----------
    curve : IncrementalCapacity.
    prominence : least height of a peak above the higher of the two valleys that part it from
        higher ones, as a share of the highest dQ/dV [1].
    noise_factor : the same, in standard deviations of the noise of dQ/dV.

    Returns
    -------
    peaks : Peaks. The position is the vertex of a parabola about the highest point; its standard
        deviation follows from the noise of the rows by the delta method. The area is the charge
        from valley to valley.
    """
    height = curve.dq_dv_ampere_hour_per_volt
    half = round(curve.smooth_volt / curve.bin_volt) // 2
    slope = weights(half, curve.bin_volt, 1)
    rows = np.maximum(height * curve.bin_volt * curve.rows_per_ampere_hour, 1.0)
    noise = np.maximum(height, 0) * curve.scatter_volt / np.sqrt(rows)
    least = np.maximum(prominence * height.max(), noise_factor * noise * np.linalg.norm(slope))
    # Beside a peak narrower than the window the filter rings by up to a tenth of its height.
    least = np.maximum(least, 0.1 * _highest_near(height, 2 * half))
    tops = np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:])) + 1
    tops = tops[_steps_down(height, tops) > least[tops]]
    tops = np.array([top for top in tops if _prominence(height, top) > least[top]], int)
    # A parabola by least squares through a third of the window about the highest point.
    reach = max(half // 3, 1)
    offsets = np.arange(-reach, reach + 1) * curve.bin_volt
    _, steepness, bend = np.linalg.pinv(offsets[:, None] ** [0, 1, 2])
    about = height[np.clip(tops[:, None] + np.arange(-reach, reach + 1), 0, len(height) - 1)]
    farthest = reach * curve.bin_volt
    shift = np.clip(-about @ steepness / (2 * about @ bend), -farthest, farthest)
    steepness_noise = noise[tops] * np.linalg.norm(np.convolve(slope, steepness))
    edges = [0, *(a + height[a:b].argmin() for a, b in pairwise(tops)), len(height) - 1]
    inside = (height[1:] + height[:-1]) / 2 * curve.bin_volt
    area = [inside[a:b].sum() for a, b in pairwise(edges)]
    return Peaks(
        voltage_volt=curve.voltage_volt[tops] + shift,
        voltage_std_volt=steepness_noise / np.abs(2 * about @ bend),
        height_ampere_hour_per_volt=height[tops],
        area_ampere_hour=np.array(area if len(tops) else []),
    )


def _highest_near(height, reach):
    """Highest value within so many points to either side."""
    padded = np.pad(height, reach, mode="edge")
    return np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).max(axis=1)


def _steps_down(height, tops):
    """Bound of each prominence: the drop to the next valley, where a higher top lies behind it.

    It spares nearly all ripples the full look around.
    """
    if len(tops) < 2:
        return np.full(len(tops), np.inf)
    valley = np.minimum.reduceat(height, tops)[:-1]
    first, second = height[tops[:-1]], height[tops[1:]]
    to_right = np.append(np.where(second > first, first - valley, np.inf), np.inf)
    to_left = np.append(np.inf, np.where(first > second, second - valley, np.inf))
    return np.minimum(to_left, to_right)


def _prominence(height, top):
    """Height above the higher of the two lowest points on the way to higher ground."""
    higher = np.flatnonzero(height > height[top])
    left = higher[higher < top].max(initial=-1) + 1
    right = higher[higher > top].min(initial=len(height))
    return height[top] - max(height[left : top + 1].min(), height[top:right].min())
