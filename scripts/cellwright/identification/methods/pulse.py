"""Fit of a circuit with constant parameters to one short record: one set point, one pulse train.

Levenberg–Marquardt over the logarithms of the time constants with analytic sensitivities; all that
is linear (resistances, offset and slope of the OCV) is solved for anew at every step.
"""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.exponentials import (
    MOST_PASSES,
    Load,
    Projected,
    coarse_start,
    columns_of,
    levenberg,
    normal_equations,
    verdict,
)
from cellwright.numerics.lags import HOLDS
from cellwright.numerics.statistics import is_white, parameter_covariance
from cellwright.refusal import Refusal

OFFSET, SLOPE = "ocv_offset_volt", "ocv_slope_volt_per_ampere_hour"


def names_of(n_rc, free_ocv):
    """Names of the parameters in the order of the linear model: linear ones, then ln tau.

    Parameters
    ----------
    n_rc, free_ocv : as in `fit_circuit`.
    """
    unknown = set(free_ocv) - {"offset", "slope"}
    if unknown or not 0 <= n_rc <= 4:
        raise Refusal(f"{n_rc} RC pairs, free OCV {sorted(free_ocv)}; 0 to 4, 'offset', 'slope'")
    extra = [OFFSET] * ("offset" in free_ocv) + [SLOPE] * ("slope" in free_ocv)
    pairs = range(1, n_rc + 1)
    taus = [f"tau{j}_second" for j in pairs]
    return ("r0_ohm", *extra, *(f"r{j}_ohm" for j in pairs), *taus)


def load_of(test_time_second, current_ampere, voltage_volt, ocv_volt, hold, free_ocv):
    """A record as the linear model, checked.

    Parameters
    ----------
    test_time_second, current_ampere, voltage_volt, ocv_volt : as in `fit_circuit`.
    hold, free_ocv : as there.
    """
    time, current, voltage = (
        np.asarray(c, float) for c in (test_time_second, current_ampere, voltage_volt)
    )
    ocv = np.asarray(ocv_volt, float)
    _check(time, current, voltage, ocv, hold)
    # Stamps of a uniform clock differ in their last digits: to the nanosecond they do not, and the
    # exponentials of a step are taken once.
    step = np.rint(np.diff(time) * 1e9) / 1e9
    fixed = [current]
    if "offset" in free_ocv:
        fixed.append(np.ones(len(time)))
    if "slope" in free_ocv:
        between = current[:-1] if hold == "zero_order" else (current[:-1] + current[1:]) / 2
        fixed.append(np.concatenate([[0.0], np.cumsum(step * between)]) / 3600.0)
    target = np.ascontiguousarray(voltage - ocv)
    return Load(step, np.ascontiguousarray(current), np.vstack(fixed), target, hold)


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
    positive = load.step_second[load.step_second > 0]
    usual = {"tau": (positive.min(), load.step_second.sum()), "ocv": (-np.inf, np.inf)}
    pairs = [bounds.get(name, usual.get(name[:3], (0.0, np.inf))) for name in names]
    for name, (lower, upper) in zip(names, pairs, strict=True):
        if not lower <= upper or (name[:3] == "tau" and lower <= 0):
            raise Refusal(f"bounds of {name} are {lower} to {upper}; they must ascend, tau above 0")
    lower, upper = np.array(pairs, float).T
    return lower, upper


def _check(time, current, voltage, ocv, hold):
    if time.ndim != 1 or not time.shape == current.shape == voltage.shape:
        found = f"time {time.shape}, current {current.shape}, voltage {voltage.shape}"
        raise Refusal(f"{found}; all must be (n,)")
    if ocv.shape not in ((), time.shape):
        raise Refusal(f"OCV has shape {ocv.shape}; a scalar or {time.shape} is wanted")
    if len(time) < 2:
        raise Refusal(f"record has {len(time)} sample(s); a relaxation needs a course of time")
    if hold not in HOLDS:
        raise Refusal(f"hold of the current is {hold!r}; allowed are {', '.join(HOLDS)}")
    if not all(np.isfinite(column).all() for column in (time, current, voltage, ocv)):
        raise Refusal("time, current, voltage or OCV holds values that are not finite")
    if np.any(time[1:] < time[:-1]):
        raise Refusal(f"time runs back after sample {int(np.argmax(np.diff(time) < 0))}")
    if time[-1] <= time[0]:
        raise Refusal("all samples carry the same time stamp")
    if current.max() == current.min():
        raise Refusal(f"current is {current[0]:g} A throughout: no step tells resistance from OCV")


