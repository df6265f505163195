"""Lumped thermal state of a cell, and its heat capacity and thermal resistance from a record."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.circuits.temperature import ZERO_CELSIUS_KELVIN
from cellwright.numerics.lags import lag
from cellwright.numerics.statistics import (
    correlation_factor,
    covariance_from_jacobian,
    delta_method,
)
from cellwright.refusal import Refusal


def heat(
    current_ampere,
    voltage_volt,
    ocv_volt,
    *,
    temperature_celsius=None,
    entropic_volt_per_kelvin=None,
):
    """Heat of a cell [W]: its losses, and the reversible heat where its coefficient is given.

    Parameters
    ----------
    current_ampere : (n,) positive on charge [A].
    voltage_volt, ocv_volt : (n,) [V].
    temperature_celsius : scalar or (n,), needed for the reversible part [degC].
    entropic_volt_per_kelvin : scalar or (n,) slope of the OCV over temperature [V/K], or None.

    Returns
    -------
    heat_watt : (n,) I·(V − OCV) + I·T·dOCV/dT [W]; the first part is never negative at rest or in
        a steady load.

    Raises
    ------
    Refusal : an entropic coefficient without a temperature.

    Source: D. Bernardi, E. Pawlikowski, J. Newman, J. Electrochem. Soc. 132 (1985) 5, without
    heat of mixing.
    """
    losses = current_ampere * (voltage_volt - ocv_volt)
    if entropic_volt_per_kelvin is None:
        return losses
    if temperature_celsius is None:
        raise Refusal("reversible heat needs a temperature beside the entropic coefficient")
    kelvin = np.asarray(temperature_celsius) + ZERO_CELSIUS_KELVIN
    return losses + current_ampere * kelvin * entropic_volt_per_kelvin


def temperature(
    test_time_second,
    heat_watt,
    ambient_celsius,
    *,
    heat_capacity_joule_per_kelvin,
    resistance_kelvin_per_watt,
    initial_celsius=None,
):
    """Temperature of a cell from its heat [degC], exact for heat and ambient linear in time.

    C·dT/dt = heat − (T − T_ambient)/R, a first-order lag of T_ambient + R·heat with tau = R·C.

    Parameters
    ----------
    test_time_second : (n,) never falling [s].
    heat_watt : (n,) [W].
    ambient_celsius : scalar or (n,) [degC].
    heat_capacity_joule_per_kelvin : C [J/K]. resistance_kelvin_per_watt : R to the ambient [K/W].
    initial_celsius : temperature at the first sample [degC]; None is that of the ambient.

    Returns
    -------
    temperature_celsius : (n,) [degC].

    Raises
    ------
    Refusal : C or R is not above zero.
    """
    # ASSUME: A cell has one temperature, and all its heat leaves through one resistance.
    if not (heat_capacity_joule_per_kelvin > 0 and resistance_kelvin_per_watt > 0):
        given = f"{heat_capacity_joule_per_kelvin:g} J/K and {resistance_kelvin_per_watt:g} K/W"
        raise Refusal(f"heat capacity and resistance are {given}; both must be above zero")
    ambient = np.broadcast_to(np.asarray(ambient_celsius, float), np.shape(heat_watt))
    start = ambient[0] if initial_celsius is None else initial_celsius
    tau = resistance_kelvin_per_watt * heat_capacity_joule_per_kelvin
    drive = ambient + resistance_kelvin_per_watt * np.asarray(heat_watt, float)
    return lag(np.diff(test_time_second), tau, drive, hold="first_order", initial=start)


SLOPE_STEP = 1e-4  # of ln tau


class ThermalFit(NamedTuple):
    """Thermal parameters of a cell fitted to its surface temperature.

    heat_capacity_joule_per_kelvin, resistance_kelvin_per_watt : with standard deviations.
    ambient_offset_kelvin : what the cell rests above the stated ambient.
    entropic_volt_per_kelvin, entropic_std_volt_per_kelvin : (k,) slope of the OCV over temperature,
    one a column of its shape; none where it was not asked for.
    rmse_kelvin : error of the fitted temperature, each second counting the same. moved_kelvin :
    scatter of what the measured one is above the ambient, likewise.
    """

    heat_capacity_joule_per_kelvin: float
    heat_capacity_std_joule_per_kelvin: float
    resistance_kelvin_per_watt: float
    resistance_std_kelvin_per_watt: float
    ambient_offset_kelvin: float
    entropic_volt_per_kelvin: np.ndarray
    entropic_std_volt_per_kelvin: np.ndarray
    rmse_kelvin: float
    moved_kelvin: float
    samples: int


def fit_thermal(
    test_time_second,
    current_ampere,
    voltage_volt,
    ocv_volt,
    surface_temperature_celsius,
    ambient_celsius,
    *,
    entropic_shape=None,
    tau_bounds_second=(30.0, 30000.0),
):
    """Heat capacity and resistance of the lumped state, by variable projection.

    1. The heat is I·(V − OCV); where asked, entropic coefficients are fitted as well.
    2. After ten minutes without a row the load is not known: the temperature starts anew, at a
       fitted value.
    3. For a given time constant the rest is linear; the time constant is searched on a grid of its
       logarithm, then by Brent's method. Every second weighs the same, whatever the logger's rate.

    Parameters
    ----------
    test_time_second, current_ampere, voltage_volt, ocv_volt : (n,) [s], [A], [V], [V].
    surface_temperature_celsius : (n,) measured on the cell [degC].
    ambient_celsius : scalar or (n,) [degC]; a constant error of it is fitted.
    entropic_shape : (n, k) columns by which the entropic coefficient moves along the record, such
        as hats over SoC (`linear.hats`), or one of ones for a mean; None: no reversible heat.
        Charge beside discharge at the same SoC tells it from losses.
    tau_bounds_second : least and greatest time constant searched [s].

    Returns
    -------
    fit : ThermalFit. Standard deviations are widened by the autocorrelation of the residuals.

    Raises
    ------
    Refusal : values not finite, a temperature that does not follow the heat, or a time constant
        that the record does not tell.
    """
    # ASSUME: The sensor on the surface shows the one temperature of the cell; the core is warmer.
    columns = (test_time_second, current_ampere, voltage_volt, ocv_volt)
    record = [np.asarray(c, float) for c in (*columns, surface_temperature_celsius)]
    ambient = np.broadcast_to(np.asarray(ambient_celsius, float), record[0].shape)
    _check(record, ambient)
    time, current, voltage, ocv, surface = record
    drives = [heat(current, voltage, ocv)]
    if entropic_shape is not None:
        drives += list((current * (surface + ZERO_CELSIUS_KELVIN))[:, None].T * entropic_shape.T)
    task = _ThermalRecord(*_parts(time), np.column_stack(drives), ambient, surface)
    return _thermal_fit(task, _best_log_tau(task, tau_bounds_second))


class _ThermalRecord(NamedTuple):
    """Rows of a record: `parts` slices between gaps, `age` since each began, `weight` in √s."""

    parts: list
    time: np.ndarray
    age: np.ndarray
    weight: np.ndarray
    drives: np.ndarray
    ambient: np.ndarray
    surface: np.ndarray


def _check(record, ambient):
    if not all(np.isfinite(values).all() for values in [*record, ambient]):
        raise Refusal("time, current, voltage, OCV or temperature holds values that are not finite")
    if len(record[0]) < 10:
        raise Refusal(f"{len(record[0])} samples; a thermal fit needs at least 10")


def _parts(time):
    """Slices between gaps, time [s], time since each slice began [s], weight of each row [√s]."""
    steps, gap_second = np.diff(time), 600.0
    edges = [0, *(np.flatnonzero(steps > gap_second) + 1).tolist(), len(time)]
    parts = [slice(a, b) for a, b in pairwise(edges)]
    age = np.concatenate([time[part] - time[part.start] for part in parts])
    inside = np.where(steps > gap_second, 0.0, steps)
    stands_for = (np.append(inside, 0.0) + np.append(0.0, inside)) / 2
    return parts, time, age, np.sqrt(stands_for)


def _design(task, log_tau):
    """Weighted columns (drives, offset, start of each part) and the weighted target [K·√s]."""
    tau = np.exp(log_tau)
    driven = np.column_stack([task.drives, task.ambient])
    first = [np.r_[np.zeros(driven.shape[1] - 1), task.ambient[p.start]] for p in task.parts]
    lagged = np.concatenate(
        [
            lag(np.diff(task.time[p]), tau, driven[p], hold="first_order", initial=start)
            for p, start in zip(task.parts, first, strict=True)
        ]
    )
    starts = np.zeros((len(task.time), len(task.parts)))
    for k, part in enumerate(task.parts):
        starts[part, k] = np.exp(-task.age[part] / tau)
    columns = np.column_stack([lagged[:, :-1], np.ones(len(task.time)), starts])
    return columns * task.weight[:, None], (task.surface - lagged[:, -1]) * task.weight


def _solved(task, log_tau):
    """Design, its linear parameters and the residual at a time constant."""
    design, target = _design(task, log_tau)
    scale = np.linalg.norm(design, axis=0)
    if not (scale > 0).all():
        raise Refusal("the record holds no heat, or no time between its gaps")
    unit = design / scale
    linear = np.linalg.lstsq(unit.T @ unit, unit.T @ target, rcond=1e-13)[0] / scale
    return design, linear, target - design @ linear


def _best_log_tau(task, bounds):
    from scipy.optimize import minimize_scalar

    grid = np.linspace(*np.log(bounds), 25)

    def error(log_tau):
        residual = _solved(task, log_tau)[2]
        return residual @ residual

    best = int(np.argmin([error(log_tau) for log_tau in grid]))
    if best in (0, len(grid) - 1):
        raise Refusal(f"the thermal time constant is not within {bounds[0]:g}–{bounds[1]:g} s")
    around = (grid[best - 1], grid[best + 1])
    return float(minimize_scalar(error, bounds=around, method="bounded").x)


def _thermal_fit(task, log_tau):
    design, linear, residual = _solved(task, log_tau)
    if linear[0] <= 0:
        raise Refusal(f"thermal resistance {linear[0]:.3g} K/W: the temperature falls with heat")
    shifted = [
        target - columns @ linear
        for columns, target in (_design(task, log_tau + d) for d in (-SLOPE_STEP, SLOPE_STEP))
    ]
    slope = (shifted[0] - shifted[1]) / (2 * SLOPE_STEP)
    jacobian = np.column_stack([design[:, 0], slope, design[:, 1:]])
    covariance = covariance_from_jacobian(jacobian, residual) * correlation_factor(residual)
    resistance, parts = linear[0], np.array([linear[0], log_tau])
    capacity, std = delta_method(lambda p: np.exp(p[1]) / p[0], parts, covariance[:2, :2])
    shapes = slice(2, 1 + task.drives.shape[1])
    slopes = linear[1 : shapes.stop - 1] / resistance
    # Of a slope b/R: its variance by those of b and R and what they have in common.
    variance = np.diag(covariance)[shapes] - 2.0 * slopes * covariance[0, shapes]
    variance = np.maximum(variance + slopes**2 * covariance[0, 0], 0.0) / resistance**2
    above = (task.surface - task.ambient) * task.weight
    above = above - task.weight * (above @ task.weight) / (task.weight @ task.weight)
    return ThermalFit(
        heat_capacity_joule_per_kelvin=float(capacity),
        heat_capacity_std_joule_per_kelvin=float(std),
        resistance_kelvin_per_watt=float(resistance),
        resistance_std_kelvin_per_watt=float(np.sqrt(covariance[0, 0])),
        ambient_offset_kelvin=float(linear[task.drives.shape[1]]),
        entropic_volt_per_kelvin=slopes,
        entropic_std_volt_per_kelvin=np.sqrt(variance),
        rmse_kelvin=float(np.sqrt(residual @ residual / (task.weight @ task.weight))),
        moved_kelvin=float(np.sqrt(above @ above / (task.weight @ task.weight))),
        samples=len(task.time),
    )
