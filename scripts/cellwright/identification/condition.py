"""Fitted circuit of one temperature, with deviations and the names of what stands at a bound."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.circuit import UNRESOLVED_SECOND
from cellwright.identification.columns import FAST_SECOND
from cellwright.identification.regression import named
from cellwright.identification.search import with_time_constants
from cellwright.numerics.linear import hats
from cellwright.numerics.statistics import rms
from cellwright.records.thinning import edge_ampere, edges

ABSENT_SECOND = 2e-4  # a diffusion time that stands for none
AT_BOUND = 0.02  # of the logarithm of a time constant: as near as the search goes


class Element(NamedTuple):
    """A branch of a fitted circuit: its kind, and dicts name → (k,) of values and deviations."""

    kind: str
    values: dict
    stds: dict


class Condition(NamedTuple):
    """A fitted circuit over SoC at one temperature; a deviation is NaN at a bound or if held.

    soc : (k,). r0_ohm, r0_std_ohm, ocv_shift_volt : (k,). branches : tuple of Element.
    missing, stretch : the SoC at which the OCV table is read, see `regression.Held`.
    at_bound : list of dict, see `_bound`. fit_rmse_volt, samples : of the rows used.
    steady_std_ohm : (k,) of the sum of all resistances, which a steady load tells though it tells
    none of them apart.
    first_sample_second, first_sample_missed_ohm : as of `first_samples`.
    """

    soc: np.ndarray
    r0_ohm: np.ndarray
    r0_std_ohm: np.ndarray
    branches: tuple
    ocv_shift_volt: np.ndarray
    missing: float
    stretch: float
    at_bound: tuple
    fit_rmse_volt: float
    samples: int
    steady_std_ohm: np.ndarray
    first_sample_second: float
    first_sample_missed_ohm: np.ndarray


def condition_of(shared, member, fit, bounds):
    """Condition of a solution, with deviations of the time constants where these were searched.

    Parameters
    ----------
    shared : Shared. member : circuit.Member. fit : Fit.
    bounds : (low, high) of searched time constants [s]; None where they are a fixed series.

    Returns
    -------
    condition : Condition.
    """
    data, (held, system, solution, covariance, _) = shared.data, fit
    stds = named(system, np.sqrt(np.diag(covariance)))
    values, tau_stds, at_bound = solution.values, np.full(len(held.tau_second), np.nan), []
    if bounds is not None and held.tau_second:
        std = np.sqrt(np.diag(with_time_constants(shared, fit)[0]))
        size = len(solution.vector)
        stds, tau_stds = named(system, std[:size]), std[size:] * np.asarray(held.tau_second)
        apart = np.abs(np.log(held.tau_second) - np.log(bounds)[:, None])
        edge = (apart < AT_BOUND).any(axis=0)
        at_bound = [_bound(f"tau{n}") for n, is_at_bound in enumerate(edge, 1) if is_at_bound]
        tau_stds = np.where(edge, np.nan, tau_stds)
    elif held.tau_second:  # of a series the last holds what relaxes more slowly as well
        at_bound = [_bound(f"tau{len(held.tau_second)}")]
    bounded = [
        _bound(name, soc)
        for name in system.names
        for soc, value in zip(data.knots, values[name], strict=True)
        if value == 0
    ]
    if held.charge_ampere_hour is not None and data.most_volt is not None:
        at_most = zip(data.knots, values["m"] >= data.most_volt, strict=True)
        bounded += [
            _bound("m", soc, limit="slow_test") for soc, held_there in at_most if held_there
        ]
    return Condition(
        data.knots,
        values["r0"],
        stds["r0"],
        _elements(data, member, held, values, stds, tau_stds),
        values["shift"],
        held.missing,
        held.stretch,
        (*at_bound, *bounded),
        rms(solution.residual_volt),
        len(solution.residual_volt),
        _steady_std(system, covariance),
        *first_samples(data, solution.residual_volt),
    )


def first_samples(data, residual_volt):
    """When the first fitted rows after steps of the current lie, and what a fit misses there.

    What relaxes before them no fit tells from an ohmic resistance. And a few time constants follow
    a whole rest: the first rows, which are few, may be missed by more than scatter.

    Parameters
    ----------
    data : columns.Data. residual_volt : (n,) of its used rows, measured minus modelled.

    Returns
    -------
    second : time after the step [s] of those sampled fast, the tenth percentile of the larger
        steps; NaN without a step.
    missed_ohm : (k,) resistance measured there less that of the circuit, by least squares over
        the steps sampled within twice that time; between knots without steps straight.
    """
    ends = np.cumsum([record.used.sum() for record in data.records])[:-1]
    pairs = zip(data.records, np.split(residual_volt, ends), strict=True)
    steps = [_first_after_steps(*pair) for pair in pairs]
    soc, second, ampere, volt = np.concatenate(steps, axis=1)
    if not len(soc):
        return np.nan, np.full(len(data.knots), np.nan)
    first = float(np.percentile(second[np.abs(ampere) >= np.abs(ampere).max() / 2], 10))
    fast = (second <= 2 * first)[:, None] * np.column_stack([ampere * volt, ampere**2])
    moved, weight = (hats(soc, data.knots).T @ fast).T
    seen = weight > 0
    if not seen.any():  # between the rows that count the current steps nowhere
        return first, np.full(len(data.knots), np.nan)
    return first, np.interp(data.knots, data.knots[seen], moved[seen] / weight[seen])


def _first_after_steps(record, residual_volt):
    """SoC, time since the step [s], current step [A] and change of the residual [V], (4, steps)."""
    time, used = record.test_time_second, np.flatnonzero(record.used)
    rows = edges(record, step_ampere=edge_ampere(record))
    after = np.searchsorted(used, rows)
    rows, after = (column[(after > 0) & (after < len(used))] for column in (rows, after))
    first, before = used[after], used[after - 1]
    # As for a pulse: at the row before, or one interval before its first row if that is later.
    interval = time[np.minimum(rows + 1, len(time) - 1)] - time[rows]
    begin = np.maximum(time[rows - 1], time[rows] - interval)
    drive = record.current_ampere * record.resistance_factor
    changes = drive[first] - drive[before], residual_volt[after] - residual_volt[after - 1]
    return np.array([record.soc[first], time[first] - begin, *changes])


def _steady_std(system, covariance):
    """Standard deviation of the sum of all resistances at each knot (k,) [ohm].

    One at its bound is no part of it; NaN where all are.
    """
    places = named(system, np.arange(len(covariance)))
    of_knot = np.array([places[name] for name in system.names if name != "m"]).T
    parts = [covariance[np.ix_(rows, rows)] for rows in of_knot]
    return np.array([np.sqrt(np.nansum(p)) if np.isfinite(p).any() else np.nan for p in parts])


def _bound(parameter, soc=None, limit="range"):
    """A parameter of a condition that its fit left at a limit: of its range, or of the slow test.

    soc : of the knot [1]; None: of all knots.
    """
    return {"parameter": parameter, "soc": None if soc is None else float(soc), "limit": limit}


def _elements(data, member, held, values, stds, tau_stds):
    """Branches of a member, the same at every temperature; one that was not fitted is near zero."""
    ones, elements = np.ones(len(data.knots)), []
    taus = zip(held.tau_second, tau_stds, strict=True)
    pairs = [(f"r{n}", tau, std) for n, (tau, std) in enumerate(taus, 1)]
    if member.kinetic:
        pairs.insert(0, ("rct", UNRESOLVED_SECOND, np.nan))
    for name, tau, tau_std in pairs:
        values_of = {"r_ohm": values.get(name, 0.0 * ones), "tau_second": tau * ones}
        std = {"r_ohm": stds.get(name, np.nan * ones), "tau_second": tau_std * ones}
        kinetic = member.kinetic and tau <= FAST_SECOND
        if kinetic:
            values_of["scale_volt"] = (held.scale_volt or 1e3) * ones
            std["scale_volt"] = np.nan * ones
        elements.append(Element("kinetic" if kinetic else "RC", values_of, std))
    if member.diffusion:
        second = held.diffusion_second or ABSENT_SECOND
        gain = second / 15.0 / 3600.0 / data.capacity_ampere_hour
        values_of = {"soc_per_ampere": gain * ones, "tau_second": second * ones}
        elements.append(Element("diffusion", values_of, dict.fromkeys(values_of, np.nan * ones)))
    if member.hysteresis:
        charge = held.charge_ampere_hour or 0.01 * data.capacity_ampere_hour
        values_of = {"m_volt": values.get("m", 0.0 * ones), "charge_ampere_hour": charge * ones}
        std = {"m_volt": stds.get("m", np.nan * ones), "charge_ampere_hour": np.nan * ones}
        elements.append(Element("hysteresis", values_of, std))
    return tuple(elements)
