"""What every method of dQ/dV gives: a curve over voltage, and peaks described."""

from typing import NamedTuple

import numpy as np

BIN_VOLT = 0.003  # of the bins in which charge is averaged; a curve has no wider step


class IncrementalCapacity(NamedTuple):
    """dQ/dV over a uniform grid of voltage, and dV/dQ over the charge at the same points.

    voltage_volt, charge_ampere_hour, dq_dv_ampere_hour_per_volt, dv_dq_volt_per_ampere_hour,
    dq_dv_std_ampere_hour_per_volt : (n,); charge from the first point of the curve. bin_volt,
    smooth_volt : step of the grid or width of a bin, and of the smoothing window (0 where a method
    has none). scatter_volt : white noise of one row along the axis of voltage.
    rows_per_ampere_hour : density of the record.
    """

    voltage_volt: np.ndarray
    charge_ampere_hour: np.ndarray
    dq_dv_ampere_hour_per_volt: np.ndarray
    dv_dq_volt_per_ampere_hour: np.ndarray
    dq_dv_std_ampere_hour_per_volt: np.ndarray
    bin_volt: float
    smooth_volt: float
    scatter_volt: float
    rows_per_ampere_hour: float
    method: str


class Peaks(NamedTuple):
    """Peaks in order of voltage (k,); empty where the curve has none, which is a result.

    Position [V], height [Ah/V], area from valley to valley [Ah], full width at half of the rise
    above the higher valley [V], each with its standard deviation (NaN where the method tells
    none); position_height_covariance [Ah]. prominence : rise above the higher valley, as a share of
    the curve's highest dQ/dV [1].
    """

    voltage_volt: np.ndarray
    voltage_std_volt: np.ndarray
    height_ampere_hour_per_volt: np.ndarray
    height_std_ampere_hour_per_volt: np.ndarray
    area_ampere_hour: np.ndarray
    area_std_ampere_hour: np.ndarray
    width_volt: np.ndarray
    width_std_volt: np.ndarray
    position_height_covariance_ampere_hour: np.ndarray
    prominence: np.ndarray


def gridded(voltage_volt, dq_dv, *, bin_volt, smooth_volt, scatter_volt, density, method):
    """Curve of a method that gives dQ/dV on a uniform grid, with what follows from it.

    Parameters
    ----------
    voltage_volt, dq_dv : (n,) [V], [Ah/V]. bin_volt, smooth_volt, scatter_volt : [V].
    density : rows of the record per charge [1/Ah]. method : its name.

    Returns
    -------
    curve : IncrementalCapacity. The noise of dQ/dV is that of a slope over the smoothing window.
    """
    positive = np.maximum(dq_dv, 1e-6 * np.max(np.abs(dq_dv)))
    moved = (dq_dv[1:] + dq_dv[:-1]) / 2 * np.diff(voltage_volt)
    rows = np.maximum(positive * bin_volt * density, 1.0)
    per_bin = positive * scatter_volt / np.sqrt(rows)
    # The norm of a Savitzky-Golay filter of order 5 for the slope, half a window of `half` bins.
    half = max(smooth_volt / bin_volt / 2, 1.0)
    return IncrementalCapacity(
        voltage_volt=voltage_volt,
        charge_ampere_hour=np.append(0.0, np.cumsum(moved)),
        dq_dv_ampere_hour_per_volt=dq_dv,
        dv_dq_volt_per_ampere_hour=1 / positive,
        dq_dv_std_ampere_hour_per_volt=per_bin * SLOPE_NORM / (bin_volt * half**1.5),
        bin_volt=bin_volt,
        smooth_volt=smooth_volt,
        scatter_volt=float(scatter_volt),
        rows_per_ampere_hour=float(density),
        method=method,
    )


# Of a Savitzky-Golay filter of order 5: norm of the weights of the slope, for half a window of many
# bins h of unit width, times h to the power 1.5.
SLOPE_NORM = 5.2
