"""Levenberg–Marquardt of a circuit's parameters in logarithms, from many starts at once.

The search is our own, not lmfit's, for a spectrum is fitted some hundred times (starts, candidate
circuits, points left out): compiled, with exact derivatives of the circuit, a fit from eight starts
takes 1 ms, less than lmfit itself adds to a single start.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from cellwright.native import array, count, function, integers, real
from cellwright.protocols.impedance.circuits import circuit_slopes
from cellwright.refusal import Refusal

MOST_PASSES = 200
MOST_NODES, MOST_PARAMETERS, BLOCK = 64, 32, 64  # of the kernel
FARTHEST, ARRIVED, STUCK = 2.0, 1e-7, 1e12
SAME = 1e-6  # relative difference of two sums of squares that are one optimum
TYPES = (*[count] * 7, real, array, integers, integers, *[array] * 5, integers)


class Problem(NamedTuple):
    """What is fitted.

    circuit : Circuit of p parameters. frequency_hertz (n,) [Hz]; impedance_ohm (n,) complex [Ω];
    weight (n,) [1/Ω]. column : (p,) place of a parameter among the q free ones, −1 where it is
    fixed; tied ones share a place. offset : (p,) logarithm of a fixed value, or of the ratio to
    the one that it is tied to. lower, upper : (q,) limits of the logarithms.
    """

    circuit: object
    frequency_hertz: np.ndarray
    impedance_ohm: np.ndarray
    weight: np.ndarray
    column: np.ndarray
    offset: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    def values(self, x):
        """Parameters (p,) at the logarithms x (q,) of the free ones."""
        free = np.where(self.column >= 0, x[self.column], 0.0) if len(x) else 0.0
        return np.exp(self.offset + free)

    def jacobian(self, x):
        """Weighted complex error (n,) at x, and its derivatives by x (q, n)."""
        impedance, slopes = circuit_slopes(self.circuit, self.frequency_hertz, self.values(x))
        found = np.zeros((len(x), len(impedance)), complex)
        free = self.column >= 0
        np.add.at(found, self.column[free], slopes[free])
        return (impedance - self.impedance_ohm) * self.weight, found * self.weight


class Found(NamedTuple):
    """Where s starts led: x (s, q) logarithms; cost (s,) half sums of squares, infinite where
    enough others had arrived before; passes (s,) over the data."""

    x: np.ndarray
    cost: np.ndarray
    passes: np.ndarray


def search(problem, starts, *, enough):
    """Optimum of each start, by damped Gauss–Newton steps within the limits.

    In C where that can be built (`native`), else in numpy with the same steps.

    Parameters
    ----------
    problem : Problem. starts : (s, q) logarithms of the free parameters, tried in this order.
    enough : so many that led to the same best end the search.

    Returns
    -------
    found : Found.

    Raises
    ------
    Refusal : a circuit of more than 64 nodes or 32 parameters.

    Source: D. W. Marquardt, J. SIAM 11 (1963) 431; steps of at most 2 in a logarithm, so that a
    poor start cannot throw a parameter to its limit.
    """
    circuit, starts = problem.circuit, np.clip(starts, problem.lower, problem.upper)
    if len(circuit.kinds) > MOST_NODES or len(circuit.names) > MOST_PARAMETERS:
        raise Refusal(f"circuit {circuit.text} has more than {MOST_PARAMETERS} parameters")
    kernel = function("impedance_search", *TYPES)
    if kernel is None:
        return search_by_numpy(problem, starts, enough=enough)
    x = np.ascontiguousarray(starts, float)
    cost, passes = np.empty(len(x)), np.empty(len(x), np.int64)
    size, measured = len(problem.weight), problem.impedance_ohm
    omega = 2 * np.pi * problem.frequency_hertz
    series = np.concatenate([omega, measured.real, measured.imag, problem.weight])
    limits = np.concatenate([problem.lower, problem.upper])
    work = np.empty(6 * BLOCK * -(-size // BLOCK))
    sizes = (size, len(circuit.kinds), len(circuit.names), x.shape[1], len(x), enough)
    tree = (_tree(circuit), problem.column, problem.offset)
    kernel(*sizes, MOST_PASSES, SAME, series, *tree, limits, work, x, cost, passes)
    return Found(x, cost, passes)


@cache
def _tree(circuit):
    """Kinds, children and places of the nodes, one after the other (4m,)."""
    return np.array(circuit[1:5], np.int64).ravel()


def search_by_numpy(problem, starts, *, enough):
    """As `search`, without a compiler."""
    x = np.clip(starts, problem.lower, problem.upper)
    cost, passes = np.full(len(x), np.inf), np.zeros(len(x), np.int64)
    for s in range(len(x)):
        if np.sum(cost[:s] <= cost[:s].min(initial=np.inf) * (1 + SAME)) < max(enough, 1):
            x[s], cost[s], passes[s] = _one(problem, x[s])
    return Found(x, cost, passes)


def _one(problem, x):
    damping, (cost, gram, gradient) = 1e-2, _normal(problem, x)
    passes = 1
    while passes < MOST_PASSES and damping < STUCK:
        passes += 1
        held = (x <= problem.lower) & (gradient > 0) | (x >= problem.upper) & (gradient < 0)
        step = _step(gram, gradient, damping, held)
        if step is None:
            damping *= 10
            continue
        trial = np.clip(x + step, problem.lower, problem.upper)
        moved = np.abs(trial - x).max(initial=0)
        after = _normal(problem, trial)
        better = after[0] < cost or moved < ARRIVED  # below that the cost resolves nothing
        if better:
            x, (cost, gram, gradient) = trial, after
        damping = max(damping / 10, 1e-12) if better else damping * 10
        if moved < ARRIVED:
            break
    return x, cost, passes


def _normal(problem, x):
    error, slopes = problem.jacobian(x)
    cost = 0.5 * float(np.vdot(error, error).real)
    return cost, (slopes.conj() @ slopes.T).real, (slopes.conj() @ error).real


def _step(gram, gradient, damping, held):
    """Damped step, cut to FARTHEST; none where the equations have no solution."""
    size = np.diagonal(gram)
    damped = gram + np.diag(damping * np.maximum(size, 1e-12 * size.max(initial=0)))
    damped[held], damped[:, held] = 0.0, 0.0
    damped[held, held] = 1.0
    try:
        lower = np.linalg.cholesky(damped)
    except np.linalg.LinAlgError:
        return None
    half = np.linalg.solve(lower, np.where(held, 0.0, -gradient))
    step = np.linalg.solve(lower.T, half)
    farthest = np.abs(step).max(initial=0)
    return step * (FARTHEST / farthest) if farthest > FARTHEST else step
