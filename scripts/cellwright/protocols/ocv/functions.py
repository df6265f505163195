"""Analytic functions for the open-circuit voltage, fitted and compared by cross-validation.

Each function is a sum of columns of the SoC with linear coefficients; some columns hold a rate
that is not linear. A function is data here: its columns, their slopes, where its rates stand.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cellwright.numerics.uncertainty import covariance_from_jacobian, standard_deviations
from cellwright.refusal import Refusal


class Form(NamedTuple):
    """One function of the SoC: columns (n, c) at given rates, their slopes, and the rates' place.

    places : of each parameter K0, K1, … the column it multiplies, or −1 − r for rate number r.
    starts : rates from which the search sets out, one row per start.
    """

    columns: Callable
    slopes: Callable
    places: tuple
    starts: tuple = ((),)


class OcvFunction(NamedTuple):
    """A fitted function and its errors; `parameters` and `std` are K0, K1, … [V, or 1 for rates].

    function : "log", "two_exponentials", "inverse", "polynomial" or "table" (which has none).
    """

    function: str
    parameters: np.ndarray
    std: np.ndarray
    rmse_volt: float
    cross_validation_rmse_volt: float
    chosen: bool


class _Fit(NamedTuple):
    parameters: np.ndarray
    std: np.ndarray
    rmse_volt: float


def _saturating(z, rate):
    return 1 - np.exp(-rate * z)


def _near_full(z, rate):
    return np.exp(-rate / (1 - z))


def _stack(*columns):
    return np.stack(np.broadcast_arrays(*columns), axis=-1)


FORMS = {
    # K0 − K1/z − K2 z + K3 ln z + K4 ln(1 − z)
    "log": Form(
        lambda z, _: _stack(1.0, -1 / z, -z, np.log(z), np.log1p(-z)),
        lambda z, _: _stack(0.0, 1 / z**2, -1.0, 1 / z, -1 / (1 - z)),
        places=(0, 1, 2, 3, 4),
    ),
    # K0 + K1 z + K2 (1 − exp(−K3 z)) + K4 (1 − exp(−K5 / (1 − z)))
    "two_exponentials": Form(
        lambda z, k: _stack(1.0, z, _saturating(z, k[0]), 1 - _near_full(z, k[1])),
        lambda z, k: _stack(
            0.0, 1.0, k[0] * np.exp(-k[0] * z), k[1] / (1 - z) ** 2 * _near_full(z, k[1])
        ),
        places=(0, 1, 2, -1, 3, -2),
        starts=tuple((first, second) for first in (3.0, 15.0, 60.0) for second in (0.01, 0.1, 1.0)),
    ),
    # K0 − K1/z + K2 exp(−K3 / (1 − z))
    "inverse": Form(
        lambda z, k: _stack(1.0, -1 / z, _near_full(z, k[0])),
        lambda z, k: _stack(0.0, 1 / z**2, -k[0] / (1 - z) ** 2 * _near_full(z, k[0])),
        places=(0, 1, 2, -1),
        starts=((0.01,), (0.1,), (1.0,)),
    ),
    # K0 + K1 z + … + K6 z⁶
    "polynomial": Form(
        lambda z, _: z[..., None] ** np.arange(7),
        lambda z, _: np.arange(7) * z[..., None] ** np.maximum(np.arange(7) - 1, 0),
        places=tuple(range(7)),
    ),
}


def fit_functions(soc, ocv_volt, *, lowest_soc=0.01, highest_soc=0.99, blocks=20):
    """Fit the four functions to an OCV table, and name the best by cross-validation.

    The table itself, interpolated by monotone cubics (PCHIP), is compared as "table". In the
    cross-validation contiguous blocks of SoC are left out in turn and predicted; the lowest and
    highest points stay in, for nothing measured says how a curve runs on beyond them.

    Parameters
    ----------
    soc, ocv_volt : (n,) ascending [1], [V].
    lowest_soc, highest_soc : range that is fitted; the functions have poles at 0 and 1 [1].
    blocks : number of blocks in the cross-validation.

    Returns
    -------
    functions : tuple of OcvFunction; exactly one has `chosen`. The standard deviations count
        what the function cannot follow as scatter.

    Raises
    ------
    Refusal : fewer than two points per block.

    Source: the thesis' table 3.2, functions (1) to (4); choice by cross-validation is ours.
    """
    soc, ocv_volt = np.asarray(soc, float), np.asarray(ocv_volt, float)
    # The tolerance keeps a table's own point at the limit inside it.
    inside = np.abs(soc - (lowest_soc + highest_soc) / 2) < (highest_soc - lowest_soc) / 2 + 1e-9
    soc, ocv_volt = soc[inside & np.isfinite(ocv_volt)], ocv_volt[inside & np.isfinite(ocv_volt)]
    if len(soc) < 2 * blocks:
        raise Refusal(f"OCV table has {len(soc)} points in range, fewer than {2 * blocks}")
    fits = {name: _fit(form, soc, ocv_volt) for name, form in FORMS.items()}
    fits["table"] = _Fit(np.array([]), np.array([]), 0.0)
    errors = {name: _left_out(name, fit, soc, ocv_volt, blocks) for name, fit in fits.items()}
    best = min(errors, key=errors.get)
    return tuple(OcvFunction(name, *fit, errors[name], name == best) for name, fit in fits.items())


def evaluate(function, parameters, soc):
    """OCV by a fitted function [V], shaped like `soc` [1]; `function` is a key of FORMS."""
    return _applied(FORMS[function], FORMS[function].columns, parameters, soc)


def slope(function, parameters, soc):
    """dOCV/dSoC by a fitted function [V], shaped like `soc` [1]; analytic."""
    return _applied(FORMS[function], FORMS[function].slopes, parameters, soc)


def _applied(form, columns, parameters, soc):
    places, parameters = np.array(form.places), np.asarray(parameters, float)
    return columns(np.asarray(soc, float), parameters[places < 0]) @ parameters[places >= 0]


def _fit(form, soc, volt):
    """Parameters, their standard deviations and the RMSE of one function."""
    from scipy.optimize import least_squares

    def residual(logs):
        columns = form.columns(soc, np.exp(logs))
        return columns @ _coefficients(columns, volt) - volt

    # Only the rates are searched; the coefficients follow from them in closed form.
    starts = [np.log(start) for start in form.starts] if form.starts[0] else []
    found = [least_squares(residual, s, bounds=(-12, 7), x_scale=0.5) for s in starts]
    rates = np.exp(min(found, key=lambda one: one.cost).x) if found else np.array([])
    columns = form.columns(soc, rates)
    coefficients, places = _coefficients(columns, volt), np.array(form.places)
    parameters = np.where(places >= 0, coefficients[places], 0.0)
    parameters[places < 0] = rates
    error = columns @ coefficients - volt
    std = standard_deviations(covariance_from_jacobian(_jacobian(form, soc, parameters), error))
    return _Fit(parameters, std, float(np.sqrt(np.mean(error**2))))


def _coefficients(columns, volt):
    """Linear least squares with columns of equal length, so that no unit dominates."""
    length = np.linalg.norm(columns, axis=0)
    length = np.where(length > 0, length, 1.0)
    return np.linalg.lstsq(columns / length, volt, rcond=None)[0] / length


def _jacobian(form, soc, parameters):
    """Derivative of the function by each parameter: exact for coefficients, central for rates."""
    places = np.array(form.places)
    rates = parameters[places < 0]
    jacobian = np.empty((len(soc), len(places)))
    jacobian[:, places >= 0] = form.columns(soc, rates)
    for rate, position in enumerate(np.flatnonzero(places < 0)):
        step = np.where(np.arange(len(rates)) == rate, 1e-6 * rates, 0.0)
        rise = form.columns(soc, rates + step) - form.columns(soc, rates - step)
        jacobian[:, position] = rise @ parameters[places >= 0] / (2 * step[rate])
    return jacobian


def _left_out(name, fit, soc, volt, blocks):
    """RMSE of the predictions of blocks of SoC that were left out of the fit."""
    errors = []
    for block in np.array_split(np.arange(1, len(soc) - 1), blocks):
        kept = np.setdiff1d(np.arange(len(soc)), block)
        predicted = _predicted(name, fit.parameters, soc[kept], volt[kept], soc[block])
        errors.append(predicted - volt[block])
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def _predicted(name, parameters, soc, volt, at):
    """Prediction from other points; the search for rates starts from those of the whole curve."""
    if name == "table":
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(soc, volt)(at)
    form = FORMS[name]
    near = form._replace(starts=(tuple(parameters[np.array(form.places) < 0]),))
    return evaluate(name, _fit(near, soc, volt).parameters, at)
