"""Interval of one parameter of a fit by profile likelihood, open where the data do not end it."""

from typing import NamedTuple

import numpy as np

from cellwright.identification.methods.pulse import fit_circuit
from cellwright.refusal import Refusal

ZERO = 1e-6  # share of the fitted value that stands for zero on a logarithmic scale


class ProfileInterval(NamedTuple):
    """Where the cost, minimised over all other parameters, rises by what the level allows.

    name, value : of the parameter. lower, upper : ends; NaN where the profile is open. open_below,
    open_above : True where the cost never rises enough within `searched` (lower, upper). told :
    both ends are closed. words : the same as a sentence.
    """

    name: str
    value: float
    lower: float
    upper: float
    open_below: bool
    open_above: bool
    searched: tuple
    told: bool
    words: str


def profile_interval(record, fit, name, *, hold, level=0.95, bounds=None, free_ocv=(), reach=1e3):
    """Interval of one parameter by profile likelihood.

    Parameters
    ----------
    record : (test_time_second, current_ampere, voltage_volt, ocv_volt) as given to `fit_circuit`.
    fit : CircuitFit of that record.
    name : of the parameter, a resistance or a time constant.
    hold, bounds, free_ocv : as in that fit.
    level : coverage, 0 to 1.
    reach : the search goes from value/reach to value·reach, or to the parameter's bounds.

    Returns
    -------
    interval : ProfileInterval.

    Raises
    ------
    Refusal : the parameter is not of the fit, is an error of the OCV, or has no value.

    Source: D. Venzon, S. Moolgavkar, Applied Statistics 37 (1988) 87; for an estimated scatter by
    the F distribution (D. Bates, D. Watts, Nonlinear Regression Analysis, 1988, sec. 6.1). Where
    the residuals are coloured, the allowed rise is widened by `fit.widening` squared.
    """
    from scipy.special import fdtri

    value = _value(fit, name)
    freedom = fit.samples - len(fit.names)
    widening = np.nan_to_num(fit.widening[fit.names.index(name)], nan=1.0)
    allowed = fdtri(1, freedom, level) * widening**2 / freedom
    settings = {"hold": hold, "n_rc": _pairs(fit), "free_ocv": free_ocv}

    def excess(log_value):
        given = float(np.exp(log_value))
        held = dict(bounds or {}) | {name: (given, given)}
        other = fit_circuit(*record, bounds=held, **settings)
        return (other.rmse_volt / fit.rmse_volt) ** 2 - 1.0 - allowed

    step = _first_step(fit, name)
    limits = (bounds or {}).get(name, (value / reach, value * reach))
    limits = max(limits[0], value * ZERO), min(limits[1], value * reach)
    ways = zip((-step, step), np.log(limits), strict=True)
    ends = [_crossing(excess, np.log(value), *way) for way in ways]
    return _told(name, value, ends, limits, level)


def _pairs(fit):
    return sum(name.startswith("tau") for name in fit.names)


def _value(fit, name):
    if name not in fit.names or name.startswith("ocv"):
        raise Refusal(f"no profile of {name}; resistances and time constants are {fit.names}")
    value = float(fit.values[fit.names.index(name)])
    if not value > 0:
        raise Refusal(f"{name} is {value:g}: a logarithmic profile starts above zero")
    return value


def _first_step(fit, name):
    """One standard deviation of the logarithm, or a tenth where there is none."""
    index = fit.names.index(name)
    step = fit.std[index] / fit.values[index]
    return float(np.clip(step, 1e-6, 1.0)) if np.isfinite(step) else 0.1


def _crossing(excess, log_value, step, limit):
    """Where the excess turns positive on the way to the limit (a logarithm), NaN if nowhere."""
    inner = log_value
    sign = np.sign(step)
    while (limit - inner) * sign > 1e-9:
        outer = inner + step if (limit - inner - step) * sign > 0 else limit
        if excess(outer) > 0:
            return _bisected(excess, inner, outer)
        inner, step = outer, step * 1.7
    return np.nan


def _bisected(excess, inner, outer):
    """Root between, to a hundredth of the distance: the interval needs no more."""
    for _ in range(7):
        middle = (inner + outer) / 2
        inner, outer = (inner, middle) if excess(middle) > 0 else (middle, outer)
    return (inner + outer) / 2


def _told(name, value, ends, limits, level):
    lower, upper = (float(np.exp(end)) for end in ends)
    below, above = bool(np.isnan(lower)), bool(np.isnan(upper))
    share = f"{name} lies at {level:.0%} between"
    if not below and not above:
        words = f"{share} {lower:.4g} and {upper:.4g}"
    elif below and above:
        words = f"{name} cannot be told: its profile is open on both sides of {value:.3g}"
    elif above:
        words = f"{name} cannot be told: its profile is open above {lower:.3g}"
    else:
        words = f"{name} cannot be told: its profile is open below {upper:.3g}"
    told = not (below or above)
    return ProfileInterval(name, value, lower, upper, below, above, limits, told, words)
