"""What a plain circuit leaves of a cell's voltage: R0 and two RC pairs, the same for all drives.

The circuit has the exact OCV and capacity of the healthy cell. Resistances and time constants are
fitted to the drives for it, the state of charge at the start to each drive alone.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

TAU_SECOND = ((2.0, 40.0), (40.0, 600.0))  # limits of the two time constants
FIRST_TAU_SECOND = (8.0, 150.0)
NEARLY_EMPTY = 0.1  # below it the OCV is too steep for a fit of resistances
SOC = np.linspace(0.0, 1.0, 1001)


class Drive(NamedTuple):
    """A drive from full as the instrument shows it without noise, at even steps of time.

    Current [A] positive on charge, voltage [V], step of time [s]. `proof`: not for the fit.
    """

    current_ampere: np.ndarray
    volt: np.ndarray
    step_second: float
    proof: bool


def residuals_volt(
    drives: list[Drive], ocv_volt: np.ndarray, *, capacity_ampere_hour: float
) -> list[np.ndarray]:
    """Voltage less that of the fitted circuit [V], of each drive.

    Parameters
    ----------
    drives : at least one of them for the fit.
    ocv_volt : over the state of charge SOC, shape (1001,).
    capacity_ampere_hour : to which the state of charge refers.

    Returns
    -------
    An array a drive, NaN where the cell is nearly empty.
    """
    laid = [_laid_out(drive, ocv_volt, capacity_ampere_hour) for drive in drives]
    fitted = [one for one in laid if not one.drive.proof]
    limits = np.log(TAU_SECOND)
    found = least_squares(
        lambda log_tau: _fit(fitted, np.exp(log_tau))[1],
        np.log(FIRST_TAU_SECOND),
        bounds=(limits[:, 0], limits[:, 1]),
        x_scale=0.1,
    )
    tau = np.exp(found.x)
    ohm = _fit(fitted, tau)[0]
    return [_remaining(one, tau, ohm) for one in laid]


class _Laid(NamedTuple):
    """A drive with its overvoltage [V], the slope of the OCV [V], and which rows count."""

    drive: Drive
    over_volt: np.ndarray
    slope_volt: np.ndarray
    counts: np.ndarray


def _laid_out(drive, ocv_volt, capacity):
    charge = np.cumsum(drive.current_ampere) * drive.step_second / 3600
    soc = np.clip(1.0 + charge / capacity, 0.0, 1.0)
    over = drive.volt - np.interp(soc, SOC, ocv_volt)
    slope = np.interp(soc, SOC, np.gradient(ocv_volt, SOC))
    return _Laid(drive, over, slope, soc > NEARLY_EMPTY)


def _columns(one, tau_second):
    """Current and its two lags [A] on the rows that count, shape (n, 3)."""
    current, kept = one.drive.current_ampere, np.exp(-one.drive.step_second / tau_second)
    lags = [lfilter([1 - k], [1.0, -k], current) for k in kept]
    return np.column_stack([current, *lags])[one.counts]


def _fit(fitted, tau_second):
    """Resistances [ohm] (R0, R1, R2) by least squares, and the residual [V] of all rows."""
    shared = np.vstack([_columns(one, tau_second) for one in fitted])
    starts = np.zeros((len(shared), len(fitted)))
    ends = np.cumsum([0, *[one.counts.sum() for one in fitted]])
    for k, one in enumerate(fitted):
        starts[ends[k] : ends[k + 1], k] = one.slope_volt[one.counts]
    rows = np.hstack([shared, starts])
    target = np.concatenate([one.over_volt[one.counts] for one in fitted])
    best = np.linalg.lstsq(rows, target, rcond=None)[0]
    return best[:3], target - rows @ best


def _remaining(one, tau_second, ohm):
    """Residual [V] of a drive with its own start, NaN on rows that do not count."""
    residual = one.over_volt[one.counts] - _columns(one, tau_second) @ ohm
    slope = one.slope_volt[one.counts]
    volt = np.full(one.over_volt.size, np.nan)
    volt[one.counts] = residual - slope * (slope @ residual) / (slope @ slope)
    return volt


def rms_volt(parts: list[np.ndarray]) -> float:
    """Root mean square [V] over all numbers of several arrays; NaN left out, 0 without any."""
    volt = np.concatenate(parts) if parts else np.zeros(0)
    known = volt[np.isfinite(volt)]
    return float(np.sqrt(np.mean(known**2))) if known.size else 0.0
