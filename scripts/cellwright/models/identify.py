"""Resistances over SoC and time constants of an n-RC model, from one or several records.

For given time constants the model is linear in everything else: V − OCV(z) = Σ over knots m of
φ_m(z)·I·R0_m + Σ over branches j and knots of x_jm·R_jm, where φ_m are hat functions over SoC and
x_jm is φ_m(z)·I through a lag of time constant tau_j. So only the logarithms of the time
constants are searched (variable projection, Golub & Pereyra 1973): first all combinations of a
grid, which is global, then least squares from the best few.
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from cellwright.models.linear import correlation_factor, design, lagged, problem_of, solve
from cellwright.models.records import edges, knots_of, thin, within
from cellwright.refusal import Refusal
from cellwright.uncertainty import covariance_from_jacobian

TAU_BOUNDS_SECOND = {
    1: ((0.5, 2000.0),),
    2: ((0.5, 60.0), (40.0, 2000.0)),
    3: ((0.5, 10.0), (10.0, 100.0), (60.0, 3000.0)),
}


class Condition(NamedTuple):
    """An n-RC model over SoC at one temperature; `_std` NaN where a parameter is at its bound."""

    soc: np.ndarray
    r0_ohm: np.ndarray
    r0_std_ohm: np.ndarray
    r_ohm: np.ndarray
    r_std_ohm: np.ndarray
    tau_second: np.ndarray
    tau_std_second: np.ndarray
    ocv_shift_volt: np.ndarray
    at_bound: tuple
    fit_rmse_volt: float
    samples: int
    bic: float


def identify(
    records,
    ocv_soc,
    ocv_volt,
    *,
    n_rc=2,
    hold="first_order",
    knots=None,
    step_ampere=None,
    tau_bounds_second=None,
    free_ocv=True,
    floor_volt=0.005,
    relative=0.2,
):
    """Fit R0(z), R_j(z) and tau_j of an n-RC model to records of one temperature.

    Parameters
    ----------
    records : sequence of Record, each starting from rest (`records.records_of`).
    ocv_soc, ocv_volt : (p,) OCV table, ascending [1], [V].
    n_rc : number of RC pairs.
    hold : "zero_order" or "first_order" hold of the current between samples.
    knots : (k,) SoC of the resistances [1]; None: where the data excite the cell.
    step_ampere : change of current that counts as a step [A]; None: a twentieth of the largest.
    tau_bounds_second : n_rc pairs (low, high) [s]; None: `TAU_BOUNDS_SECOND`. Narrowed to what
        the sampling and the longest steady stretch of the data can show.
    free_ocv : also fit a shift of the OCV at each knot (hysteresis, another temperature, age), so
        that an error of the OCV table does not become resistance. The shift is part of the model.
    floor_volt, relative : the model is trusted to floor + relative·|V − OCV| [V], [1]; rows weigh
        by the inverse, so that a 6C pulse does not outvote what happens at working currents.

    Returns
    -------
    condition : Condition.

    Raises
    ------
    Refusal : nothing excites the cell, or the data cannot tell the parameters apart.

    Source: thesis 2.3 (2.17–2.20), with a deterministic search in place of its genetic one.
    """
    # ASSUME: OCV at a test's temperature and direction is the slow test's curve plus a shift over
    # SoC that is fitted together with the resistances, from the fitted data only.
    # ASSUME: Time constants of a cell do not depend on SoC, its resistances do (linear between).
    step = _step_ampere(records) if step_ampere is None else step_ampere
    knots = knots_of(records, step_ampere=step) if knots is None else np.asarray(knots, float)
    bounds = _bounds(records, step, n_rc, tau_bounds_second)
    thinned = [within(thin(r, step_ampere=step / 10), knots) for r in records]
    problem = problem_of(
        thinned,
        knots,
        ocv_soc,
        ocv_volt,
        hold=hold,
        free_ocv=free_ocv,
        floor_volt=floor_volt,
        relative=relative,
    )
    if len(problem.target_volt) <= len(knots) * (n_rc + 2):
        raise Refusal(f"{len(problem.target_volt)} rows cannot carry {len(knots)} SoC knots")
    tau = _search(problem, bounds)
    return _condition(problem, knots, tau, bounds)


def _step_ampere(records):
    largest = max(np.abs(np.diff(r.current_ampere)).max() for r in records)
    if largest == 0:
        raise Refusal("the current never changes: resistance cannot be told from OCV")
    return largest / 20


def _bounds(records, step_ampere, n_rc, asked):
    if asked is None and n_rc not in TAU_BOUNDS_SECOND:
        raise Refusal(f"no default bounds of the time constants of {n_rc} RC pairs; give them")
    asked = TAU_BOUNDS_SECOND[n_rc] if asked is None else asked
    steady, sampling = 0.0, []
    for r in records:
        marks = np.r_[0, edges(r, step_ampere=step_ampere), len(r.soc) - 1]
        steady = max(steady, np.diff(r.test_time_second[marks]).max())
        sampling.append(np.median(np.diff(r.test_time_second)))
    bounds = [(max(low, min(sampling)), min(high, steady)) for low, high in asked]
    if any(low >= high for low, high in bounds):
        raise Refusal(f"steady stretches of {steady:.3g} s at most cannot show {asked[-1]} s")
    return np.log(bounds)


def _search(problem, log_bounds, *, grid=8, finest=1e-3):
    """Time constants: best of a grid, then its neighbours at ever smaller distance."""
    low, high = log_bounds.T
    shares = (np.arange(grid) + 0.5) / grid
    centre = _best(problem, [a + (b - a) * shares for a, b in log_bounds])
    reach = (high - low) / grid / 2
    while reach.max() > finest:
        near = np.clip(centre + reach * np.array([[-1], [0], [1]]), low, high)
        better = _best(problem, near.T)
        reach = reach / 2 if np.array_equal(better, centre) else reach
        centre = better
    return np.exp(centre)


def _best(problem, candidates):
    """The combination of candidate time constants that leaves the smallest error.

    Each candidate is filtered once and one Gram matrix holds all products, so that a combination
    costs only the small non-negative solve.
    """
    axes = [np.unique(axis) for axis in candidates]
    blocks = [lagged(problem, np.exp(x)) for axis in axes for x in axis]
    matrix = np.hstack([problem.fixed, *blocks])
    gram, moment = matrix.T @ matrix, matrix.T @ problem.target_volt
    fixed, width = problem.fixed.shape[1], blocks[0].shape[1]
    first = fixed + width * np.cumsum([0, *(len(axis) for axis in axes)])
    scores = {}
    for choice in product(*(range(len(axis)) for axis in axes)):
        starts = [f + width * c for f, c in zip(first, choice, strict=False)]
        pick = np.concatenate([np.arange(fixed), *(np.arange(s, s + width) for s in starts)])
        found = solve(gram[np.ix_(pick, pick)], moment[pick], problem.signed)
        scores[choice] = found @ moment[pick]
    best = max(scores, key=scores.get)
    return np.array([axis[c] for axis, c in zip(axes, best, strict=True)])


def _condition(problem, knots, tau, log_bounds):
    matrix = design(problem, tau)
    found = solve(matrix.T @ matrix, matrix.T @ problem.target_volt, problem.signed)
    residual = matrix @ found - problem.target_volt
    std = _standard_deviations(problem, matrix, found, tau, residual)
    size, samples = len(found) + len(tau), len(residual)
    shift, table = found[: problem.signed], found[problem.signed :].reshape(-1, len(knots))
    table_std = std[problem.signed : len(found)].reshape(-1, len(knots))
    mean_square = float(np.mean((residual / problem.weight) ** 2))
    return Condition(
        soc=knots,
        r0_ohm=table[0],
        r0_std_ohm=table_std[0],
        r_ohm=table[1:],
        r_std_ohm=table_std[1:],
        tau_second=tau,
        tau_std_second=tau * std[len(found) :],
        ocv_shift_volt=shift if problem.signed else np.zeros(len(knots)),
        at_bound=_at_bound(table, knots, tau, log_bounds),
        fit_rmse_volt=float(np.sqrt(mean_square)),
        samples=samples,
        bic=float(samples * np.log(mean_square) + size * np.log(samples)),
    )


def _standard_deviations(problem, matrix, found, tau, residual, *, step=1e-4):
    """Of the linear parameters, then of the logarithms of the time constants; NaN at a bound."""
    width, fixed = problem.drives[0].shape[1], problem.fixed.shape[1]
    slopes = []
    for j, t in enumerate(tau):
        r = found[fixed + j * width : fixed + (j + 1) * width]
        change = lagged(problem, t * np.exp(step)) - lagged(problem, t * np.exp(-step))
        slopes.append(change @ r / (2 * step))
    active = np.append(found != 0, np.ones(len(tau), bool))
    covariance = covariance_from_jacobian(np.column_stack([matrix, *slopes])[:, active], residual)
    std = np.full(len(active), np.nan)
    std[active] = np.sqrt(np.diag(covariance) * correlation_factor(residual))
    return std


def _at_bound(table, knots, tau, log_bounds):
    names = [
        f"R{row} at SoC {knots[column]:.3f}" for row, column in np.argwhere(table == 0).tolist()
    ]
    for j, (t, (low, high)) in enumerate(zip(np.log(tau), log_bounds, strict=True), 1):
        if min(t - low, high - t) < 0.01:
            names.append(f"tau{j}")
    return tuple(names)
