"""Fit of a circuit with constant parameters to one short record: one set point, one pulse train.

Levenberg–Marquardt over the logarithms of the time constants with analytic sensitivities; all that
is linear (the resistances) is solved for anew at every step.
"""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.exponentials import MOST_PASSES, Projected, levenberg
from cellwright.numerics.lags import HOLDS
from cellwright.numerics.statistics import is_white, parameter_covariance
from cellwright.refusal import Refusal
from pulse_methods.exponentials import Load, coarse_start, columns_of, normal_equations, verdict


def names_of(n_rc):
    """Names of the parameters in the order of the linear model: linear ones, then ln tau.

    Parameters
    ----------
    n_rc : number of RC pairs, 0 to 4; another one is refused.
    """
    if not 0 <= n_rc <= 4:
        raise Refusal(f"{n_rc} RC pairs; 0 to 4 are offered")
    pairs = range(1, n_rc + 1)
    return ("r0_ohm", *(f"r{j}_ohm" for j in pairs), *(f"tau{j}_second" for j in pairs))


def load_of(test_time_second, current_ampere, voltage_volt, ocv_volt, hold):
    """Checked record as the load of the linear model.

    Parameters
    ----------
    test_time_second, current_ampere, voltage_volt, ocv_volt, hold : as in `fit_circuit`.
    """
    time, current, voltage = (
        np.asarray(c, float) for c in (test_time_second, current_ampere, voltage_volt)
    )
    ocv = np.asarray(ocv_volt, float)
    _check(time, current, voltage, ocv, hold)
    # Stamps of a uniform clock differ in their last digits: to the nanosecond they do not, and the
    # exponentials of a step are taken once.
    step = np.diff(time)
    step *= 1e9
    step = np.rint(step, out=step)
    step /= 1e9
    return Load(step, current, current[None], voltage - ocv, hold)


def limits_of(names, load, bounds):
    """Limits of the search of every parameter: (lower, upper), (p,) each, in its unit.

    Parameters
    ----------
    names : of the parameters.
    load : exponentials.Load, whose shortest step and whole length limit the time constants.
    bounds : dict, name → (lower, upper), that stand in place of the usual ones.
    """
    unknown = set(bounds) - set(names)
    if unknown:
        raise Refusal(f"bounds of {', '.join(sorted(unknown))}; parameters are {', '.join(names)}")
    step = load.step_second
    shortest = least if (least := step.min()) > 0 else step[step > 0].min()
    usual = {"tau": (shortest, step.sum())}
    pairs = [bounds.get(name, usual.get(name[:3], (0.0, np.inf))) for name in names]
    for name, (lower, upper) in zip(names, pairs, strict=True):
        if not lower <= upper or (name[:3] == "tau" and lower <= 0):
            raise Refusal(f"bounds of {name} are {lower} to {upper}; they must ascend, tau above 0")
    lower, upper = np.array(pairs, float).T
    return lower, upper


def _check(time, current, voltage, ocv, hold):
    if time.ndim != 1 or not time.shape == current.shape == voltage.shape:
        shapes = f"time {time.shape}, current {current.shape}, voltage {voltage.shape}"
        raise Refusal(f"{shapes}; all must be (n,)")
    if ocv.shape not in ((), time.shape):
        raise Refusal(f"OCV has shape {ocv.shape}; a scalar or {time.shape} is wanted")
    if len(time) < 2:
        raise Refusal(f"record has {len(time)} sample(s); a relaxation needs a course of time")
    if hold not in HOLDS:
        raise Refusal(f"hold of the current is {hold!r}; allowed are {', '.join(HOLDS)}")
    if not all(np.isfinite(column).all() for column in (time, current, voltage, ocv)):
        raise Refusal("time, current, voltage or OCV holds values that are not finite")
    if (time[1:] < time[:-1]).any():
        raise Refusal(f"time runs back after sample {int(np.argmax(np.diff(time) < 0))}")
    if time[-1] <= time[0]:
        raise Refusal("all samples carry the same time stamp")
    if current.max() == current.min():
        raise Refusal(f"current is {current[0]:g} A throughout: no step tells resistance from OCV")


class CircuitFit(NamedTuple):
    """A circuit fitted to a record; all vectors in the order of `names`.

    names : "r0_ohm", "r1_ohm", …, "tau1_second", …, time constants ascending. values (p,).
    std, covariance, correlation : NaN for a parameter that is fixed, at a bound or not told by the
    data, and for the resistance of a pair whose time constant is at a bound. widening : (p,) std
    over what it would be for white residuals. at_bound : names of those at a limit. rmse_volt [V].
    samples : rows fitted. iterations : passes over the data. verdict : what the data do not tell,
    in words; empty where they tell all.
    """

    names: tuple
    values: np.ndarray
    std: np.ndarray
    covariance: np.ndarray
    correlation: np.ndarray
    widening: np.ndarray
    at_bound: tuple
    rmse_volt: float
    samples: int
    iterations: int
    verdict: str