class CircuitFit(NamedTuple):
    """A circuit fitted to a record; all vectors in the order of `names`.

    names : "r0_ohm", then "ocv_offset_volt" and "ocv_slope_volt_per_ampere_hour" where free, then
    "r1_ohm", "r2_ohm", …, "tau1_second", "tau2_second", …, time constants ascending. values (p,).
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
    free_ocv=(),
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
    free_ocv : any of "offset" [V] and "slope" [V/Ah over the charge passed]: errors of the OCV.

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
    load = load_of(test_time_second, current_ampere, voltage_volt, ocv_volt, hold, free_ocv)
    names = names_of(n_rc, free_ocv)
    if len(load.drive) <= len(names):
        raise Refusal(f"{len(load.drive)} samples for {len(names)} parameters; more are needed")
    lower, upper = limits_of(names, load, bounds or {})
    at, passes = _optimum(load, lower, upper, n_rc, start)
    at = _ascending(at, lower, upper)
    values = np.concatenate([at.linear, np.exp(at.log_tau)])
    limited = (values <= lower * (1 + 1e-9)) | (values >= upper * (1 - 1e-9))
    flagged = limited & (lower < upper)
    covariance, widening = _spread(load, at, limited)
    # A pair whose time constant is not told has no resistance of its own either.
    alone = np.flatnonzero(flagged[len(at.linear) :]) + len(at.linear) - n_rc
    covariance[alone] = covariance[:, alone] = np.nan
    std = np.sqrt(np.diag(covariance))
    certain = np.where(std > 0, std, np.nan)
    said = [verdict(names, values, covariance, lower, upper)]
    said += ["the search has not arrived at an optimum"] * (passes >= MOST_PASSES)
    return CircuitFit(
        names=names,
        values=values,
        std=std,
        covariance=covariance,
        correlation=covariance / (certain[:, None] * certain),
        widening=widening,
        at_bound=tuple(name for name, at_end in zip(names, flagged, strict=True) if at_end),
        rmse_volt=float(np.sqrt(at.power / len(load.drive))),
        samples=len(load.drive),
        iterations=passes,
        verdict="; ".join(filter(None, said)),
    )


def _optimum(load, lower, upper, pairs, start):
    """Best fit and passes over the data: first with resistances of either sign, then bounded."""
    size = len(lower) - pairs
    linear_bounds = lower[:size], upper[:size]
    tau_bounds = np.column_stack([lower, upper])[size:]

    def search(tau, linear, bounds):
        around = (np.log(tau_bounds.T), bounds)
        return levenberg(normal_at, np.log(tau), linear, around, samples=len(load.drive))

    def normal_at(log_tau, linear):
        return normal_equations(load, np.exp(log_tau), linear)

    # A resistance held at zero gives its time constant no slope to follow: free, none gets stuck.
    held = linear_bounds[0] == linear_bounds[1]
    signed = np.where(held, lower[:size], -np.inf), np.where(held, upper[:size], np.inf)
    first = _started(load, start, tau_bounds, linear_bounds)
    at, passes = search(*first, signed)
    if ((at.linear >= linear_bounds[0]) & (at.linear <= linear_bounds[1])).all():
        return at, passes
    again = coarse_start(load, tau_bounds, linear_bounds) if pairs else first
    at, more = search(*again, linear_bounds)
    return at, passes + more


def _started(load, start, tau_bounds, linear_bounds):
    pairs = len(tau_bounds)
    if start is None and pairs:
        return coarse_start(load, tau_bounds, linear_bounds)
    tau = np.asarray(() if start is None else start, float)
    if tau.shape != (pairs,) or not (tau > 0).all():
        raise Refusal(f"start is {start}; wanted are {pairs} time constants above zero")
    return np.clip(tau, *tau_bounds.T), np.zeros(len(linear_bounds[0]))


def _ascending(at, lower, upper):
    """Pairs in the order of their time constants, where bounds do not tell them apart."""
    size, pairs = len(at.linear), len(at.log_tau)
    bounds = np.column_stack([lower, upper])
    r, tau = bounds[size - pairs : size], bounds[size:]
    if not ((r == r[:1]).all() and (tau == tau[:1]).all()):
        return at
    order = np.argsort(at.log_tau, kind="stable")
    head = np.arange(size - pairs)
    whole = np.concatenate([head, size - pairs + order, size + order])
    gram, moment = at.gram[np.ix_(whole, whole)], at.moment[whole]
    return Projected(at.log_tau[order], at.linear[whole[:size]], gram, moment, at.power, at.near)


def _spread(load, at, limited):
    """Covariance in natural units, and by how much coloured residuals widened each deviation."""
    free = np.flatnonzero(~limited & (np.diag(at.gram) > 0))
    size, samples, tau = len(at.linear), len(load.drive), np.exp(at.log_tau)
    unit = np.concatenate([np.ones(size), tau])[free]
    gram = at.gram[np.ix_(free, free)]
    found = white = parameter_covariance(gram, at.power, samples)
    if not is_white(at.near, at.power, samples):
        columns = columns_of(load, tau)
        residual = load.target_volt - at.linear @ columns[:size]
        columns[size:] *= at.linear[size - len(tau) :, None]
        series = {"sensitivity": columns[free], "residual": residual}
        found = parameter_covariance(gram, at.power, samples, **series)
    covariance = np.full(at.gram.shape, np.nan)
    covariance[np.ix_(free, free)] = found * np.outer(unit, unit)
    widening = np.full(len(at.gram), np.nan)
    plain, wide = np.diag(white), np.diag(found)
    widening[free] = np.sqrt(np.divide(wide, plain, out=np.ones(len(free)), where=plain != 0))
    return covariance, widening
