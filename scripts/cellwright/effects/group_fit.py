"""Least squares within bounds that hold: a healthy branch is within the declared spread, or it
is not healthy. Gauss–Newton steps, each the exact minimum of its quadratic within the bounds."""

from typing import NamedTuple

import numpy as np

from cellwright.effects.problem import derivatives

STEPS, PASSES, HALVES = 4, 5, 5
WORTH = 1e-6
SETTLED = 1.0  # a fall of the cost below this ends the walk


class Chart(NamedTuple):
    """The lie of the land: white (m, k) whitened derivatives, precision (k, k) with priors."""

    columns: np.ndarray | None
    white: np.ndarray
    precision: np.ndarray


class Settled(NamedTuple):
    """Most likely values within bounds.

    values : dict. prediction : (m,). cost : chi-square with priors. chart : Chart.
    names : of the free parameters. at_bound : of those on a bound.
    """

    values: dict
    prediction: np.ndarray
    cost: float
    chart: Chart
    names: tuple
    at_bound: tuple


def priors(problem):
    """Prior precision (k, k) and its product with the prior means (k,)."""
    weight = np.array([f.std**-2.0 for f in problem.free])
    prior = np.diag(weight)
    if problem.coupling is not None:
        prior = prior + problem.coupling
    return prior, weight * np.array([f.prior for f in problem.free])


def within(precision, moment, lower, upper, start):
    """Minimum of x'Px/2 − m'x between bounds, by the primal active-set method.

    Parameters
    ----------
    precision : (k, k) positive definite P. moment : (k,) m. lower, upper, start : (k,).

    Returns
    -------
    x : (k,).

    Source: J. Nocedal, S. Wright, Numerical Optimization, 2nd ed., 2006, algorithm 16.3.
    """
    x = np.clip(start, lower, upper)
    held = (x <= lower) | (x >= upper)
    for _ in range(PASSES * len(x)):
        slope = precision @ x - moment
        free = np.flatnonzero(~held)
        way = np.zeros(len(x))
        way[free] = -np.linalg.solve(precision[np.ix_(free, free)], slope[free])
        share, stop = _blocked(x, way, lower, upper)
        x = x + share * way
        if stop is not None:
            x[stop], held[stop] = (upper if way[stop] > 0 else lower)[stop], True
            continue
        gain = _gains(precision, precision @ x - moment, x, held, lower, upper)
        if gain.max(initial=0.0) < WORTH:
            return x
        held[int(np.argmax(gain))] = False
    return x


def _blocked(x, way, lower, upper):
    """Share of the way to the first bound, and whose it is; (1, None) where none is met."""
    room = np.where(way > 0, upper - x, lower - x)
    shares = np.divide(room, way, out=np.full(len(x), np.inf), where=way != 0)
    first = int(np.argmin(shares))
    return (float(shares[first]), first) if shares[first] < 1.0 else (1.0, None)


def _gains(precision, slope, x, held, lower, upper):
    """Fall of the cost that letting go of each held parameter promises."""
    inward = ((x <= lower) & (slope < 0)) | ((x >= upper) & (slope > 0))
    return np.where(held & inward & (upper > lower), slope**2 / np.diag(precision), 0.0)


def surveyed(problem, values, prediction):
    """Chart of a problem at a place, whose prediction (m,) is known."""
    return whitened(problem, derivatives(problem, values, prediction))


def whitened(problem, columns):
    """Chart from derivatives (m, k) that are known, by the noise of the problem."""
    white = problem.whiten(columns)
    return Chart(columns, white, white.T @ white + priors(problem)[0])


def beside(chart, own):
    """Chart with one more parameter without a prior, of whitened derivative own (m,)."""
    mixed = chart.white.T @ own
    precision = np.block([[chart.precision, mixed[:, None]], [mixed[None], own @ own]])
    return Chart(None, np.column_stack([chart.white, own]), precision)


def settle(problem, values, *, chart=None, columns=None, renew=None, steps=STEPS):
    """Walk to the most likely values within the bounds.

    Parameters
    ----------
    problem : problem.Problem. values : dict, start.
    chart : Chart to walk by, or None: surveyed at every step.
    columns : (m, k) derivatives at the start, where they are known.
    renew : name of the last parameter, where its derivative is made anew at each further step.
    steps : at most so many.

    Returns
    -------
    settled : Settled.
    """
    known = priors(problem)
    limits = np.array([f.lower for f in problem.free]), np.array([f.upper for f in problem.free])
    here, by = _judged(problem, values, *known), chart
    for step in range(steps):
        if chart is None:
            known_here = columns is not None and step == 0
            by = whitened(problem, columns) if known_here else surveyed(problem, *here[:2])
        elif renew and step:
            fresh = derivatives(problem, here[0], here[1], (renew,))
            by = beside(_but_last(by), problem.whiten(fresh)[:, 0])
        new = _stepped(problem, here, by, known, limits)
        fell, here = here[3] - new[3], new
        if fell < SETTLED:
            break
    at = np.array([here[0][f.name] for f in problem.free])
    on = ((at <= limits[0]) | (at >= limits[1])) & (limits[1] > limits[0])
    bound = tuple(f.name for f, held in zip(problem.free, on, strict=True) if held)
    names = tuple(f.name for f in problem.free)
    return Settled(here[0], here[1], here[3], by, names, bound)


def _but_last(chart):
    return Chart(None, chart.white[:, :-1], chart.precision[:-1, :-1])


def _judged(problem, values, prior, pull):
    """Values, prediction, whitened residual, cost."""
    prediction = problem.predict(values)
    white = problem.whiten(problem.measured - prediction)
    at = np.array([values[f.name] for f in problem.free])
    return values, prediction, white, float(white @ white + at @ prior @ at - 2 * pull @ at)


def _stepped(problem, here, chart, known, limits):
    prior, pull = known
    names = [f.name for f in problem.free]
    at = np.array([here[0][name] for name in names])
    moment = chart.white.T @ here[2] + pull + (chart.precision - prior) @ at
    aim = within(chart.precision, moment, *limits, at)
    share = 1.0
    for _ in range(HALVES):
        moved = here[0] | dict(zip(names, (at + share * (aim - at)).tolist(), strict=True))
        new = _judged(problem, moved, prior, pull)
        if np.isfinite(new[3]) and new[3] <= here[3]:
            return new
        share /= 3
    return here