def fit_circuit(
    test_time_second,
    current_ampere,
    voltage_volt,
    ocv_volt,
    *,
    hold,
    n_rc=2,
    start=None,
    bounds=None,
):
    """Fit R0 and any number of RC pairs to the voltage of a record that starts from rest.

    Parameters
    ----------
    test_time_second, current_ampere, voltage_volt : (n,) [s], [A] positive on charge, [V].
    ocv_volt : scalar or (n,) open-circuit voltage [V].
    hold : "zero_order" or "first_order": how the current runs between two samples.
    n_rc : number of RC pairs, 0 to 4.
    start : (n_rc,) time constants to start from [s]; None searches a grid on thinned rows.
    bounds : dict, name of a parameter → (lower, upper) in its unit; two equal ones fix it. Else
        resistances are 0 or more, time constants between the shortest step and the whole record.

    Returns
    -------
    fit : CircuitFit.

    Raises
    ------
    Refusal : lengths differ, not finite, time runs back, fewer rows than parameters, a current that
        never changes, parameters that the load does not tell apart, an unknown bound or hold.

    Source: thesis 2.3, cost (2.20), with a gradient in place of its genetic algorithm.
    """
    # ASSUME: A record fitted with constant parameters stays near one SoC and one temperature.
    load = load_of(test_time_second, current_ampere, voltage_volt, ocv_volt, hold)
    names = names_of(n_rc)
    if len(load.drive) <= len(names):
        raise Refusal(f"{len(load.drive)} samples for {len(names)} parameters; more are needed")
    lower, upper = limits_of(names, load, bounds or {})
    best, passes = _optimum(load, lower, upper, n_rc, start)
    best = _ascending(best, lower, upper)
    values = np.concatenate([best.linear, np.exp(best.log_tau)])
    limited = (values <= lower * (1 + 1e-9)) | (values >= upper * (1 - 1e-9))
    flagged = limited & (lower < upper)
    covariance, widening = _covariance(load, best, limited)
    # A pair whose time constant is not told has no resistance of its own either.
    unpaired = flagged[len(best.linear) :].nonzero()[0] + len(best.linear) - n_rc
    covariance[unpaired] = covariance[:, unpaired] = np.nan
    std = np.sqrt(covariance.diagonal())
    certain = np.where(std > 0, std, np.nan)
    sentences = [verdict(names, values, covariance, lower, upper)]
    sentences += ["the search has not arrived at an optimum"] * (passes >= MOST_PASSES)
    return CircuitFit(
        names=names,
        values=values,
        std=std,
        covariance=covariance,
        correlation=covariance / (certain[:, None] * certain),
        widening=widening,
        at_bound=tuple(name for name, at_end in zip(names, flagged, strict=True) if at_end),
        rmse_volt=float(np.sqrt(best.power / len(load.drive))),
        samples=len(load.drive),
        iterations=passes,
        verdict="; ".join(filter(None, sentences)),
    )


def _optimum(load, lower, upper, pairs, start):
    """Best fit and passes over the data: first with resistances of either sign, then bounded."""
    size = len(lower) - pairs
    linear_bounds = lower[:size], upper[:size]
    tau_bounds = np.array([lower[size:], upper[size:]]).T
    log_tau_bounds = np.log(tau_bounds.T)

    def search(tau, linear, bounds):
        around = (log_tau_bounds, bounds)
        return levenberg(normal_at, np.log(tau), linear, around, samples=len(load.drive))

    def normal_at(log_tau, linear):
        return normal_equations(load, np.exp(log_tau), linear)

    # A resistance held at zero gives its time constant no slope to follow: free, none gets stuck.
    held = linear_bounds[0] == linear_bounds[1]
    signed = np.where(held, lower[:size], -np.inf), np.where(held, upper[:size], np.inf)
    first = _started(load, start, tau_bounds, linear_bounds)
    best, passes = search(*first, signed)
    if ((best.linear >= linear_bounds[0]) & (best.linear <= linear_bounds[1])).all():
        return best, passes
    again = coarse_start(load, tau_bounds, linear_bounds) if pairs else first
    best, more_passes = search(*again, linear_bounds)
    return best, passes + more_passes


def _started(load, start, tau_bounds, linear_bounds):
    pairs = len(tau_bounds)
    if start is None and pairs:
        return coarse_start(load, tau_bounds, linear_bounds)
    tau = np.asarray(() if start is None else start, float)
    if tau.shape != (pairs,) or not (tau > 0).all():
        raise Refusal(f"start is {start}; wanted are {pairs} time constants above zero")
    return np.clip(tau, *tau_bounds.T), np.zeros(len(linear_bounds[0]))


