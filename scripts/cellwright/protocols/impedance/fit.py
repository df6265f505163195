"""Fit of an equivalent circuit to a measured spectrum: limits, starts, constraints, search.

The search is our own, not lmfit's, for a spectrum is fitted some hundred times (starts, candidate
circuits, points left out): compiled, with exact derivatives of the circuit, a fit from several
starts takes 0.3 ms, less than lmfit itself adds to a single start.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from cellwright.native import array, count, function, integers, real
from cellwright.numerics.statistics import covariance_from_jacobian
from cellwright.protocols.impedance.circuits import (
    THESIS,
    circuit_slopes,
    parse,
    series_resistance,
)
from cellwright.refusal import Refusal

SLOW = ("capacitance", "cpe", "time")  # roles that set a time constant


def features(frequency_hertz, impedance_ohm):
    """Features of a spectrum with a capacitive part; limits and starts of its fit follow from them.

    frequency_hertz : (n,) [Hz]. impedance_ohm : (n,) complex [Ω].

    Returns dict: smallest, least real part of the capacitive points [Ω]; span, its range [Ω];
    largest, largest modulus [Ω]; lowest, highest, angular frequencies of all points [1/s]; fastest,
    the highest of a capacitive one; warburg, Y0 that the lowest frequency alone gives [S·s^½];
    leads, inductance that the highest alone gives [H].
    """
    real, imaginary = impedance_ohm.real, impedance_ohm.imag
    capacitive = np.flatnonzero(imaginary < 0)
    inside = real[capacitive]
    smallest, largest = float(inside.min()), float(np.abs(impedance_ohm).max())
    least = 1e-6 * largest  # so that no limit and no start is zero
    slowest, fastest = frequency_hertz.argmin(), frequency_hertz.argmax()
    lowest, highest = (2 * math.pi * float(frequency_hertz[k]) for k in (slowest, fastest))
    return {
        "smallest": smallest,
        "span": max(float(inside.max()) - smallest, least),
        "largest": largest,
        "lowest": lowest,
        "highest": highest,
        "fastest": 2 * math.pi * float(frequency_hertz[capacitive].max()),
        "warburg": 1 / (math.sqrt(lowest) * max(abs(float(imaginary[slowest])), least)),
        "leads": max(abs(float(imaginary[fastest])), least) / highest,
    }


def parameter_limits(circuit, size):
    """Lower and upper limits of the parameters (2, p), from the size of the spectrum."""
    # Decades beyond what the spectrum spans: a limit that is met says "not determined".
    ends = {
        "resistance": (1e-4 * min(size["span"], size["smallest"]), 100 * size["largest"]),
        "series": (size["smallest"] / 100, size["largest"]),
        "capacitance": (1e-9 / size["largest"], 1e9 / size["largest"]),
        "inductance": (size["leads"] * 1e-4, size["leads"] * 1e2),
        "cpe": (1e-6 / size["largest"], 1e9 / size["largest"]),
        # Below 0.3 a constant-phase element is no capacitance any more.
        "exponent": (0.3, 1.0),
        "warburg": (size["warburg"] * 1e-3, size["warburg"] * 1e4),
        "time": (1e-2 / size["highest"], 1e3 / size["lowest"]),
    }
    return np.array([ends[role] for role in _roles(circuit.text)]).T


def spread_starts(circuit, size, *, number):
    """Starts (s, p): resistances and time constants spread over the range of the spectrum.

    The first is the middle of all; each later one a point of an even, fixed sequence, so that the
    same spectrum gives the same starts. Arcs take turns along the frequency axis, first come, fast.
    """
    roles = _roles(circuit.text)
    shares, positions = _shares(number, roles)
    middle = {
        "series": size["smallest"],
        "resistance": size["span"],
        "inductance": size["leads"],
        "warburg": size["warburg"],
    }
    slow = [k for k, role in enumerate(roles) if role in SLOW]
    rate = size["fastest"] * (size["lowest"] / size["fastest"]) ** positions
    starts = np.array([middle.get(role, 1.0) for role in roles]) * shares
    for k, rates in zip(slow, rate.T, strict=True):
        # T of an arc is 1/(R·ω^P); exponents of real cells lie about 0.75.
        power = rates**0.75 if roles[k] == "cpe" else rates
        starts[:, k] = 1 / (power if roles[k] == "time" else power * size["span"] * shares[:, k])
    return starts


@cache
def _shares(number, roles):
    """What does not depend on the spectrum: starts (s, p) over the size that belongs to their role,
    for capacitive elements that of their resistance, and their places (s, slow) between the fastest
    and the slowest frequency, 0 to 1.

    The element named first is the fastest in one start, the slowest in the next.
    """
    share = _even_points(number, len(roles))
    slow = [k for k, role in enumerate(roles) if role in SLOW]
    shares = np.stack([_start_share(role, share, k) for k, role in enumerate(roles)], axis=1)
    forwards, odd = np.arange(len(slow)), np.arange(number)[:, None] % 2
    order = np.where(odd, forwards[::-1], forwards)
    return shares, (order + share[:, slow]) / max(len(slow), 1)


def _start_share(role, share, k):
    """Start (s,) of parameter k of this role over the size that belongs to it."""
    if role == "exponent":
        return 0.6 + 0.3 * share[:, k]
    if role == "series":
        return 0.6 + 0.4 * share[:, k]
    if role in SLOW:
        return np.power(10.0, share[:, k - 1] - 1)
    decades = {"resistance": (1.5, -1.2), "inductance": (0.5, -0.25), "warburg": (1.5, -0.5)}
    slope, least = decades[role]
    return np.power(10.0, slope * share[:, k] + least)


@cache
def _even_points(number, dimensions):
    """Evenly spread points (number, dimensions) in 0…1, the first in the middle."""
    ratio = 1.5  # tends to the root of x^(d+1) = x + 1, which spreads points evenly
    for _ in range(60):
        ratio = (1 + ratio) ** (1 / (dimensions + 1))
    steps = np.power(1 / ratio, np.arange(1, dimensions + 1))
    return (0.5 + np.arange(number)[:, None] * steps) % 1


@cache
def _roles(text):
    """Roles of a circuit's parameters, the resistance in series with all else as "series"."""
    circuit = parse(text)
    series = series_resistance(circuit)
    return tuple("series" if k == series else role for k, role in enumerate(circuit.roles))


