"""Curves of dQ/dV of several temperatures on one scale of smoothing, and their peaks on it."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal

END_SIGMAS = 5.0  # where a curve begins and ends polarisation sets, not the cell


class Peak(NamedTuple):
    """A peak at the common smoothing.

    voltage_volt, height_ampere_hour_per_volt, area_ampere_hour from valley to valley;
    voltage_std_volt : what smoothing leaves open. left_std_ampere_hour, right_std_ampere_hour :
    of the area, by the place of either valley.
    clear : whether both valleys lie below 0.8 of its height.
    """

    voltage_volt: float
    voltage_std_volt: float
    height_ampere_hour_per_volt: float
    area_ampere_hour: float
    left_std_ampere_hour: float
    right_std_ampere_hour: float
    clear: bool


def smoothed(voltage_volt, dq_dv, *, sigma_volt):
    """dQ/dV (n,) on its uniform grid (n,) [V], smoothed by a Gaussian of that width [V].

    At the ends the Gaussian is cut and scaled up, so that a constant stays itself.
    """
    step = (voltage_volt[-1] - voltage_volt[0]) / (len(voltage_volt) - 1)
    reach = max(int(np.ceil(4 * sigma_volt / step)), 1)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * step / sigma_volt) ** 2)
    inside = np.convolve(np.ones(len(dq_dv)), kernel)[reach:-reach]
    return np.convolve(dq_dv, kernel)[reach:-reach] / inside


# ASSUME: The edge of a peak's area is uncertain by the smoothing width (five of them at the ends
# of the curve), its place by how far it moves when smoothed twice as wide.
def scaled_peaks(voltage_volt, dq_dv, *, sigma_volt=0.01, prominence=0.05):
    """Peaks of one curve at the common smoothing.

    A chamber that swings prints ripples into dQ/dV that noise of the channel does not explain;
    curves are smoothed alike before their peaks are held against each other.

    Parameters
    ----------
    voltage_volt, dq_dv : (n,) curve of stage `ica_curve` [V], [A h/V].
    sigma_volt : width of the Gaussian [V]. prominence : least rise of a peak above the higher of
        its two valleys, as a share of the curve's highest value [1].

    Returns
    -------
    list of Peak, from low voltage.

    Raises
    ------
    Refusal : a curve shorter than eight widths, or without a peak.
    """
    if voltage_volt[-1] - voltage_volt[0] < 8 * sigma_volt:
        raise Refusal(f"dQ/dV spans less than {8 * sigma_volt:g} V")
    height = smoothed(voltage_volt, dq_dv, sigma_volt=sigma_volt)
    wide = smoothed(voltage_volt, dq_dv, sigma_volt=2 * sigma_volt)
    tops, edges = _tops(height, prominence * height.max())
    if not len(tops):
        raise Refusal(f"no peak of dQ/dV stands out at a smoothing of {1e3 * sigma_volt:g} mV")
    return [
        _peak(voltage_volt, height, wide, top, left, right, sigma_volt)
        for top, (left, right) in zip(tops, pairwise(edges), strict=True)
    ]


def _tops(height, least):
    """Rows of the peaks and of the valleys about them; peaks too low against a valley give way,
    the lowest rise first."""
    inner = np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:])) + 1
    tops = list(inner)
    while tops:
        valleys = [a + int(height[a : b + 1].argmin()) for a, b in pairwise([0, *tops])][1:]
        edges = [0, *valleys, len(height) - 1]
        rises = [
            height[top] - max(height[_low(height, a, top)], height[_low(height, top, b)])
            for top, (a, b) in zip(tops, pairwise(edges), strict=True)
        ]
        lowest = int(np.argmin(rises))
        if rises[lowest] >= least:
            return tops, edges
        tops.pop(lowest)
    return [], []


def _low(height, first, last):
    return first + int(height[first : last + 1].argmin())


def _peak(voltage, height, wide, top, left, right, sigma):
    step = voltage[1] - voltage[0]
    bend = height[top - 1] - 2 * height[top] + height[top + 1]
    shift = 0.5 * (height[top - 1] - height[top + 1]) / bend if bend else 0.0
    reach = max(int(2 * sigma / step), 1)
    near = slice(max(top - reach, 0), top + reach + 1)
    moved = voltage[near][int(np.argmax(wide[near]))] - voltage[top]
    inside = height[left : right + 1]
    return Peak(
        float(voltage[top] + shift * step),
        float(np.hypot(0.5 * moved, step / np.sqrt(12))),
        float(height[top]),
        float(np.sum((inside[1:] + inside[:-1]) / 2) * step),
        float(height[left] * sigma * (END_SIGMAS if left == 0 else 1)),
        float(height[right] * sigma * (END_SIGMAS if right == len(height) - 1 else 1)),
        bool(max(height[left], height[right]) < 0.8 * height[top]),
    )
