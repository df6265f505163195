"""How sure a fitted number is: covariance, propagation and intervals, shared by all fits.

A parameter that the data do not determine has NaN for its variance; `why_unknown` says why.
"""

import numpy as np


def covariance_from_jacobian(jacobian, residual):
    """Covariance of the parameters of a least-squares fit, s² (JᵀJ)⁻¹.

    Parameters
    ----------
    jacobian : (n, p) derivative of each residual by each parameter.
    residual : (n,) residuals at the optimum, weighted as they were fitted.

    Returns
    -------
    covariance : (p, p). Rows and columns of a parameter that the data do not determine are NaN;
        all are NaN where there is no residual left over to estimate the scatter from.

    Source: Seber & Wild, Nonlinear Regression (1989), eq. 2.20; by SVD of the scaled Jacobian,
    so that the units of the parameters do not matter.
    """
    jacobian, residual = np.asarray(jacobian, float), np.asarray(residual, float)
    rows, parameters = jacobian.shape
    covariance = np.full((parameters, parameters), np.nan)
    if rows <= parameters or not (np.isfinite(jacobian).all() and np.isfinite(residual).all()):
        return covariance
    scale, singular, directions, kept = _decomposed(jacobian)
    weights = directions[kept] / singular[kept, None]
    variance = residual @ residual / (rows - parameters)
    covariance = variance * (weights.T @ weights) / np.outer(scale, scale)
    unknown = _undetermined(scale, directions[~kept])
    covariance[unknown] = covariance[:, unknown] = np.nan
    return covariance


def why_unknown(jacobian, *, names) -> str:
    """Reason in words for the NaN in a covariance; empty where every parameter is determined.

    Parameters
    ----------
    jacobian : (n, p) as given to `covariance_from_jacobian`.
    names : p names of the parameters.
    """
    jacobian = np.asarray(jacobian, float)
    rows, parameters = jacobian.shape
    if not np.isfinite(jacobian).all():
        return "the model is not finite at the optimum"
    if rows <= parameters:
        return f"{rows} data for {parameters} parameters leave nothing to estimate a scatter from"
    scale, _, directions, kept = _decomposed(jacobian)
    unknown = [names[k] for k in np.flatnonzero(_undetermined(scale, directions[~kept]))]
    return f"the data do not determine {', '.join(unknown)}" if unknown else ""


def _decomposed(jacobian):
    """Column norms, singular values and right vectors of the scaled Jacobian, and which count."""
    norm = np.linalg.norm(jacobian, axis=0)
    scale = np.where(norm > 0, norm, 1.0)
    _, singular, directions = np.linalg.svd(jacobian / scale, full_matrices=False)
    kept = singular > max(jacobian.shape) * np.finfo(float).eps * singular[0]
    return scale, singular, directions, kept


def _undetermined(scale, null_directions):
    """Parameters that can be moved without moving the model."""
    return (np.abs(null_directions) > 1e-6).any(axis=0) if len(null_directions) else scale < 0


def standard_deviations(covariance):
    """Square roots of the diagonal; NaN stays NaN. Shape (p,) from (p, p)."""
    return np.sqrt(np.diagonal(covariance))


def delta_method(function, parameters, covariance):
    """Value of a function of fitted parameters and its standard deviation.

    Parameters
    ----------
    function : takes (p,) and returns a float or an array (m,).
    parameters : (p,) fitted values.
    covariance : (p, p).

    Returns
    -------
    value, std : float or (m,) each, std = √(g C gᵀ) with the gradient g by central differences.
    """
    parameters = np.asarray(parameters, float)
    value = np.asarray(function(parameters), float)
    # The cube root of the machine's precision balances truncation against rounding.
    size = np.fmax(np.abs(parameters), standard_deviations(covariance))
    steps = np.cbrt(np.finfo(float).eps) * np.where(size > 0, size, 1.0)
    columns = [
        (np.asarray(function(parameters + step)) - function(parameters - step)) / (2 * width)
        for step, width in zip(np.diag(steps), steps, strict=True)
    ]
    gradient = np.stack(columns, axis=-1)
    variance = np.einsum("...i,ij,...j", gradient, covariance, gradient)
    return value, np.sqrt(np.maximum(variance, 0.0))


def t_interval(value, std, degrees_of_freedom, *, level=0.95):
    """Confidence interval of an estimate whose scatter was itself estimated.

    Parameters
    ----------
    value, std : float or (m,) in any one unit.
    degrees_of_freedom : data minus parameters; below 1 the interval is not known (NaN).
    level : coverage, 0 to 1.

    Returns
    -------
    lower, upper : shaped like `value`.
    """
    from scipy.special import stdtrit

    if degrees_of_freedom < 1:
        unknown = np.full(np.shape(value), np.nan)
        return unknown, unknown
    reach = stdtrit(degrees_of_freedom, (1 + level) / 2) * np.asarray(std)
    return value - reach, value + reach


def percentile_interval(draws, *, level=0.95):
    """Interval that holds the middle share of bootstrap draws.

    Parameters
    ----------
    draws : (n, …) replicates along the first axis.
    level : share inside, 0 to 1.

    Returns
    -------
    lower, upper : shaped like one draw.
    """
    return tuple(np.quantile(draws, [(1 - level) / 2, (1 + level) / 2], axis=0))
