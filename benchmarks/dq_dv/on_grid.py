"""dQ/dV on a uniform grid of voltage: the curve with what follows from it, and its peaks."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.numerics.linear import SAVITZKY_GOLAY_ORDER, savitzky_golay_weights
from cellwright.protocols.ica.spline import Peaks


class GridCurve(NamedTuple):
    """dQ/dV over a uniform grid of voltage, arrays (n,).

    charge from the first point. bin_volt, smooth_volt : width of a bin and of the smoothing window.
    scatter_volt : white noise of one row along the axis of voltage.
    """

    voltage_volt: np.ndarray
    charge_ampere_hour: np.ndarray
    dq_dv_ampere_hour_per_volt: np.ndarray
    dq_dv_std_ampere_hour_per_volt: np.ndarray
    bin_volt: float
    smooth_volt: float
    scatter_volt: float


def gridded(voltage_volt, dq_dv, *, bin_volt, smooth_volt, scatter_volt, density):
    """Curve of a method that gives dQ/dV on a uniform grid, with what follows from it.

    Parameters
    ----------
    voltage_volt, dq_dv : (n,) [V], [Ah/V]. bin_volt, smooth_volt, scatter_volt : [V].
    density : rows of the record per charge [1/Ah].

    Returns
    -------
    curve : GridCurve. The noise of dQ/dV is that of a slope over the smoothing window.
    """
    positive = np.maximum(dq_dv, 1e-6 * np.max(np.abs(dq_dv)))
    moved = (dq_dv[1:] + dq_dv[:-1]) / 2 * np.diff(voltage_volt)
    rows = np.maximum(positive * bin_volt * density, 1.0)
    per_bin = positive * scatter_volt / np.sqrt(rows)
    # The norm of a Savitzky-Golay filter of order 5 for the slope, half a window of `half` bins.
    half = max(smooth_volt / bin_volt / 2, 1.0)
    return GridCurve(
        voltage_volt=voltage_volt,
        charge_ampere_hour=np.append(0.0, np.cumsum(moved)),
        dq_dv_ampere_hour_per_volt=dq_dv,
        dq_dv_std_ampere_hour_per_volt=per_bin * SLOPE_NORM / (bin_volt * half**1.5),
        bin_volt=bin_volt,
        smooth_volt=smooth_volt,
        scatter_volt=float(scatter_volt),
    )


# Of a Savitzky-Golay filter of order 5: norm of the weights of the slope, for half a window of many
# bins h of unit width, times h to the power 1.5.
SLOPE_NORM = 5.2


def grid_peaks(curve, *, prominence, noise_factor=5.0):
    """Peaks of dQ/dV that stand out of their surroundings and of the noise.

    Parameters
    ----------
    curve : GridCurve.
    prominence : least height of a peak above the higher of the two valleys that part it from
        higher ones, as a share of the highest dQ/dV [1].
    noise_factor : the same, in standard deviations of the noise of dQ/dV.

    Returns
    -------
    peaks : Peaks. The position is the vertex of a parabola about the highest point; its standard
        deviation follows from the noise of the rows by the delta method. The area is the charge
        from valley to valley.
    """
    height, std = curve.dq_dv_ampere_hour_per_volt, curve.dq_dv_std_ampere_hour_per_volt
    half = max(round(curve.smooth_volt / curve.bin_volt) // 2, 1)
    threshold = np.maximum(prominence * height.max(), noise_factor * std)
    # Beside a peak narrower than the window the filter rings by up to a tenth of its height.
    padded = np.pad(height, 2 * half, mode="edge")
    near = np.lib.stride_tricks.sliding_window_view(padded, 4 * half + 1)
    threshold = np.maximum(threshold, 0.1 * near.max(axis=1))
    tops = np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:])) + 1
    tops = tops[_steps_down(height, tops) > threshold[tops]]
    tops = np.array([top for top in tops if _prominence(height, top) > threshold[top]], int)
    shift, shift_std = _vertices(curve, half, tops)
    edges = [0, *(a + height[a:b].argmin() for a, b in pairwise(tops)), len(height) - 1]
    charge = curve.charge_ampere_hour
    area = [charge[b] - charge[a] for a, b in pairwise(edges)] if len(tops) else []
    unknown = np.full(len(tops), np.nan)
    return Peaks(
        voltage_volt=curve.voltage_volt[tops] + shift,
        voltage_std_volt=shift_std,
        height_ampere_hour_per_volt=height[tops],
        height_std_ampere_hour_per_volt=std[tops],
        area_ampere_hour=np.array(area),
        area_std_ampere_hour=unknown,
        width_volt=_widths(curve, tops),
        width_std_volt=unknown,
        position_height_covariance_ampere_hour=unknown,
        prominence=np.array([_prominence(height, top) for top in tops]) / height.max(),
    )


def _vertices(curve, half, tops):
    """Vertex of a parabola through a third of the window about each peak, and its deviation [V]."""
    height = curve.dq_dv_ampere_hour_per_volt
    slope = savitzky_golay_weights(max(half, SAVITZKY_GOLAY_ORDER), curve.bin_volt, 1)
    noise = curve.dq_dv_std_ampere_hour_per_volt[tops] / np.linalg.norm(slope)
    reach = max(half // 3, 1)
    offsets = np.arange(-reach, reach + 1) * curve.bin_volt
    _, steepness, bend = np.linalg.pinv(offsets[:, None] ** [0, 1, 2])
    heights = height[np.clip(tops[:, None] + np.arange(-reach, reach + 1), 0, len(height) - 1)]
    farthest = reach * curve.bin_volt
    shift = np.clip(-heights @ steepness / (2 * heights @ bend), -farthest, farthest)
    std = noise * np.linalg.norm(np.convolve(slope, steepness)) / np.abs(2 * heights @ bend)
    return shift, std


def _widths(curve, tops):
    """Full width of each peak at half of its rise above the higher valley [V]."""
    from scipy.signal import peak_widths

    return peak_widths(curve.dq_dv_ampere_hour_per_volt, tops, 0.5)[0] * curve.bin_volt


def _steps_down(height, tops):
    """Upper bound of each prominence: the drop to the next valley before a higher top.

    With it nearly all ripples need no search over the whole curve.
    """
    if len(tops) < 2:
        return np.full(len(tops), np.inf)
    valley = np.minimum.reduceat(height, tops)[:-1]
    first, second = height[tops[:-1]], height[tops[1:]]
    to_right = np.append(np.where(second > first, first - valley, np.inf), np.inf)
    to_left = np.append(np.inf, np.where(first > second, second - valley, np.inf))
    return np.minimum(to_left, to_right)


def _prominence(height, top):
    """Height of a peak above the higher of the two valleys between it and higher peaks."""
    higher = np.flatnonzero(height > height[top])
    from_row = higher[higher < top].max(initial=-1) + 1
    to_row = higher[higher > top].min(initial=len(height))
    return height[top] - max(height[from_row : top + 1].min(), height[top:to_row].min())
