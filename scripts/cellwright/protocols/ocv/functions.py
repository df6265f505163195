"""Analytic functions for the open-circuit voltage, fitted and compared by cross-validation.

Each function is a sum of columns of the SoC with linear coefficients; some columns hold a rate
that is not linear. A function is data here: its columns, and where its rates stand.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cellwright.numerics.least_squares import best_logarithms
from cellwright.numerics.statistics import covariance_from_jacobian, rms, standard_deviations
from cellwright.refusal import Refusal

BLOCKS = 20  # of the cross-validation


class Form(NamedTuple):
    """One analytic function of the SoC: its columns (n, c), and the places of its parameters.

    places : of each parameter K0, K1, … the column it multiplies, or −1 − r for rate number r.
    starts : rates from which the search sets out, one row per start.
    """

    columns: Callable
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


def _near_full(z, rate):
    """exp(−rate/(1 − z)), a term that acts near full charge."""
    return np.exp(-rate / (1 - z))


def _stack(*columns):
    """Columns (n, c) of functions of the SoC, constants broadcast."""
    return np.stack(np.broadcast_arrays(*columns), axis=-1)


FORMS = {
    # K0 − K1/z − K2 z + K3 ln z + K4 ln(1 − z)
    "log": Form(
        lambda z, _: _stack(1.0, -1 / z, -z, np.log(z), np.log1p(-z)),
        places=(0, 1, 2, 3, 4),
    ),
    # K0 + K1 z + K2 (1 − exp(−K3 z)) + K4 (1 − exp(−K5 / (1 − z)))
    "two_exponentials": Form(
        lambda z, k: _stack(1.0, z, 1 - np.exp(-k[0] * z), 1 - _near_full(z, k[1])),
        places=(0, 1, 2, -1, 3, -2),
        starts=tuple((first, second) for first in (3.0, 15.0, 60.0) for second in (0.01, 0.1, 1.0)),
    ),
    # K0 − K1/z + K2 exp(−K3 / (1 − z))
    "inverse": Form(
        lambda z, k: _stack(1.0, -1 / z, _near_full(z, k[0])),
        places=(0, 1, 2, -1),
        starts=((0.01,), (0.1,), (1.0,)),
    ),
    # K0 + K1 z + … + K6 z⁶
    "polynomial": Form(
        lambda z, _: z[..., None] ** np.arange(7),
        places=tuple(range(7)),
    ),
}


def fit_functions(soc, ocv_volt):
    """Fit the four functions to an OCV table, and name the best by cross-validation.

    The table itself, interpolated by monotone cubics (PCHIP), is compared as "table". In the
    cross-validation twenty contiguous blocks of SoC are left out in turn and predicted; the lowest
    and highest points stay in, for nothing measured says how a curve runs on beyond them.

    soc, ocv_volt : (n,) ascending [1], [V]. SoC 0.01 to 0.99 is fitted: the functions have poles
        at 0 and 1.

    Returns functions: tuple of OcvFunction; exactly one has `chosen`. The standard deviations
    count what the function cannot follow as scatter. Raises Refusal: fewer than two points per
    block.

    Source: the thesis' table 3.2, functions (1) to (4); choice by cross-validation is ours.
    """
    soc, ocv_volt = np.asarray(soc, float), np.asarray(ocv_volt, float)
    # The tolerance keeps a table's own point at the limit inside it.
    inside = (np.abs(soc - 0.5) < 0.49 + 1e-9) & np.isfinite(ocv_volt)
    soc, ocv_volt = soc[inside], ocv_volt[inside]
    if len(soc) < 2 * BLOCKS:
        raise Refusal(f"OCV table has {len(soc)} points in range, fewer than {2 * BLOCKS}")
    fits = {}
    for name, form in FORMS.items():
        parameters = fit_parameters(form, soc, ocv_volt)
        std = parameter_stds(form, parameters, soc, ocv_volt)
        error = evaluate(name, parameters[:, 0], soc) - ocv_volt
        fits[name] = parameters[:, 0], std[:, 0], rms(error)
    fits["table"] = (np.array([]), np.array([]), 0.0)
    errors = {name: _left_out_rmse(name, fit[0], soc, ocv_volt) for name, fit in fits.items()}
    best = min(errors, key=errors.get)
    return tuple(OcvFunction(name, *fit, errors[name], name == best) for name, fit in fits.items())


def evaluate(function, parameters, soc):
    """OCV by a fitted function [V], shaped like `soc` [1]; `function` is a key of FORMS."""
    form, parameters = FORMS[function], np.asarray(parameters, float)
    places = np.array(form.places)
    return form.columns(np.asarray(soc, float), parameters[places < 0]) @ parameters[places >= 0]


def fit_parameters(form, soc, ocv_volt, *, powers=None, near=None):
    """Parameters of one function by least squares: rates by lmfit, coefficients in closed form.

    form : Form. soc, ocv_volt : (n,) [1], [V].
    powers : (n, q) factors that each coefficient is a sum over, such as powers of a temperature;
        None: each coefficient is one number.
    near : rates (r,) to set out from, or None: the form's own starts.

    Returns parameters: (p, q), K0, K1, … in rows; a rate has only its first column, else 0.
    """
    powers = np.ones((len(soc), 1)) if powers is None else powers

    def solved(logs):
        design = _design(form, soc, np.exp(logs), powers)
        # Columns of equal length, so that no unit dominates.
        length = np.linalg.norm(design, axis=0)
        length = np.where(length > 0, length, 1.0)
        coefficients = np.linalg.lstsq(design / length, ocv_volt, rcond=None)[0] / length
        return coefficients, design @ coefficients - ocv_volt

    starts = np.log(form.starts if near is None else [near])
    logs = best_logarithms(lambda x: solved(x)[1], starts, bounds=(-12, 7), scale=0.5)
    return _in_places(form, np.exp(logs), solved(logs)[0].reshape(-1, powers.shape[1]))


def parameter_stds(form, parameters, soc, ocv_volt, *, powers=None):
    """Standard deviations of fitted parameters, shaped like them; NaN where undetermined.

    What the function cannot follow counts as scatter.

    form, soc, ocv_volt, powers : as of the fit. parameters : (p, q) of it.
    """
    powers, places = np.ones((len(soc), 1)) if powers is None else powers, np.array(form.places)
    rates, coefficients = parameters[places < 0, 0], parameters[places >= 0].ravel()
    design, slopes = _design(form, soc, rates, powers), np.empty((len(soc), len(rates)))
    for k, step in enumerate(1e-6 * np.diag(rates)):
        rise = _design(form, soc, rates + step, powers) - _design(form, soc, rates - step, powers)
        slopes[:, k] = rise @ coefficients / (2 * step[k])
    residual = design @ coefficients - ocv_volt
    covariance = covariance_from_jacobian(np.hstack([slopes, design]), residual)
    std_rates, std = np.split(standard_deviations(covariance), [len(rates)])
    return _in_places(form, std_rates, std.reshape(-1, powers.shape[1]), unused=np.nan)


def _design(form, soc, rates, powers):
    """Columns (n, c·q) of the function, each times every power."""
    columns = form.columns(soc, rates)
    return (columns[:, :, None] * powers[:, None, :]).reshape(len(soc), -1)


def _in_places(form, rates, coefficients, *, unused=0.0):
    """Rates (r,) and coefficients (c, q) as parameters (p, q) in the order of the formula."""
    places = np.array(form.places)
    parameters = np.full((len(places), coefficients.shape[1]), unused)
    parameters[places >= 0] = coefficients[places[places >= 0]]
    parameters[places < 0, 0] = rates[-1 - places[places < 0]]
    return parameters


def _left_out_rmse(name, parameters, soc, volt):
    """RMSE over blocks of SoC left out of the fit in turn [V]; rates start from the full fit's."""
    from scipy.interpolate import PchipInterpolator

    errors = []
    for block in np.array_split(np.arange(1, len(soc) - 1), BLOCKS):
        others = np.delete(soc, block), np.delete(volt, block)
        if name == "table":
            predicted = PchipInterpolator(*others)(soc[block])
        else:
            rates = parameters[np.array(FORMS[name].places) < 0]
            refitted = fit_parameters(FORMS[name], *others, near=rates)[:, 0]
            predicted = evaluate(name, refitted, soc[block])
        errors.append(predicted - volt[block])
    return rms(np.concatenate(errors))
