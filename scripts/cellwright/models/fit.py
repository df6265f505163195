"""Fit of a circuit with constant parameters to one short record: one set point, one pulse train.

Levenberg–Marquardt over the logarithms of the time constants with analytic sensitivities; all that
is linear (resistances, offset and slope of the OCV) is solved for anew at every step.
"""

from typing import NamedTuple

import numpy as np

from cellwright.models.circuit import rc_circuit
from cellwright.models.coarse import coarse_start
from cellwright.models.coloured import is_white, parameter_covariance
from cellwright.models.identifiability import verdict
from cellwright.models.normal import columns_of, normal_equations
from cellwright.models.projection import MOST, Projected, levenberg
from cellwright.models.task import limits_of, load_of, names_of
from cellwright.refusal import Refusal


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
    said += ["the search has not arrived at an optimum"] * (passes >= MOST)
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


def circuit_of(fit):
    """The fitted circuit as data, for `simulate` and `impedance`: tuple of Branch.

    Parameters
    ----------
    fit : CircuitFit.
    """
    found = dict(zip(fit.names, fit.values, strict=True))
    pairs = range(1, 1 + sum(name.startswith("tau") for name in fit.names))
    r, tau = ([found[form.format(j)] for j in pairs] for form in ("r{}_ohm", "tau{}_second"))
    return rc_circuit(found["r0_ohm"], r, tau)


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
