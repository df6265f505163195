"""dQ/dV of a charge: a curve over voltage, and peaks described."""

from typing import NamedTuple

import numpy as np


class IncrementalCapacity(NamedTuple):
    """dQ/dV over a uniform grid of voltage, and dV/dQ over the charge at the same points.

    voltage_volt, charge_ampere_hour, dq_dv_ampere_hour_per_volt, dv_dq_volt_per_ampere_hour,
    dq_dv_std_ampere_hour_per_volt : (n,); charge from the first point of the curve.
    """

    voltage_volt: np.ndarray
    charge_ampere_hour: np.ndarray
    dq_dv_ampere_hour_per_volt: np.ndarray
    dv_dq_volt_per_ampere_hour: np.ndarray
    dq_dv_std_ampere_hour_per_volt: np.ndarray


class Peaks(NamedTuple):
    """Peaks in order of voltage (k,); empty where the curve has none, which is a result.

    Position [V], height [Ah/V], area from valley to valley [Ah], full width at half of the rise
    above the higher valley [V], each with its standard deviation;
    position_height_covariance [Ah]. prominence : rise above the higher valley, as a share of the
    curve's highest dQ/dV [1].
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