def _ascending(fit, lower, upper):
    """Pairs in the order of their time constants, where bounds do not tell them apart."""
    size, pairs = len(fit.linear), len(fit.log_tau)
    if (fit.log_tau[1:] >= fit.log_tau[:-1]).all():
        return fit
    bounds = np.column_stack([lower, upper])
    r, tau = bounds[size - pairs : size], bounds[size:]
    if not ((r == r[:1]).all() and (tau == tau[:1]).all()):
        return fit
    order = np.argsort(fit.log_tau, kind="stable")
    head = np.arange(size - pairs)
    permutation = np.concatenate([head, size - pairs + order, size + order])
    gram, moment = fit.gram[np.ix_(permutation, permutation)], fit.moment[permutation]
    return Projected(
        fit.log_tau[order], fit.linear[permutation[:size]], gram, moment, fit.power, fit.near
    )


def _covariance(load, fit, limited):
    """Covariance in natural units, and by how much coloured residuals widened each deviation."""
    free = np.flatnonzero(~limited & (fit.gram.diagonal() > 0))
    size, samples, tau = len(fit.linear), len(load.drive), np.exp(fit.log_tau)
    unit = np.concatenate([np.ones(size), tau])[free]
    block = free[:, None], free
    gram = fit.gram[block]
    spread = white = parameter_covariance(gram, fit.power, samples)
    if not is_white(fit.near, fit.power, samples):
        columns = columns_of(load, tau)
        residual = load.target_volt - fit.linear @ columns[:size]
        columns[size:] *= fit.linear[size - len(tau) :, None]
        series = {"sensitivity": columns[free], "residual": residual}
        spread = parameter_covariance(gram, fit.power, samples, **series)
    covariance = np.full(fit.gram.shape, np.nan)
    covariance[block] = spread * (unit[:, None] * unit)
    widening = np.full(len(fit.gram), np.nan)
    plain, wide = white.diagonal(), spread.diagonal()
    widening[free] = np.sqrt(np.divide(wide, plain, out=np.ones(len(free)), where=plain != 0))
    return covariance, widening


ZERO = 1e-6  # share of the fitted value that stands for zero on a logarithmic scale


class ProfileInterval(NamedTuple):
    """Where the cost, minimised over all other parameters, rises by what 95 % allow.

    lower, upper : ends; NaN where the cost never rises enough. words : the same as a sentence.
    """

    lower: float
    upper: float
    words: str


def profile_interval(record, fit, name, *, hold, bounds=None):
    """95 % interval of one parameter by profile likelihood.

    The search goes to a thousandth and to a thousand times the value, or to its bounds.

    Parameters
    ----------
    record : (test_time_second, current_ampere, voltage_volt, ocv_volt) as given to `fit_circuit`.
    fit : CircuitFit of that record.
    name : of the parameter, a resistance or a time constant.
    hold, bounds : as in that fit.

    Returns
    -------
    interval : ProfileInterval.

    Raises
    ------
    Refusal : the parameter is not of the fit, or has no value.

    Source: D. Venzon, S. Moolgavkar, Applied Statistics 37 (1988) 87; for an estimated scatter by
    the F distribution (D. Bates, D. Watts, Nonlinear Regression Analysis, 1988, sec. 6.1). Where
    the residuals are coloured, the allowed rise is widened by `fit.widening` squared.
    """
    from scipy.special import fdtri

    value = _profiled_value(fit, name)
    freedom = fit.samples - len(fit.names)
    widening = np.nan_to_num(fit.widening[fit.names.index(name)], nan=1.0)
    allowed = fdtri(1, freedom, 0.95) * widening**2 / freedom
    settings = {"hold": hold, "n_rc": sum(n.startswith("tau") for n in fit.names)}

    def excess(log_value):
        trial = float(np.exp(log_value))
        held = dict(bounds or {}) | {name: (trial, trial)}
        refit = fit_circuit(*record, bounds=held, **settings)
        return (refit.rmse_volt / fit.rmse_volt) ** 2 - 1.0 - allowed

    step = _first_step(fit, name)
    limits = (bounds or {}).get(name, (1e-3 * value, 1e3 * value))
    limits = max(limits[0], value * ZERO), min(limits[1], 1e3 * value)
    directions = zip((-step, step), np.log(limits), strict=True)
    ends = [_crossing(excess, np.log(value), *step_and_limit) for step_and_limit in directions]
    return _interval(name, value, ends)


def _profiled_value(fit, name):
    if name not in fit.names:
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
    """Root between two points, to a hundredth of their distance."""
    for _ in range(7):
        middle = (inner + outer) / 2
        inner, outer = (inner, middle) if excess(middle) > 0 else (middle, outer)
    return (inner + outer) / 2


def _interval(name, value, ends):
    lower, upper = (float(np.exp(end)) for end in ends)
    below, above = np.isnan(lower), np.isnan(upper)
    if not below and not above:
        words = f"{name} lies at 95% between {lower:.4g} and {upper:.4g}"
    elif below and above:
        words = f"{name} cannot be told: its profile is open on both sides of {value:.3g}"
    elif above:
        words = f"{name} cannot be told: its profile is open above {lower:.3g}"
    else:
        words = f"{name} cannot be told: its profile is open below {upper:.3g}"
    return ProfileInterval(lower, upper, words)