MOST_PASSES = 200
MOST_NODES, MOST_PARAMETERS, BLOCK = 64, 32, 64  # of the kernel
SAME = 1e-6  # relative difference of two sums of squares that are one optimum
TYPES = (*[count] * 7, real, *[array] * 3, integers, integers, *[array] * 6, integers, array)


class Problem(NamedTuple):
    """A spectrum, the circuit to fit to it, and which of its parameters are free.

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
        free = x[self.column] * (self.column >= 0) if len(x) else 0.0
        return np.exp(self.offset + free)

    def jacobian(self, x):
        """Weighted complex error (n,) at x, and its derivatives by x (q, n)."""
        impedance, slopes = circuit_slopes(self.circuit, self.frequency_hertz, self.values(x))
        derivatives = np.zeros((len(x), len(impedance)), complex)
        free = self.column >= 0
        np.add.at(derivatives, self.column[free], slopes[free])
        return (impedance - self.impedance_ohm) * self.weight, derivatives * self.weight


def search(problem, starts, *, enough):
    """Optimum of each start, by damped Gauss–Newton steps within the limits.

    In C where that can be built (`native`), else in numpy with the same steps.

    problem : Problem. starts : (s, q) logarithms of the free parameters, tried in this order.
    enough : so many that led to the same best end the search.

    Returns x: (s, q) logarithms that each start led to; cost: (s,) half sums of squares, infinite
    where enough others had arrived before; rows: (q + 1, 2n) at the best, the weighted error and
    its derivatives by the q logarithms, real parts first. Raises Refusal: a circuit of more than 64
    nodes or 32 parameters.

    Source: D. W. Marquardt, J. SIAM 11 (1963) 431; steps of at most 2 in a logarithm, so that a
    poor start cannot throw a parameter to its limit.
    """
    circuit = problem.circuit
    if len(circuit.kinds) > MOST_NODES or len(circuit.names) > MOST_PARAMETERS:
        raise Refusal(f"circuit {circuit.text} has more than {MOST_PARAMETERS} parameters")
    kernel = function("impedance_search", *TYPES)
    if kernel is None:
        return search_by_numpy(problem, starts, enough=enough)
    x, points = np.array(starts, float, order="C"), len(problem.weight)
    number, free = x.shape
    cost, passes = np.empty(number), np.empty(number, np.int64)
    rows, work = np.empty((free + 1, 2 * points)), np.empty(6 * BLOCK * -(-points // BLOCK))
    sizes = (points, len(circuit.kinds), len(circuit.names), free, number, enough, MOST_PASSES)
    impedance = np.ascontiguousarray(problem.impedance_ohm).view(float)
    series = (np.ascontiguousarray(problem.frequency_hertz), impedance, problem.weight)
    freedom = (problem.column, problem.offset, problem.lower, problem.upper)
    kernel(*sizes, SAME, *series, _tree(circuit.text), *freedom, work, x, cost, passes, rows)
    return x, cost, rows


@cache
def _tree(text):
    """Circuit of a text as the kernel reads it (4m,): kinds, left and right children, places."""
    return np.array(parse(text)[1:5], np.int64).ravel()


def search_by_numpy(problem, starts, *, enough):
    """As `search`, without a compiler."""
    x = np.clip(starts, problem.lower, problem.upper)
    cost = np.full(len(x), np.inf)
    for s in range(len(x)):
        if np.sum(cost[:s] <= cost[:s].min(initial=np.inf) * (1 + SAME)) < max(enough, 1):
            x[s], cost[s] = _descend(problem, x[s])
    error, slopes = problem.jacobian(x[np.argmin(cost)])
    rows = np.vstack([error, slopes])
    return x, cost, np.hstack([rows.real, rows.imag])


def _descend(problem, x):
    """Optimum (q,) from one start, and its cost."""
    damping, (cost, gram, gradient) = 1e-2, _normal(problem, x)
    passes = 1
    while passes < MOST_PASSES and damping < 1e12:  # above it no step leads down: stuck
        passes += 1
        at_limit = (x <= problem.lower) & (gradient > 0) | (x >= problem.upper) & (gradient < 0)
        step = _step(gram, gradient, damping, at_limit)
        if step is None:
            damping *= 10
            continue
        trial = np.clip(x + step, problem.lower, problem.upper)
        if np.abs(trial - x).max(initial=0) < 1e-7:
            return trial, cost  # below what the cost resolves: without another look
        after = _normal(problem, trial)
        better = after[0] < cost
        if better:
            x, (cost, gram, gradient) = trial, after
        damping = max(damping / 10, 1e-12) if better else damping * 10
    return x, cost


def _normal(problem, x):
    """Half the sum of squares, the normal matrix (q, q) and the gradient (q,) at x."""
    error, slopes = problem.jacobian(x)
    cost = 0.5 * float(np.vdot(error, error).real)
    return cost, (slopes.conj() @ slopes.T).real, (slopes.conj() @ error).real


def _step(gram, gradient, damping, at_limit):
    """Damped step (q,), at most 2 in a logarithm; None where the equations have no solution."""
    size = np.diagonal(gram)
    damped = gram + np.diag(damping * np.maximum(size, 1e-12 * size.max(initial=0)))
    damped[at_limit], damped[:, at_limit] = 0.0, 0.0
    damped[at_limit, at_limit] = 1.0
    try:
        lower = np.linalg.cholesky(damped)
    except np.linalg.LinAlgError:
        return None
    half = np.linalg.solve(lower, np.where(at_limit, 0.0, -gradient))
    step = np.linalg.solve(lower.T, half)
    farthest = np.abs(step).max(initial=0)
    return step * (2.0 / farthest) if farthest > 2.0 else step


class CircuitFit(NamedTuple):
    """A fitted circuit; all vectors in the order of `names`.

    circuit : its text. names : of the p parameters, with their units (see `circuits.parse`).
    values, std : (p,); std is NaN for a parameter that is fixed, at the limit of its search or not
    determined. correlation : (p, p), NaN likewise. at_bound : names of those at a limit; at_upper :
    of those at the upper one. free : q, number of parameters that were free. rms_relative_residual
    : of the complex error over the modulus. bic : Bayesian information criterion, for comparing
    circuits on the same points.
    """

    circuit: str
    names: tuple
    values: np.ndarray
    std: np.ndarray
    correlation: np.ndarray
    at_bound: tuple
    at_upper: tuple
    free: int
    rms_relative_residual: float
    bic: float


def fit_circuit(
    frequency_hertz,
    impedance_ohm,
    *,
    circuit=THESIS,
    starts=8,
    start=None,
    fixed=None,
    tied=None,
):
    """Circuit fitted by complex least squares with modulus weights, in logarithmic parameters.

    frequency_hertz : (n,) in any order [Hz].
    impedance_ohm : (n,) complex [Ω], capacitive arc with a negative imaginary part.
    circuit : text of the circuit, see `circuits.parse`.
    starts : how many starts are tried at most for each capacitive element, that of `start`
        included. Three that lead to the same best are enough where there is one capacitive element;
        all are tried where arcs may change places.
    start : dict, name of a parameter → value: where the first start differs from the spectrum's own
        features.
    fixed : dict, name → value that it keeps.
    tied : dict, name → (other name, ratio to it).

    Returns fit: CircuitFit, the best of the starts. Raises Refusal: fewer than 8 points, not
    finite, a frequency or real part that is not positive, no capacitive part; an unknown parameter;
    a text that is no circuit.

    Source: thesis sec. 3.2; modulus weights: J. R. Macdonald, Impedance Spectroscopy (2005) 3.2.
    """
    # ASSUME: Errors of an impedance are a fixed share of its modulus at every frequency.
    frequency, impedance = np.asarray(frequency_hertz, float), np.asarray(impedance_ohm, complex)
    check(frequency, impedance)
    tree = parse(circuit)
    asked = set().union(*(names or () for names in (start, fixed, tied)))
    if unknown := sorted(asked - set(tree.names)):
        raise Refusal(f"circuit {circuit} has no parameter {unknown}; it has {list(tree.names)}")
    size = features(frequency, impedance)
    column, offset = _freedom(tree, fixed or {}, tied or {})
    # Place of each free parameter among all; of tied ones the first.
    places = column.tolist()
    free = [places.index(k) for k in range(max(places, default=-1) + 1)]
    ends = [np.log(limits[free]) for limits in parameter_limits(tree, size)]
    problem = Problem(tree, frequency, impedance, 1 / np.abs(impedance), column, offset, *ends)
    # Arcs may change places, so each capacitive element multiplies the optima.
    slow = sum(role in SLOW for role in tree.roles)
    first = spread_starts(tree, size, number=starts * max(slow, 1) if starts > 1 else 1)
    enough = 3 if slow <= 1 else len(first)
    for name, value in (start or {}).items():
        first[0, tree.names.index(name)] = value
    optima = search(problem, np.log(first)[:, free], enough=enough)
    return _result(problem, *optima)


def check(frequency_hertz, impedance_ohm):
    """Refuse what is no spectrum of a cell: see `fit_circuit`."""
    if len(frequency_hertz) < 8:
        raise Refusal(f"spectrum of {len(frequency_hertz)} points; a fit needs 8")
    if not (np.isfinite(frequency_hertz).all() and np.isfinite(impedance_ohm).all()):
        raise Refusal("spectrum holds values that are not finite")
    if not (frequency_hertz.min() > 0 and impedance_ohm.real.min() > 0):
        raise Refusal("spectrum holds a frequency or a real part that is not positive")
    if not impedance_ohm.imag.min() < 0:
        raise Refusal("spectrum has no capacitive part (negative imaginary part)")


def _freedom(tree, fixed, tied):
    """Place of each parameter among the free ones (−1: fixed), offset of its logarithm."""
    leads = [tied[name][0] if name in tied else name for name in tree.names]
    if any(lead in tied or lead in fixed for lead, _ in tied.values()):
        raise Refusal("a parameter is tied to one that is itself tied or fixed")
    free = [name for name in tree.names if name not in fixed and name not in tied]
    column = [free.index(lead) if lead in free else -1 for lead in leads]
    kept = [fixed.get(name, tied.get(name, (None, 1.0))[1]) for name in tree.names]
    if not all(value > 0 for value in kept):
        raise Refusal("a fixed value or the ratio of a tied parameter is not above zero")
    return np.array(column, np.int64), np.log(np.array(kept, float))


def _result(problem, found, costs, rows):
    """CircuitFit of the best optimum."""
    best = int(costs.argmin())
    x, cost = found[best], float(costs[best])
    residual, slopes = rows[0], rows[1:]
    names, points, data = problem.circuit.names, len(problem.weight), len(residual)
    # Within a thousandth, the slack of where the search stops.
    highest = problem.upper - x < 1e-3
    limited = (x - problem.lower < 1e-3) | highest
    values = problem.values(x)
    covariance = _covariance(slopes, residual, limited, problem.column)
    covariance *= values[:, None] * values
    std = np.sqrt(covariance.diagonal())
    certain = np.where(std > 0, std, np.nan)
    places = problem.column.tolist()
    return CircuitFit(
        circuit=problem.circuit.text,
        names=names,
        values=values,
        std=std,
        correlation=covariance / (certain[:, None] * certain),
        at_bound=_at(limited, names, places),
        at_upper=_at(highest, names, places),
        free=len(x),
        rms_relative_residual=math.sqrt(2 * cost / points),
        bic=data * math.log(max(2 * cost / data, 1e-30)) + len(x) * math.log(data),
    )


def _at(ended, names, places):
    """Names of the parameters whose free one ended so."""
    ended = ended.tolist()
    return tuple(n for n, k in zip(names, places, strict=True) if k >= 0 and ended[k])


def _covariance(slopes, residual, limited, column):
    """Covariance (p, p) of the logarithms of all parameters; NaN where fixed or limited."""
    free = np.flatnonzero(~limited)
    # One place more than there are free parameters: that of the fixed ones.
    wide = np.full((len(limited) + 1, len(limited) + 1), np.nan)
    wide[free[:, None], free] = covariance_from_jacobian(slopes[free].T, residual)
    return wide[column[:, None], column]
